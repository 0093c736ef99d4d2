"""Second moments of ARMA processes over any span in O(log span) steps, by joining blocks of samples.

x = theta(B) u with phi(B) u = e. As a state serve u and its backward differences, (u_t, nabla u_t, nabla^2 u_t, ..),
nabla = 1 - B, of which there are d = max(p, q + 1): with phi(B) = sum_k b_k nabla^k and c_i = b_0 + .. + b_i

    X_t = F X_{t-1} + (1, 1, ..)' e_t,    F_ki = [i >= k] - c_i,    x_t = h' X_t,

and near unit roots, where u_t, u_{t-1}, .. are almost the same, these stay small and c_0 = phi(1) is what tells the
roots apart. With the sum of all u so far as one more state, Y = (X, sum u), a block of m samples is

    Y_m - Y_0 = D Y_0 + E,    Cov(E) = G,

and two blocks join in three small products (`join`): powers of two by doubling, any m from its bits. (Smith 1968 solves
G = F G F' + Q, the covariance P of X, so.) Sums of differences are differences, hence x_1 + .. + x_m = y' (Y_m - Y_0),
y = (h_1, h_2, .., 0, h_0), and the Haar coefficient of two blocks one after the other is

    y' (Y_2m - 2 Y_m + Y_0)/(2m) = [(D'D'y)' Y_0 + (D'y - y)' E + y' E']/(2m).

Its variance is a sum of squares: what cancels in sums over the autocovariance does not here. Coefficients in doubles
know a root 1 - delta to 1e-16/delta, and so do results on spans beyond 1/delta, an r-fold root to 1e-16/delta^r.
"""

from math import comb
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float

_NUM_DOUBLINGS = 56
"""After 2^56 samples nothing is left of a start, by a root that doubles can tell from 1."""


class Form(NamedTuple):
    """An ARMA process with innovations of variance 1 in state-space form, see the file."""

    step: Float[Array, "d d"]
    """F - 1."""
    readout: Float[Array, " d"]
    """h."""


def form(phi: list[Any], theta: list[Any]) -> Form:
    """The form of phi_1 .. phi_p, theta_1 .. theta_q (numbers)."""
    d = max(len(phi), len(theta) + 1)
    rows = []
    for i in range(d):
        c = jnp.ones(())  # b_0 + .. + b_i, by sum_{k<=i} (-1)^k C(j, k) = (-1)^i C(j-1, i)
        for j, a in enumerate(phi, start=1):
            c = c - (-1) ** i * comb(j - 1, i) * a
        rows.append(c)
    step = jnp.triu(jnp.ones((d, d)), 1) - jnp.stack(rows)[None, :]
    return Form(step, jnp.stack(in_differences([jnp.ones(()), *theta], d)))


def in_differences(coefficients: list[Any], num: int) -> list[Any]:
    """The polynomial a_0 + a_1 B + .. in powers of nabla = 1 - B, `num` of them."""
    return [
        sum(((-1) ** k * comb(j, k) * a for j, a in enumerate(coefficients)), start=jnp.zeros(())) for k in range(num)
    ]


class Block(NamedTuple):
    """A block of samples, see the file."""

    D: Float[Array, "d1 d1"]
    G: Float[Array, "d1 d1"]


def join(a: Block, b: Block) -> Block:
    """Block a, and block b after it."""
    carried = a.G + _product(b.D, a.G)
    return Block(a.D + b.D + _product(b.D, a.D), carried + _product(carried, b.D.T) + b.G)


def _doublings(form: Form) -> tuple[Block, Float[Array, "d1 d1"]]:
    """The blocks of 1, 2, 4, .. samples, stacked, and the last G, in which P stands."""
    d = len(form.readout)
    of_sum = jnp.eye(d)[0] + form.step[0]
    D = jnp.zeros((d + 1, d + 1)).at[:d, :d].set(form.step).at[d, :d].set(of_sum)
    last, blocks = lax.scan(lambda b, _: (join(b, b), b), Block(D, jnp.ones((d + 1, d + 1))), None, _NUM_DOUBLINGS)
    return blocks, last.G


@jax.jit
def stationary_covariance(form: Form) -> Float[Array, "d d"]:
    """P, the covariance of the state X."""
    return _doublings(form)[1][:-1, :-1]


def wavelet_variance(form: Form, tau: Float[Array, "*J"]) -> Float[Array, "*J"]:
    """Haar wavelet variance at spans that are powers of two; NaN at others."""
    powers, last = _doublings(form)
    level = jnp.round(jnp.log2(tau / 2))
    blocks = jax.tree.map(lambda leaf: leaf[level.astype(jnp.int32)], powers)
    return jnp.where(2.0**level == tau / 2, _of_blocks(form, blocks, last, tau), jnp.nan)


def wavelet_variance_of_any_span(form: Form, tau: Float[Array, "*J"]) -> Float[Array, "*J"]:
    """Haar wavelet variance at even spans: the blocks of their bits, joined."""
    powers, last = _doublings(form)

    def add(found: Block, power: tuple[Array, Block]) -> tuple[Block, None]:
        size, block = power
        joined = jax.vmap(join, (0, None))(found, block)
        has_bit = jnp.mod(jnp.floor(tau / 2 / size), 2) == 1
        return jax.tree.map(lambda new, old: jnp.where(has_bit[:, None, None], new, old), joined, found), None

    empty = jax.tree.map(lambda leaf: jnp.zeros((*tau.shape, *leaf.shape[1:])), powers)
    blocks = lax.scan(add, empty, (2.0 ** jnp.arange(_NUM_DOUBLINGS, dtype=jnp.float64), powers))[0]
    return _of_blocks(form, blocks, last, tau)


def _of_blocks(form: Form, blocks: Block, last: Float[Array, "d1 d1"], tau: Float[Array, "*J"]) -> Float[Array, "*J"]:
    """Of two equal blocks, the formula of the file."""
    y = jnp.concatenate([form.readout[1:], jnp.zeros(1), form.readout[:1]])

    def variance(b: Block) -> Array:
        turned = _times(b.D.T, y)
        before = _times(b.D.T, turned)  # 0 for the sum of u, whose variance in `last` means nothing
        first = turned - y
        P = last.at[-1].set(0.0).at[:, -1].set(0.0)
        return sum_of(before, P) + sum_of(first, b.G) + sum_of(y, b.G)

    def sum_of(x: Array, G: Array) -> Array:
        return jnp.sum(x * _times(G, x))

    return jax.vmap(variance)(blocks) / (tau * tau)


def powers_times(
    M: Float[Array, "d d"], x: Float[Array, " d"], exponents: Float[Array, " E"], num_bits: int = 32
) -> Float[Array, "E d"]:
    """M^m x for integers m from 0 to 2^num_bits - 1, given as floats."""

    def square(carry: tuple[Array, Array], power: Array) -> tuple[tuple[Array, Array], None]:
        M, found = carry
        has_bit = jnp.mod(jnp.floor(exponents / power), 2) == 1
        found = jnp.where(has_bit[:, None], jax.vmap(_times, (None, 0))(M, found), found)
        return (_product(M, M), found), None

    start = M, jnp.broadcast_to(x, (*exponents.shape, *x.shape))
    return lax.scan(square, start, 2.0 ** jnp.arange(num_bits, dtype=jnp.float64))[0][1]


def _product(A: Array, B: Array) -> Array:
    """Matrix product of small matrices: fused with what is around it, which a call of a library is not."""
    return jnp.sum(A[:, :, None] * B[None, :, :], axis=1)


def _times(A: Array, x: Array) -> Array:
    return jnp.sum(A * x[None, :], axis=1)
