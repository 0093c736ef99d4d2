"""Errors of an IMU, drawn for many runs at once: a function of the runs' keys, and of nothing else about the runs.

Every state and every white part has a stream of random numbers of its own, named by channel and process, and every
stream is cut into blocks of fixed length with a key each. So the noise of a run depends neither on the other runs, nor
on the aiding, nor on how long the run goes on. (The length does enter quantisation noise, which is drawn at once, and
the place of a slice of a recording.)

The numbers are normal ones of single precision, turned to double: 24 bits of noise are enough (they reach 5.4 sigma,
which one sample in 15 million exceeds), at half the time.
"""

import zlib
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Int, Key

from nav_jax.layout import CHANNELS
from nav_jax.linalg import factor, root
from nav_jax.noise import ImuErrors, draw
from nav_jax.recorded import RecordedErrors

_BLOCK = 1000
"""Samples drawn at once: a few MB for a chunk of runs, which stays in the cache."""


class Emulated(NamedTuple):
    """Errors of R runs."""

    total: Float[Array, "N 6 R"]
    """What is added to the perfect sensors."""
    lasting: Float[Array, "H 6 R"]
    """At the samples asked for, the part with a memory: what filter states could estimate. NaN where nobody knows."""


class Held(NamedTuple):
    """Samples at which the lasting part is asked for, by the blocks in which they are drawn."""

    local: Int[Array, "B K"]
    """Positions in each block, filled up with zeros."""
    position: Int[Array, " H"]
    """Of each sample in `local`, row after row; B K for the sample after the last block."""


def held_samples(samples: Int[np.ndarray, " H"], num_samples: int) -> Held:
    """Prepare the samples 0 .. N at which `emulate` keeps the lasting part; all of them would be as much again."""
    num_blocks = -(-num_samples // _BLOCK)
    block = samples // _BLOCK
    rows = [np.unique(samples[block == b]) for b in range(num_blocks)]
    width = max(1, *map(len, rows))
    local = np.zeros((num_blocks, width), dtype=np.int64)
    place = {num_blocks * _BLOCK: num_blocks * width}
    for b, row in enumerate(rows):
        local[b, : len(row)] = row - b * _BLOCK
        place |= {int(k): b * width + i for i, k in enumerate(row)}
    return Held(jnp.asarray(local), jnp.asarray([place[int(k)] for k in samples]))


def stream(key: Key[Array, ""], name: str) -> Key[Array, ""]:
    """The key of a named stream of random numbers."""
    return jax.random.fold_in(key, zlib.crc32(name.encode()))


def normals(keys: Key[Array, " R"], names: tuple[str, ...], num: int, block: Array) -> Float[Array, "num S R"]:
    """Standard normal numbers of several streams of each run."""
    numbers = jnp.asarray(np.array([zlib.crc32(n.encode()) for n in names], dtype=np.uint32))

    def of_run(key):
        streams = jax.vmap(lambda n: jax.random.fold_in(jax.random.fold_in(key, n), block))(numbers)
        return jax.vmap(lambda k: jax.random.normal(k, (num,), dtype=jnp.float32), out_axes=1)(streams)

    return jax.vmap(of_run, out_axes=2)(keys).astype(jnp.float64)


def emulate(errors: ImuErrors | RecordedErrors, keys: Key[Array, " R"], num_samples: int, held: Held) -> Emulated:
    """Draw the errors of an IMU.

    Parameters
    ----------
    errors
        The model, or a recording.
    keys
        One a run.
    num_samples
        N.
    held
        Where the lasting part is kept, see `held_samples`.

    Returns
    -------
    Emulated

    Raises
    ------
    ValueError
        A recording is shorter than N.
    """
    if isinstance(errors, RecordedErrors):
        return _slices(errors, keys, num_samples, held)
    bank = errors.bank()
    num_runs, size = keys.shape[0], len(bank.states)
    names = tuple(f"imu {state}" for state in bank.states)
    white_names = tuple(f"imu {channel} white" for channel in CHANNELS)
    if size:
        x = factor(bank.initial) @ normals(keys, tuple(f"{n} start" for n in names), 1, jnp.uint32(0))[0]
    else:
        x = jnp.zeros((0, num_runs))
    gain = factor(bank.driving)
    white = root(bank.white)[:, None]
    one = jnp.ones(())

    def block(x, given):
        number, at = given
        noise = normals(keys, names + white_names, _BLOCK, number)

        def sample(x, e):
            lasting = bank.errors(x)
            total = lasting + white * e[size:]
            driven = jnp.diag(gain)[:, None] * e[:size] if bank.diagonal else gain @ e[:size]
            return bank.advance(x, one) + driven, (total, lasting)

        x, (total, lasting) = jax.lax.scan(sample, x, noise)
        return x, (total, lasting[at])

    numbers = jnp.arange(held.local.shape[0], dtype=jnp.uint32)
    x, (total, lasting) = jax.lax.scan(block, x, (numbers, held.local))
    total = total.reshape(-1, len(CHANNELS), num_runs)[:num_samples]
    lasting = jnp.concatenate([lasting.reshape(-1, len(CHANNELS), num_runs), bank.errors(x)[None]])
    return Emulated(_with_stateless(errors, keys, total), lasting[held.position])


def _with_stateless(errors: ImuErrors, keys: Key[Array, " R"], total: Float[Array, "N 6 R"]) -> Float[Array, "N 6 R"]:
    """Add the processes that have no state, drawn by themselves."""
    num_samples = total.shape[0]
    for channel, name in enumerate(CHANNELS):
        model = errors.stateless(channel)
        if model is not None:
            streams = jax.vmap(lambda k, name=name: stream(k, f"imu {name} stateless"))(keys)
            total = total.at[:, channel].add(draw(model, num_samples, streams))
    return total


def _slices(errors: RecordedErrors, keys: Key[Array, " R"], num_samples: int, held: Held) -> Emulated:
    spare = len(errors.record) - num_samples
    if spare < 0:
        raise ValueError(
            f"The recording has {len(errors.record)} samples at {errors.rate:g} Hz, and a run takes {num_samples}: "
            "use a longer recording or a shorter trajectory."
        )
    record = jnp.asarray(errors.record)

    def of_run(key):
        at = jax.random.randint(stream(key, "imu slice"), (), 0, spare + 1)
        return jax.lax.dynamic_slice_in_dim(record, at, num_samples)

    total = jax.vmap(of_run, out_axes=2)(keys)
    return Emulated(total, jnp.full((held.position.shape[0], *total.shape[1:]), jnp.nan))
