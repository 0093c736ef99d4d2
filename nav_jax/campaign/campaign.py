"""A Monte Carlo study that lives on disk: many scenarios, filters and runs, computed by whoever is there."""

import contextlib
import os
import tempfile
import time
import warnings
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Key

from gmwm_jax._internal.checks import integer, of_kind, typed_key
from gmwm_jax._internal.chunks import words_of_key
from gmwm_jax._internal.cores import num_threads
from gmwm_jax._internal.environment import differences, environment
from gmwm_jax._internal.executors import Pool, Workers, threads
from gmwm_jax._internal.progress import Bar, Progress, progress_bar
from gmwm_jax._internal.specification import (
    Specification,
    definition_of,
    difference,
    require_numbers,
    specification_of,
)
from gmwm_jax._internal.tasks import carry_out, why
from nav_jax.campaign.contents import KEEPS
from nav_jax.campaign.looks import Looks
from nav_jax.campaign.results import CampaignStatus, Cost, Statistics, named
from nav_jax.campaign.specification import NUMBERS, Definition
from nav_jax.campaign.store import Store, read_root, read_specification
from nav_jax.campaign.tasks import Told, bench_of, default_size, run_task
from nav_jax.filter.experiment import GAINS, check_rates, named_filters
from nav_jax.filter.layout import GROUPS, NAVIGATION
from nav_jax.filter.scenario import Scenario
from nav_jax.imu.errors import ImuErrors
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.runs import Runs
from nav_jax.simulation.stopping import Rule, rule_of

Task = tuple[str, int]


