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
_STEP = 37
"""Numbers of a run for each of its states that a step with a covariance of its own goes through. A chunk has as many
runs as fill the cache of a core with them, or half of it where loops are compiled as a whole, or down to half as many.
With 24 states and 1 MiB that is 128 and 72. As a whole, 40 to 72 take the same time, 24 take 1.25 and 80 take 1.4 times
as long; otherwise 64 to 128 take the same time, 52 take 1.06 and 24 take 1.25 times as long."""
_FEWEST = 24
"""Fewer pay badly for a step: with 57 states and 1 MiB 16 to 64 take the same time, and 8 take 1.4 times as long."""
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
    cache = core_cache()
    if shared or cache is None:
        return _SIZES  # runs on shared gains have no covariances of their own
    room = cache // 2 if loops_are_fast() else cache
    most = min(_SIZES[-1], max(_FEWEST, room // (_STEP * FLOAT * num_states) // 4 * 4))
    return range(most, most // 2 // 4 * 4 - 1, -4)


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
