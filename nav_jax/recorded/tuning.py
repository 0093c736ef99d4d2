"""Noise parameters from recorded navigation data: those under which the innovations of the filter are most likely.

Parameters are sought on the real line (logarithms). What the record does not determine is held and marked; with a
prior, it is sought all the same and marked as coming from there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float64

from gmwm_jax._internal.checks import integer, of_kind, probability
from gmwm_jax._internal.checks import number as check_number
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.labelled import Arrays, Labelled, Values
from gmwm_jax._internal.progress import Progress, progress_bar
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.fixes import Fixes
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.parameters import AidingLines, ErrorLines
from nav_jax.filter.scenario import EVERY
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.imu import Imu
from nav_jax.imu.vibration import VibrationNoise
from nav_jax.kinematics.earth import AbstractEarth
from nav_jax.recorded._search import Objective, search
from nav_jax.recorded.likelihood import Model, Record
from nav_jax.recorded.navigation import prepare_navigation
from nav_jax.recorded.plausibility import warn_of_record
from nav_jax.statistics.distributions import normal_quantile

_WIDEST = 20.0
"""Half of an interval of logarithms, at most: what only a wide prior holds might leave the range of numbers."""


def _check(tuning: "Tuning") -> None:
    """Raise a ValueError for names that are not those of the values, in a file."""
    if len(tuning.names) != len(tuning.value):
        raise ValueError(f"It has {len(tuning.names)} names and {len(tuning.value)} values.")


@saved(not_finite=("se", "ci_low", "ci_high"), check=_check)
@dataclass(frozen=True, eq=False, repr=False)
class Tuning(Drawable, Saved, Labelled):
    """The result of `tune`: the noise parameters that a recorded run makes most likely.

    Attributes
    ----------
    errors
        The tuned model.
    aiding
        The sensors, with the standard deviations that were found if they were sought.
    names
        Of P parameters.
    start, value
        Before and after, per sample (factors for aiding sensors; partial autocorrelations in place of the coefficients
        of an AR(2) or ARMA), shape (P,).
    se
        Standard errors on the real line (of logarithms; of the logit of a phi), NaN where not sought. They and the
        intervals are conditional: given that what was not sought has the value at which it was held. With a prior,
        they are those of the record and the prior together.
    ci_low, ci_high
        Limits of the intervals, NaN where not sought.
    sought
        Whether the parameter was sought to the end; the others are at their start, or lost.
    lost
        Whether the search moved the parameter to where the record does not determine it, such as far below what it
        shows. It is held there, and has no interval.
    observable
        Whether the record determines the parameter. Without a prior, what it does not determine is not sought.
    held
        Names that were not sought because it was asked for.
    loss_start, loss
        Minus the logarithm of the likelihood, less a constant.
    num_innovations
        Scalars that entered it.
    converged
        Whether the search came to its end.
    level
        Confidence of the intervals.
    """

    errors: ImuErrors
    aiding: tuple[AbstractAiding, ...]
    names: tuple[str, ...]
    start: Float64[np.ndarray, " P"]
    value: Float64[np.ndarray, " P"]
    se: Float64[np.ndarray, " P"]
    ci_low: Float64[np.ndarray, " P"]
    ci_high: Float64[np.ndarray, " P"]
    sought: Bool[np.ndarray, " P"]
    lost: Bool[np.ndarray, " P"]
    observable: Bool[np.ndarray, " P"]
    held: tuple[str, ...]
    loss_start: float
    loss: float
    num_innovations: int
    converged: bool
    level: float

    def applied(self, aiding: Sequence[Fixes]) -> tuple[Fixes, ...]:
        """Fixes of these sensors with the standard deviations that were found, their own covariances scaled likewise.

        Raises
        ------
        ValueError
            Other sensors than were tuned.

        Examples
        --------
        >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=20.0, rate=20.0))
        >>> rng = np.random.default_rng(0)
        >>> fixes = nj.Fixes(  # of a receiver that says 20 cm, and has 5
        ...     nj.GnssPosition(2.0, horizontal=0.2, vertical=0.2),
        ...     exact.time[10::10],
        ...     exact.position[10::10] + rng.normal(0.0, 0.05, (40, 3)),
        ... )
        >>> filter = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
        >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
        >>> start["initial"] = nj.InitialUncertainty(position_sd=0.1, velocity_sd=0.1, attitude_sd=0.01)
        >>> found = nj.tune(samples, [fixes], filter, **start, tune_aiding=True, hold=["accel", "gyro"])
        >>> (better,) = found.applied([fixes])
        >>> better.sensor.believed.round(2).tolist()
        [0.05, 0.05, 0.05]
        """
        tuned = {sensor.name: sensor for sensor in self.aiding}
        if {f.sensor.name for f in aiding} != tuned.keys():
            asked = ", ".join(f.sensor.name for f in aiding) or "none"
            raise ValueError(f"The tuning is of {', '.join(tuned)}, and the fixes are of {asked}.")
        return tuple(_applied(f, tuned[f.sensor.name]) for f in aiding)

    def _arrays(self) -> Arrays:
        """A row a parameter."""
        per_sample = "SI, per sample; a factor for an aiding sensor"
        units = dict.fromkeys(("start", "value", "ci_low", "ci_high"), per_sample) | {"se": "1"}
        names = ("start", "value", "ci_low", "ci_high", "se", "sought", "lost", "observable")
        variables = {name: Values("parameter", getattr(self, name), units.get(name, "")) for name in names}
        variables["remark"] = Values("parameter", self.remarks)
        attributes = {"loss_start": self.loss_start, "loss": self.loss, "level": self.level}
        attributes |= {"num_innovations": self.num_innovations, "converged": int(self.converged)}
        return Arrays(variables, {"parameter": Values("parameter", self.names)}, attributes, ("parameter",))

    def table(self) -> str:
        """Each parameter before and after, with its interval."""
        p = f"{100 * self.level:g} %"
        head = ["parameter", "start", "tuned", f"{p} low", f"{p} high", "se (log)", ""]
        rows = [
            [name, *(number(float(x), 4) for x in row), remark]
            for name, remark, *row in zip(
                self.names, self.remarks, self.start, self.value, self.ci_low, self.ci_high, self.se, strict=True
            )
        ]
        return format_table(head, rows)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Return, for each parameter, why it is not what the record says; "" if it is."""
        return tuple(
            "held" if name in self.held
            else "" if seen
            else "not observable: from the prior" if sought
            else "lost in the search: held there" if lost
            else "not observable: held"
            for name, sought, lost, seen in zip(self.names, self.sought, self.lost, self.observable, strict=True)
        )  # fmt: skip

    def __repr__(self) -> str:
        ended = "converged" if self.converged else "NOT converged: the search was ended before its minimum"
        gain = self.loss_start - self.loss
        lines = [
            f"Tuning by the likelihood of {self.num_innovations} innovations: {ended}",
            f"log likelihood {gain:+.4g} against the start",
            self.table(),
        ]
        if not self.sought.all():
            lines.append("Standard errors and intervals are given the values of what is held.")
        if self.lost.any():
            lines.append("What was lost is held where the search left it: the record may do without that process.")
        return "\n".join(lines)


