"""Sums over an autocovariance that is known at some lags: covariances of Haar coefficients, wavelet variance, spectrum.

What is kept is the structure function D(h) = gamma(0) - gamma(h), which a slow process has with all its digits and one
that is not stationary has as well. Its second sum

    U(m) = sum_{0<h<m} (m - h) D(h)

is a generalised covariance of the integrated process (see `haar`): the covariances are its second differences in both
half spans. Where the filters lie more than four times their lengths (and 128 lags) apart those would cancel; there one
of the two second differences is a sum over D with the triangle n - |s| for weights, by a rule of three points that is
exact up to degree 5.

D is known at all lags below 256 and at twice ten lags, even and odd ones, in each of the panels beyond, which grow as
the lag: between them it is interpolated by a polynomial of degree 9 for each parity, so that what alternates from
sample to sample is smooth as well. The sums of the polynomials over integers are exact.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Float
from scipy.special import erf

from gmwm_jax.processes._maths.haar import Points, nine_terms

_NODES = 10
_FIRST = 256
_LONGEST = 2**25
"""Lags up to twice the longest record."""
_GRADED = 4
"""A panel is this much shorter than its first lag."""
_FAR = 4
_NEAR = 128
"""Lags at which small filters see what alternates from sample to sample and dies out."""
_AT_ONCE = 2**18
"""Lags that are interpolated together."""
_STEP = 0.12
"""Width in octaves of the steps by which the lags of a spectrum are cut into bands."""
_REACH = 0.75
"""Where such a step is over."""


class Lattice(NamedTuple):
    """Lags at which an autocovariance is looked at, and what interpolates between them."""

    first: int
    """All lags below it are there."""
    lags: Any
    """(L,): those, and 2 Q of each panel, the even ones first."""
    starts: Any
    """(R,) first lag of each panel."""
    lengths: Any
    index: Any
    """(2, W, Q): which lags serve a window, by parity: windows along the first lags, then the panels."""
    nodes: Any
    """(2, W, Q): those lags."""
    barycentric: Any
    """(2, W, Q)"""
    sums: Any
    """(R, 2 Q + 2, 2 Q): sum over a panel of D and of (end - h) D, and sum_{h<m} (m - h) D at its lags m."""
    second: Any
    """(R, 2 Q, 2 Q): second difference of a smooth function at the lags of a panel."""


def _chebyshev(count: int) -> Float[np.ndarray, " Q"]:
    """Q of the integers 0 .. count - 1, near the roots of a Chebyshev polynomial."""
    return np.round((count - 1) / 2 * (1 - np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)))


def _barycentric(nodes: Float[np.ndarray, "*W Q"]) -> Float[np.ndarray, "*W Q"]:
    gaps = nodes[..., :, None] - nodes[..., None, :]
    size = np.max(np.abs(gaps), axis=(-2, -1), keepdims=True) / 4
    return 1 / np.prod(np.where(np.eye(_NODES, dtype=bool), 1.0, gaps / size), axis=-1)


def _lagrange(nodes: Float[np.ndarray, " Q"], at: Float[np.ndarray, " G"]) -> Float[np.ndarray, "G Q"]:
    """The polynomials that are 1 at one node each."""
    gaps = nodes[:, None] - nodes
    factors = (at[:, None, None] - nodes) / np.where(gaps == 0, 1.0, gaps)
    return np.prod(np.where(gaps == 0, 1.0, factors), axis=2)


def _gauss_for_sums(first: int, count: int) -> tuple[Float[np.ndarray, " G"], Float[np.ndarray, " G"]]:
    """Nodes and weights of sums over first, first + 2, .., exact up to degree 15 (Gautschi 2004, table 1.2)."""
    num = min(8, count)
    k = np.arange(1, num)
    beside = np.sqrt(k**2 * (float(count) ** 2 - k**2) / (4 * (4 * k**2 - 1)))
    jacobi = np.diag(np.full(num, (count - 1) / 2)) + np.diag(beside, 1) + np.diag(beside, -1)
    nodes, vectors = np.linalg.eigh(jacobi)
    return first + 2 * nodes, count * vectors[0] ** 2


def _panel_sums(start: int, length: int, nodes: Float[np.ndarray, "2 Q"]) -> Float[np.ndarray, "_ 2*Q"]:
    rows = []
    for m, power in ((start + length, 0), (start + length, 1), *((m, 1) for m in nodes.ravel())):
        row = []
        for parity in (0, 1):
            count = int((m - start - parity + 1) // 2)
            if count <= 0:
                row.append(np.zeros(_NODES))
                continue
            h, w = _gauss_for_sums(start + parity, count)
            row.append((w * (m - h) ** power) @ _lagrange(nodes[parity], h))
        rows.append(np.concatenate(row))
    return np.stack(rows)


def _second_difference(nodes: Float[np.ndarray, " Q"]) -> Float[np.ndarray, "Q Q"]:
    """Of the polynomial p through the values at the nodes, p'' + p''''/12."""
    w = _barycentric(nodes)
    gaps = nodes[:, None] - nodes
    slope = np.where(gaps == 0, 0.0, w[None, :] / w[:, None] / np.where(gaps == 0, 1.0, gaps))
    slope -= np.diag(np.sum(slope, axis=1))
    second = slope @ slope
    return second + second @ second / 12


@lru_cache
def lattice(resolution: int = 1) -> Lattice:
    """The lags, with panels shorter by a factor."""
    first = _FIRST * resolution
    starts, lengths, at = [], [], first
    while at <= _LONGEST:
        starts.append(at)
        lengths.append(at // (_GRADED * resolution) // 2 * 2)
        at += lengths[-1]
    own = np.stack(
        [[start + p + 2 * _chebyshev(n // 2) for p in (0, 1)] for start, n in zip(starts, lengths, strict=True)]
    )
    lags = np.concatenate([np.arange(first, dtype=float), own.ravel()])
    steps = 2 * np.arange(first // 2 - _NODES + 1)[:, None] + 2 * np.arange(_NODES)
    panel = first + 2 * _NODES * np.arange(len(starts))[:, None] + np.arange(_NODES)
    index = np.stack([np.concatenate([steps + p, panel + p * _NODES]) for p in (0, 1)])
    sums = [_panel_sums(start, n, nodes) for start, n, nodes in zip(starts, lengths, own, strict=True)]
    second = np.zeros((len(starts), 2 * _NODES, 2 * _NODES))
    for r, nodes in enumerate(own):
        second[r, :_NODES, :_NODES], second[r, _NODES:, _NODES:] = map(_second_difference, nodes)
    return Lattice(
        first,
        lags,
        np.array(starts, dtype=float),
        np.array(lengths, dtype=float),
        index,
        lags[index],
        _barycentric(lags[index]),
        np.stack(sums),
        second,
    )


def interpolate(at: Lattice, values: Float[Array, " L"], lag: Points, sign: Points) -> Points:
    """A function of the lag from its values on the lattice, at lags >= 0 on the line of one parity, sign = (-1)^lag."""
    if lag.size > _AT_ONCE:  # ten numbers for each lag are more than a long record
        rows = -(-lag.size // _AT_ONCE)
        padding = (0, rows * _AT_ONCE - lag.size)
        blocks = tuple(jnp.pad(x.ravel(), padding).reshape(rows, _AT_ONCE) for x in (lag, sign))
        return lax.map(lambda block: interpolate(at, values, *block), blocks).ravel()[: lag.size].reshape(lag.shape)
    parity = jnp.where(sign < 0, 1, 0)
    step = jnp.clip(jnp.floor((lag - parity) / 2) - _NODES // 2 + 1, 0, at.first // 2 - _NODES)
    panel = jnp.searchsorted(jnp.asarray(at.starts), lag, side="right") - 1
    window = jnp.where(lag < at.first, step.astype(panel.dtype), at.first // 2 - _NODES + 1 + panel)
    distance = lag[..., None] - jnp.asarray(at.nodes)[parity, window]
    hit = distance == 0
    parts = jnp.asarray(at.barycentric)[parity, window] / jnp.where(hit, 1.0, distance)
    parts = jnp.where(jnp.any(hit, axis=-1, keepdims=True), jnp.where(hit, 1.0, 0.0), parts)
    known = values[jnp.asarray(at.index)][parity, window]
    return jnp.sum(parts * known, axis=-1) / jnp.sum(parts, axis=-1)


def parity_of(lag: Points) -> Points:
    """(-1)^lag of integers."""
    return 1 - 2 * jnp.mod(lag, 2)


def second_sum(at: Lattice, D: Float[Array, " L"]) -> Float[Array, " L"]:
    """U on the lattice from D on it."""
    inner = jnp.cumsum(D[: at.first]) - D[: at.first]  # sums over h < m
    U = jnp.cumsum(inner)
    own = D[at.first :].reshape(len(at.starts), 2 * _NODES)
    sums = jnp.einsum("rmi,ri->rm", at.sums, own)
    total = inner[-1] + D[at.first - 1]
    A = total + jnp.cumsum(sums[:, 0]) - sums[:, 0]
    added = at.lengths * A + sums[:, 1]
    start = U[-1] + total + jnp.cumsum(added) - added
    m = at.lags[at.first :].reshape(own.shape)
    beyond = start[:, None] + (m - at.starts[:, None]) * A[:, None] + sums[:, 2:]
    return jnp.concatenate([U, beyond.ravel()])


def second_difference(at: Lattice, U: Float[Array, " L"]) -> Float[Array, " L"]:
    """D on the lattice from U on it; beyond the first lags without what alternates from sample to sample."""
    after = jnp.append(U[1 : at.first], U[at.first])
    inner = after - 2 * U[: at.first] + jnp.append(U[1], U[: at.first - 1])  # U is even, and D(0) = 0 = U(0) = U(1)
    own = U[at.first :].reshape(len(at.starts), 2 * _NODES)
    return jnp.concatenate([inner, jnp.einsum("rmi,ri->rm", at.second, own).ravel()])


def _without_alternation(at: Lattice, D: Float[Array, " L"]) -> Float[Array, " L"]:
    """On the lattice the mean of D and of what the other parity has there."""
    lags = jnp.asarray(at.lags)
    return (D + interpolate(at, D, lags, -parity_of(lags))) / 2


def wavelet_variance(at: Lattice, U: Float[Array, " L"], tau: Float[Array, "*J"]) -> Float[Array, "*J"]:
    """(2 U(2n) - 8 U(n))/tau^2 at even spans."""
    n = tau / 2
    return (2 * interpolate(at, U, tau, jnp.ones_like(tau)) - 8 * interpolate(at, U, n, parity_of(n))) / (tau * tau)


def haar_covariance(
    at: Lattice, U: Float[Array, " L"], D: Float[Array, " L"], lag: Points, parity: Points, n_j: Points, n_k: Points
) -> Points:
    """Cross-covariance of Haar coefficients, see `haar`."""

    def add(total: Array, term: tuple[Array, Array, Array]) -> tuple[Array, None]:
        m, sign, weight = term
        return total + weight * interpolate(at, U, m, sign), None

    near, _ = lax.scan(add, jnp.zeros_like(lag), nine_terms(lag, parity, n_j, n_k))

    distance = jnp.abs(lag - n_j + n_k)
    least = jnp.maximum(_FAR * (n_j + n_k), _NEAR)
    far = distance > least
    distance = jnp.where(far, distance, least + 1)
    short, long = jnp.minimum(n_j, n_k), jnp.maximum(n_j, n_k)
    # a filter of more than one sample on a side sees nothing that alternates for long
    single = long == 1
    smooth = _without_alternation(at, D)
    side = jnp.sqrt(jnp.maximum(2 * short * short - 3, 1.0) / 5)
    beside = short * short * (short * short - 1) / 12 / (side * side)

    def add_far(total: Array, term: tuple[Array, Array]) -> tuple[Array, None]:
        a, s = term
        weight = jnp.where(a == 0, -2.0, 1.0) * jnp.where(s == 0, short * short - 2 * beside, beside)
        m = distance + a * long + s * side
        # for single ones s = 0 alone counts
        sign = jnp.where(single, parity * jnp.where(a == 0, 1.0, -1.0), 1.0)
        value = jnp.where(single, interpolate(at, D, m, sign), interpolate(at, smooth, m, sign))
        return total + weight * value, None

    a, s = (x.ravel() for x in np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]))
    apart, _ = lax.scan(add_far, jnp.zeros_like(lag), (jnp.asarray(a), jnp.asarray(s)))
    return jnp.where(far, apart, near) / (4 * n_j * n_k)


def spectrum(at: Lattice, variance: Any, D: Float[Array, " L"], frequency: Float[Array, "*F"]) -> Float[Array, "*F"]:
    """Sum over the lags, cut into bands of an octave by smooth steps.

    Of a band all that a frequency sees that turns more often than the band has points is nothing; what alternates
    from sample to sample is summed apart, at the distance from 1/2.
    """
    smooth = _without_alternation(at, D)
    bands = int(np.log2(_LONGEST)) - int(np.log2(_FIRST)) - 2
    lags, weights, strides = [np.arange(1.0, _FIRST * 2**_REACH)], [], []
    weights.append(1 - _rise(lags[0], _FIRST))
    strides.append(np.zeros_like(lags[0]))
    for band in range(bands):
        middle = float(_FIRST * 2**band)
        stride = middle / 32
        h = np.arange(np.ceil(middle * 2**-_REACH / stride), 2 * middle * 2**_REACH / stride) * stride
        lags.append(h)
        weights.append(stride * (_rise(h, middle) - _rise(h, 2 * middle)))
        strides.append(np.full_like(h, stride))
    h, weight, stride = (jnp.asarray(np.concatenate(x)) for x in (lags, weights, strides))
    direct = stride == 0
    ones = jnp.ones_like(h)
    own = interpolate(at, D, h, parity_of(h))
    even, odd, mean = interpolate(at, D, h, ones), interpolate(at, D, h, -ones), interpolate(at, smooth, h, ones)

    def summed(gamma: Array, f: Array) -> Array:
        turns = f[:, None] * h[None]
        seen = f[:, None] * stride[None] < 0.5
        return 2 * jnp.where(seen, jnp.cos(2 * np.pi * (turns - jnp.round(turns))), 0.0) @ (weight * gamma)

    steady = jnp.where(direct, variance - own, variance - mean)
    alternating = jnp.where(direct, 0.0, (odd - even) / 2)
    f = frequency.ravel()
    return (variance + summed(steady, f) + summed(alternating, 0.5 - f)).reshape(frequency.shape)


def _rise(lag: Any, middle: float | int) -> Any:
    """From 0 to 1 around a lag, smoothly in its logarithm."""
    return (1 + erf(np.log2(lag / middle) / (_STEP * np.sqrt(2)))) / 2
