"""Plain integrated navigation: the filter of the Monte Carlo on given sensor arrays, without a reference."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float64, Int

from gmwm_jax._internal.checks import as_float, integer, of_kind, real_array
from gmwm_jax._internal.compiling import compiled_sooner
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.programs import bound_programs, bounded
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.states import joined
from nav_jax.filter.history import Estimates, histories, smoothed_history
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.layout import GROUPS, JUDGED, NAVIGATION, ON_CHANNELS
from nav_jax.filter.loop import run_estimate
from nav_jax.filter.measurement import decorrelated
from nav_jax.filter.scenario import EVERY, OUTPUT_INTERVAL, output_times, require_names
from nav_jax.filter.schedule import Schedule, make_schedule
from nav_jax.filter.score import Truth
from nav_jax.filter.smoother import smoothed
from nav_jax.filter.status import Status
from nav_jax.filter.timeline import Estimate, Inputs, Outcome, Timeline, start_covariance, timeline_of
from nav_jax.imu.channels import CHANNELS
from nav_jax.imu.emulation import AtEnd, GivenErrors
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.imu import Imu
from nav_jax.imu.vibration import VibrationNoise
from nav_jax.kinematics.earth import AbstractEarth, FlatEarth
from nav_jax.kinematics.state import NavState
from nav_jax.kinematics.wgs84 import Wgs84
from nav_jax.recorded._export import export_navigation, navigation_dataset
from nav_jax.recorded.gates import Gate, gate_line, limits_of, warn_of_rows
from nav_jax.recorded.outages import Outages, without
from nav_jax.recorded.plausibility import check_record, warn_of_innovations, warn_of_open_outages, warn_of_record
from nav_jax.recorded.reference import ReferenceErrors
from nav_jax.recorded.withheld import Withheld
from nav_jax.statistics.distributions import chi2_quantile
from nav_jax.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    import xarray


_OF_A_FAILED_FILTER = ("sd", "sensor_errors", "innovation", "innovation_sd", "nis")
"""Fields that are NaN from the epoch on at which it failed."""


_TOLD = 0.95
"""Of the standard deviation at the start: an error that is not known better at the end has not been observed."""


def _check(navigation: "Navigation") -> None:
    """Raise where innovations are not those of the fixes, which nothing could have made."""
    given = {f.sensor.name: int(f.given.sum()) for f in navigation.fixes}
    for name, found in (("innovation", navigation.innovation), ("nis", navigation.nis)):
        if {sensor: len(x) for sensor, x in found.items()} != given:
            raise ValueError(f"{name} is of {', '.join(found) or 'no sensor'}, and not of the fixes that were given.")
    if not set(navigation.withheld) <= set(given):
        raise ValueError("There are fixes that were withheld of sensors without fixes.")
    if any(len(x) != given.get(name) for name, x in navigation.refused.items()):
        raise ValueError("refused is not of the fixes that were given.")


@saved(added=("refused",), not_finite=_OF_A_FAILED_FILTER, check=_check)
@dataclass(frozen=True, eq=False, repr=False)
class Navigation(Drawable, Saved):
    """The result of `navigate`: an integrated navigation solution.

    At an epoch with fixes they are what the filter says after the update by all fixes of that epoch, also at the last
    epoch; what it said before that is in `before`. Estimate and standard deviation are always of the same side.

    Attributes
    ----------
    trajectory
        The estimate at the start and after every covariance step; of a smoother, at every output and fix.
    sd
        Standard deviations of position N, E, D (m), velocity (m/s), attitude (rad, rotation vector in n) and of the
        estimated errors of accelerometers (m/s^2) and gyros (rad/s), shape (E, 15).
    sensor_errors
        Estimated errors of accelerometer x, y, z and gyro x, y, z, shape (E, 6).
    before
        The same at the epochs with fixes, before their update. Without epochs for a smoother, which knows all fixes.
    innovation, innovation_sd, nis
        Sensor -> innovations (F, K), what the filter says of them, and their normalised squares (F,), each component
        given those before it; of the fixes that the filter was given.
    status
        How it ended.
    fixes
        Of all sensors, as they were given.
    withheld
        Sensor -> the fixes in its outages beside their predictions, where there are any. Of a smoother too, they are
        those of the filter.
    errors
        Against the reference, if there is one.
    refused
        Sensor with a gate -> which of the fixes that the filter was given did not pass, shape (F,).
    """

    trajectory: Trajectory
    sd: Float64[np.ndarray, "E 15"]
    sensor_errors: Float64[np.ndarray, "E 6"]
    before: Estimates
    innovation: Mapping[str, Float64[np.ndarray, "_ _"]]
    innovation_sd: Mapping[str, Float64[np.ndarray, "_ _"]]
    nis: Mapping[str, Float64[np.ndarray, " _"]]
    status: Status
    fixes: tuple[Fixes, ...] = ()
    withheld: Mapping[str, Withheld] = field(default_factory=dict)
    errors: ReferenceErrors | None = None
    refused: Mapping[str, Bool[np.ndarray, " _"]] = field(default_factory=dict)

    @property
    def time(self) -> Float64[np.ndarray, " E"]:
        """Epochs, s."""
        return self.trajectory.time

    @property
    def unobserved(self) -> dict[str, float]:
        """Channels of the IMU -> standard deviation of their estimated error at the end over that at the start.

        Of those for which it is 0.95 or more: no sensor, and nothing that the vehicle did, has told them. Without
        entries for a smoother, which is as sure at the start as at the end.

        Examples
        --------
        >>> samples, exact = nj.perfect_imu(nj.motions.static(duration=20.0, rate=20.0))  # nothing tells the heading
        >>> filter = nj.ImuErrors("WN(sigma2=1e-6)", "WN(sigma2=1e-10)", rate=20.0, gyro_bias_sd=1e-3)
        >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
        >>> gnss = nj.GnssPosition(horizontal=0.01, vertical=0.01)
        >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20])
        >>> list(nj.navigate(samples, [fixes], filter, **start, initial=nj.InitialUncertainty()).unobserved)
        ['gyro z']
        """
        if len(self.before) == 0 and self.nis:
            return {}
        first, last = self.sd[[0, -1]][:, NAVIGATION.size :]
        return {name: float(b / a) for name, a, b in zip(CHANNELS, first, last, strict=True) if b >= _TOLD * a > 0}

    def to_xarray(self) -> "xarray.Dataset":
        """All estimates and innovations as a Dataset with units; needs the extra ``io``."""
        return navigation_dataset(self)

    def export(
        self, path: str | os.PathLike[str], *, origin: Any = None, start: Any = None, interval: Real = 1.0
    ) -> Path:
        """Write the track for other programs: a table ``.csv`` or ``.npz``, a map ``.kml`` or ``.gpx``.

        `save` writes all of the solution, and `load` gives that back. A table has the columns of
        `nav_jax.trajectory.save_trajectory`, by which `read_trajectory` reads it, then the standard deviations and the
        estimated errors of the sensors. A file of maps has the track.

        Parameters
        ----------
        path
            The file; it appears whole or not at all.
        origin
            Latitude, longitude (rad) and height (m) of the origin of n; a table then has latitude, longitude and height
            too. Needed by maps; that of the Earth unless given.
        start
            UTC at time zero, as ``numpy.datetime64``; maps then have times.
        interval
            s between points of a map.

        Raises
        ------
        ValueError
            Another suffix, or a map without an origin.

        Examples
        --------
        >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))
        >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
        >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
        >>> free = nj.navigate(samples, [], filter, **start, initial=nj.InitialUncertainty())
        >>> free.export("free.csv").name, free.export("free.kml", origin=(0.8, 0.1, 400.0)).name
        ('free.csv', 'free.kml')
        """
        return export_navigation(self, path, origin=origin, start=start, interval=interval)

    def plot(self, *, sigmas: float = 3.0, axes: GivenAxes | None = None) -> Figure:
        """Draw the track with the fixes, and what the filter says of its uncertainty.

        Parameters
        ----------
        sigmas
            Size of ellipses and bounds in standard deviations.
        axes
            Two Axes to draw into, plan and height; a new figure if left out.

        Returns
        -------
        Figure
            See `nav_jax.plotting.plot_navigation`.
        """
        return self._draw(sigmas=sigmas, axes=axes)

    def __repr__(self) -> str:
        last = self.sd[-1]
        rows = [[b.name, b.unit, *(f"{x:.3g}" for x in last[JUDGED[b.name]])] for b in NAVIGATION.blocks]
        lines = [
            f"Navigation from {self.trajectory.time[0]:g} to {self.trajectory.time[-1]:g} s: {self.status.sentence}",
            f"standard deviations at {self.time[-1]:g} s",
            format_table(["", "unit", "N", "E", "D"], rows, left=2),
            *(_nis_line(s, x, self.innovation[s].shape[1]) for s, x in self.nis.items()),
            *(
                gate_line(f.sensor.name, f.time[f.given], self.refused[f.sensor.name])
                for f in self.fixes
                if f.sensor.name in self.refused
            ),
            *_unobserved_line(self),
            *(f"\n{s} in its outages, predicted - measured\n{w!r}" for s, w in self.withheld.items()),
        ]
        return "\n".join(lines if self.errors is None else [*lines, "", repr(self.errors)])


def _unobserved_line(navigation: Navigation) -> list[str]:
    """What no sensor told."""
    listed = ", ".join(f"{name} {ratio:.3g}" for name, ratio in navigation.unobserved.items())
    return [f"hardly observed, with sd at the end over that at the start: {listed}"] if listed else []


def _nis_line(sensor: str, nis: Float64[np.ndarray, " F"], K: int) -> str:
    """The mean, and where it is with 95 % probability if the filter is right: its innovations are then independent."""
    dof = K * len(nis)
    low, high = (float(chi2_quantile(p, dof)) / len(nis) for p in (0.025, 0.975))
    band = f"[{low:.3g}, {high:.3g}]"
    return f"NIS of {sensor}: mean {nis.mean():.3g} over {len(nis)} fixes of {K} components, 95 % band {band}"


class Prepared(NamedTuple):
    """A record as the filter takes it."""

    timeline: Timeline
    sensors: tuple[AbstractAiding, ...]
    inputs: Inputs
    """Of one run, without sensor states."""
    schedule: Schedule
    start: float
    """Of the record, s."""
    outputs: Int[np.ndarray, " E"]
    """The segments that end at the epochs asked for."""
    fixes: list[Int[np.ndarray, " _"]]
    """Of each sensor, the segments that end with a fix."""
    columns: Int[np.ndarray, " _"]
    """Where the scalars of each sensor begin, and their number."""
    whitening: list[Float64[np.ndarray, "_ K K"] | None]
    """Of each sensor, what takes the components of each fix to the scalars of the filter; None where it is one."""


def prepare_navigation(
    imu: Imu,
    aiding: Sequence[Fixes],
    filter: ImuErrors,
    *,
    position: Any,
    velocity: Any,
    quaternion: Any,
    every: int,
    output_interval: Real,
    earth: AbstractEarth | None,
    reference: Trajectory | None = None,
    vibration: VibrationNoise | None = None,
    gate: Gate | None = None,
) -> Prepared:
    """Check and arrange a record; parameters and errors as of `navigate`."""
    if abs(filter.rate / imu.rate - 1) > 1e-6:
        raise ValueError(
            f"The errors belong to {filter.rate:g} Hz and the record to {imu.rate:g} Hz: use at_rate({imu.rate:g})."
        )
    earth = FlatEarth() if earth is None else earth
    of_kind("earth", earth, AbstractEarth)
    sensors = tuple(f.sensor.on(earth) for f in aiding)
    require_names([s.name for s in sensors])
    bound_programs()
    epochs = imu.epochs
    times = output_times(float(epochs[0]), float(epochs[-1]), output_interval, "record")
    start = {
        name: real_array(name, value, (size,))
        for name, value, size in (("position", position, 3), ("velocity", velocity, 3), ("quaternion", quaternion, 4))
    }
    if abs(np.linalg.norm(start["quaternion"]) - 1) > 1e-6:
        raise ValueError(f"The quaternion must have length 1, and has {np.linalg.norm(start['quaternion']):g}.")
    earth.check(start["position"][None], None if reference is None else reference.origin)
    check_record(imu, aiding, start["position"], start["quaternion"], earth)
    schedule = make_schedule(epochs, np.concatenate([times, *(f.time for f in aiding)]), integer("every", every, 1))
    lengths = [len(times), *(len(f.time) for f in aiding)]
    outputs, *fixes = np.split(schedule.event, np.cumsum(lengths)[:-1])
    M = len(schedule.time)
    p, v, q = (as_float(a[:, None]) for a in start.values())
    begin = NavState(p, v, q, as_float(np.zeros((0, 1))))
    truth = _truth(reference, schedule.time, earth)
    given = [s[f.given] for s, f in zip(fixes, aiding, strict=True)]
    shaken = None if vibration is None else vibration.densities(imu)
    timeline = timeline_of(imu, schedule, sensors, given, truth, earth, shaken=shaken)
    limits = limits_of(gate, sensors)
    if limits is not None:
        timeline = eqx.tree_at(lambda t: t.gates, timeline, as_float(limits), is_leaf=lambda x: x is None)
    z = np.zeros((M, timeline.valid.shape[1], 1))
    columns = np.cumsum([0, *(len(s.axes) for s in sensors)])
    spans = list(zip(aiding, fixes, columns[:-1], columns[1:], strict=True))
    for f, segments, a, b in spans:
        z[segments, a:b, 0] = decorrelated(f.sensor, as_float(f.value.T)).T
    whitening = [_whitening(f) for f in aiding]
    if any(w is not None for w in whitening):
        # on top of what the sensor decorrelates by itself
        on_top = np.broadcast_to(np.eye(z.shape[1]), (M, z.shape[1], z.shape[1])).copy()
        for w, (f, segments, a, b) in zip(whitening, spans, strict=True):
            if w is not None:
                on_top[segments, a:b, a:b] = w if f.sensor.mixing is None else w @ np.asarray(f.sensor.mixing)
        timeline = eqx.tree_at(lambda t: t.whitening, timeline, as_float(on_top), is_leaf=lambda x: x is None)
    zero = as_float(np.zeros((M, len(CHANNELS), 1)))
    none = GivenErrors(as_float(np.zeros((*timeline.imu.shape[:-1], len(CHANNELS), 1))), AtEnd(zero, zero))
    return Prepared(
        timeline,
        sensors,
        Inputs(begin, none, as_float(z)),
        schedule,
        float(epochs[0]),
        outputs,
        fixes,
        columns,
        whitening,
    )


def _whitening(fixes: Fixes) -> Float64[np.ndarray, "F K K"] | None:
    """What makes the noise of each fix that of the sensor's scalars, which have the believed standard deviations.

    So that a factor on what is believed, which is what `tune` seeks, is one on what the fixes state.
    """
    if fixes.covariance is None:
        return None
    believed = np.asarray(fixes.sensor.believed)
    return believed[:, None] * np.linalg.inv(np.linalg.cholesky(fixes.covariance))


@bounded
@compiled_sooner
def run_record(
    timeline: Timeline,
    sensors: tuple[AbstractAiding, ...],
    inputs: Inputs,
    filter: ImuErrors,
    initial: InitialUncertainty,
    *,
    trace: bool = False,
    smooth: bool = False,
    predict: bool = False,
) -> Outcome:
    """Run the filter over a prepared record; inside of another program it is a part of that."""
    bank = joined(filter.bank(), timeline.own)
    x = jnp.zeros((len(bank.states), inputs.start.p.shape[1]))
    inputs = inputs._replace(start=inputs.start._replace(x=x))
    P = start_covariance(initial, bank)
    outcome = run_estimate(timeline, bank, sensors, inputs, P, trace=trace, remember=smooth, predict=predict)
    return smoothed(timeline, bank, sensors, outcome) if smooth else outcome


def navigate(
    imu: Imu,
    aiding: Sequence[Fixes],
    filter: ImuErrors,
    *,
    position: Any,
    velocity: Any,
    quaternion: Any,
    initial: InitialUncertainty,
    every: int = EVERY,
    output_interval: Real = OUTPUT_INTERVAL,
    earth: AbstractEarth | None = None,
    smooth: bool = False,
    reference: Trajectory | None = None,
    outages: Outages = (),
    vibration: VibrationNoise | None = None,
    gate: Gate | None = None,
    throw: bool = True,
) -> Navigation:
    """Run the filter on recorded sensors.

    Parameters
    ----------
    imu
        The record.
    aiding
        Fixes of each sensor; may be empty (free inertial navigation). The filter is not given those in the outages of
        their sensor: the result has them beside its predictions.
    filter
        What it believes of the errors of the IMU; their rate must be that of the record.
    position, velocity, quaternion
        The start: NED in m and m/s, q_nb scalar-first.
    initial
        How well the start is known.
    every
        Number of IMU samples in a covariance step.
    output_interval
        s between epochs at which there is an estimate whatever the covariance steps and fixes are.
    earth
        Its gravity, its rate and its shape; a `FlatEarth` unless given.
    smooth
        Give the estimate of the fixed-interval smoother, from all fixes of the record, at every output and fix.
    reference
        A trajectory to be compared with, on the same clock and in the same frame; the filter knows nothing of it.
    outages
        Intervals (start, end) in s, in which the fixes of all receivers, ends included, are kept from the filter; or
        sensor -> intervals.
    vibration
        White noise that grows with what the samples show of vibration, beside that of `filter`; none unless given.
    gate
        Refuse fixes whose normalised innovation squared, over all components, lies beyond the quantile of this
        probability, 0.999 say, if the filter is right; or sensor -> its own. All are taken unless given.
    throw
        Raise if the filter fails; else its status says so.

    Returns
    -------
    Navigation

    Raises
    ------
    ValueError
        Another rate, fixes outside the record or off the Earth, gravity that points up at the start, arrays of wrong
        shape, two sensors of one name, a start or an Earth of another class, a reference of another time, an outage
        that holds no fix or has none before it, a gate that is no probability.
    RuntimeError
        The filter failed, and ``throw``.

    Warns
    -----
    RefusedFixesWarning
        A gate refused five fixes in a row.
    ImplausibleRecordWarning
        Parts of the record contradict each other: forces and gravity, turns and accelerations of the IMU and of the
        fixes, heights, the start and the first fixes; an outage that nothing follows, of a smoother; innovations that
        are five times as large as the filter states, and more.
    LinearisationWarning
        An attitude at the start that is less certain than 10 deg.
    FarOriginWarning
        On a curved Earth, an origin that is 500 km or more from all fixes.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> rng = np.random.default_rng(0)
    >>> imu = nj.Imu(samples.time, samples.gyro, samples.accel + rng.normal(0.0, 0.2, (200, 3)), 20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20] + rng.normal(0.0, 0.02, (10, 3)))
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> start["initial"] = nj.InitialUncertainty(position_sd=0.1, velocity_sd=0.1, attitude_sd=0.01)
    >>> solution = nj.navigate(imu, [fixes], filter, **start)
    >>> solution.status.name
    'ok'
    """
    of_kind("initial", initial, InitialUncertainty)
    if vibration is not None:
        of_kind("vibration", vibration, VibrationNoise)
    aiding = without(aiding, outages)
    done = prepare_navigation(
        imu,
        aiding,
        filter,
        position=position,
        velocity=velocity,
        quaternion=quaternion,
        every=every,
        output_interval=output_interval,
        earth=earth,
        reference=reference,
        vibration=vibration,
        gate=gate,
    )
    warn_of_record(imu, aiding, done.inputs.start, initial, earth)
    if smooth:
        warn_of_open_outages(aiding)
    predict = not all(f.given.all() for f in aiding)
    how = {"trace": not smooth, "smooth": smooth, "predict": predict}
    outcome = run_record(done.timeline, done.sensors, done.inputs, filter, initial, **how)
    status = Status(int(outcome.status[0]))
    if throw and status is not Status.ok:
        raise RuntimeError(
            f"The filter failed: {status.sentence}. Look at the start, the units of the sensors and the noise model; "
            "with throw=False the solution up to there is returned."
        )
    nu, sd, withheld, refused = {}, {}, {}, {}
    gates = done.timeline.gates
    innovation, variance = (np.asarray(a)[..., 0] for a in (outcome.innovation, outcome.variance))
    parts = zip(aiding, done.fixes, done.columns[:-1], done.columns[1:], done.whitening, strict=True)
    for i, (fixes, segments, a, b, W) in enumerate(parts):
        name, given = fixes.sensor.name, fixes.given
        # scalars of fixes with a covariance of their own come back in the unit of the sensor
        unit = 1.0 if W is None else np.diagonal(W[given], axis1=1, axis2=2)
        nu[name] = innovation[segments[given], a:b] / unit
        sd[name] = np.sqrt(variance[segments[given], a:b]) / unit
        if gates is not None and outcome.passed is not None and np.isfinite(gates[i]):
            refused[name] = ~np.asarray(outcome.passed)[segments[given], i, 0]
            warn_of_rows(name, fixes.time[given], refused[name])
        else:
            warn_of_innovations(name, (innovation**2 / variance)[segments[given], a:b].sum(axis=1), int(b - a))
        if not given.all() and outcome.comparison is not None:
            at = segments[~given]
            residual, C = (np.asarray(x)[..., 0] for x in outcome.comparison)
            withheld[name] = _withheld(fixes, W, residual[at, a:b], C[at, a:b, a:b])
    after, before = _estimates(done, outcome)
    label = "smoothed navigation" if smooth else "navigation"
    return Navigation(
        Trajectory(after.time, after.position, after.velocity, after.quaternion, label, _origin(earth)),
        after.sd,
        after.sensor_errors,
        before,
        nu,
        sd,
        {n: ((nu[n] / sd[n]) ** 2).sum(axis=1) for n in nu},
        status,
        tuple(aiding),
        withheld,
        None if reference is None else _reference_errors(reference, done, outcome),
        refused,
    )


def _origin(earth: AbstractEarth | None) -> Float64[np.ndarray, "3"] | None:
    """Of positions, where the Earth knows it."""
    return np.asarray(earth.origin) if isinstance(earth, Wgs84) else None


def _withheld(
    fixes: Fixes,
    whitening: Float64[np.ndarray, "F K K"] | None,
    residual: Float64[np.ndarray, "f K"],
    covariance: Float64[np.ndarray, "f K K"],
) -> Withheld:
    """What is said of the f fixes that the filter was without: scalars become components of the sensor."""
    mixing = fixes.sensor.mixing
    if whitening is not None:
        back = np.linalg.inv(whitening[~fixes.given])
    else:
        back = np.eye(residual.shape[1]) if mixing is None else np.asarray(mixing)
    error = -(back @ residual[:, :, None])[:, :, 0]
    C = back @ covariance @ np.swapaxes(back, -1, -2)
    sensor = fixes.sensor
    return Withheld(fixes.time[~fixes.given], error, C, sensor.axes, sensor.unit, fixes.outages)


def _truth(reference: Trajectory | None, time: Float64[np.ndarray, " M"], earth: AbstractEarth) -> Truth:
    """The reference at the ends of the segments; its own ends where it ends."""
    if reference is None:  # errors of the channels are then what the filter estimates, all others mean nothing
        still, level = np.zeros((len(time), 3, 1)), np.tile(np.eye(4)[None, :, :1], (len(time), 1, 1))
        return Truth(as_float(still), as_float(still), as_float(level))
    inside = time.clip(reference.time[0], reference.time[-1])
    instants, which = np.unique(inside, return_inverse=True)
    if len(instants) < 2:
        raise ValueError(
            f"The reference is of {reference.time[0]:g} to {reference.time[-1]:g} s, and the record ends at "
            f"{time[-1]:g} s: they have no time in common."
        )
    known = reference.at(instants)
    p, v, q = (as_float(a[which][:, :, None]) for a in (known.position, known.velocity, known.quaternion))
    axes = earth.local(known.position[which])
    return Truth(p, v, q, None if axes is None else as_float(axes[..., None]))


def _reference_errors(reference: Trajectory, done: Prepared, outcome: Outcome) -> ReferenceErrors:
    """At outputs and fixes that the reference covers."""
    rows = np.unique(np.concatenate([done.outputs, *done.fixes]))
    time = done.schedule.time[rows]
    rows = rows[(time >= reference.time[0]) & (time <= reference.time[-1])]
    n = NAVIGATION.size
    error, sd = (np.asarray(a)[rows, :n, 0] for a in (outcome.judgement.error, outcome.judgement.sd))
    nees = dict(zip(GROUPS, np.asarray(outcome.judgement.nees)[rows, :, 0].T, strict=True))
    del nees["sensors"]  # of which a reference knows nothing
    return ReferenceErrors(done.schedule.time[rows], error, sd, nees)


def _estimates(done: Prepared, outcome: Outcome) -> tuple[Estimates, Estimates]:
    """At all epochs and after the updates, and before them; of a smoother at outputs and fixes."""
    if outcome.trace is not None:
        return histories(done.schedule, done.start, done.timeline.valid, outcome.trace)[0]
    # nothing is known to compare with: errors of the channels are what is estimated of them
    sensors = outcome.judgement.error[:, ON_CHANNELS]
    events = Estimate(outcome.state.p, outcome.state.v, outcome.state.q, sensors, outcome.judgement.sd)
    return smoothed_history(done.schedule, events, np.unique(np.concatenate([done.outputs, *done.fixes])))
