"""Covariance analysis of filters: what a Monte Carlo estimates, exact to first order and at once."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import jax
import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.cached import cached_property
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.labelled import Arrays, Labelled, Values
from gmwm_jax._internal.memory import FLOAT, require_memory
from gmwm_jax._internal.progress import Progress, progress_bar
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from nav_jax.filter.experiment import Setup, check_rates, named_filters
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.joint_covariance import Lincov, linear_covariance, motion_of
from nav_jax.filter.layout import GROUPS, JUDGED, NAVIGATION, ON_CHANNELS, channel_columns
from nav_jax.filter.scenario import Scenario
from nav_jax.imu.channels import CHANNELS, NAMES
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.output import warn_of_range
from nav_jax.imu.recorded import RecordedErrors
from nav_jax.statistics.distributions import chi2_quantile, weighted_chi2_cdf
from nav_jax.statistics.epochs import Judged

_SINGULAR = 1e-13
"""Smallest eigenvalue of a matrix of correlations that is more than rounding."""


@saved(not_finite=("true", "claimed", "innovation", "innovation_claimed"))
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Covariances(Judged, Drawable, Saved):
    """True and claimed covariance of one filter along a reference.

    Attributes
    ----------
    name
        Of the filter.
    time
        Epochs in s, shape (E,).
    true, claimed
        Second moments of the errors, and what the filter says of them: position (m), velocity (m/s), attitude (rad) and
        the errors of the estimated sensor errors (m/s^2, rad/s), rows and columns as of `nav_jax.filter.layout.JUDGED`.
        The blocks between navigation and sensors are not kept and NaN.
    channels
        Columns of the sensors on which the filter has a state.
    fixes
        Sensor -> times of its fixes.
    innovation, innovation_claimed
        Sensor -> variance of its innovations, each component given those before it, and what the filter says of it.
    outages
        Sensor -> (start, end) of each, in s.
    notes
        Sentences that a reader of the numbers must know.
    """

    name: str
    time: Float64[np.ndarray, " E"]
    true: Float64[np.ndarray, "E col col"]
    claimed: Float64[np.ndarray, "E col col"]
    channels: tuple[int, ...]
    fixes: Mapping[str, Float64[np.ndarray, " _"]] = field(default_factory=dict)
    innovation: Mapping[str, Float64[np.ndarray, "_ _"]] = field(default_factory=dict)
    innovation_claimed: Mapping[str, Float64[np.ndarray, "_ _"]] = field(default_factory=dict)
    outages: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @cached_property
    def sd(self) -> Float64[np.ndarray, "E col"]:
        """Root of the true mean square of each component."""
        return np.sqrt(np.diagonal(self.true, axis1=1, axis2=2))

    @cached_property
    def sd_claimed(self) -> Float64[np.ndarray, "E col"]:
        """Standard deviations that the filter states."""
        return np.sqrt(np.diagonal(self.claimed, axis1=1, axis2=2))

    def rms(self, block: str) -> Float64[np.ndarray, " E"]:
        """True RMS of the norm of a block: position, velocity, attitude, accel, gyro."""
        return np.linalg.norm(self.sd[:, JUDGED[block]], axis=1)

    def rms_claimed(self, block: str) -> Float64[np.ndarray, " E"]:
        """What the filter says of it."""
        return np.linalg.norm(self.sd_claimed[:, JUDGED[block]], axis=1)

    def dof(self, group: str) -> int:
        """Number of states of a group: the expectation of its NEES where the filter is consistent."""
        return len(self._columns(group))

    def nees(self, group: str) -> Float64[np.ndarray, " E"]:
        """Expected NEES, tr(P^-1 P_true); NaN where P is singular."""
        return self._weights(group).sum(axis=1)

    def coverage(self, group: str, level: float = 0.95) -> Float64[np.ndarray, " E"]:
        """Probability that the error lies in the region that the filter gives for `level`; NaN where P is singular.

        The NEES of a Gaussian error is a weighted sum of chi-square variables.
        """
        weights = self._weights(group)
        known = np.isfinite(weights).all(axis=1)
        out = np.full(len(self.time), np.nan)
        if known.any():
            out[known] = weighted_chi2_cdf(weights[known], float(chi2_quantile(level, weights.shape[1])))
        return out

    def nis_ratio(self, sensor: str) -> Float64[np.ndarray, " F"]:
        """Expected NIS of a sensor over its number of components."""
        return (self.innovation[sensor] / self.innovation_claimed[sensor]).mean(axis=1)

    def _columns(self, group: str) -> list[int]:
        if group not in GROUPS:
            raise ValueError(f"{group!r} is none of the groups {', '.join(GROUPS)}.")
        without_state = {*channel_columns(range(len(CHANNELS)))} - {*channel_columns(self.channels)}
        return [c for c in JUDGED.columns(*GROUPS[group]) if c not in without_state]

    def _weights(self, group: str) -> Float64[np.ndarray, "E k"]:
        """Eigenvalues of P^-1 P_true."""
        at = np.ix_(range(len(self.time)), self._columns(group), self._columns(group))
        P, S = self.claimed[at], self.true[at]
        sd = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
        out = np.full(sd.shape, np.nan)
        if not sd.shape[1]:
            return out
        known = np.asarray((sd > 0).all(axis=1))
        scale = sd[known][:, :, None] * sd[known][:, None, :]
        roots, vectors = np.linalg.eigh(P[known] / scale)
        regular = roots[:, 0] > _SINGULAR
        known[known] = regular
        white = vectors[regular] / np.sqrt(roots[regular])[:, None, :]
        S = np.swapaxes(white, 1, 2) @ (S[known] / scale[regular]) @ white
        out[known] = np.maximum(np.linalg.eigvalsh(S), 0.0)
        return out

    def plot(self, *, group: str = "pose", level: float = 0.95, axes: GivenAxes | None = None) -> Figure:
        """Draw true against claimed errors, and how consistent that makes the filter.

        Parameters
        ----------
        group
            Of states whose NEES and coverage are drawn, see `nav_jax.filter.layout.GROUPS`.
        level
            Of the region whose coverage is drawn.
        axes
            Four Axes to draw into; a new figure if left out.

        Returns
        -------
        Figure
            See `nav_jax.plotting.plot_analysis`.
        """
        return self._draw(group=group, level=level, axes=axes)

    def __repr__(self) -> str:
        """True RMS errors beside what the filter says of them, at the judged epoch."""
        k = self.epoch()
        rows = []
        for block, unit in ((b.name, b.unit) for b in JUDGED.blocks):
            true, said = self.rms(block)[k], self.rms_claimed(block)[k]
            if block not in NAVIGATION and not said:
                continue
            nees = self.nees(block)[k] / self.dof(block) if block in GROUPS else np.nan
            rows.append([block, unit, number(true, 4), number(said, 4), number(float(nees), 3)])
        notes = "".join(f"\nnote: {n}" for n in self.notes)
        head = ["", "unit", "true rms", "claimed rms", "NEES / dof"]
        return f"{self.name}: linear covariances at {self.time[k]:g} s\n{format_table(head, rows, left=2)}{notes}"


def _check(analysis: "Analysis") -> None:
    """Raise a ValueError for an analysis of nothing, in a file."""
    if not analysis.filters:
        raise ValueError("There is no filter in it.")


@saved(check=_check)
@dataclass(frozen=True, eq=False, repr=False)
class Analysis(Mapping[str, Covariances], Drawable, Saved, Labelled):
    """The result of `analyse`: several filters along one reference, by their names."""

    filters: Mapping[str, Covariances]
    reference: str
    truth: str

    def __getitem__(self, name: str) -> Covariances:
        if name not in self.filters:
            raise KeyError(f"No filter {name!r}; there are {', '.join(self.filters)}.")
        return self.filters[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.filters)

    def __len__(self) -> int:
        return len(self.filters)

    def _arrays(self) -> Arrays:
        """Covariances, and a row a filter, epoch and block with the RMS of its norm."""
        first, each = next(iter(self.filters.values())), self.filters.values()
        rows, matrix = ("filter", "time", "block"), ("filter", "time", "component", "component_2")
        by_block, by_component = (f"of each {x}: see the coordinate {x}_unit" for x in ("block", "component"))
        blocks = [b.name for b in JUDGED.blocks]
        variables = {
            "rms": Values(rows, [np.stack([c.rms(b) for b in blocks], 1) for c in each], by_block),
            "rms_claimed": Values(rows, [np.stack([c.rms_claimed(b) for b in blocks], 1) for c in each], by_block),
            "true": Values(matrix, [c.true for c in each], f"product of two components; {by_component}"),
            "claimed": Values(matrix, [c.claimed for c in each], f"product of two components; {by_component}"),
        }
        coordinates = {
            "filter": Values("filter", list(self)),
            "time": Values("time", first.time, "s"),
            "block": Values("block", blocks),
            "block_unit": Values("block", [b.unit for b in JUDGED.blocks]),
            "component": Values("component", JUDGED.components),
            "component_2": Values("component_2", JUDGED.components),
            "component_unit": Values("component", JUDGED.units),
        }
        attributes = {"reference": self.reference, "truth": self.truth, "frames": "n: NED; b: forward, right, down; SI"}
        return Arrays(variables, coordinates, attributes, rows)

    def plot(self, *, group: str = "pose", level: float = 0.95, axes: GivenAxes | None = None) -> Figure:
        """Draw true against claimed errors of the filters, and how consistent that makes them.

        Parameters
        ----------
        group
            Of states whose NEES and coverage are drawn, see `nav_jax.filter.layout.GROUPS`.
        level
            Of the region whose coverage is drawn.
        axes
            Four Axes to draw into; a new figure if left out.

        Returns
        -------
        Figure
            See `nav_jax.plotting.plot_analysis`.
        """
        return self._draw(group=group, level=level, axes=axes)

    def __repr__(self) -> str:
        """The filters from the smallest true position error on, at the judged epoch."""
        first = next(iter(self.filters.values()))
        k = first.epoch()
        head = ["filter", "position [m]", "claimed [m]", "attitude [deg]", "claimed [deg]", "NEES / 3", "cover. 95 %"]
        rows = []
        for c in sorted(self.filters.values(), key=lambda c: c.rms("position")[k]):
            degrees = np.rad2deg([c.rms("attitude")[k], c.rms_claimed("attitude")[k]])
            values = [c.rms("position")[k], c.rms_claimed("position")[k], *degrees, c.nees("position")[k] / 3]
            rows.append([c.name, *(number(float(v), 4) for v in values), number(float(c.coverage("position")[k]), 3)])
        lines = [f"Linear covariances along {self.reference or 'a trajectory'} at {first.time[k]:g} s, RMS errors"]
        notes: dict[str, list[str]] = {}
        for c in self.filters.values():
            for note in c.notes:
                notes.setdefault(note, []).append(c.name)
        lines += [f"truth: {self.truth}", "", format_table(head, rows)]
        return "\n".join([*lines, *(f"note on {', '.join(of)}: {note}" for note, of in notes.items())])


def analyse(
    scenario: Scenario,
    truth: ImuErrors,
    filters: Mapping[str, ImuErrors] | ImuErrors | None = None,
    *,
    believed_initial: InitialUncertainty | None = None,
    progress: Progress = False,
) -> Analysis:
    """Compute the true and the claimed covariance of filters that believe other noise models than the truth.

    Exact to first order in the errors, see `linear_covariance`; for what is beyond that `compare` runs a Monte Carlo.

    Parameters
    ----------
    scenario
        Trajectory, aiding, start and Earth.
    truth
        Errors of the IMU.
    filters
        Name -> what that filter believes, or one of them; the truth if not given.
    believed_initial
        What the filters believe of the start; its true uncertainty if not given.
    progress
        Show a bar of filters (needs the extra ``app``); or a function of what is done and the total, which may
        cancel by raising.

    Raises
    ------
    ValueError
        A truth that is a recording or has a process without state-space form; rates that differ.

    Warns
    -----
    SaturationWarning
        The reference reaches the range of the true IMU.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> analysis = nj.analyse(scenario, truth)
    >>> bool(abs(next(iter(analysis.values())).nees("pose")[-1] - 6) < 0.1)  # a filter that believes the truth
    True
    """
    truth = model_of(truth)
    filters = named_filters(truth, filters)
    setup = Setup(scenario, check_rates(truth, filters))
    warn_of_range(truth.output, setup.imu)
    motion = motion_of(setup.experiment)
    # always given: with or without it there is one program
    initial = scenario.initial if believed_initial is None else believed_initial
    segments = len(setup.schedule.pattern)
    require_memory(
        FLOAT * segments * (2 + 2 * len(filters)) * JUDGED.size**2,  # true and claimed; of one filter twice on the way
        f"Covariances of {len(filters)} filters in {segments} segments",
        "take a larger output_interval of the scenario, or fewer fixes",
    )
    found = {}
    bar = progress_bar(len(filters), "filter", progress)
    try:
        for name, f in filters.items():
            computed = linear_covariance(setup.experiment, truth, f, believed_initial=initial, motion=motion)
            found[name] = covariances_of(setup, computed, f, name, (*_of_output(truth), *_unexcited(truth, f)))
            bar.update(1)
    finally:
        bar.close()
    return Analysis(found, setup.reference.name, repr(truth))


def model_of(truth: ImuErrors | RecordedErrors) -> ImuErrors:
    """What covariances can be computed from.

    Raises
    ------
    ValueError
        A recording.
    """
    if not isinstance(truth, ImuErrors):
        raise ValueError(f"Covariances follow from a model: truth is ImuErrors, and this is {truth!r}.")
    return truth


def _of_output(truth: ImuErrors) -> tuple[str, ...]:
    return () if truth.output is None else truth.output.notes()


def _unexcited(truth: ImuErrors, believed: ImuErrors) -> tuple[str, ...]:
    """Notes if a filter estimates what the truth does not have."""
    ours, theirs = (Counter(s.channel for s in e.states) for e in (believed, truth))
    none = [NAMES[c] for c in sorted(ours) if not theirs[c]]
    more = [NAMES[c] for c in sorted(ours) if ours[c] > theirs[c] > 0]
    return (
        *(f"The filter estimates errors of {', '.join(none)}, which truly are white or none.",) * bool(none),
        *(f"The filter has more states for {', '.join(more)} than the truth, which cannot excite all.",) * bool(more),
    )


_NOT_VALID = ("A variance is negative or not finite: these numbers mean nothing.",)


def covariances_of(
    setup: Setup, result: Lincov, believed: ImuErrors, name: str, notes: tuple[str, ...] = ()
) -> Covariances:
    """The result of `linear_covariance` at the epochs of a setup."""
    arrays = jax.tree.map(np.asarray, result)
    at = setup.output_segments
    both = []
    for claim in (arrays.true, arrays.claimed):
        P = np.full((len(at), JUDGED.size, JUDGED.size), np.nan)
        n = NAVIGATION.size
        P[:, :n, :n], P[:, ON_CHANNELS, ON_CHANNELS] = claim.navigation[at], claim.sensors[at]
        both.append(P)
    edges = np.cumsum([0, *(len(s.axes) for s in setup.aiding)])
    names = [s.name for s in setup.aiding]
    parts = list(zip(names, setup.fix_segments, edges[:-1], edges[1:], strict=True))
    return Covariances(
        name=name,
        time=setup.output_times,
        true=both[0],
        claimed=both[1],
        channels=tuple(sorted({s.channel for s in believed.states if s.is_of_imu})),
        fixes=setup.fixes,
        innovation={n: arrays.innovation[s, a:b] for n, s, a, b in parts},
        innovation_claimed={n: arrays.innovation_claimed[s, a:b] for n, s, a, b in parts},
        outages=setup.outages,
        notes=(*believed.notes(), *notes, *_NOT_VALID * (not arrays.valid.all())),
    )
