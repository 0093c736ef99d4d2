"""Monte Carlo: hundreds of runs of one filter or of several, chunk by chunk, on all cores.

Every filter is given the same keys, and so the same noise: common random numbers. Chunks go to a pool of threads (JAX
releases the interpreter while it computes), so that the covariances of a chunk stay in the cache of one core; the
numbers of a run depend on its key alone.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import Any, Literal, overload

import jax
import numpy as np
from jaxtyping import Key

from gmwm_jax._internal.checks import integer, number, typed_key
from gmwm_jax._internal.chunks import numbered_keys
from gmwm_jax._internal.interrupts import AbandonableExecutor
from gmwm_jax._internal.memory import require_memory
from gmwm_jax._internal.progress import Progress, progress_bar
from gmwm_jax._internal.typing import Real
from nav_jax.filter.experiment import (
    GAINS,
    Setup,
    check_rates,
    draw_inputs,
    gains_of,
    named_filters,
    run_filter,
)
from nav_jax.filter.history import histories
from nav_jax.filter.layout import NAVIGATION
from nav_jax.filter.scenario import Scenario
from nav_jax.filter.status import Status
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.recorded import RecordedErrors
from nav_jax.simulation._placement import placement
from nav_jax.simulation.collected import Collected, run_chunk
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.levels import LINEAR, PILOT, TWO_LEVEL, TwoLevel, two_levels
from nav_jax.simulation.linear import enlarged, known_means, small
from nav_jax.simulation.runs import Runs, Track
from nav_jax.simulation.stopping import Rule, Stopped, Watch, rule_of
from nav_jax.statistics.epochs import judged_epoch

_OF_FEW = PILOT // 2
"""Runs in a chunk of two levels: 48 to 64 with 24 states take 0.85 of the time, but a pilot is then less than two."""


def monte_carlo(
    scenario: Scenario,
    truth: ImuErrors | RecordedErrors,
    filter: ImuErrors | None = None,
    *,
    name: str = "filter",
    num_runs: int,
    key: Key[Any, ""],
    gains: str = "estimate",
    smooth: bool = False,
    chunk_size: int | None = None,
    workers: int | None = None,
    devices: Sequence[Any] | None = None,
    keep: Iterable[int] = (),
    stop: Rule | str | None = None,
    progress: Progress = False,
) -> Runs:
    """Run one filter many times along a reference, each time with new noise.

    Parameters
    ----------
    scenario
        Trajectory, aiding, start and Earth.
    truth
        Errors of the IMU that are emulated.
    filter
        What the filter believes of them; the truth if not given.
    name
        Of the filter in tables and figures.
    num_runs, key, gains, smooth, chunk_size, workers, devices, keep, stop, progress
        See `compare`.

    Returns
    -------
    Runs

    Raises
    ------
    ValueError
        As in `compare`; two levels, which make no runs of one kind.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> runs = nj.monte_carlo(scenario, truth, num_runs=4, key=jax.random.key(0))
    >>> runs.errors("position").shape  # runs, epochs, north east down
    (4, 10, 3)
    """
    if gains == TWO_LEVEL:
        raise ValueError("gains is two-level, which gives means of two kinds of runs: use nav_jax.compare.")
    (believed,) = named_filters(truth, filter).values()
    return compare(
        scenario,
        truth,
        {name: believed},
        num_runs=num_runs,
        key=key,
        gains=gains,
        smooth=smooth,
        chunk_size=chunk_size,
        workers=workers,
        devices=devices,
        keep=keep,
        stop=stop,
        progress=progress,
    ).runs[name]


@overload
def compare(
    scenario: Scenario,
    truth: ImuErrors | RecordedErrors,
    filters: Mapping[str, ImuErrors] | ImuErrors | None = None,
    *,
    num_runs: int,
    key: Key[Any, ""],
    gains: Literal["two-level"],
    smooth: bool = False,
    chunk_size: int | None = None,
    workers: int | None = None,
    devices: Sequence[Any] | None = None,
    keep: Iterable[int] = (),
    stop: Rule | str | None = None,
    progress: Progress = False,
) -> TwoLevel: ...


@overload
def compare(
    scenario: Scenario,
    truth: ImuErrors | RecordedErrors,
    filters: Mapping[str, ImuErrors] | ImuErrors | None = None,
    *,
    num_runs: int,
    key: Key[Any, ""],
    gains: str = "estimate",
    smooth: bool = False,
    chunk_size: int | None = None,
    workers: int | None = None,
    devices: Sequence[Any] | None = None,
    keep: Iterable[int] = (),
    stop: Rule | str | None = None,
    progress: Progress = False,
) -> Comparison: ...


def compare(
    scenario: Scenario,
    truth: ImuErrors | RecordedErrors,
    filters: Mapping[str, ImuErrors] | ImuErrors | None = None,
    *,
    num_runs: int,
    key: Key[Any, ""],
    gains: str = "estimate",
    smooth: bool = False,
    chunk_size: int | None = None,
    workers: int | None = None,
    devices: Sequence[Any] | None = None,
    keep: Iterable[int] = (),
    stop: Rule | str | None = None,
    progress: Progress = False,
) -> Comparison | TwoLevel:
    """Compare filters that believe different noise models on the same runs.

    Parameters
    ----------
    scenario
        Trajectory, aiding, start and Earth.
    truth
        Errors of the IMU that are emulated: a model, or a recording.
    filters
        Name -> what that filter believes, or one of them; the truth if not given. Their rate must be that of the truth.
    num_runs
        Number of runs of each filter.
    key
        ``jax.random.key(seed)``. Run i has a key of its own whatever the number of runs.
    gains
        ``estimate``: an EKF for each run. ``reference``: one covariance and one set of gains along the reference, exact
        to first order in the errors and several times faster; not for errors so large that they bend the filter.
        ``two-level``: means of the first, mostly from a few runs, see `nav_jax.simulation.two_level`; no default, since
        it gives no runs to draw, keep, test in pairs or stop by.
    smooth
        Judge the fixed-interval smoother, which uses all measurements of a run, in place of the filter.
    chunk_size
        Runs computed at once, on each device: on a GPU as many as find room unless told otherwise. It changes speed and
        memory, and the last bits of the numbers.
    workers
        Threads; as many as cores that the process may use (or as the environment variable ``GMWM_JAX_NUM_THREADS``
        says) unless told otherwise, one on a GPU and where devices are stated.
    devices
        Over which the runs of a chunk are spread, such as ``jax.devices()``; JAX's default device alone if not given.
        It changes no bit of the numbers.
    keep
        Numbers of runs whose whole trajectory is kept.
    stop
        ``significant``, ``anytime``, or a rule such as ``nj.Precision(position=0.01)``, see `nav_jax.simulation`: stop
        when filters are told apart, or when means are known as well as that; `num_runs` is then the largest number. The
        table takes account of it.
    progress
        Show a bar (needs the extra ``app``); or a function of what is done and the total, which may cancel by
        raising.

    Returns
    -------
    Comparison
        With fewer runs than asked for if it was interrupted from the keyboard: what was done by then. A `TwoLevel` of
        two levels.

    Raises
    ------
    ValueError
        Rates that differ, a recording as the truth and no filter, a number out of range; trajectories to keep of a
        smoother; several threads for several devices; a rule that compares filters, and one filter; trajectories to
        keep, or a rule, of two levels.
    TypeError
        The key is an integer or of the old kind.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0))
    >>> list(comparison)
    ['right', 'white']
    >>> comparison["right"].num_good
    4
    """
    if gains == TWO_LEVEL:
        if stop is not None or list(keep):
            raise ValueError(
                "gains is two-level, which gives means: no run can be kept, nor stops it early. "
                "Leave keep and stop out."
            )
        how = {"smooth": smooth, "chunk_size": chunk_size, "workers": workers, "devices": devices}
        return two_level(scenario, truth, filters, num_runs=num_runs, key=key, progress=progress, **how)
    typed_key(key)
    filters = named_filters(truth, filters)
    if gains not in GAINS:
        raise ValueError(f"gains is one of {', '.join((*GAINS, TWO_LEVEL))}, and is {gains!r}.")
    num_runs = integer("num_runs", num_runs, 1)
    setup = Setup(scenario, check_rates(truth, filters))
    how = {"chunk_size": chunk_size, "workers": workers, "devices": devices, "smooth": smooth, "progress": progress}
    return _compare(setup, truth, filters, num_runs=num_runs, key=key, gains=gains, keep=keep, stop=stop, **how)


def _compare(
    setup: Setup,
    truth: ImuErrors | RecordedErrors,
    filters: Mapping[str, ImuErrors],
    *,
    num_runs: int,
    key: Key[Any, ""],
    gains: str,
    smooth: bool,
    chunk_size: int | None,
    workers: int | None,
    devices: Sequence[Any] | None,
    progress: Progress,
    keep: Iterable[int] = (),
    stop: Rule | str | None = None,
) -> Comparison:
    """As `compare`; gains may be linear, too: those of the reference, and errors so small that filters are linear."""
    rule = rule_of(stop, len(filters))
    kept = sorted({integer("A run to keep", i, 0) for i in keep})
    if kept and smooth:
        raise ValueError("Trajectories that are kept are those of the filter: keep them without smooth=True.")
    if kept and kept[-1] >= num_runs:
        raise ValueError(f"Run {kept[-1]} cannot be kept: there are {num_runs}, numbered from 0.")
    _require_runs(setup, len(filters), num_runs)
    on_reference = gains != "estimate"
    drawn, errors = small(setup, truth) if gains == LINEAR and isinstance(truth, ImuErrors) else (setup, truth)
    states = NAVIGATION.size + max(len(f.states) for f in filters.values())
    how = {"chunk_size": chunk_size, "workers": workers, "devices": devices}
    place = placement(setup, states, num_runs, **how, shared=on_reference, smooth=smooth)
    size = place.size
    shared = {n: gains_of(setup.experiment, f, smooth=smooth) if on_reference else None for n, f in filters.items()}

    def task(chunk: int, names: Sequence[str]) -> dict[str, Any]:
        of = {name: filters[name] for name in names}
        return run_chunk(drawn, errors, of, place.keys(key, chunk), shared, smooth=smooth)

    collected = {name: Collected(setup, num_runs) for name in filters}
    watch = None if rule is None else _watch(rule, setup, collected, num_runs)

    def look(chunks: int) -> Stopped | None:
        return None if watch is None else watch(min(num_runs, chunks * size))

    done = _run_chunks(task, list(filters), -(-num_runs // size), place.workers, progress, collected, size, look)
    finished = min(num_runs, done * size)
    if not finished:
        raise KeyboardInterrupt("Interrupted before the first chunk of runs was done.")
    stopped = look(done)
    if stopped is not None:
        finished = num_runs = stopped.looks[-1]
    keeps = [i for i in kept if i < finished]
    runs = {}
    for name, f in filters.items():
        tracks = _tracks(setup, truth, f, key, keeps, on_reference=on_reference)
        found = collected[name].runs(name, f, truth, finished, num_runs, tracks, smooth=smooth)
        runs[name] = enlarged(found) if gains == LINEAR else found
    return Comparison(setup.reference, runs, truth=repr(truth), stopped=stopped)


def two_level(
    scenario: Scenario,
    truth: ImuErrors | RecordedErrors,
    filters: Mapping[str, ImuErrors] | ImuErrors | None = None,
    *,
    num_runs: int,
    key: Key[Any, ""],
    excess: Real = 0.05,
    smooth: bool = False,
    chunk_size: int | None = None,
    workers: int | None = None,
    devices: Sequence[Any] | None = None,
    progress: Progress = False,
) -> TwoLevel:
    """Compare the means of filters with gains of their own, from a few runs and what is known of linear filters.

    To first order in the errors a filter is linear, so that a run and what a linear filter does in the same run err
    alike. The mean of the second is known: its errors are Gaussian with the covariance of
    `nav_jax.lincov.linear_covariance`. That mean, plus the mean difference of a few runs, is the mean of the first (a
    control variate; Giles 2015), without bias but for what such a covariance leaves out. How many differences it takes
    follows from a pilot of 64: at the epoch at which filters are judged, and there for position and NEES of all
    filters, the variance should be at most 1 + excess times that of `num_runs` runs with their own gains, as far as the
    runs so far can tell.

    Nobody knows the mean of linear runs of a smoother, of a recording as the truth, of noise without state-space form,
    or where a sensor depends on the motion of the body (`nav_jax.aiding.AbstractAiding.uses_body`); and it is not
    believed where the pilot's linear runs miss it by 5 standard errors. Then `num_runs` runs on gains along the
    reference stand for it, which are several times as fast as others. Where runs with their own gains would be half of
    all runs or more, and where one of the pilot's fails, all have their own.

    Parameters
    ----------
    scenario, truth, filters, key, smooth, chunk_size, workers, devices, progress
        See `compare`.
    num_runs
        As many runs with their own gains would be as sure.
    excess
        See above.

    Returns
    -------
    TwoLevel
        `mean` and `difference` at every epoch, and what linearisation costs: their ``correction``.

    Raises
    ------
    ValueError
        As in `compare`; an excess that is not positive, fewer than two runs.

    Notes
    -----
    It is no default of `compare`: means are all that it gives, and it does not pay on all examples of the project. As
    sure as 2,000 runs, it takes 0.07 to 0.42 of their processor time where 64 to 435 runs with gains of their own are
    enough (``benchmarks/results/two_levels.md``), by way of shared gains 0.5 to 1.3; and more than theirs where a
    heading is known to 40 degrees only, so that all runs have their own (1.8), or where all of them take less than half
    a second (1.1).

    There is no third level, of runs on shared gains between the other two. The variance of the difference to a linear
    run is 0.2 to 1.8 times that of the difference to a run on shared gains (position and NEES in 12 examples), so that
    about as many differences are wanted of either, and the mean of the linear runs is had for nothing.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> found = nj.simulation.two_level(scenario, truth, num_runs=8, key=jax.random.key(0))
    >>> found.mean("filter").value.shape
    (10,)
    """
    typed_key(key)
    num_runs, excess = integer("num_runs", num_runs, 2), number("excess", excess)
    filters = named_filters(truth, filters)
    setup = Setup(scenario, check_rates(truth, filters))
    how = {"smooth": smooth, "workers": workers, "devices": devices, "progress": progress}
    # how many have gains of their own is seen only then: chunks of one size are compiled once
    size = _OF_FEW if chunk_size is None and num_runs > PILOT and jax.default_backend() == "cpu" else chunk_size

    def run(gains: str, count: int) -> Comparison:
        sized = chunk_size if gains == "reference" else size
        return _compare(setup, truth, filters, num_runs=count, key=key, gains=gains, chunk_size=sized, **how)

    return two_levels(run, num_runs, excess, known_means(setup, truth, filters, smooth=smooth))


def _watch(
    rule: Rule, setup: Setup, collected: Mapping[str, Collected], num_runs: int
) -> Callable[[int], Stopped | None]:
    """What a rule says when so many runs are there."""
    fixes = dict(zip((s.name for s in setup.aiding), setup.fix_times, strict=True))
    epoch = judged_epoch(setup.output_times, setup.outages, fixes)
    watch = Watch(rule, num_runs, float(setup.output_times[epoch]))

    def look(count: int) -> Stopped | None:
        error = {name: c.error[:count, epoch, :3] for name, c in collected.items()}
        return watch.look(count, error, {name: c.status[:count] == Status.ok for name, c in collected.items()})

    return look


def require_runs(scenario: Scenario, rate: float, num_filters: int, num_runs: int) -> None:
    """Raise if the results of so many runs find no room, before anything that they are to follow is computed.

    Raises
    ------
    MemoryError
        With the memory that they would take.
    """
    _require_runs(Setup(scenario, rate), num_filters, num_runs)


def _require_runs(setup: Setup, num_filters: int, num_runs: int) -> None:
    what = f"{num_runs} runs of {num_filters} filters with {len(setup.output_times)} epochs each"
    make_smaller = "ask for fewer runs, or for fewer epochs by a larger output_interval of the scenario"
    require_memory(num_filters * Collected.bytes_of(setup, num_runs), what, make_smaller)


def _run_chunks(
    task: Callable[[int, Sequence[str]], dict[str, Any]],
    names: list[str],
    num_chunks: int,
    workers: int,
    progress: Progress,
    collected: dict[str, Collected],
    size: int,
    enough: Callable[[int], object],
) -> int:
    """Run all chunks, or as many as are enough; returns how many, from the first on, are complete."""
    # Every filter compiles a program of its own: the first chunk goes filter by filter, so that they compile at once.
    jobs = [(0, [name]) for name in names] + [(chunk, names) for chunk in range(1, num_chunks)]
    complete = np.zeros((num_chunks, len(names)), dtype=bool)
    bar = progress_bar(num_chunks * len(names) * size, "run", progress)
    pool = AbandonableExecutor(workers)
    ended = False
    waiting: dict[Future[dict[str, Any]], int] = {}
    try:
        for chunk, of in jobs:
            waiting[pool.submit(task, chunk, of)] = chunk
            if len(waiting) >= 2 * workers:
                _collect(waiting, collected, complete, names, size, bar)
            if enough(_leading(complete)):
                break
        while waiting and not enough(_leading(complete)):
            _collect(waiting, collected, complete, names, size, bar)
        ended = True
    except KeyboardInterrupt:
        pass
    finally:
        # a chunk that is compiled or computed cannot be stopped, and is not waited for by who wants to stop
        pool.shutdown(wait=ended, cancel_futures=True)
        bar.close()
    return _leading(complete)


def _leading(complete: np.ndarray) -> int:
    """Chunks that are complete, from the first on."""
    whole = complete.all(axis=1)
    return int(len(complete) if whole.all() else np.argmin(whole))


def _collect(waiting: dict, collected: dict, complete: np.ndarray, names: list[str], size: int, bar: Any) -> None:
    """Take in what is done, waiting for the first."""
    for future in wait(waiting, return_when=FIRST_COMPLETED).done:
        chunk = waiting.pop(future)
        for name, output in future.result().items():
            collected[name].take(chunk * size, output)
            complete[chunk, names.index(name)] = True
            bar.update(size)


def _tracks(
    setup: Setup, truth: Any, believed: ImuErrors, key: Any, kept: list[int], *, on_reference: bool
) -> dict[int, Track]:
    """The whole trajectory of some runs, by running them again."""
    if not kept:
        return {}
    inputs = draw_inputs(setup.experiment, truth, numbered_keys(key, kept))
    gains = gains_of(setup.experiment, believed, trace=True) if on_reference else None
    trace = run_filter(setup.experiment, believed, inputs, gains, trace=True).trace
    assert trace is not None
    both = histories(setup.schedule, float(setup.reference.time[0]), setup.experiment.timeline.valid, trace)
    return {i: Track(**vars(after), before=before) for i, (after, before) in zip(kept, both, strict=True)}
