"""Monte Carlo runs of one filter model: errors, what the filter said of them, innovations, and what became of each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from jaxtyping import Bool, Float64, Integer

from gmwm_jax._internal.cached import cached_property
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.saved import AsDataset
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.stores import import_xarray
from gmwm_jax._internal.text_table import format_table, number
from nav_jax.filter.history import ESTIMATES, Estimates
from nav_jax.filter.layout import JUDGED, NAVIGATION
from nav_jax.filter.status import Status
from nav_jax.simulation._dataset import RUNS_KIND, dataset_to_fields, runs_to_dataset
from nav_jax.statistics.epochs import judged_epoch, outage_intervals

if TYPE_CHECKING:
    import pandas
    import xarray


@saved(not_finite=ESTIMATES)
@dataclass(frozen=True, eq=False)
class Track(Estimates):
    """One whole run at every epoch of the IMU: NED in m and m/s, quaternion from body to NED.

    The epochs are the start and the ends of all covariance steps.
    """

    before: Estimates


@saved(not_finite=("error", "sd", "position_covariance", "nees", "nis", "innovation"))
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Runs(Drawable, AsDataset):
    """The runs of one filter along one reference: R runs, E epochs.

    Attributes
    ----------
    name
        Of the model.
    time
        Epochs in s.
    error
        Estimate - truth, columns `nav_jax.filter.layout.JUDGED` in SI. The last six are errors of the estimated sensor
        errors: the sum of the states of that axis minus the true error without its white part.
    sd
        Standard deviations that the filter states for them; 0 where it has no state on that axis.
    position_covariance
        Of the position error, in m^2.
    nees
        Group of states -> error' P^-1 error. NaN where P is singular (no initial
        uncertainty): an epoch with a NaN in any run that is ok is left out, see `known_epochs`.
    dof
        Group -> number of its states, the expectation of its NEES.
    status
        Of each run, see `Status`. Rows of runs that are not ok are NaN.
    nis
        Sensor -> innovation' S^-1 innovation at each of its fixes.
    nis_time
        Sensor -> times of the fixes.
    nis_dof
        Sensor -> size of the innovation.
    innovation
        Sensor -> innovations.
    outages
        Sensor -> (start, end) of each, in s.
    notes
        Sentences that a reader of the numbers must know.
    tracks
        Number of a run -> its whole trajectory; all have one time.
    num_requested
        Runs that were asked for, more than there are if interrupted; 0 for as many as there are.

    Raises
    ------
    ValueError
        Shapes that do not match, times that do not increase, NaN in a run that is ok, or negative sd.
    """

    dataset_kind: ClassVar[str] = RUNS_KIND

    name: str
    time: Float64[np.ndarray, " E"]
    error: Float64[np.ndarray, "R E col"]
    sd: Float64[np.ndarray, "R E col"]
    position_covariance: Float64[np.ndarray, "R E 3 3"]
    nees: Mapping[str, Float64[np.ndarray, "R E"]]
    dof: Mapping[str, int]
    status: Integer[np.ndarray, " R"]
    nis: Mapping[str, Float64[np.ndarray, "R _"]] = field(default_factory=dict)
    nis_time: Mapping[str, Float64[np.ndarray, " _"]] = field(default_factory=dict)
    nis_dof: Mapping[str, int] = field(default_factory=dict)
    innovation: Mapping[str, Float64[np.ndarray, "R _ _"]] = field(default_factory=dict)
    outages: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    tracks: Mapping[int, Track] = field(default_factory=dict)
    num_requested: int = 0

    def __post_init__(self) -> None:
        _check(self)
        if not self.num_requested:
            object.__setattr__(self, "num_requested", len(self))

    # -- which runs, which epochs -----------------------------------------------------------------------------------

    def __len__(self) -> int:
        return self.error.shape[0]

    @cached_property
    def good(self) -> Bool[np.ndarray, " R"]:
        """Runs that are ok: the only ones in any statistic."""
        return self.status == Status.ok

    @property
    def num_good(self) -> int:
        """Number of runs that are ok."""
        return int(np.count_nonzero(self.good))

    @property
    def num_failed(self) -> int:
        """Number of runs that failed; they are left out of every statistic."""
        return len(self) - self.num_good

    @property
    def interrupted(self) -> bool:
        """Whether there are fewer runs than were asked for."""
        return len(self) < self.num_requested

    def select(
        self, values: Float64[np.ndarray, "R ..."], runs: Integer[np.ndarray, " _"] | None = None
    ) -> Float64[np.ndarray, "_ ..."]:
        """Rows of the good runs, or of the runs of these numbers in rising order; no copy where they are all."""
        chosen = np.flatnonzero(self.good) if runs is None else runs
        return values if len(chosen) == len(values) else values[chosen]

    def errors(self, block: str, runs: Integer[np.ndarray, " _"] | None = None) -> Float64[np.ndarray, "_ E 3"]:
        """Errors in one of the blocks, by default of the good runs, see `select`."""
        return self.select(self.error[:, :, JUDGED[block]], runs)

    def sds(self, block: str, runs: Integer[np.ndarray, " _"] | None = None) -> Float64[np.ndarray, "_ E 3"]:
        """Standard deviations that belong to `errors`."""
        return self.select(self.sd[:, :, JUDGED[block]], runs)

    def known_epochs(self, group: str) -> Bool[np.ndarray, " E"]:
        """Epochs at which the group has a NEES in all good runs: not those at which a covariance is singular."""
        return np.isfinite(np.sum(self.select(self.nees[group]), axis=0))

    @property
    def outage_intervals(self) -> tuple[tuple[float, float], ...]:
        """Of all sensors, each interval once, by start."""
        return outage_intervals(self.outages)

    def epoch(self, at: float | None = None) -> int:
        """Number of the epoch at which models are judged.

        Parameters
        ----------
        at
            Time in s, the nearest epoch is taken. By default the end of the outage that ends last, where errors are
            largest: the last epoch that is not after it and has no new fix yet; without outage the last epoch.
        """
        return judged_epoch(self.time, self.outages, self.nis_time, at)

    # -- as others want it ------------------------------------------------------------------------------------------

    def to_xarray(self) -> "xarray.Dataset":
        """All of it as a Dataset (run, time, component), with units; the big arrays are not copied."""
        return runs_to_dataset(self)

    @classmethod
    def from_xarray(cls, dataset: "xarray.Dataset") -> "Runs":
        """Build the runs from the Dataset that `to_xarray` made."""
        fields = dataset_to_fields(dataset)
        tracks = {
            i: Track(**arrays, before=Estimates(**before)) for i, (arrays, before) in fields.pop("tracks").items()
        }
        return cls(**fields, tracks=tracks)

    def to_pandas(self) -> "pandas.DataFrame":
        """Errors and standard deviations, one row a run and epoch, columns (error or sd, component)."""
        import_xarray("pandas")
        both = self.to_xarray()[["error", "sd"]].drop_vars(["model", "unit"])
        return both.to_dataframe().unstack("component")[["error", "sd"]]  # type: ignore[return-value]

    # -- for a reader -----------------------------------------------------------------------------------------------

    def counts(self) -> str:
        """How many runs there are, failed, and were asked for, as text."""
        text = f"{len(self)} run{'s' * (len(self) != 1)}"
        if self.interrupted:
            text += f" of {self.num_requested} (interrupted)"
        for status in sorted(set(self.status[~self.good].tolist())):
            known = Status(status).sentence if status in list(Status) else f"status {status}"
            text += f", {np.count_nonzero(self.status == status)} failed ({known})"
        return text

    def plot(
        self,
        *,
        blocks: Sequence[str] = ("position",),
        max_runs: int = 50,
        sigmas: float = 3.0,
        axes: GivenAxes | None = None,
    ) -> Figure:
        """Draw errors of the runs with the bounds of the filter.

        Parameters
        ----------
        blocks
            A column each: ``position``, ``velocity``, ``attitude``.
        max_runs
            At most so many runs are drawn; the bounds are of all.
        sigmas
            Bounds are that many standard deviations away.
        axes
            Three Axes a block to draw into, of shape (3, blocks); a new figure if left out.

        Returns
        -------
        Figure
            See `nav_jax.plotting.plot_errors`.
        """
        return self._draw(blocks=blocks, max_runs=max_runs, sigmas=sigmas, axes=axes)

    def __repr__(self) -> str:
        """RMS errors beside what the filter says of them, at the judged epoch."""
        if not self.num_good:
            return f"{self.name}: {self.counts()}"
        k = self.epoch()
        head = ["", "unit", "rms error", "rms sd", "NEES / dof"]
        rows = []
        for block, unit in ((b.name, b.unit) for b in JUDGED.blocks):
            e, s = self.errors(block)[:, k], self.sds(block)[:, k]
            if block not in NAVIGATION and not np.any(s):
                continue
            nees = self.select(self.nees[block])[:, k].mean() / self.dof[block] if block in self.nees else np.nan
            rows.append([block, unit, number(_rms(e), 4), number(_rms(s), 4), number(float(nees), 3)])
        notes = "".join(f"\nnote: {n}" for n in self.notes)
        return f"{self.name}: {self.counts()}; at {self.time[k]:g} s\n{format_table(head, rows, left=2)}{notes}"


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(x**2, axis=-1))))


def _check(runs: Runs) -> None:
    """Raise unless shapes match, times increase, and runs that are ok are finite."""
    for name, of, sizes in (("NEES", runs.nees, runs.dof), ("NIS", runs.nis, runs.nis_dof)):
        if set(of) != set(sizes):
            raise ValueError(f"{runs.name}: {name} of {sorted(of)}, and degrees of freedom of {sorted(sizes)}.")
    if set(runs.nis) != set(runs.nis_time) or not set(runs.innovation) <= set(runs.nis):
        raise ValueError(f"{runs.name}: times of {sorted(runs.nis_time)}, and NIS of {sorted(runs.nis)}.")
    if bad_names := [sensor for sensor in runs.nis if "/" in sensor]:
        raise ValueError(f"{runs.name}: a name with a slash, {bad_names[0]!r}, cannot be that of a sensor on disk.")
    every = runs.error.shape[:2]
    checked = {
        "error": (runs.error, (*every, JUDGED.size)),
        "sd": (runs.sd, (*every, JUDGED.size)),
        "position_covariance": (runs.position_covariance, (*every, 3, 3)),
    }
    for s, nis in runs.nis.items():
        checked[f"NIS of {s}"] = nis, (every[0], len(runs.nis_time[s]))
    for s, innovation in runs.innovation.items():
        checked[f"innovation of {s}"] = innovation, (every[0], len(runs.nis_time[s]), runs.nis_dof[s])
    # where a covariance is singular, there is no NEES
    may_be_nan = {f"NEES of {group}": (nees, every) for group, nees in runs.nees.items()}
    others = {"time": (runs.time, every[1:]), "status": (runs.status, every[:1])}
    for name, (array, shape) in (others | checked | may_be_nan).items():
        if array.shape != shape:
            raise ValueError(f"{runs.name}: {name} has the shape {array.shape}, and {shape} is wanted.")
    if not every[1] or not np.all(np.isfinite(runs.time)) or np.any(np.diff(runs.time) <= 0):
        raise ValueError(f"{runs.name}: the times of its {every[1]} epochs do not increase from each to the next.")
    for name, (array, _) in checked.items():
        sums = np.sum(array, axis=tuple(range(1, array.ndim)))  # finite only if every term is; no temporary
        if np.any(bad := ~np.isfinite(sums) & runs.good):
            raise ValueError(f"{runs.name}: {name} has NaN or inf in run {np.argmax(bad)}, whose status is ok.")
    if np.min(runs.select(runs.sd), initial=0.0) < 0:
        raise ValueError(f"{runs.name}: there are negative standard deviations.")
    tracks = list(runs.tracks.values())
    if any(not np.array_equal(tracks[0].time, track.time) for track in tracks):
        raise ValueError(f"{runs.name}: the tracks have different times.")
