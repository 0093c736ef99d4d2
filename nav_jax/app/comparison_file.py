"""A comparison written as a TOML file: checked as a whole, section by section, before anything is computed.

Sections: ``[trajectory]``, ``[truth]``, ``[filters.NAME]``, ``[[aiding]]``, ``[initial]``, ``[run]``, ``[output]``, see
`nav_jax.app.sections`. Files that they name are looked for beside the configuration.
"""

import os
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, get_args

import jax
import numpy as np
from pydantic import BaseModel, ValidationError

from gmwm_jax._internal.progress import Progress
from nav_jax.app.sections import (
    AIDING,
    BELIEVED,
    MOTIONS,
    SOURCES,
    Aiding,
    InitialSection,
    OutputSection,
    RecordingErrors,
    RunSection,
    TrajectoryFile,
)
from nav_jax.campaign.campaign import Campaign
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.scenario import Scenario
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.recorded import RecordedErrors
from nav_jax.simulation.campaign import compare
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.levels import TWO_LEVEL, TwoLevel

T = TypeVar("T")
AidingT = TypeVar("AidingT", bound=Aiding)

TRUTH = "truth"
"""The text that makes a filter believe the truth."""

_SECTIONS = ("trajectory", "truth", "filters", "aiding", "initial", "run", "output")


@dataclass(frozen=True)
class Config:
    """A comparison, ready to run.

    Attributes
    ----------
    scenario, truth, filters
        Arguments of `nav_jax.compare`.
    run, output
        Sections of these names.
    """

    scenario: Scenario
    truth: ImuErrors | RecordedErrors
    filters: Mapping[str, ImuErrors]
    run: RunSection
    output: OutputSection

    def compare(
        self,
        *,
        num_runs: int | None = None,
        seed: int | None = None,
        only: Sequence[str] = (),
        stop: str | None = None,
        progress: Progress = False,
    ) -> Comparison:
        """Run it.

        Parameters
        ----------
        num_runs, seed, stop
            In place of those in the file.
        only
            Some of the filters; all by default.
        progress
            Show a bar.

        Raises
        ------
        ValueError
            The file wants two levels, see `two_level`.
        """
        if self.run.has_two_levels:
            raise ValueError("[run] gains is two-level, which gives means and no runs to compare: state another one.")
        found = self._run(num_runs, seed, only, stop, progress)
        assert isinstance(found, Comparison)
        return found

    def two_level(
        self,
        *,
        num_runs: int | None = None,
        seed: int | None = None,
        only: Sequence[str] = (),
        stop: str | None = None,
        progress: Progress = False,
    ) -> TwoLevel:
        """Run it as ``gains = "two-level"`` says, whatever the file says; see `compare`."""
        whole = replace(self, run=self.run.model_copy(update={"gains": TWO_LEVEL}))
        found = whole._run(num_runs, seed, only, stop, progress)
        assert isinstance(found, TwoLevel)
        return found

    def _run(
        self, num_runs: int | None, seed: int | None, only: Sequence[str], stop: str | None, progress: Progress
    ) -> Comparison | TwoLevel:
        run = self.run
        return compare(
            self.scenario,
            self.truth,
            {name: f for name, f in self.filters.items() if not only or name in only},
            num_runs=run.num_runs if num_runs is None else num_runs,
            key=jax.random.key(run.seed if seed is None else seed),
            stop=run.rule if stop is None else stop,
            progress=progress,
            **{k: getattr(run, k) for k in ("gains", "chunk_size", "workers")},
        )

    def campaign(self, *, num_runs: int | None = None, seed: int | None = None, keep: str = "statistics") -> Campaign:
        """Make a campaign of it, which runs into a store.

        Parameters
        ----------
        num_runs, seed
            In place of those in the file.
        keep
            See `nav_jax.Campaign`.
        """
        run = self.run
        if isinstance(self.truth, RecordedErrors):
            raise ValueError("[truth] is a recording, and a campaign takes a model: state one.")
        if run.has_two_levels:
            raise ValueError(
                "[run] gains is two-level, and a campaign has one level: run two, with reference and with estimate and "
                "fewer runs, and put their comparisons into nav_jax.simulation.TwoLevel."
            )
        return Campaign(
            self.scenario,
            self.truth,
            self.filters,
            key=jax.random.key(run.seed if seed is None else seed),
            num_runs=run.num_runs if num_runs is None else num_runs,
            keep=keep,
            gains=run.gains,
            **({} if run.chunk_size is None else {"chunk_size": run.chunk_size}),
        )


