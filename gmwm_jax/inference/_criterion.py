"""The wavelet information criterion (WVIC) of models that were fitted with the same weights, and its uncertainty.

How well would a model, fitted to these data, describe other data of the same sensor? Its objective there is on average

    WVIC = Q + optimism,    optimism = 2 tr(Omega Cov(nu_hat, nu(theta_hat)))

(Efron 2004; Guerrier et al. 2013; Zhang & Guerrier 2018), Q the objective that the model has here. By theory,
nu(theta_hat) moves with nu_hat by A B (`fitting.standard_errors`): with z = L' nu_hat, Omega = L L', S = L' V L its
covariance, and P = L' A B L'^-1 the projection on the tangents L' A,

    optimism = 2 tr(P S),

twice the number of parameters if the weights are the inverse covariance.

The difference of two objectives is that of the squares of whitened residuals e_a, e_b, with e = (1 - P) z + misfit:
its variance is 4 d' S d with d the difference of the misfits, and 2 T, T = tr(((P_a - P_b) S)^2), of the noise.

- Of models of which neither contains the other, d is taken from e_a - e_b, to which noise adds 4 T on average:
  SE^2 = 2 T + max(0, 4 (e_a - e_b)' S (e_a - e_b) - 4 T)   (compare Vuong 1989).
- Of nested models the error is that *if both were equally good*, which is when what the smaller one misses makes up for
  what the larger one fits of the noise, d d' ~ (P_a - P_b) S (P_a - P_b):   SE^2 = 6 T.
"""

import numpy as np
from jaxtyping import Float

_RANK = 1e-8
"""Of the largest singular value of the tangents: a direction below it is none."""


def projection(tangents: Float[np.ndarray, "J p"]) -> Float[np.ndarray, "J J"]:
    """P, on the span of whitened tangents."""
    length = np.linalg.norm(tangents, axis=0)
    U, s, _ = np.linalg.svd(tangents / np.where(length > 0, length, 1.0), full_matrices=False)
    U = U[:, s > _RANK * s[0]] if s.size else U
    return U @ U.T


def optimism(P: Float[np.ndarray, "J J"], S: Float[np.ndarray, "J J"]) -> float:
    """2 tr(P S)."""
    return 2 * float(np.sum(P * S))


def standard_error(
    a: tuple[Float[np.ndarray, " J"], Float[np.ndarray, "J J"]],
    b: tuple[Float[np.ndarray, " J"], Float[np.ndarray, "J J"]],
    S: Float[np.ndarray, "J J"],
    nested: bool,
) -> float:
    """Standard error of the difference of the criteria of two models.

    Parameters
    ----------
    a, b
        Whitened residuals and P of each.
    S
        Covariance of the whitened wavelet variance.
    nested
        Does one of them contain the other?
    """
    e, D = a[0] - b[0], (a[1] - b[1]) @ S
    T = float(np.sum(D * D.T))
    return float(np.sqrt(6 * T if nested else 2 * T + max(0.0, 4 * float(e @ S @ e) - 4 * T)))
