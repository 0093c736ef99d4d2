"""Loops over a batch whose elements end one by one, without `jax.vmap`.

Mapped over a batch, a loop is traced again and again until it is known what in it depends on the batch, and a loop in
a loop as often as the product: written for a batch it is traced once, which takes half the time in all.
"""

from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool

_T = TypeVar("_T")


def while_each(unfinished: Callable[[_T], Bool[Array, " S"]], step: Callable[[_T], _T], states: _T) -> _T:
    """Repeat a step while an element of the batch is unfinished; those that are finished stay as they are.

    Parameters
    ----------
    unfinished
        States -> which of them are unfinished.
    step
        States -> the next ones, as if all were unfinished.
    states
        A tree of arrays, the axis of the batch first.
    """
    return lax.while_loop(
        lambda states: jnp.any(unfinished(states)),
        lambda states: choose_each(unfinished(states), step(states), states),
        states,
    )


def choose_each(which: Bool[Array, " S"], new: _T, old: _T) -> _T:
    """The new elements of a batch where `which` says so, and the old ones elsewhere; trees of arrays."""

    def choose(new: Array, old: Array) -> Array:
        return lax.select(lax.broadcast_in_dim(which, new.shape, (0,)), new, old)

    return jax.tree.map(choose, new, old)
