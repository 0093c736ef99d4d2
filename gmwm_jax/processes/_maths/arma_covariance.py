"""Covariances of the Haar coefficients of an ARMA process at real lags, from tables of powers of its transition.

The autocovariance is gamma_m = h' F^m P h (see `_doubling`), and what `_haar` asks for is its double sum: with
a_m = sum_{i<m} h'F^i x, c_m = sum_{k<m} a_k, t_m = sum_{k<m} c_k, two forms of it that differ by a multiple of m^2 are

    K(m) = -m gamma_0/2 - c_m  for x = F P h,    K~(m) = -t_{m+1}  for x = (F - 1) P h;

the first for a process that forgets within the filters, the second for one that hardly moves: at each point that
with the smaller numbers is taken. Filters that lie apart, g samples between them, have with A_n = 1 + F + .. + F^(n-1)

    -h' A_{n_j}^2 A_{n_k}^2 (F - 1)^2 F^(g+1) P h / (4 n_j n_k),

where nothing cancels. All of these are linear in M^m (x, 0, 0, 0), M the step of (F^m x, a_m, c_m, t_m), and
m = R k + i splits them into a table of rows of M^(R k) and one of M^i (x, 0, 0, 0).

Between the integers of one parity they are interpolated by a polynomial of degree 7. That is smooth where the
autocovariance is; one that oscillates has no smooth extension, and its sums over lags need narrow panels.
"""

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float

from gmwm_jax.processes._maths.doubling import Form, powers_times, stationary_covariance
from gmwm_jax.processes._maths.haar import Points, gap, nine_terms

_NUM_BITS = 13
_RADIX = 2**12
_NUM_ROWS = 2**_NUM_BITS
"""Lags stay below their product, twice the longest record, of 2^24 samples."""
_NUM_LEVELS = 31
_NODES = 8
_BEFORE = 6.0
"""How far before a lag the first node of its polynomial lies: three nodes of its parity."""


@jax.jit
def haar_covariance(form: Form, lag: Points, parity: Points, n_j: Points, n_k: Points) -> Float[Array, "*P"]:
    """Cross-covariance of Haar coefficients with half spans that are powers of two."""
    d = len(form.readout)
    F, h = jnp.eye(d) + form.step, form.readout
    w = stationary_covariance(form) @ h
    gamma_0 = h @ w
    M = jnp.zeros((d + 3, d + 3)).at[:d, :d].set(F).at[d, :d].set(h)
    M = M.at[[d, d + 1, d + 2, d + 1, d + 2], [d, d + 1, d + 2, d, d + 1]].set(1.0)
    M_R = lax.fori_loop(0, _NUM_BITS - 1, lambda _, A: A @ A, M)

    rows = jnp.arange(_NUM_ROWS, dtype=jnp.float64)
    row_c, row_t = jax.vmap(powers_times, (None, 0, None, None))(M_R.T, jnp.eye(d + 3)[d + 1 :], rows, _NUM_BITS)
    columns = jax.vmap(powers_times, (None, 0, None, None))(M_R[:d, :d], jnp.eye(d), rows, _NUM_BITS)
    starts = jnp.zeros((3, d + 3)).at[:, :d].set(jnp.stack([F @ w, form.step @ w, F @ form.step @ form.step @ w]))
    starts = starts.at[1].set(M @ starts[1])
    first = jnp.arange(_RADIX + 2 * _NODES, dtype=jnp.float64)
    low_c, low_t, low_far = jax.vmap(powers_times, (None, 0, None, None))(M, starts, first, _NUM_BITS)

    def second_difference(totals: Array, term: tuple[Array, Array, Array]) -> tuple[Array, None]:
        m, sign, weight = term
        row, nodes, polynomial = _located(m, sign)
        c, t = (
            jnp.sum(high[row] * jnp.sum(polynomial[..., None] * low[nodes], axis=1), axis=1)
            for high, low in ((row_c, low_c), (row_t, low_t))
        )
        forms = jnp.stack([-m * gamma_0 / 2 - c, -t])
        return jnp.stack([totals[0] + weight * forms, jnp.maximum(totals[1], jnp.abs(forms))]), None

    terms = nine_terms(lag, parity, n_j, n_k)
    (sums, sizes), _ = lax.scan(second_difference, jnp.zeros((2, 2, *lag.shape)), terms)
    overlapping = jnp.where(sizes[0] <= sizes[1], sums[0], sums[1])

    between = gap(lag, n_j, n_k)
    row, nodes, polynomial = _located(jnp.maximum(between, 0.0), parity)
    x = jnp.sum(polynomial[..., None] * low_far[nodes, :d], axis=1)
    x = jnp.sum(jnp.moveaxis(columns, 0, 2)[row] * x[:, None, :], axis=2)
    sums_of_powers = _squared_sums(form)
    level_j, level_k = (jnp.round(jnp.log2(n)).astype(jnp.int32) for n in (n_j, n_k))
    x = jnp.sum(sums_of_powers[level_k] * x[:, None, :], axis=2)
    apart = -jnp.sum(jnp.tensordot(h, sums_of_powers, (0, 1))[level_j] * x, axis=1)
    return jnp.where(between >= 0, apart, overlapping) / (4 * n_j * n_k)


def _located(m: Points, sign: Points) -> tuple[Array, Array, Array]:
    """Row of the first table, rows of the second (P, Q), and the weights (P, Q) that interpolate between those."""
    whole = jnp.where(sign > 0, 2 * jnp.floor(m / 2), 2 * jnp.floor((m - 1) / 2) + 1)
    first = jnp.maximum(whole - _BEFORE, jnp.where(sign > 0, 0.0, 1.0))
    row = jnp.floor(first / _RADIX)
    q = jnp.arange(_NODES, dtype=jnp.float64)
    distance = ((m - first) / 2)[:, None] - q[None]
    itself = jnp.eye(_NODES, dtype=bool)
    others = jnp.where(itself, 1.0, q[:, None] - q[None, :])
    factors = jnp.where(itself[None], 1.0, distance[:, None, :] / others[None])
    nodes = (first - row * _RADIX)[:, None] + 2 * q[None]
    return row.astype(jnp.int32), nodes.astype(jnp.int32), jnp.prod(factors, axis=2)


def _squared_sums(form: Form) -> Float[Array, "L d d"]:
    """A_n^2, A_n = 1 + F + .. + F^(n-1), of n = 1, 2, 4, .."""

    def double(carry: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], Array]:
        D, A = carry
        return (2 * D + D @ D, 2 * A + D @ A), A @ A

    return lax.scan(double, (form.step, jnp.eye(len(form.readout))), None, _NUM_LEVELS)[1]