def tune(
    imu: Imu,
    aiding: Sequence[Fixes],
    filter: ImuErrors,
    *,
    position: Any,
    velocity: Any,
    quaternion: Any,
    initial: InitialUncertainty,
    tune_aiding: bool = False,
    hold: Sequence[str] = (),
    max_steps: int = 50,
    prior: Any = None,
    every: int = EVERY,
    earth: AbstractEarth | None = None,
    vibration: VibrationNoise | None = None,
    level: float = 0.95,
    progress: Progress = False,
) -> Tuning:
    """Find the noise parameters under which the innovations of a recorded run are most likely.

    Parameters
    ----------
    imu, aiding, position, velocity, quaternion, initial, every, earth, vibration
        See `nav_jax.recorded.navigation`. The vibration is not sought: `noise_in_motion` does that.
    filter
        What it believes where the search starts, such as fits of a static recording; its structure is that of the
        result.
    tune_aiding
        Seek also the standard deviations that the filter believes of the aiding sensors, as factors: what receivers say
        of their fixes is seldom right. `Tuning.applied` multiplies the fixes by them.
    hold
        Names of parameters that are not sought, or what several begin with: ``["accel", "gyro"]`` with `tune_aiding`
        leaves the standard deviations of the fixes alone, which takes a fraction of the time.
    max_steps
        Of the search, each time that what is observable has changed.
    prior
        Penalise the way from the start: a standard deviation of the logarithms, or their covariance (P, P).
    level
        Confidence of the intervals.
    progress
        Show a count of the steps (needs the extra ``app``); or a function of what is done and None, which may cancel
        by raising.

    Returns
    -------
    Tuning
        As far as the search has come, and not converged, if it was interrupted from the keyboard.

    Raises
    ------
    ValueError
        No fix, an unknown name, a prior that is no covariance, a number out of range, nothing that the record
        determines, a filter that fails at the start; as of `nav_jax.recorded.navigation`.

    Notes
    -----
    What is observable is judged at the start and again at every solution. What is lost on the way, as a process that
    the record does not have, is held where the search has left it: try the model without it. Of a parameter that is
    barely in sight, records show the large estimates only, and an interval that is too short.

    Standard deviations of fixes are those of white noise. A receiver that filters its positions has errors that last,
    of which innovations show little: hold what it says of them, or give it a drift.

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
    >>> tuning = nj.tune(imu, [fixes], filter, **start, max_steps=3)
    >>> tuning.names[0]
    'accel WN sigma2'
    """
    level, max_steps = probability("level", level), integer("max_steps", max_steps, 1)
    of_kind("initial", initial, InitialUncertainty)
    if vibration is not None:
        of_kind("vibration", vibration, VibrationNoise)
    if not aiding:
        raise ValueError("Without aiding there are no innovations, and nothing to tune by.")
    done = prepare_navigation(
        imu,
        aiding,
        filter,
        position=position,
        velocity=velocity,
        quaternion=quaternion,
        every=every,
        output_interval=imu.duration,
        earth=earth,
        vibration=vibration,
    )
    warn_of_record(imu, aiding, done.inputs.start, initial, earth)
    record = Record(done.timeline, done.inputs, initial)
    model = Model(ErrorLines(filter), AidingLines(done.sensors), tune_aiding)
    names, size = model.names, len(model.names)
    held = _held(names, hold)
    candidates = [i for i in range(size) if names[i] not in held]
    if not candidates:
        raise ValueError("The record determines none of the parameters: all of them are held.")
    objective = Objective(record, model, _penalty(prior, size), candidates)
    begin = objective(objective.start)
    if not np.isfinite(begin.loss):
        raise ValueError("The filter fails at the start: look at the record with navigate first.")
    bar = progress_bar(None, "step", progress)
    try:
        found = search(objective, candidates, max_steps, bar)
    finally:
        bar.close()
    if not found.sought.any():
        raise ValueError("The record determines none of the parameters: it is too short, or its aiding too poor.")
    known = found.sought & np.isfinite(found.se)
    half = np.where(known, np.minimum(normal_quantile(level) * found.se, _WIDEST), 0.0)
    limits = np.sort([_values(model, found.vector + x) for x in (-half, half)], axis=0)
    tuned, sensors = model.build(jnp.asarray(found.vector))
    return Tuning(
        errors=tuned,
        aiding=sensors,
        names=names,
        start=_values(model, objective.start),
        value=_values(model, found.vector),
        se=np.where(known, found.se, np.nan),
        ci_low=np.where(known, limits[0], np.nan),
        ci_high=np.where(known, limits[1], np.nan),
        sought=found.sought,
        lost=found.lost,
        observable=found.observable,
        held=held,
        loss_start=begin.loss,
        loss=found.loss,
        num_innovations=int(np.asarray(record.timeline.valid).sum()),
        converged=found.converged,
        level=level,
    )