class Campaign:
    """Many runs of several filters in several scenarios, chunk by chunk into a store that survives whatever happens.

    A task computes all filters on the same chunk of runs of one scenario, and writes its own part of one Zarr folder
    with a checksum at the end. What is whole in a store is never computed again, what is not always is; so a campaign
    that was killed is continued by running it again, and so is one that is to have more runs. The numbers are the same,
    to the last bit, whoever computed them in whatever order on one kind of processor.

    Parameters
    ----------
    scenarios
        By name, or one of them.
    truth
        Errors of the IMU that are emulated.
    filters
        Name -> what that filter believes, or one of them; the truth if not given.
    key
        ``jax.random.key(seed)``. Run i has a key of its own, the same in every scenario, whatever the number of runs.
    num_runs
        Of each filter in each scenario. It is rounded up to whole chunks, whose last runs would be computed anyway.
    chunk_size
        Runs of a task, by which a campaign is computed, continued and stopped. Unless given 64, or 256 with
        ``keep="statistics"``, whose sums take as much room on disk for each chunk, however large it is; state less
        where there are many workers for few runs. Another size changes the last bits of results: it belongs to what
        defines a campaign.
    keep
        ``judged``: errors, standard deviations, NEES and status of each run at the judged epoch (see `Runs.epoch`).
        ``statistics``: and sums over the runs of each chunk at every epoch. ``runs``: and all runs at every epoch.
    gains
        See `nav_jax.compare`.

    Raises
    ------
    ValueError
        Rates that differ, a name that cannot be that of a folder, a number out of range, or something from outside of
        the packages, which no other process could build.
    TypeError
        The key is an integer or of the old kind.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> key = jax.random.key(0)
    >>> options = {"key": key, "num_runs": 8, "chunk_size": 4}
    >>> study = nj.Campaign({"drive": scenario}, truth, {"right": truth, "white": white}, **options)
    >>> study.run("study.zarr").complete
    True
    >>> study.comparison("drive")["right"].num_good
    8
    >>> nj.Campaign.open("study.zarr").num_runs
    8
    """

    def __init__(
        self,
        scenarios: Mapping[str, Scenario] | Scenario,
        truth: ImuErrors,
        filters: Mapping[str, ImuErrors] | ImuErrors | None = None,
        *,
        key: Key[Any, ""],
        num_runs: int,
        chunk_size: int | None = None,
        keep: str = "statistics",
        gains: str = "estimate",
    ):
        typed_key(key)
        scenarios = {"scenario": scenarios} if isinstance(scenarios, Scenario) else dict(scenarios)
        if not scenarios:
            raise ValueError("Give at least one scenario: {name: Scenario}.")
        for name, scenario in scenarios.items():
            of_kind(f"scenarios[{name!r}]", scenario, Scenario)
            if not name or not all(c.isalnum() or c in " _-" for c in name):
                raise ValueError(
                    f"A scenario is a folder of the store: letters, digits, _ and - make its name, not {name!r}."
                )
        if not isinstance(truth, ImuErrors):
            raise ValueError(
                f"The truth of a campaign is ImuErrors, which every worker can build, and this is {truth!r:.80}."
            )
        filters = named_filters(truth, filters)
        check_rates(truth, filters)
        for what, value, known in (("keep", keep, KEEPS), ("gains", gains, GAINS)):
            if value not in known:
                raise ValueError(f"{what} is one of {', '.join(known)}, and is {value!r}.")
        size = default_size(keep) if chunk_size is None else integer("chunk_size", chunk_size, 1)
        key_words = words_of_key(key)
        self._define(specification_of(Definition(scenarios, truth, filters, *key_words, size, keep, gains), NUMBERS))
        self._num_chunks = -(-integer("num_runs", num_runs, 1) // size)

    def _define(self, specification: Specification) -> None:
        """Take what the workers will read, and not what it was made from: both sides have the same numbers."""
        self._specification, self._definition = specification, definition_of(specification)
        self._path: Path | None = None

    @classmethod
    def open(cls, store: str | os.PathLike) -> "Campaign":
        """Build the campaign that a store is of, with as many runs as it is to have.

        One that was begun by a version with other random numbers can be read, and is not continued.

        Raises
        ------
        FileNotFoundError
            There is nothing.
        ValueError
            It is damaged, or no store of a campaign.
        """
        specification, num_chunks = read_specification(store)
        campaign = cls.__new__(cls)
        campaign._define(specification)
        campaign._num_chunks, campaign._path = num_chunks, Path(store)
        return campaign

    @classmethod
    def merge(cls, stores: Sequence[str | os.PathLike], into: str | os.PathLike) -> "Campaign":
        """Gather what several stores of one campaign have, each of which computed other chunks, in one more.

        Parameters
        ----------
        stores
            Of which a chunk is taken from the first that has it.
        into
            A new store, or one of the same campaign.

        Raises
        ------
        FileNotFoundError, ValueError
            There is none, one is damaged, of another campaign, or was begun with other random numbers than those of
            this version.
        """
        if not stores:
            raise ValueError("Give at least one store to merge.")
        known = [cls.open(store) for store in stores]
        merged = cls.open(stores[0])
        for path, other in zip(stores, known, strict=True):
            texts = other._specification.text, merged._specification.text
            require_numbers(path, texts[0], NUMBERS)
            if texts[0] != texts[1]:
                raise ValueError(
                    f"{path} is the store of another campaign than {stores[0]}: {difference(*texts, 'that one')}."
                )
        merged._num_chunks = max(other._num_chunks for other in known)
        target, sources = merged._open_store(Path(into)), [other._store() for other in known]
        for scenario, chunk in merged._tasks():
            if target.read(scenario, chunk) is None:
                found = (s.read(scenario, chunk) for s in sources if chunk < s.num_chunks)
                arrays = next((a for a in found if a is not None), None)
                if arrays is not None:
                    target.write(scenario, chunk, arrays)
        return merged

    # -- what it is -------------------------------------------------------------------------------------------------

    @property
    def num_runs(self) -> int:
        """Runs of each filter in each scenario, whole chunks."""
        return self._num_chunks * self._definition.chunk_size

    @property
    def chunk_size(self) -> int:
        """Runs in a chunk."""
        return self._definition.chunk_size

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self._definition.scenarios)

    @property
    def filters(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self._definition.filters)

    @property
    def specification(self) -> str:
        """What defines the campaign, as canonical JSON."""
        return self._specification.text

    def __repr__(self) -> str:
        size = self._definition.chunk_size
        return (
            f"Campaign of {', '.join(self.filters)} in {', '.join(self.scenarios)}: {self.num_runs} runs in chunks of "
            f"{size}, keeps {self._definition.keep}\ntruth: {self._definition.truth!r}"
        )

    # -- computing --------------------------------------------------------------------------------------------------

    def cost(self) -> Cost:
        """Compute a few runs of each scenario, and say what all of them will take.

        The first ones by themselves, since they compile, and then as many at a time as `run` computes in its threads:
        one thread alone takes more CPU time, that of cores which wait for it.

        Returns
        -------
        Cost
            CPU time of this process, and bytes on disk.
        """
        first = later = 0.0
        workers, num_bytes = num_threads(), 0
        benches = {name: bench_of(self._specification, name) for name in self.scenarios}
        layouts = {name: bench.layout_of(bench.at_once) for name, bench in benches.items()}
        with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as threads:
            store = Store(Path(folder) / "pilot.zarr", self._specification, layouts, 2)
            store.restore()
            frame = _bytes_below(store.path)
            for scenario, bench in benches.items():
                parts = self._definition.chunk_size // bench.at_once
                begin = time.process_time()
                arrays = bench.part(0)
                _keep(store, scenario, 0, arrays)
                compiled = time.process_time()
                later_parts = [part * bench.at_once for part in range(1, 1 + workers)]
                deque(threads.map(bench.part, later_parts), maxlen=0)
                of_part = (time.process_time() - compiled) / workers
                computed = time.process_time()
                _keep(store, scenario, 1, arrays)
                first += compiled - begin + (parts - 1) * of_part
                later += parts * of_part + time.process_time() - computed
                for row in bench.rows:
                    num_bytes += store.bytes_of(scenario, row.name) * (parts if row.per_run else 1) // 2
        return Cost(first, later, self._num_chunks, num_bytes, frame)

    def run(
        self,
        store: str | os.PathLike,
        *,
        executor: Workers = None,
        chunks: Iterable[int] | None = None,
        stop: Rule | str | None = None,
        progress: Progress = False,
    ) -> CampaignStatus:
        """Compute what a store lacks of this campaign.

        Parameters
        ----------
        store
            A folder, new or one of this campaign, on a disk that all workers see.
        executor
            A `concurrent.futures.Executor`, a function that makes one (such as `nav_jax.campaign.processes`, whose
            workers are replaced when they die), or what has ``get_executor()``, such as a Dask Client. Threads of this
            process unless given.
        chunks
            Numbers of those to be computed; all unless given. Machines without a common disk take some each, see
            `merge`.
        stop
            See `nav_jax.compare`: each scenario stops by itself, at whole chunks, and the number of runs is the
            largest. Chunks up to the next look of every scenario come first. A scenario of which a chunk of a look
            failed is computed to the end.
        progress
            Show a bar; or a function of what is done and the total, which may cancel by raising.

        Returns
        -------
        CampaignStatus
            With what failed: the others go on. Interrupted from the keyboard, with what was done by then.

        Raises
        ------
        ValueError
            The store is of another campaign: the message names the field that differs. It was begun by a version with
            other random numbers. Some of the chunks are wanted
            and a rule, which looks at all; a rule that compares filters, and one filter.
        FileExistsError
            There is something else at the path.
        OSError
            The store cannot be written, as where the disk is full; what is whole in it is kept.
        RuntimeError
            Workers died, and nobody has said how to make others. A Dask cluster ended, or had no worker for two
            minutes where it is of this machine, for a day where it is not, or for as long as Dask's configuration
            says (``distributed.scheduler.no-workers-timeout``).
        """
        rule = rule_of(stop, len(self.filters))
        if rule is not None and chunks is not None:
            raise ValueError("A rule looks at all chunks in their order: leave either stop or chunks out.")
        require_numbers(self._path or store, self._specification.text, NUMBERS)
        target = self._open_store(Path(store))
        if differing := differences(target.environment, environment()):
            warnings.warn(
                f"{store} was begun elsewhere ({differing}): new runs agree with those that are there to rounding, not "
                "to the last bit.",
                stacklevel=2,
            )
        wanted = None if chunks is None else {integer("A chunk", chunk, 0) for chunk in chunks}
        todo = [task for task in self._tasks() if wanted is None or task[1] in wanted]
        damaged: dict[str, tuple[int, ...]] = {}
        lacking = []
        for scenario, chunk in todo:
            if target.read(scenario, chunk) is None:
                lacking.append((scenario, chunk))
                if target.is_begun(scenario, chunk):
                    damaged[scenario] = (*damaged.get(scenario, ()), chunk)
        if damaged:
            warnings.warn(f"Chunks of {store} are damaged and computed again: {named(damaged)}.", stacklevel=2)
        bar = progress_bar(len(lacking), "chunk", progress)
        try:
            self._compute(target, self._rounds(target, lacking, rule), executor, bar)
        except KeyboardInterrupt:
            pass
        finally:
            bar.close()
        return self.status(stop=rule)

    def _rounds(self, store: Store, lacking: list[Task], rule: Rule | None) -> Iterator[list[Task]]:
        """Yield what is lacking, or with a rule what its next looks lack, until there is no more of it."""
        if rule is None:
            yield lacking
            return
        looks = {scenario: self._looks(store, scenario, rule) for scenario in self.scenarios}
        while True:
            going = {scenario for scenario, of in looks.items() if of.look() is None}
            lacking = [task for task in lacking if task[0] in going]
            first = [task for task in lacking if task[1] < looks[task[0]].next_chunks]
            # a look that lacks what was tried cannot be taken, nor can those after it
            blind = going - {scenario for scenario, _ in first}
            now = [task for task in lacking if task in first or task[0] in blind]
            if not now:
                return
            yield now
            lacking = [task for task in lacking if task not in now]

    def _compute(self, store: Store, rounds: Iterator[list[Task]], executor: Workers, bar: Bar) -> None:
        """Have the tasks of each round done, and note those that cannot be."""

        def take(task: Task, told: Told | Exception) -> None:
            if isinstance(told, Told) and told.unwritable:
                raise OSError(told.problem)
            # an exception is that of an engine, or of its worker, for a task that it has given up
            problem = told.problem if isinstance(told, Told) else why(told)
            if problem is not None:
                store.note_failure(*task, problem)
            bar.update(1)

        def died(happened: str, tasks: list[Task]) -> str:
            return (
                f"{happened} while it had one of the chunks {named(_by_scenario(tasks))}: what is whole in "
                f"{store.path} is kept. Run the campaign again; executor=nj.campaign.processes(n) replaces workers "
                "that die now and then."
            )

        given = str(store.path.absolute()), store.specification.digest, store.num_chunks
        carry_out(rounds, run_task, given, Pool(executor, threads), take, died=died)

    # -- what is there ----------------------------------------------------------------------------------------------

    def status(self, *, stop: Rule | str | None = None) -> CampaignStatus:
        """Read the store of this campaign, and say what is there, what is not and why.

        Parameters
        ----------
        stop
            The rule with which it is run, if with one: of a scenario that it stopped nothing more is missing.

        Raises
        ------
        ValueError
            The campaign has no store yet; a rule that compares filters, and one filter.
        """
        store, rule = self._store(), rule_of(stop, len(self.filters))
        ended = {} if rule is None else {name: self._looks(store, name, rule).look() for name in self.scenarios}
        stopped = {name: one for name, one in ended.items() if one is not None and one.early}
        size = self._definition.chunk_size
        missing: dict[str, tuple[int, ...]] = {name: () for name in self.scenarios}
        damaged, failed = dict(missing), {}
        for scenario, chunk in self._tasks():
            beyond = scenario in stopped and chunk * size >= stopped[scenario].looks[-1]
            if beyond or store.read(scenario, chunk) is not None:
                continue
            missing[scenario] += (chunk,)
            if store.is_begun(scenario, chunk):
                damaged[scenario] += (chunk,)
            if (why := store.failure(scenario, chunk)) is not None:
                failed[scenario, chunk] = why
        return CampaignStatus(str(store.path), self._num_chunks, size, missing, damaged, failed, stopped)

    def comparison(self, scenario: str | None = None, *, stop: Rule | str | None = None) -> Comparison:
        """Compare the filters in one scenario, with the runs that are there by now.

        Parameters
        ----------
        scenario
            Its name; may be left out where there is one.
        stop
            The rule with which it is run: the runs up to the look at which it ends them, whatever else is there. All
            runs where it has not ended them yet.

        Returns
        -------
        Comparison
            At every epoch if the campaign keeps ``runs``, else at the judged one alone.

        Raises
        ------
        ValueError
            There is no run yet, or no such scenario; a rule that compares filters, and one filter.
        """
        name, rule = self._named(scenario), rule_of(stop, len(self.filters))
        stopped = None if rule is None else self._looks(self._store(), name, rule).look()
        most = self._num_chunks if stopped is None else stopped.looks[-1] // self._definition.chunk_size
        bench, chunks = bench_of(self._specification, name), self._read(name, most, per_run=True)
        whole = self._definition.keep == "runs"
        rows = list(next(iter(chunks.values())))
        arrays = {row: np.concatenate([chunk[row] for chunk in chunks.values()]) for row in rows}
        notes = []
        if not whole:
            time = next(iter(bench.templates.values())).time[bench.epoch]
            notes.append(
                f"Of each run the epoch at {time:g} s was kept: the share of epochs in band is that of this one."
            )
        if lacking := most - len(chunks):
            runs = lacking * self._definition.chunk_size
            notes.append(
                f"{runs} of {self.num_runs} runs are missing: they are not computed yet, failed or are damaged."
            )
            if rule is not None:
                notes.append(f"{rule} has not ended these runs: it cannot look beyond those that are missing.")
        runs = {
            name: self._runs(template, {row: a[:, i] for row, a in arrays.items()}, bench.epoch, notes, most)
            for i, (name, template) in enumerate(bench.templates.items())
        }
        return Comparison(bench.setup.reference, runs, truth=repr(self._definition.truth), stopped=stopped)

    def _runs(
        self, template: Runs, arrays: Mapping[str, np.ndarray], epoch: int, notes: Sequence[str], num_chunks: int
    ) -> Runs:
        """The runs of one filter in so many chunks, of every epoch or of the judged one."""
        whole = self._definition.keep == "runs"
        get = (lambda name: arrays[f"all_{name}"]) if whole else (lambda name: arrays[name][:, None])
        nees = get("nees")
        fields: dict[str, Any] = {name: get(name) for name in ("error", "sd", "position_covariance")}
        if whole:
            fields |= {of: {s: arrays[f"{of}.{s}"] for s in template.nis} for of in ("nis", "innovation")}
        else:
            none: dict[str, Any] = {name: {} for name in ("nis", "nis_time", "nis_dof", "innovation")}
            fields |= none | {"time": template.time[epoch : epoch + 1]}
        return replace(
            template,
            status=arrays["status"],
            nees={group: nees[..., list(GROUPS).index(group)] for group in template.nees},
            notes=(*template.notes, *notes),
            num_requested=num_chunks * self._definition.chunk_size,
            **fields,
        )

    def statistics(self, scenario: str | None = None) -> dict[str, Statistics]:
        """Sum the chunks that are there, in their order, to the statistics of each filter at every epoch.

        Parameters
        ----------
        scenario
            Its name; may be left out where there is one.

        Raises
        ------
        ValueError
            The campaign keeps only the judged epoch, there is no good run, or no such scenario.
        """
        if self._definition.keep == "judged":
            raise ValueError('A campaign with keep="judged" has no statistics of other epochs: see its comparison.')
        name = self._named(scenario)
        bench, chunks = bench_of(self._specification, name), self._read(name, self._num_chunks, per_run=False)
        totals: dict[str, np.ndarray] = {}
        for arrays in chunks.values():
            totals = {row: (totals[row] + a[0] if totals else a[0]) for row, a in arrays.items()}
        return {
            model: _statistics(template, {row: total[i] for row, total in totals.items()})
            for i, (model, template) in enumerate(bench.templates.items())
        }

    def _read(self, scenario: str, num_chunks: int, *, per_run: bool) -> dict[int, dict[str, np.ndarray]]:
        """Of the first chunks those that are there by number, in order: what has a row for each run, or the sums."""
        store, rows = self._store(), bench_of(self._specification, scenario).rows
        wanted = [row.name for row in rows if row.per_run is per_run]
        found = {}
        for chunk in range(num_chunks):
            arrays = store.read(scenario, chunk)
            if arrays is not None:
                found[chunk] = {name: arrays[name] for name in wanted}
        if not found:
            raise ValueError(f"There is no run of {scenario} in {store.path} yet: see status().")
        return found

    # -- helpers ----------------------------------------------------------------------------------------------------

    def _tasks(self) -> list[Task]:
        """All of them; every scenario gets on."""
        return [(scenario, chunk) for chunk in range(self._num_chunks) for scenario in self.scenarios]

    def _looks(self, store: Store, scenario: str, rule: Rule) -> Looks:
        return Looks(store, bench_of(self._specification, scenario), scenario, rule)

    def _named(self, scenario: str | None) -> str:
        if scenario is None and len(self.scenarios) == 1:
            return self.scenarios[0]
        if scenario not in self.scenarios:
            said = "Name one of the scenarios" if scenario is None else f"{scenario!r} is none of the scenarios"
            raise ValueError(f"{said}: {', '.join(self.scenarios)}.")
        return str(scenario)

    def _open_store(self, path: Path) -> Store:
        """Make the folder of a store, or look at the one that is there; the campaign is that of this folder then."""
        if path.exists():
            with contextlib.suppress(ValueError):  # `restore` says it, or mends it
                self._num_chunks = max(self._num_chunks, read_root(path).num_chunks)
        self._path = path
        store = self._store()
        if damaged := store.restore():
            warnings.warn(f"Files of {path} were damaged and are restored: {', '.join(damaged)}.", stacklevel=3)
        return store

    def _store(self) -> Store:
        if self._path is None:
            raise ValueError("This campaign has no store yet: run it, or take Campaign.open(store).")
        layouts = {name: bench_of(self._specification, name).layout for name in self.scenarios}
        return Store(self._path, self._specification, layouts, self._num_chunks)


