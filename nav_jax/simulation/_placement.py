"""Where runs are computed, and how many at once.

On a CPU a thread takes one chunk after the other, small enough that the covariances of its runs stay in the cache of a
core. Other devices are bound by the time that a step takes to begin, which is that of one run or of thousands (see
https://github.com/jax-ml/jax/issues/2491): a chunk there is all runs that find room. Runs ask nothing of each other, so
that over several devices they are spread without a word between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Key

from gmwm_jax._internal.checks import integer
from gmwm_jax._internal.cores import core_cache, num_threads
from gmwm_jax._internal.memory import FLOAT
from gmwm_jax._internal.xla_loops import loops_are_fast
from nav_jax.filter.experiment import Setup, run_keys
from nav_jax.filter.layout import GROUPS, JUDGED

_SIZES = range(64, 129, 8)
"""Runs in a chunk on a CPU with room for them in the cache of a core: whole vectors, and enough to pay for a step; more
come back later when interrupted."""
_SMALL_CACHE = 2**19
"""Bytes up to which that cache is small, and holds the covariances of fewer runs. With 1 MiB 104 took as long as 24."""
_PARTS = 36
"""Of a small cache that the covariances of a chunk fill together, with 8 bytes a number and what a step holds beside
them. On 512 KiB that is 24 runs of 24 states, which took 0.70 (a covariance every step) and 0.50 (every tenth) of the
time that 64 take; of 15 states 64 were the best, and of 54 states 8."""
_IN_ONE = (16, 24)
"""The same with covariances where loops are compiled as a whole, if the cache has room for them: of 24
states 0.44 (512 KiB) and 0.57 (2 MiB) of the time that 64 take, of 15 states as much as 64; of 54 states 8 took 0.36 of
the time of 16."""
_PARTS_IN_ONE = 54
"""Of the cache that their covariances fill then."""
_STRIDE = 32
"""Runs of which columns of covariances come to lie on the same sets of the cache: 32 took twice the time of 24."""
_SMOOTHER_BYTES = 1_000_000_000
"""What the covariances of all chunks that are smoothed at once may take."""
_SHARE = 0.5
"""Of the memory of a device other than a CPU that runs may take by what is counted; the rest is for what is not."""
_COVARIANCES = 12
"""Matrices of all states that a run has at a time in a step: before, after, their products and transposes."""


@dataclass(frozen=True)
class Placement:
    """A chunk of runs on its devices.

    Attributes
    ----------
    each
        Runs in a chunk on each device.
    workers
        Threads that compute a chunk at a time.
    sharding
        Of the keys over the devices; None for the default device alone.
    """

    each: int
    workers: int
    sharding: NamedSharding | None

    @property
    def size(self) -> int:
        """Runs in a chunk, on all its devices."""
        return self.each * (1 if self.sharding is None else self.sharding.mesh.size)

    def keys(self, key: Key[Any, ""], chunk: int) -> Key[jax.Array, " R"]:
        """The keys of the runs of a chunk, where they are wanted: all that is computed from them is there too.

        The last chunk is filled up with runs that nobody asked for, as another size would compile again.
        """
        keys = run_keys(key, chunk * self.size, (chunk + 1) * self.size)
        return keys if self.sharding is None else jax.device_put(keys, self.sharding)


def placement(
    setup: Setup,
    num_states: int,
    num_runs: int,
    *,
    chunk_size: int | None,
    workers: int | None,
    devices: Sequence[Any] | None,
    shared: bool,
    smooth: bool,
) -> Placement:
    """Decide on it.

    Parameters
    ----------
    setup
        The prepared scenario.
    num_states
        Most that one of the filters has.
    num_runs
        How many are wanted.
    chunk_size, workers, devices
        See `nav_jax.compare`.
    shared
        Whether runs share the gains of the reference, and have no covariances of their own.
    smooth
        Whether those that have keep them at every event, for a smoother.

    Raises
    ------
    ValueError
        A number out of range, no device, or several workers for several devices.
    """
    sharding, device = None, jax.devices()[0]
    if devices is not None:
        if not devices:
            raise ValueError("devices= names one device or more, such as jax.devices(), and is empty.")
        if workers not in (None, 1):
            raise ValueError(f"Runs on several devices go in step, by one thread: leave out workers={workers}.")
        device = devices[0]
        sharding = NamedSharding(Mesh(np.array(devices), ("runs",)), PartitionSpec("runs"))
    count = 1 if sharding is None else sharding.mesh.size
    on_cpu = device.platform == "cpu"
    default = num_threads() if on_cpu and sharding is None else 1
    workers = default if workers is None else integer("workers", workers, 1)
    if chunk_size is not None:
        return Placement(integer("chunk_size", chunk_size, 1), workers, sharding)
    each = -(-num_runs // (workers * count))
    if on_cpu:
        size = _of_cpu(each, _sizes(num_states, shared=shared))
    else:
        size = min(each, max(1, int(_SHARE * _memory(device) / _bytes_of_run(setup, num_states))))
    if smooth and not shared:
        of_run = 2 * FLOAT * len(setup.schedule.time) * num_states**2
        size = min(size, max(1, _SMOOTHER_BYTES // (of_run * workers)))
    return Placement(size, workers, sharding)


def _sizes(num_states: int, *, shared: bool) -> Sequence[int]:
    """Of chunks that stay in the cache of a core, the preferred ones first."""
    cache, fast = core_cache(), loops_are_fast()
    if fast and not shared:
        room = _fitting(cache or _SMALL_CACHE, _PARTS_IN_ONE, num_states)
        return [size for size in _IN_ONE if size <= room] or [8]
    if shared or cache is None or cache > _SMALL_CACHE:
        return _SIZES  # runs on shared gains have no covariances of their own
    most = min(_SIZES[-1], max(8, _fitting(cache, _PARTS, num_states)))
    return [size for size in range(most, max(8, 2 * most // 3 // 8 * 8) - 1, -8) if size != _STRIDE]


def _fitting(cache: int, parts: int, num_states: int) -> int:
    return cache // (parts * num_states**2) // 8 * 8


def _of_cpu(each: int, sizes: Sequence[int]) -> int:
    """The size with which a thread that has so many runs fills up its last chunk with the fewest."""
    if each <= min(sizes):
        return -(-each // 8) * 8
    return min(sizes, key=lambda size: -(-each // size) * size)


def _bytes_of_run(setup: Setup, num_states: int) -> int:
    """What a device holds of a run: results at the end of every segment, and the covariances of a step."""
    M, K = setup.experiment.timeline.valid.shape
    results = M * (2 * JUDGED.size + 9 + len(GROUPS) + 3 * K + 10 + num_states)
    return FLOAT * (results + _COVARIANCES * num_states**2)


def _memory(device: Any) -> float:
    """Bytes that a device has, 4 GB where it does not say."""
    stated = device.memory_stats() or {}
    return float(stated.get("bytes_limit", 4e9))
