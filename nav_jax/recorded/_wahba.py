"""Wahba's problem: the rotation that leads one set of vectors best to another."""

import numpy as np
from jaxtyping import Float64


def davenport(alpha: Float64[np.ndarray, "K 3"], beta: Float64[np.ndarray, "K 3"]) -> Float64[np.ndarray, "4"]:
    """The unit quaternion q, scalar first, with the least sum of ``|alpha_k - C(q) beta_k|^2`` (Davenport's q-method).

    It is the eigenvector of the largest eigenvalue of a symmetric matrix (4, 4); Markley and Crassidis (2014), sec.
    5.3. Vectors along one line leave the turn about it open, which is then any.
    """
    B = alpha.T @ beta
    K = np.empty((4, 4))
    K[0, 0] = np.trace(B)
    K[0, 1:] = K[1:, 0] = B[2, 1] - B[1, 2], B[0, 2] - B[2, 0], B[1, 0] - B[0, 1]
    K[1:, 1:] = B + B.T - np.trace(B) * np.eye(3)
    q = np.linalg.eigh(K)[1][:, -1]
    return q if q[0] >= 0 else -q
