"""Newton's method for the reduced objective, from a batch of starts.

Saddle-free (Dauphin et al. 2014): the eigenvalues of the Hessian are taken by their size, so that a step leads down
along what bends down as well, and an eigenvalue of zero is no step. Steps are as long as the quadratic model deserves
(a trust region, Conn, Gould & Toint 2000): in the logarithm of a correlation time, at first a factor of e. In a bounded
problem coordinates whose slope leads out of their box stay where they are, and steps end at its walls (projected
Newton, Bertsekas 1982).
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Int

from gmwm_jax.fitting._batch import choose_each, while_each
from gmwm_jax.fitting.reduced import Data, Layout, Reduced, reduced

_FIRST_RADIUS, _LARGEST_RADIUS = 1.0, 4.0
_SMALLEST_STEP = 1e-7
"""The error after it is its square, or 1e-6 of it (see `reduced`): below rounding."""
_SMALLEST_RADIUS = 1e-9
"""Where steps this short are refused, rounding decides."""
_NO_GAIN = 1e-24
"""Of the objective, that is expected of a step."""
_FLAT = 1e-12
"""Of the largest eigenvalue: the smallest that a step is divided by."""
_TINY = 1e-300
TOUCHES = 1e-9
"""Of a coordinate: this close to a bound it is at it."""


class _State(NamedTuple):
    u: Float[Array, "S C"]
    here: Reduced
    move: Float[Array, "S C"]
    """From u to where it is tried next."""
    expected: Float[Array, " S"]
    """What the quadratic model says that the move gains."""
    share: Float[Array, " S"]
    """Of Newton's step that the move is: less than one where the radius cuts it."""
    radius: Float[Array, " S"]
    done: Bool[Array, " S"]
    count: Int[Array, " S"]


def descend(
    layout: Layout, starts: Float[Array, "S C"], data: Data, max_steps: Int[Array, ""]
) -> tuple[Float[Array, "S C"], Reduced]:
    """Go from each start to the minimum below it; coordinates may lie beyond their ends, see `fold`."""

    def unfinished(s: _State) -> Array:
        return ~s.done & (s.count < max_steps)

    def step(s: _State) -> _State:
        there = reduced(layout, s.u + s.move, data, s.here.passive)
        gain = s.here.half - there.half  # of the first, from nowhere, infinite
        taken = gain >= -1e-14 * s.here.half
        first = s.count == 0
        length = jnp.max(jnp.abs(s.move), axis=1)
        ratio = gain / jnp.maximum(s.expected, _TINY)
        longer = jnp.minimum(2 * s.radius, _LARGEST_RADIUS)
        radius = jnp.where(ratio < 0.25, length / 4, jnp.where((ratio > 0.75) & (s.share < 1), longer, s.radius))
        radius = jnp.where(first, s.radius, radius)
        settled = ~first & (length < jnp.where(taken, _SMALLEST_STEP, _SMALLEST_RADIUS))

        u, here = choose_each(taken, (s.u + s.move, there), (s.u, s.here))
        if layout.bounded:
            here = _held(here, stuck(here.gradient, u, data))
        bends, axes = jnp.linalg.eigh(here.hessian)
        size = jnp.abs(bends)
        size = jnp.maximum(size, _FLAT * jnp.max(size, axis=1, keepdims=True) + _TINY)
        along = (here.gradient[:, None, :] @ axes)[:, 0]
        newton = -(axes @ (along / size)[:, :, None])[:, :, 0]
        share = jnp.minimum(1.0, radius / jnp.maximum(jnp.max(jnp.abs(newton), axis=1), _TINY))
        move = share[:, None] * newton
        if layout.bounded:
            move = jnp.clip(u + move, *_ends(data)) - u
            expected = -jnp.sum(here.gradient * move, axis=1) * (1 - share / 2)
        else:
            expected = jnp.sum(along * along / size, axis=1) * share * (1 - share / 2)
        return _State(
            u=u,
            here=here,
            move=move,
            expected=expected,
            share=share,
            radius=radius,
            done=settled | (expected <= _NO_GAIN * here.half),
            count=s.count + 1,
        )

    batch, num = starts.shape
    none = jnp.zeros(batch)
    passive = jnp.ones((batch, len(layout.free)), dtype=bool)
    nowhere = Reduced(
        none + jnp.inf, jnp.zeros((batch, num)), jnp.zeros((batch, num, num)), jnp.zeros((batch, len(layout.kinds))),
        passive,
    )  # fmt: skip
    begin = _State(
        starts, nowhere, jnp.zeros((batch, num)), none, none + 1, none + _FIRST_RADIUS, none > 0, jnp.zeros(batch, int)
    )
    last = while_each(unfinished, step, begin)
    return last.u, last.here


def stuck(gradient: Float[Array, "S C"], u: Float[Array, "S C"], data: Data) -> Bool[Array, "S C"]:
    """Coordinates at a bound beyond which the objective falls."""
    low, high = _ends(data)
    return (u <= low + TOUCHES) & (gradient > 0) | (u >= high - TOUCHES) & (gradient < 0)


def _ends(data: Data) -> tuple[Float[Array, "1 C"], Float[Array, "1 C"]]:
    return data.bounds[None, :, 0], data.bounds[None, :, 1]


def _held(here: Reduced, held: Bool[Array, "S C"]) -> Reduced:
    """The derivatives of the problem in which some coordinates are held."""
    free = jnp.where(held, 0.0, 1.0)
    largest = jnp.max(jnp.abs(here.hessian), axis=(1, 2))
    alone = (largest[:, None] * (1 - free))[:, :, None] * np.eye(free.shape[1])[None]
    hessian = here.hessian * free[:, :, None] * free[:, None, :] + alone
    return here._replace(gradient=here.gradient * free, hessian=hessian)