def read_config(path: str | os.PathLike[str]) -> Config:
    """Read a configuration and all that it names.

    Raises
    ------
    FileNotFoundError
        No such file, or one that it names.
    ValueError
        No TOML; a section, key, unit or value that is wrong, by its place in the file.
    """
    return from_toml(Path(path), config_of)


_FILES = ("file", "fit", "recording", "imu")
"""Keys that name a file to be read."""


def named_files(path: Path) -> tuple[list[Path], dict[str, str]]:
    """Return the files that a configuration names, and what it says of its output; nothing of what is no TOML.

    It is looked at before it is checked, so that an output is not written onto an input.
    """
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return [], {}  # said when it is read

    output = tables.get("output", {})
    texts = {k: v for k, v in output.items() if isinstance(v, str)} if isinstance(output, dict) else {}
    return [path.parent / name for name in names_of_files(tables)], texts


def names_of_files(tables: Mapping[str, Any] | list[Any]) -> Iterator[str]:
    """Run over what the keys say that name a file to be read."""
    for key, item in tables.items() if isinstance(tables, Mapping) else enumerate(tables):
        if isinstance(item, Mapping | list):
            yield from names_of_files(item)
        elif key in _FILES and isinstance(item, str):
            yield item


def config_of(tables: Mapping[str, Any], folder: Path) -> Config:
    """Make a comparison of the sections of a file.

    Parameters
    ----------
    tables
        Name of a section -> its keys, as TOML has them.
    folder
        Where files that they name are looked for.

    Raises
    ------
    ValueError
        A section, key, unit or value that is wrong, by its place in the file.

    Examples
    --------
    >>> from pathlib import Path
    >>> from nav_jax.app.comparison_file import config_of
    >>> truth = {"accel": "WN(sigma2=1e-4)", "gyro": "WN(sigma2=1e-8)", "rate": 20.0}
    >>> config_of({"trajectory": {"motion": "static", "duration": "5 s"}, "truth": truth}, Path()).scenario.every
    1
    """
    check_sections(tables, _SECTIONS, ("trajectory", "truth"))
    # all sections are checked before the first file is read
    run = checked(RunSection, tables.get("run", {}), "[run]")
    output = checked(OutputSection, tables.get("output", {}), "[output]")
    start = checked(InitialSection, tables.get("initial", {}), "[initial]")
    motion = _trajectory_section(tables["trajectory"])
    true = _errors_section(tables["truth"], "[truth]")
    believed = filter_sections(tables.get("filters", {TRUTH: TRUTH}))
    aiding = aiding_sections(tables.get("aiding", []), AIDING)

    with place("[truth]"):
        truth = true.build(folder)
    if isinstance(truth, RecordedErrors) and None in believed.values():
        raise ValueError("[filters]: the truth is a recording, of which no filter has a model: state one.")
    known: dict[str, Any] = {}
    for name, section in believed.items():
        with place(f"[filters.{name}]"):
            known[name] = truth if section is None else section.build(folder)
    with place("[trajectory]"):
        reference = motion.build(folder, truth.rate, run.gravity)
    sensors = []
    for i, section in enumerate(aiding):
        with place(f"[[aiding]] {i + 1}"):
            sensors.append(section.build())
    with place("[initial]"):
        initial = InitialUncertainty(**start.given())
    with place("[run]"):
        if run.origin is not None:
            if run.earth == "flat":
                raise ValueError('origin is that of earth = "wgs84".')
            reference = replace(reference, origin=np.array(run.origin)) if reference.origin is None else reference
        origin = reference.origin if run.origin is None else np.array(run.origin)
        earth = run.build_earth(origin, "[run]")
    without: dict[str, Any] = {"neglected": tuple(run.neglected), "suspected": tuple(run.suspected)}
    without["temperature"] = run.temperature(reference.time)
    scenario = Scenario(reference, sensors, initial, earth, run.every, run.output_interval, **without)
    return Config(scenario, truth, known, run, output)


def _trajectory_section(table: Any) -> Any:
    where = "[trajectory]"
    _require_table(table, where)
    if ("file" in table) == ("motion" in table):
        raise ValueError(f'{where}: give either file = "..." or motion = "...", one of {", ".join(MOTIONS)}.')
    if "file" in table:
        return checked(TrajectoryFile, table, where)
    if table["motion"] not in list(MOTIONS):  # it may be a list or a table, which have no hash
        raise ValueError(f"{where}: motion is one of {', '.join(MOTIONS)}, and is {table['motion']!r}.")
    return checked(MOTIONS[table["motion"]], table, where)


