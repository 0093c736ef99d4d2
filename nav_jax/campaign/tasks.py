"""One task of a campaign: a scenario and a chunk of its runs, in whatever process it finds itself.

A task knows where the store is and what campaign it is of, nothing else: it reads the specification, computes all
filters on the same runs and writes its own part of the store. Done twice, it writes the same bytes twice.
"""

import threading
from collections.abc import Mapping
from functools import reduce
from typing import NamedTuple

import numpy as np

from gmwm_jax._internal.executors import prepare_worker
from gmwm_jax._internal.specification import Specification, definition_of, require_numbers
from nav_jax.campaign.contents import contents
from nav_jax.campaign.specification import NUMBERS, Definition
from nav_jax.campaign.store import Layout, Store, read_specification
from nav_jax.filter.experiment import Setup, gains_of, run_keys
from nav_jax.filter.timeline import Gains
from nav_jax.simulation.collected import Collected, run_chunk
from nav_jax.simulation.runs import Runs

AT_ONCE = 64
"""Runs that are computed at once, of chunks of a multiple of them. The last bits depend on it, so that it depends on no
machine; see `nav_jax.simulation._placement` for how the time depends on it."""

_FOR_SUMS = 256
"""Runs in a chunk unless stated, where sums over them are kept. These take as much room whatever the number of runs: of
5,000 runs of three filters at 300 epochs all takes 13 MB, and in chunks of 64 it takes 36. No compression gets far with
the sums, whose digits are random: a tenth less with bytes of equal weight side by side."""


def default_size(keep: str) -> int:
    """Runs in a chunk unless stated, by what is kept of them."""
    return _FOR_SUMS if keep == "statistics" else AT_ONCE


class Told(NamedTuple):
    """What a task tells who sent it.

    Attributes
    ----------
    problem
        Why it was not done, if so.
    unwritable
        Whether that is the store: no other task would be done either.
    """

    problem: str | None
    unwritable: bool


def run_task(path: str, digest: str, num_chunks: int, scenario: str, chunk: int) -> Told:
    """Compute one chunk of the runs of a scenario and write it.

    Parameters
    ----------
    path
        Of the store.
    digest
        Of its specification.
    num_chunks
        Of the store.
    scenario, chunk
        Which.
    """
    prepare_worker()
    try:
        bench = _bench(path, digest, scenario)
        arrays = bench.compute(chunk)
    except Exception as error:  # whatever it is, it is of this task; others go on
        return Told(f"{type(error).__name__}: {error}", False)
    try:
        Store(path, bench.specification, {scenario: bench.layout}, num_chunks).write(scenario, chunk, arrays)
    except OSError as error:
        return Told(str(error), True)
    return Told(None, False)


class Bench:
    """A scenario, prepared: what all its tasks in one process share.

    Parameters
    ----------
    specification, definition
        Of the campaign.
    scenario
        Name.
    """

    def __init__(self, specification: Specification, definition: Definition, scenario: str):
        self.specification, self.definition = specification, definition
        self.setup = Setup(definition.scenarios[scenario], definition.truth.rate)
        self.templates = {name: self._runs(name, Collected(self.setup, 0), 0) for name in definition.filters}
        first = next(iter(self.templates.values()))
        self.epoch = first.epoch()
        self.rows = contents(definition.keep, first)
        self._gains = None
        self._first = threading.Lock()

    @property
    def at_once(self) -> int:
        """Runs that are computed at once: a chunk is one such part, or several."""
        size = self.definition.chunk_size
        return AT_ONCE if size % AT_ONCE == 0 else size

    @property
    def layout(self) -> Layout:
        """What is stored of the scenario."""
        return self.layout_of(self.definition.chunk_size)

    def layout_of(self, size: int) -> Layout:
        """What is stored where chunks have so many runs."""
        runs, models = next(iter(self.templates.values())), len(self.templates)
        arrays = {}
        for row in self.rows:
            value = row.of(runs, self.epoch)
            chunk = (size if row.per_run else 1, models, *value.shape[1:])
            arrays[row.name] = value.dtype.name, chunk, ("run" if row.per_run else "chunk", "model", *row.dims)
        return Layout(
            arrays, {"time": (runs.time, "time")} | {f"{s}_time": (t, f"{s}_time") for s, t in runs.nis_time.items()}
        )

    def compute(self, chunk: int) -> dict[str, np.ndarray]:
        """Run all filters over a chunk, and say what is kept of it: its parts, whose sums are added in their order."""
        size = self.definition.chunk_size
        parts = [self.part(first) for first in range(chunk * size, (chunk + 1) * size, self.at_once)]
        rows = {row: [part[row.name] for part in parts] for row in self.rows}
        return {row.name: np.concatenate(of) if row.per_run else reduce(np.add, of) for row, of in rows.items()}

    def part(self, first: int) -> dict[str, np.ndarray]:
        """Run all filters over as many runs as are computed at once, from this one on."""
        with self._first:  # the first compiles what all others use
            if self._gains is None:
                own, experiment = self.definition.gains == "estimate", self.setup.experiment
                gains = {n: None if own else gains_of(experiment, f) for n, f in self.definition.filters.items()}
                kept = self._computed(first, gains)
                self._gains = gains
                return kept
        return self._computed(first, self._gains)

    def _computed(self, first: int, gains: Mapping[str, Gains | None]) -> dict[str, np.ndarray]:
        definition, size = self.definition, self.at_once
        collected = {name: Collected(self.setup, size) for name in definition.filters}
        keys = run_keys(definition.key, first, first + size)
        for name, output in run_chunk(self.setup, definition.truth, definition.filters, keys, gains).items():
            collected[name].take(0, output)
        runs = [self._runs(name, c, size) for name, c in collected.items()]
        return {row.name: np.stack([row.of(r, self.epoch) for r in runs], axis=1) for row in self.rows}

    def _runs(self, name: str, collected: Collected, count: int) -> Runs:
        believed, truth = self.definition.filters[name], self.definition.truth
        return collected.runs(name, believed, truth, count, count, {}, smooth=False)


_benches: dict[tuple[str, str], Bench] = {}
_MOST_BENCHES = 8
_opening = threading.RLock()


def bench_of(specification: Specification, scenario: str) -> Bench:
    """A scenario of a campaign, prepared once in a process, whatever store it is for."""
    key = (specification.digest, scenario)
    with _opening:
        if key not in _benches:
            bench = Bench(specification, definition_of(specification), scenario)
            while len(_benches) >= _MOST_BENCHES:
                del _benches[next(iter(_benches))]
            _benches[key] = bench
        return _benches[key]


def _bench(path: str, digest: str, scenario: str) -> Bench:
    with _opening:
        if (digest, scenario) in _benches:
            return _benches[digest, scenario]
        specification, _ = read_specification(path)
        if specification.digest != digest:
            raise ValueError(f"{path} has become the store of another campaign")
        require_numbers(path, specification.text, NUMBERS)  # of who sent the task: workers may have another version
        return bench_of(specification, scenario)
