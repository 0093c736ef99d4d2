"""Covariance of the wavelet variance by pairs, for a model and the missing samples of one record.

nu_j^2 = x' Q_j x (`variance.gaps`), so by Isserlis' theorem, for a Gaussian x with covariance Sigma and mean mu,

    Cov(nu_j^2, nu_k^2) = 2 tr(Q_j Sigma Q_k Sigma) + 4 mu' Q_j Sigma Q_k mu.

The trace is E(x' Q_j Sigma Q_k x) over draws x of the model (Hutchinson 1990): a few of them do, since each averages
over its whole length. z_j' Sigma z_k is a sum over frequencies, as each z_j = Q_j x adds up to zero: exact for white
noise and random walks if the transform is no shorter than the record.

Most of what is left of chance goes if the same draws are put through the MODWT of a complete record, whose covariance V
is known (`variance.covariance`). With G and G_0 the two Gram matrices, of the record with gaps and without them,

    R R_0^-1 G R_0'^-1 R',    R R' = V,  R_0 R_0' = G_0,

which is positive semidefinite, and V itself where nothing is missing.
"""

from collections.abc import Iterable, Iterator

import jax
import numpy as np
from jaxtyping import Float
from numpy import fft

from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.simulation import simulate_each
from gmwm_jax.variance.covariance import wv_covariance
from gmwm_jax.variance.gaps import PairCounts, quadratic_forms_times

_SAMPLES = 1 << 17
"""Of all draws together."""
_FEWEST, _MOST = 2, 256
"""Draws."""
_AT_ONCE = 1 << 18
"""Samples worked on at once."""


def gap_covariance(model: Composite, pairs: PairCounts) -> Float[np.ndarray, "J J"]:
    """Covariance of the wavelet variance by pairs: deterministic, the error of a standard deviation 1 to 3 %.

    5 % at spans with a few degrees of freedom.

    Parameters
    ----------
    model
        All parameters given; Gaussian (for QN, which is not, an approximation).
    pairs
        Of `gmwm_jax.variance.gaps.find_pairs`.
    """
    drifts = [p for p in model.processes if p.deterministic]
    noises = [p for p in model.processes if not p.deterministic]
    J, num = pairs.num_levels, pairs.num_samples
    if not noises:
        return np.zeros((J, J))
    noise = Composite(noises)
    root = _root_of_spectrum(noise, pairs.size)
    V = np.asarray(wv_covariance(noise, num, J))
    of_mean = sum(
        (4 * _gram(quadratic_forms_times(_draws(Composite([p]), num, 1), pairs), root) for p in drifts),
        np.zeros((J, J)),
    )
    sd = np.sqrt(np.diag(V))
    if np.any(sd == 0):  # no noise at some scale
        return of_mean
    with_gaps, complete = np.zeros((J, J)), np.zeros((J, J))
    count, at_once = int(np.clip(_SAMPLES // num, _FEWEST, _MOST)), max(1, _AT_ONCE // num)
    draws = _draws(noise, num, count)
    for x in (draws[first : first + at_once] for first in range(0, count, at_once)):
        with_gaps += _gram(quadratic_forms_times(x, pairs), root)
        complete += _gram(_complete_forms_times(x, J), root)
    unit = np.outer(sd, sd)
    T = np.linalg.cholesky(V / unit) @ np.linalg.inv(np.linalg.cholesky(complete / unit))
    return (T @ (with_gaps / unit) @ T.T) * unit + of_mean


def _draws(model: Composite, num: int, count: int) -> Float[np.ndarray, "B N"]:
    return np.asarray(simulate_each(model, jax.random.split(jax.random.key(0), count), num))


def _root_of_spectrum(noise: Composite, size: int) -> Float[np.ndarray, " F"]:
    """What to multiply Fourier transforms by, so that z' Sigma z is the sum of their squares, halved at both ends.

    At zero frequency it multiplies the slope of the transform, by the square root of f^2 S(f) as f -> 0.
    """
    f = fft.rfftfreq(size)
    f[0] = 0.05 / size
    root = np.sqrt(np.asarray(noise.psd(f)) / size)
    weight = np.full(len(f), np.sqrt(2.0))
    weight[0] = 2 * np.pi * f[0]
    if size % 2 == 0:
        weight[-1] = 1.0
    return root * weight


def _gram(forms: Iterable[Float[np.ndarray, "B N"]], root: Float[np.ndarray, " F"]) -> Float[np.ndarray, "J J"]:
    """Sum over records of z_j' Sigma z_k, z_j = Q_j x."""
    size = 2 * len(root) - 2
    rows = []
    for z in forms:
        transform = fft.rfft(z, size)
        transform[:, 0] = z @ np.arange(z.shape[1])
        rows.append((transform * root).ravel().view(np.float64))
    stacked = np.stack(rows)
    return stacked @ stacked.T


def _complete_forms_times(x: Float[np.ndarray, "B N"], num_levels: int) -> Iterator[Float[np.ndarray, "B N"]]:
    """H_j' H_j x / M_j, H_j the Haar filter of level j within a complete record."""
    x = x - np.mean(x, axis=1, keepdims=True)
    for n in (1 << j for j in range(num_levels)):
        W = _haar(x, n)
        # the transpose filters backwards
        yield _haar(np.pad(W, ((0, 0), (2 * n - 1, 2 * n - 1))), n) * (-1.0 / W.shape[1])


def _haar(x: Float[np.ndarray, "B N"], n: int) -> Float[np.ndarray, "B M"]:
    """Difference of neighbouring sums of n samples, over 2n."""
    sums = np.cumsum(np.pad(x, ((0, 0), (1, 0))), axis=1)
    return (sums[:, 2 * n :] - 2 * sums[:, n:-n] + sums[:, : -2 * n]) / (2 * n)