def _statistics(template: Runs, totals: Mapping[str, Any]) -> Statistics:
    """Of one filter, from sums over all its good runs."""
    num = int(totals["num_good"])
    if not num:
        raise ValueError(f"{template.name} has no good run.")
    blocks = [block.name for block in NAVIGATION.blocks]
    groups = {group: i for i, group in enumerate(GROUPS) if group in template.nees}
    return Statistics(
        name=template.name,
        num_good=num,
        time=template.time,
        mean_error=totals["sum_error"] / num,
        rms_error=np.sqrt(totals["sum_squared_error"] / num),
        rms_sd=np.sqrt(totals["sum_variance"] / num),
        mean_length={block: totals["sum_length"][:, i] / num for i, block in enumerate(blocks)},
        mean_nees={group: totals["sum_nees"][:, i] / num for group, i in groups.items()},
        dof={group: template.dof[group] for group in groups},
        coverage={group: totals["covered"][:, i] / num for group, i in groups.items()},
        mean_nis={sensor: totals[f"sum_nis.{sensor}"] / num for sensor in template.nis},
        nis_time=template.nis_time,
        histogram=totals["histogram"],
        outages=template.outages,
    )


def _keep(store: Store, scenario: str, chunk: int, arrays: Mapping[str, np.ndarray]) -> None:
    """Write a chunk, and look at what was written."""
    store.write(scenario, chunk, arrays)
    store.read(scenario, chunk)


def _by_scenario(tasks: Iterable[Task]) -> dict[str, tuple[int, ...]]:
    found: dict[str, tuple[int, ...]] = {}
    for scenario, chunk in tasks:
        found[scenario] = (*found.get(scenario, ()), chunk)
    return found


def _bytes_below(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
