"""Newton's method for the reduced objective, from one start.

Saddle-free (Dauphin et al. 2014): the eigenvalues of the Hessian are taken by their size, so that a step leads down
along what bends down as well, and an eigenvalue of zero is no step. Steps are as long as the quadratic model deserves
(a trust region, Conn, Gould & Toint 2000): in the logarithm of a correlation time, at first a factor of e. In a bounded
problem coordinates whose slope leads out of their box stay where they are, and steps end at its walls (projected
Newton, Bertsekas 1982).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float, Int

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
    u: Float[Array, " C"]
    here: Reduced
    move: Float[Array, " C"]
    """From u to where it is tried next."""
    expected: Float[Array, ""]
    """What the quadratic model says that the move gains."""
    share: Float[Array, ""]
    """Of Newton's step that the move is: less than one where the radius cuts it."""
    radius: Float[Array, ""]
    done: Bool[Array, ""]
    count: Int[Array, ""]


def descend(
    layout: Layout, start: Float[Array, " C"], data: Data, max_steps: Int[Array, ""]
) -> tuple[Float[Array, " C"], Reduced]:
    """Go from a start to the minimum below it; coordinates may lie beyond their ends, see `fold`."""

    def unfinished(s: _State) -> Array:
        return ~s.done & (s.count < max_steps)

    def step(s: _State) -> _State:
        there = reduced(layout, s.u + s.move, data, s.here.passive)
        gain = s.here.half - there.half  # of the first, from nowhere, infinite
        taken = gain >= -1e-14 * s.here.half
        first = s.count == 0
        length = jnp.max(jnp.abs(s.move))
        ratio = gain / jnp.maximum(s.expected, _TINY)
        longer = jnp.minimum(2 * s.radius, _LARGEST_RADIUS)
        radius = jnp.where(ratio < 0.25, length / 4, jnp.where((ratio > 0.75) & (s.share < 1), longer, s.radius))
        radius = jnp.where(first, s.radius, radius)
        settled = ~first & (length < jnp.where(taken, _SMALLEST_STEP, _SMALLEST_RADIUS))

        here = jax.tree.map(lambda new, old: jnp.where(taken, new, old), there, s.here)
        u = jnp.where(taken, s.u + s.move, s.u)
        if layout.bounded:
            here = _held(here, stuck(here.gradient, u, data))
        bends, axes = jnp.linalg.eigh(here.hessian)
        size = jnp.maximum(jnp.abs(bends), _FLAT * jnp.max(jnp.abs(bends)) + _TINY)
        along = axes.T @ here.gradient
        newton = -(axes @ (along / size))
        share = jnp.minimum(1.0, radius / jnp.maximum(jnp.max(jnp.abs(newton)), _TINY))
        move = share * newton
        if layout.bounded:
            move = jnp.clip(u + move, *data.bounds.T) - u
            expected = -jnp.sum(here.gradient * move) * (1 - share / 2)
        else:
            expected = jnp.sum(along * along / size) * share * (1 - share / 2)
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

    num, none = layout.num_coordinates, jnp.zeros(())
    nothing = jnp.zeros(len(layout.kinds)), jnp.ones(len(layout.free), dtype=bool)
    nowhere = Reduced(jnp.asarray(jnp.inf), jnp.zeros(num), jnp.zeros((num, num)), *nothing)
    radius = jnp.asarray(_FIRST_RADIUS)
    begin = _State(start, nowhere, jnp.zeros(num), none, none + 1, radius, jnp.asarray(False), jnp.asarray(0))
    last = lax.while_loop(unfinished, step, begin)
    return last.u, last.here


def stuck(gradient: Float[Array, " C"], u: Float[Array, " C"], data: Data) -> Bool[Array, " C"]:
    """Coordinates at a bound beyond which the objective falls."""
    low, high = data.bounds.T
    return (u <= low + TOUCHES) & (gradient > 0) | (u >= high - TOUCHES) & (gradient < 0)


def _held(here: Reduced, held: Bool[Array, " C"]) -> Reduced:
    """The derivatives of the problem in which some coordinates are held."""
    free = jnp.where(held, 0.0, 1.0)
    alone = jnp.max(jnp.abs(here.hessian)) * jnp.diag(1 - free)
    return here._replace(gradient=here.gradient * free, hessian=here.hessian * free[:, None] * free[None, :] + alone)
