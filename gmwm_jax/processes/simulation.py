"""Draws from a model, one named stream of random numbers for each component."""

import zlib
from collections import Counter
from functools import partial
from typing import SupportsIndex

import equinox as eqx
import jax
import jax.core
from jax import Array
from jaxtyping import Float, Key

from gmwm_jax._internal.checks import integer, require_x64, typed_key
from gmwm_jax._internal.memory import FLOAT, require_memory
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.processes.base import AbstractProcess, Composite, sum_arrays
from gmwm_jax.processes.registry import as_model

_WHILE_DRAWN = 3
"""Arrays of the length of the record: random bits, normal deviates, and what a recursion makes of them."""


def simulate(
    model: str | AbstractProcess | Composite, num_samples: SupportsIndex, *, key: PRNGKey
) -> Float[Array, " N"]:
    """Draw one record of a model.

    Stationary components start from their stationary distribution (R's simts starts them at zero, which takes
    variance off every slow one), random walks and drifts from zero.

    Parameters
    ----------
    model
        All parameters given.
    num_samples
        N. Static: another length compiles again.
    key
        A typed key, ``jax.random.key(seed)``. Every component draws from a stream of its own, named by its kind and
        number, so adding one leaves the noise of the others as it was.

    Returns
    -------
    Record in signal units. vmap over keys draws many.

    Raises
    ------
    ValueError
        A parameter without value, or a number of samples that is no positive integer.
    TypeError
        The key is an integer or of the old kind.

    Examples
    --------
    >>> x = gj.simulate("WN(sigma2=1.0) + RW(gamma2=1e-4)", 2000, key=jax.random.key(0))
    >>> x.shape
    (2000,)
    """
    require_x64()
    typed_key(key)
    model = as_model(model)
    for process in model.processes:
        process.require_complete()
    num = integer("num_samples", num_samples, 1)
    if not isinstance(key, jax.core.Tracer):
        require_memory(bytes_of_draw(model, num), f"{num} samples of {model}", "draw fewer samples")
    seen: Counter[str] = Counter()
    parts = []
    for process in model.processes:
        seen[process.kind] += 1
        stream = jax.random.fold_in(key, zlib.crc32(f"{process.kind}:{seen[process.kind]}".encode()))
        parts.append(_draw(process, num, stream))
    return sum_arrays(parts)


def bytes_of_draw(model: Composite, num_samples: int) -> int:
    """Memory of a draw: the record, each component, and the arrays of one while it is drawn."""
    return FLOAT * num_samples * (1 + len(model.processes) + _WHILE_DRAWN)


@partial(jax.jit, static_argnums=2)
def simulate_each(model: Composite, keys: Key[Array, " B"], num_samples: int) -> Float[Array, "B N"]:
    """Draw a record for each key, compiled as a whole."""
    return jax.vmap(lambda key: simulate(model, num_samples, key=key))(keys)


@eqx.filter_jit
def _draw(process: AbstractProcess, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:
    return process.simulate(num_samples, key)
