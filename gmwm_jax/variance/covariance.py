"""Covariance of the wavelet-variance estimator for a Gaussian process of known model, exact for finite N.

With gamma_jk(h) = Cov(W_{j,t+h}, W_{k,t}) and a mean mu_j of the coefficients (zero but for a drift), Isserlis'
theorem gives

    Cov(nu_j, nu_k) = 1/(M_j M_k) sum_h N_jk(h) [2 gamma_jk(h)^2 + 4 mu_j mu_k gamma_jk(h)],

N_jk(h) the number of pairs of coefficients at lag h. (Percival 1995 and Serroukh, Walden & Percival 2000 take the limit
of large N, where it becomes an integral over the spectrum.) For a robust wavelet variance each 2 gamma^2 is multiplied
by a polynomial in the squared correlation, see `gmwm_jax.variance.robust`: to first order, and for mu = 0.

The sum has 2N terms for each pair of scales. But gamma_jk is smooth between nine kinks, the lags at which an edge or
the middle of one filter meets one of the other's, and varies there on the scale of the distance to the nearest kink
(or of a correlation time, when it has died out before the panels grow longer). Hence a graded quadrature: panels that
double in length away from every kink, and in each a Gauss rule *for sums over integers*, whose orthogonal polynomials
are the discrete Chebyshev (Gram) polynomials; exact for polynomials up to degree 2Q - 1 and, on panels of up to Q
points, for everything. Even and odd lags are summed apart, so that an AR1 with phi < 0 is smooth as well.
What rings (an ARMA with complex roots) takes shorter panels; 16 turns before it has fallen by e are still resolved, and
beyond the error grows to 10 % for what rings for ever, which should be a SIN. Under jit, where a model's roots are not
known, panels are for three turns.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.checks import integer, require_x64
from gmwm_jax.processes.base import AbstractProcess, Composite, scaled
from gmwm_jax.processes.registry import as_model
from gmwm_jax.variance.haar import check_num_levels, num_coefficients, scales
from gmwm_jax.variance.robust import biweight

_NODES = 8
"""Q, Gauss nodes in a panel."""
_RESOLVED = {1: 1.0, 4: 5.0, 16: 20.0, 64: 100.0}
"""Fineness of panels -> the ringing, radians an e-folding, that they resolve: the sums keep 8 digits."""


class LagQuadrature(NamedTuple):
    """Nodes and weights for the sums over lags of all pairs j >= k of scales, as one flat list."""

    lag: Any
    parity: Any
    n_j: Any
    n_k: Any
    weight: Any
    """Quadrature weight times N_jk(h) / (M_j M_k)."""
    pair: Any
    """Index of the pair, in the order of `numpy.tril_indices`."""


@lru_cache
def _gauss_for_sums(count: int) -> tuple[Float[np.ndarray, " Q"], Float[np.ndarray, " Q"]]:
    """Nodes and weights with sum_i w_i f(x_i) = sum_{x=0}^{count-1} f(x) for polynomials f up to degree 2Q - 1.

    Golub & Welsch (1969) from the recurrence of the discrete Chebyshev polynomials (Gautschi 2004, table 1.2).
    """
    if count <= _NODES:
        return np.arange(count, dtype=float), np.ones(count)
    k = np.arange(1, _NODES)
    off_diagonal = np.sqrt(k**2 * (float(count) ** 2 - k**2) / (4 * (4 * k**2 - 1)))
    jacobi = np.diag(np.full(_NODES, (count - 1) / 2)) + np.diag(off_diagonal, 1) + np.diag(off_diagonal, -1)
    nodes, vectors = np.linalg.eigh(jacobi)
    return nodes, count * vectors[0] ** 2


def _panels(first: int, last: int, graded_left: bool, graded_right: bool, fineness: int) -> list[tuple[int, int]]:
    """Cut the integers first..last into panels [start, stop), as long as they lie away from a graded end / fineness."""
    if last < first:
        return []
    if graded_left and graded_right:
        middle = (first + last) // 2
        return _panels(first, middle, True, False, fineness) + _panels(middle + 1, last, False, True, fineness)
    panels, length, start = [], 2 * _NODES, first
    while start <= last:
        stop = min(start + length, last + 1)
        panels.append((start, stop))
        length = max(2 * _NODES, (stop - first) // fineness)
        start = stop
    # graded towards the other end: the same, mirrored
    return panels if graded_left else [(first + last + 1 - b, first + last + 1 - a) for a, b in reversed(panels)]


@lru_cache(maxsize=16)
def lag_quadrature(num_samples: int, num_levels: int, fineness: int = 1) -> LagQuadrature:
    """Nodes and weights for a record of N samples and levels 1..J, in panels shorter by a factor."""
    tau = scales(num_levels).astype(int)
    M = num_coefficients(num_samples, num_levels)
    j, k = np.tril_indices(num_levels)
    panels, pair_of = [], []
    for pair, (tau_j, tau_k) in enumerate(zip(tau[j].tolist(), tau[k].tolist(), strict=True)):
        lowest, highest = -(num_samples - tau_j), num_samples - tau_k
        kinks = sorted({a * (tau_j // 2) - b * (tau_k // 2) for a in range(3) for b in range(3)})
        edges = [h for h in kinks if lowest <= h <= highest]
        here = _panels(lowest, edges[0] - 1, False, True, fineness)
        for left, right in zip(edges, [*edges[1:], None], strict=True):
            here.append((left, left + 1))
            here += _panels(left + 1, highest if right is None else right - 1, True, right is not None, fineness)
        panels += here
        pair_of += [pair] * len(here)

    # lags of one parity in each panel: first, first + 2, ...
    first = (np.array(panels)[:, :1] + [0, 1]).ravel()
    count = (np.repeat(np.array(panels)[:, 1], 2) - first + 1) // 2
    counts, which = np.unique(count, return_inverse=True)
    nodes, weights = np.zeros((2, len(counts), _NODES))
    for i, c in enumerate(counts):
        x, w = _gauss_for_sums(int(c))
        nodes[i, : len(x)], weights[i, : len(x)] = x, w
    panel, node = np.nonzero(weights[which])
    h = first[panel] + 2 * nodes[which[panel], node]
    pair = np.repeat(pair_of, 2)[panel]
    tau_j, tau_k = tau[j[pair]], tau[k[pair]]
    # t in [tau_j - 1, N - 1] and t - h in [tau_k - 1, N - 1]
    N_jk = np.minimum(num_samples - 1, num_samples - 1 + h) - np.maximum(tau_j - 1, tau_k - 1 + h) + 1
    return LagQuadrature(
        lag=h,
        parity=1.0 - 2.0 * (first[panel] % 2),
        n_j=tau_j / 2,
        n_k=tau_k / 2,
        weight=weights[which[panel], node] * N_jk / (M[j[pair]] * M[k[pair]]),
        pair=pair.astype(np.int32),
    )


def wv_covariance(
    model: str | AbstractProcess | Composite,
    num_samples: int,
    num_levels: int | None = None,
    *,
    efficiency: float | None = None,
) -> Float[Array, "J J"]:
    """Compute the covariance matrix of the Haar MODWT wavelet variance of a record of N samples.

    Parameters
    ----------
    model
        All parameters given; Gaussian (for QN, which is not, an approximation).
    num_samples, num_levels
        N, and J, by default floor(log2 N) - 1.
    efficiency
        Of a robust wavelet variance; None for the classic one. The robust one is no sum, and its covariance holds to
        first order: where a scale has many independent coefficients.

    Returns
    -------
    Cov(nu_j, nu_k) in u^4. Pure in the parameters of the model: jit, grad and vmap it.

    Raises
    ------
    ValueError
        A parameter without value; too short a record; a component that is not ergodic (SIN); an efficiency not on
        offer, or for a model with a drift.

    Examples
    --------
    >>> gj.variance.wv_covariance("WN(sigma2=1.0)", num_samples=2000, num_levels=4).shape
    (4, 4)
    """
    require_x64()
    model = as_model(model)
    num_samples = integer("num_samples", num_samples, 1)
    J = check_num_levels(num_samples, num_levels)
    for process in model.processes:
        process.require_complete()
        if not process.ergodic:
            raise ValueError(f"There is no covariance of the wavelet variance of {process.kind}: it is not ergodic.")
    polynomial = np.ones(1)
    if efficiency is not None:
        require_no_mean(model)
        polynomial = biweight(efficiency).polynomial
    return _covariance(model, lag_quadrature(num_samples, J, _fineness(model)), polynomial, J)


def _fineness(model: Composite) -> int:
    """How much shorter panels must be than for what only decays: until a ringing has died out they hold few turns."""
    ringing = max(p.ringing(p.shape) for p in model.processes)
    return next((fineness for fineness, resolved in _RESOLVED.items() if ringing <= resolved), max(_RESOLVED))


def require_no_mean(model: Composite) -> None:
    """Raise if the coefficients of a model have a mean: a robust scale around zero is then not the root of E(W^2)."""
    for process, label in zip(model.processes, model.labels, strict=True):
        if process.deterministic:
            raise ValueError(
                f"{label} gives wavelet coefficients a mean, and the robust wavelet variance is one of coefficients "
                "around zero: it would be biased at every scale where the mean shows. Take the drift off the record "
                "(a least-squares line, say), leave it out of the model, or use the classic wavelet variance."
            )


def _covariance_of_pairs(
    model: Composite, q: LagQuadrature, polynomial: Float[Array, " K"], J: int
) -> Float[Array, "J J"]:
    gamma = jnp.zeros_like(q.lag)
    mu_j, mu_k = jnp.zeros_like(q.lag), jnp.zeros_like(q.lag)
    for p in model.processes:
        gamma = gamma + scaled(p.unit_haar_covariance, p.amplitude, p.shape, q.lag, q.parity, q.n_j, q.n_k)
        mu_j = mu_j + jnp.sqrt(p.amplitude) * p.unit_haar_mean(q.n_j)
        mu_k = mu_k + jnp.sqrt(p.amplitude) * p.unit_haar_mean(q.n_k)
    num_pairs = J * (J + 1) // 2
    rows, columns = np.tril_indices(J)
    nu = model.wavelet_variance(scales(J))
    variances = (nu[rows] * nu[columns])[q.pair]
    # squared correlation; a model without any variance has none
    y = gamma * gamma / jnp.where(variances > 0, variances, 1.0)
    terms = q.weight * (2 * gamma * gamma * jnp.polyval(polynomial[::-1], y) + 4 * mu_j * mu_k * gamma)
    sums = jax.ops.segment_sum(terms, q.pair, num_segments=num_pairs, indices_are_sorted=True)
    return jnp.zeros((J, J)).at[rows, columns].set(sums).at[columns, rows].set(sums)


_covariance = jax.jit(_covariance_of_pairs, static_argnums=3)
