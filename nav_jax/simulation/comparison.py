"""Several filter models on the same runs: ranked, drawn, and written to disk."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from gmwm_jax._internal.cached import cached_property
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.saved import AsDataset
from gmwm_jax._internal.states import State, from_state, saved, to_state
from nav_jax.simulation._dataset import join_models, runs_to_dataset
from nav_jax.simulation.ranking import Ranking, common_runs, rank
from nav_jax.simulation.runs import Runs
from nav_jax.simulation.stopping import Stopped
from nav_jax.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    import xarray

COMPARISON_KIND = "nav_jax comparison"

_REFERENCE = {"position": ("axis", "m"), "velocity": ("axis", "m/s"), "quaternion": ("quaternion", "1")}


@saved(added=("stopped",))
@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Drawable, AsDataset):
    """Several filters on common random numbers: run i of each has the same truth and the same noise.

    Attributes
    ----------
    reference
        The trajectory that all runs follow.
    runs
        By name of the model. Epochs and fixes are the same; an interrupted model may have fewer runs.
    truth
        What the sensors' errors were drawn from, in words.
    stopped
        By which rule the runs ended, if by one.

    Raises
    ------
    ValueError
        No model, or models with different epochs or fixes.
    """

    dataset_kind: ClassVar[str] = COMPARISON_KIND

    reference: Trajectory
    runs: Mapping[str, Runs]
    truth: str = ""
    stopped: Stopped | None = None

    def __post_init__(self) -> None:
        if not self.runs:
            raise ValueError("A comparison takes one model or more, and has none.")
        named = {name: r if r.name == name else replace(r, name=name) for name, r in self.runs.items()}
        object.__setattr__(self, "runs", named)
        first, *others = named.values()
        for other in others:
            if not np.array_equal(first.time, other.time):
                raise ValueError(f"{first.name} and {other.name} have different epochs: run them along one time.")
            for sensor in first.nis_time.keys() & other.nis_time.keys():
                if not np.array_equal(first.nis_time[sensor], other.nis_time[sensor]):
                    raise ValueError(f"{first.name} and {other.name} have different fixes of {sensor}.")

    def __getitem__(self, model: str) -> Runs:
        if model not in self.runs:
            raise KeyError(f"No model {model!r}; there are {', '.join(self.runs)}.")
        return self.runs[model]

    def __iter__(self) -> Iterator[str]:
        return iter(self.runs)

    def __len__(self) -> int:
        return len(self.runs)

    @cached_property
    def num_common(self) -> int:
        """Runs in which no model failed; a model that has fewer than two good runs does not count."""
        return len(common_runs(self.runs))

    def epoch(self, at: float | None = None) -> int:
        """Number of the epoch at which models are judged, see `Runs.epoch`."""
        return next(iter(self.runs.values())).epoch(at)

    def table(self, at: float | None = None, level: float = 0.95) -> Ranking:
        """The models from the best mean position error on, with what may be said of the differences.

        Parameters
        ----------
        at
            Time in s; the end of the last outage by default, or of the runs if there is none.
        level
            Of bands, intervals and coverage.

        Raises
        ------
        ValueError
            Fewer than two common runs, or a time outside the runs.
        """
        return rank(self.runs, self.epoch(at), level, self.stopped)

    def plot(
        self, *, at: float | None = None, level: float = 0.95, log: bool = True, axes: GivenAxes | None = None
    ) -> Figure:
        """Draw all models at a glance: mean errors, consistency, and which differences are real.

        Parameters
        ----------
        at
            Time in s at which they are judged, see `table`.
        level
            Of all bands and intervals.
        log
            Logarithmic errors, by which a filter with and without GNSS fits into one frame; else linear ones.
        axes
            Six Axes to draw into; a new figure if left out.

        Returns
        -------
        Figure
            See `nav_jax.plotting.plot_comparison`.
        """
        return self._draw(at=at, level=level, log=log, axes=axes)

    def __repr__(self) -> str:
        names = ", ".join(self.runs)
        lines = [f"Comparison of {names} along {self.reference.name or 'a trajectory'}"]
        if self.truth:
            lines.append(f"truth: {self.truth}")
        counts = {name: r.counts() for name, r in self.runs.items()}
        if len(set(counts.values())) == 1:
            lines.append(f"each model: {next(iter(counts.values()))}")
        else:
            lines += [f"{name}: {count}" for name, count in counts.items()]
        if outages := sorted({i for r in self.runs.values() for i in r.outage_intervals}):
            lines.append(f"outages: {', '.join(f'{a:g} .. {b:g} s' for a, b in outages)}")
        notes: dict[str, list[str]] = {}
        for name, r in self.runs.items():
            for note in r.notes:
                notes.setdefault(note, []).append(name)
        few = "No ranking: it takes 2 or more runs in which no model failed."
        lines += ["", repr(self.table()) if self.num_common >= 2 else few]
        lines += [f"note on {', '.join(of)}: {note}" for note, of in notes.items()]
        return "\n".join(lines)

    # -- as others want it ------------------------------------------------------------------------------------------

    def to_xarray(self) -> "xarray.Dataset":
        """All of it as a Dataset (model, run, time, component) with the reference; `save` writes it.

        Runs and states that one model lacks are NaN there, and its `status` of such runs is -1.
        """
        joined = join_models([runs_to_dataset(r) for r in self.runs.values()])
        ref = self.reference
        joined = joined.assign_coords(reference_time=("reference_time", ref.time, {"units": "s"}))
        for name, (last, unit) in _REFERENCE.items():
            joined[f"reference_{name}"] = (("reference_time", last), getattr(ref, name), {"units": unit})
        origin = {} if ref.origin is None else {"origin": ref.origin.tolist()}
        ended = {} if self.stopped is None else {"stopped": json.dumps(to_state(self.stopped).tree)}
        return joined.assign_attrs(kind=COMPARISON_KIND, truth=self.truth, reference=ref.name, **origin, **ended)

    @classmethod
    def from_xarray(cls, dataset: "xarray.Dataset") -> "Comparison":
        """Build the comparison from the Dataset that `to_xarray` made."""
        try:
            names = [str(name) for name in dataset["model"].values]
            arrays = {name: dataset[f"reference_{name}"].values for name in ("time", *_REFERENCE)}
            reference = Trajectory(**arrays, name=dataset.attrs["reference"], origin=dataset.attrs.get("origin"))
            truth = dataset.attrs["truth"]
            ended = dataset.attrs.get("stopped")
            stopped = None if ended is None else from_state(State(json.loads(ended), {}))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"This Dataset is not one that Comparison.to_xarray made: {error}.") from error
        runs = {name: Runs.from_xarray(dataset.isel(model=i)) for i, name in enumerate(names)}
        return cls(reference, runs, truth, stopped)