def _errors_section(table: Any, where: str, sources: Mapping[str, type[Any]] = SOURCES) -> Any:
    _require_table(table, where)
    kinds = [key for key in sources if key in table or (key == "accel" and "gyro" in table)]
    if len(kinds) != 1:
        raise ValueError(
            f"{where}: the errors are given by accel and gyro, or by sensor, by fit, by device or by recording, one "
            f"of them; there are {', '.join(table) or 'no keys'}."
        )
    return checked(sources[kinds[0]], table, where)


def _filter_section(table: Any, where: str) -> Any:
    """None for a filter that believes the truth."""
    if isinstance(table, str):
        if table != TRUTH:
            raise ValueError(f'{where} is a section, or the text "{TRUTH}", and is {table!r}.')
        return None
    section = _errors_section(table, where, BELIEVED)
    if isinstance(section, RecordingErrors):
        raise ValueError(f"{where}: a filter believes a model, and a recording is none.")
    return section


# -- shared with config_record.py -------------------------------------------------------------------------------------


def from_toml(path: Path, build: Callable[[Mapping[str, Any], Path], T]) -> T:
    """What `build` makes of the sections of a file and its folder; errors begin with the name of the file."""
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is no TOML file: {error}.") from error
    except RecursionError as error:
        raise ValueError(f"{path} is no TOML file that is read: it is nested too deeply.") from error
    try:
        return build(tables, path.parent)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def check_sections(tables: Mapping[str, Any], known: Sequence[str], needed: Sequence[str]) -> None:
    """Raise on a section that nobody knows, or one that is missing."""
    if unknown := [name for name in tables if name not in known]:
        raise ValueError(f"there is no section [{unknown[0]}]; the sections are {', '.join(known)}.")
    for name in needed:
        if name not in tables:
            raise ValueError(f"the section [{name}] is missing.")


def filter_sections(tables: Any) -> dict[str, Any]:
    """Name -> section; None for a filter that believes the truth."""
    if not isinstance(tables, Mapping) or not tables:
        raise ValueError("[filters] has a section for each filter, such as [filters.right].")
    return {name: _filter_section(table, f"[filters.{name}]") for name, table in tables.items()}


def aiding_sections(listed: Any, kinds: Mapping[str, type[AidingT]]) -> list[AidingT]:
    """The sections of a list, each by its type."""
    if not isinstance(listed, list):
        raise ValueError("[[aiding]] is a list of sensors: write its name in double brackets.")
    sections = []
    for i, table in enumerate(listed):
        where = f"[[aiding]] {i + 1}"
        _require_table(table, where)
        if table.get("type") not in list(kinds):
            raise ValueError(f"{where}: type is one of {', '.join(kinds)}, and is {table.get('type')!r}.")
        sections.append(checked(kinds[table["type"]], table, where))
    return sections


def _require_table(table: Any, where: str) -> None:
    if not isinstance(table, Mapping):
        raise ValueError(f"{where} is a section with keys, and is {table!r}.")


def checked(section: type[Any], table: Any, where: str) -> Any:
    """The section that a table makes; errors are sentences that begin with where it stands."""
    _require_table(table, where)
    try:
        return section.model_validate(table)
    except ValidationError as error:
        raise ValueError(" ".join(_sentence(section, e, where) for e in error.errors())) from error


def _sentence(section: type[BaseModel], error: Any, where: str) -> str:
    key = ".".join(str(part) for part in error["loc"])
    if error["type"] == "extra_forbidden":
        keys = _section_of(section, error["loc"][:-1]).model_fields
        return f"{where}: there is no key {key!r}; the keys are {', '.join(keys)}."
    if error["type"] == "missing":
        return f"{where}: the key {key!r} is missing."
    if error["type"] == "value_error":
        return f"{where}, {key}: {str(error['ctx']['error']).rstrip('.')}."
    return f"{where}, {key}: {error['msg']}, and it is {error['input']!r}."


def _section_of(section: type[BaseModel], path: Sequence[Any]) -> type[BaseModel]:
    """The section inside this one to which a path leads; the last on the way, if it leads to no section."""
    for key in path:
        field = section.model_fields.get(key)
        inner = [] if field is None else [field.annotation, *get_args(field.annotation)]
        section = next((a for a in inner if isinstance(a, type) and issubclass(a, BaseModel)), section)
    return section


@contextmanager
def place(where: str) -> Iterator[None]:
    """Say where in the file an error comes from."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error