def _applied(fixes: Fixes, tuned: AbstractAiding) -> Fixes:
    """The fixes of a sensor that believes other standard deviations."""
    C = fixes.covariance
    if C is not None:
        factor = np.asarray(tuned.believed) / np.asarray(fixes.sensor.believed)
        # C = L L': what `tune` scales are the components of L^-1 e, see `navigation._whitening`
        half = np.linalg.cholesky(C) * factor
        C = half @ half.swapaxes(-1, -2)
    return replace(fixes, sensor=eqx.tree_at(lambda s: s.believed, fixes.sensor, tuned.believed), covariance=C)


def _held(names: Sequence[str], hold: Sequence[str]) -> tuple[str, ...]:
    """The parameters of these names, and those whose names begin with them.

    Raises
    ------
    ValueError
        There is none.
    """
    found = {given: [n for n in names if n == given or n.startswith(f"{given} ")] for given in hold}
    if unknown := sorted(given for given, of_it in found.items() if not of_it):
        raise ValueError(f"There is no parameter {unknown[0]!r} to hold; there are {', '.join(names)}.")
    asked = {name for of_it in found.values() for name in of_it}
    return tuple(name for name in names if name in asked)


def _values(model: Model, vector: Float64[np.ndarray, " P"]) -> Float64[np.ndarray, " P"]:
    """Parameters per sample, and factors."""
    size = len(model.errors.names)
    return np.concatenate([model.errors.values(vector[:size]), np.exp(vector[size:])])


def _penalty(prior: Any, size: int) -> Float64[np.ndarray, "P P"]:
    if prior is None:
        return np.zeros((size, size))
    if np.ndim(prior) == 0:
        return np.eye(size) / check_number("prior", prior) ** 2
    covariance = np.asarray(prior, dtype=float)
    if covariance.shape != (size, size) or not np.isfinite(covariance).all():
        raise ValueError(f"The covariance of the prior is ({size}, {size}) and finite; this one is {covariance.shape}.")
    try:
        np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError as error:
        raise ValueError("The covariance of the prior is not positive definite.") from error
    return np.linalg.inv(covariance)
