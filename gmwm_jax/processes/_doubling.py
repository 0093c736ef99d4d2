"""Second moments of ARMA processes over any span in O(log span) steps, by joining blocks of samples.

x = theta(B) u with phi(B) u = e. As a state serve u and its backward differences, (u_t, nabla u_t, nabla^2 u_t, ..),
nabla = 1 - B, of which there are d = max(p, q + 1): with phi(B) = sum_k b_k nabla^k and c_i = b_0 + .. + b_i

    X_t = F X_{t-1} + (1, 1, ..)' e_t,    F_ki = [i >= k] - c_i,    x_t = h' X_t,

and near unit roots, where u_t, u_{t-1}, .. are almost the same, these stay small and c_0 = phi(1) is what tells the
roots apart. A block of m samples is all that matters of them: with X_0 the state before it,

    D = F^m - 1,   s' = (1, 0, ..) (F + .. + F^m),   X_m = F^m X_0 + E,   u_1 + .. + u_m = s' X_0 + Z,

and the covariances G, c, v of (E, Z). Two blocks join in a few products (`join`), hence powers of two by doubling and
any m from its bits. (Smith 1968 solves G = F G F' + Q, the covariance of X, so.) Sums of differences are differences:
x_1 + .. + x_m = h_0 (u_1 + .. + u_m) + l' (X_m - X_0), l = (h_1, h_2, .., 0). Hence a Haar coefficient of two blocks is

    (a' X_0 + [w' E - h_0 Z] + [l' E' + h_0 Z'])/(2m),   a = h_0 D's + D'D'l,   w = h_0 s + (D - 1)'l,

and its variance a sum of squares: what cancels in sums over the autocovariance does not here. Coefficients in doubles
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

    D: Float[Array, "d d"]
    s: Float[Array, " d"]
    G: Float[Array, "d d"]
    c: Float[Array, " d"]
    v: Float[Array, ""]


def one_sample(form: Form) -> Block:
    """The block of one sample."""
    d = len(form.readout)
    return Block(form.step, jnp.eye(d)[0] + form.step[0], jnp.ones((d, d)), jnp.ones(d), jnp.ones(()))


def join(a: Block, b: Block) -> Block:
    """Block a, and block b after it."""
    crossing = a.c + _times(a.G, b.s)
    carried = a.G + _product(b.D, a.G)
    return Block(
        D=a.D + b.D + _product(b.D, a.D),
        s=a.s + b.s + _times(a.D.T, b.s),
        G=carried + _product(carried, b.D.T) + b.G,
        c=crossing + _times(b.D, crossing) + b.c,
        v=a.v + b.v + jnp.sum(b.s * (a.c + crossing)),
    )


def _doublings(form: Form) -> tuple[Block, Float[Array, "d d"]]:
    """The blocks of 1, 2, 4, .. samples, stacked, and the covariance P of the state."""
    last, blocks = lax.scan(lambda b, _: (join(b, b), b), one_sample(form), None, _NUM_DOUBLINGS)
    return blocks, last.G


@jax.jit
def stationary_covariance(form: Form) -> Float[Array, "d d"]:
    """P, the covariance of the state."""
    return _doublings(form)[1]


def wavelet_variance(form: Form, tau: Float[Array, "*J"]) -> Float[Array, "*J"]:
    """Haar wavelet variance at spans that are powers of two; NaN at others."""
    powers, P = _doublings(form)
    level = jnp.round(jnp.log2(tau / 2))
    blocks = jax.tree.map(lambda leaf: leaf[level.astype(jnp.int32)], powers)
    return jnp.where(2.0**level == tau / 2, _of_blocks(form, blocks, P, tau), jnp.nan)


def wavelet_variance_of_any_span(form: Form, tau: Float[Array, "*J"]) -> Float[Array, "*J"]:
    """Haar wavelet variance at even spans: the blocks of their bits, joined."""
    powers, P = _doublings(form)

    def add(found: Block, power: tuple[Array, Block]) -> tuple[Block, None]:
        size, block = power
        joined = jax.vmap(join, (0, None))(found, block)
        has_bit = jnp.mod(jnp.floor(tau / 2 / size), 2) == 1
        found = jax.tree.map(
            lambda new, old: jnp.where(has_bit.reshape(-1, *[1] * (new.ndim - 1)), new, old), joined, found
        )
        return found, None

    empty = jax.tree.map(lambda leaf: jnp.zeros((*tau.shape, *leaf.shape[1:])), powers)
    blocks = lax.scan(add, empty, (2.0 ** jnp.arange(_NUM_DOUBLINGS, dtype=jnp.float64), powers))[0]
    return _of_blocks(form, blocks, P, tau)


def _of_blocks(form: Form, blocks: Block, P: Float[Array, "d d"], tau: Float[Array, "*J"]) -> Float[Array, "*J"]:
    """Of two equal blocks, the formula of the file."""
    h_0, rest = form.readout[0], jnp.concatenate([form.readout[1:], jnp.zeros(1)])

    def variance(b: Block) -> Array:
        turned = _times(b.D.T, rest)
        a = h_0 * _times(b.D.T, b.s) + _times(b.D.T, turned)
        first, second = h_0 * b.s + turned - rest, rest
        halves = [jnp.sum(x * (_times(b.G, x) + sign * 2 * h_0 * b.c)) for x, sign in ((first, -1), (second, 1))]
        return jnp.sum(a * _times(P, a)) + halves[0] + halves[1] + 2 * h_0 * h_0 * b.v

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
