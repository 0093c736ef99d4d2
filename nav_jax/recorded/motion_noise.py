"""Does the noise model of a sensor at rest hold in motion? The likelihood of a record says it, axis by axis.

Beside the model each axis has white noise that grows with what its samples show of vibration, by a factor kappa of its
own (`nav_jax.imu.vibration`). The factors that make the innovations most likely are estimates; at kappa = 0 the model
is that of the sensor at rest.

A factor is 0 to 1, with which all of the variance of the samples is noise. At the edge, where the model holds, twice
the logarithm of the likelihood ratio of an axis is zero with probability 1/2 and otherwise a chi-square variable of one
degree of freedom (Chernoff 1954). That of all six together has k degrees of freedom with probability binom(6, k) / 64,
as far as the axes tell nothing of each other (Self & Liang 1987). Intervals are those of the likelihood ratio, with the
other factors most likely.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import comb
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64
from scipy.special import chdtrc

from gmwm_jax._internal.checks import number as check_number
from gmwm_jax._internal.checks import of_kind, probability
from gmwm_jax._internal.cores import num_threads
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.interrupts import AbandonableExecutor
from gmwm_jax._internal.labelled import Arrays, Labelled, Values
from gmwm_jax._internal.programs import bounded
from gmwm_jax._internal.progress import Progress, progress_bar
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.fixes import Fixes
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.scenario import EVERY
from nav_jax.filter.timeline import Inputs
from nav_jax.imu.channels import CHANNELS
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.imu import Imu
from nav_jax.imu.vibration import VibrationNoise
from nav_jax.kinematics.earth import AbstractEarth
from nav_jax.recorded._factors import Found, likelihood_end, minimise
from nav_jax.recorded.likelihood import Record, Slopes, slopes_of
from nav_jax.recorded.navigation import prepare_navigation, run_record
from nav_jax.recorded.plausibility import warn_of_record
from nav_jax.statistics.distributions import normal_quantile

_STARTS = (0.0, 0.1)
"""Of the searches for all factors."""
_OTHER = 0.01
"""By which the loss of another minimum is lower."""


def _check(found: "NoiseInMotion") -> None:
    """Raise a ValueError for values that are not of the six axes, in a file."""
    for name in ("factor", "ci_low", "ci_high", "ratio"):
        if len(getattr(found, name)) != len(CHANNELS):
            raise ValueError(f"{name} has {len(getattr(found, name))} values, and an IMU six axes.")


@saved(check=_check)
@dataclass(frozen=True, eq=False, repr=False)
class NoiseInMotion(Drawable, Saved, Labelled):
    """The result of `noise_in_motion`: how much of the vibration of a record is white noise of its IMU.

    Attributes
    ----------
    factor
        kappa of accelerometer x, y, z and gyro x, y, z, shape (6,).
    ci_low, ci_high
        Limits of their intervals, from 0 to 1: with 1, all of the variance of the samples would be noise.
    ratio
        Twice the logarithm of the likelihood with the factor over that without, the others most likely, shape (6,).
    ratio_of_all
        The same of all factors.
    window
        s, over which variances of the samples were taken.
    num_innovations
        Scalars that entered the likelihood.
    converged
        Whether all searches came to their end.
    level
        Confidence of the intervals.
    """

    factor: Float64[np.ndarray, "6"]
    ci_low: Float64[np.ndarray, "6"]
    ci_high: Float64[np.ndarray, "6"]
    ratio: Float64[np.ndarray, "6"]
    ratio_of_all: float
    window: float
    num_innovations: int
    converged: bool
    level: float

    @property
    def p(self) -> Float64[np.ndarray, "6"]:
        """Probability of such a ratio, or a larger one, where the model of the sensor at rest holds for that axis."""
        return np.where(self.ratio > 0, chdtrc(1, self.ratio) / 2, 1.0)

    @property
    def p_of_all(self) -> float:
        """The same of all axes together."""
        if self.ratio_of_all <= 0:
            return 1.0
        P = len(CHANNELS)
        return float(sum(comb(P, k) * chdtrc(k, self.ratio_of_all) for k in range(1, P + 1)) / 2**P)

    @property
    def vibration(self) -> VibrationNoise:
        """For `navigate`, and the functions that take its arguments."""
        accel, gyro = self.factor.reshape(2, 3).tolist()
        return VibrationNoise(accel=accel, gyro=gyro, window=self.window)

    def _arrays(self) -> Arrays:
        """A row an axis."""
        names = ("factor", "ci_low", "ci_high", "ratio", "p")
        variables = {name: Values("channel", getattr(self, name), "1") for name in names}
        attributes = {"ratio_of_all": self.ratio_of_all, "p_of_all": self.p_of_all, "window": self.window}
        attributes |= {"num_innovations": self.num_innovations, "level": self.level, "converged": int(self.converged)}
        return Arrays(variables, {"channel": Values("channel", CHANNELS)}, attributes, ("channel",))

    def __repr__(self) -> str:
        percent = f"{100 * self.level:g} %"
        head = ["", "kappa", f"{percent} low", "high", "2 log ratio", "p"]
        columns = (self.factor, self.ci_low, self.ci_high, self.ratio, self.p)
        rows = [[name, *(number(float(x), 3) for x in row)] for name, *row in zip(CHANNELS, *columns, strict=True)]
        alpha = 1 - self.level
        if self.p_of_all < alpha:
            said = "does not hold in motion: believe `vibration` beside it"
        else:
            said = "is not contradicted by this record"
        ended = "" if self.converged else "\nNOT converged: a search was ended before its end"
        return (
            f"White noise in motion = that at rest + kappa x variance of the samples over {self.window:g} s / rate; "
            f"{self.num_innovations} innovations\n{format_table(head, rows)}\n"
            f"all axes: 2 log ratio {self.ratio_of_all:.4g}, p {self.p_of_all:.2g}: the noise at rest {said}{ended}"
        )


def noise_in_motion(
    imu: Imu,
    aiding: Sequence[Fixes],
    filter: ImuErrors,
    *,
    position: Any,
    velocity: Any,
    quaternion: Any,
    initial: InitialUncertainty,
    window: Real = 0.25,
    every: int = EVERY,
    earth: AbstractEarth | None = None,
    level: float = 0.95,
    progress: Progress = False,
) -> NoiseInMotion:
    """Test whether the noise model of a sensor at rest holds in a recorded drive, and find what vibration adds to it.

    Parameters
    ----------
    imu, aiding, position, velocity, quaternion, initial, every, earth
        See `nav_jax.recorded.navigation`.
    filter
        The model of the sensors at rest, such as fits of a static recording.
    window
        s, over which variances of the samples are taken, about each of them.
    level
        Confidence of the intervals.
    progress
        Show a count of the evaluations (needs the extra ``app``); or a function of what is done and None, which may
        cancel by raising.

    Raises
    ------
    ValueError
        No fix, a number out of range, a filter that fails without any vibration; as of `nav_jax.recorded.navigation`.

    Notes
    -----
    What is wrong with the aiding sensors is found here too: where their standard deviations are not known, `tune` them
    first (``tune_aiding=True``). Noise that merely rises with speed or temperature is taken for that of vibration.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> rng = np.random.default_rng(0)
    >>> imu = nj.Imu(samples.time, samples.gyro, samples.accel + rng.normal(0.0, 0.2, (200, 3)), 20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20] + rng.normal(0.0, 0.02, (10, 3)))
    >>> filter = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> start["initial"] = nj.InitialUncertainty(position_sd=0.1, velocity_sd=0.1, attitude_sd=0.01)
    >>> found = nj.recorded.noise_in_motion(imu, [fixes], filter, **start)
    >>> found.p_of_all < 1e-3, found.vibration.window
    (True, 0.25)
    """
    level, window = probability("level", level), check_number("window", window)
    of_kind("initial", initial, InitialUncertainty)
    if not aiding:
        raise ValueError("Without aiding there are no innovations, and nothing that tells the noise.")
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
        vibration=VibrationNoise(1.0, 1.0, window),
    )
    warn_of_record(imu, aiding, done.inputs.start, initial, earth)
    record = Record(done.timeline, done.inputs, initial)
    bar = progress_bar(None, "step", progress)

    def evaluate(point: Float64[np.ndarray, " P"]) -> Found:
        loss, gradient, information = jax.tree.map(
            np.asarray, _slopes(record, filter, done.sensors, jnp.asarray(point))
        )
        bar.update(1)
        # a filter that breaks down is as unlikely as can be
        return Found(float(loss) if np.isfinite(loss) else np.inf, np.nan_to_num(gradient), np.nan_to_num(information))

    axes = range(len(CHANNELS))
    rise = normal_quantile(level) ** 2 / 2
    pool = AbandonableExecutor(num_threads())
    try:
        none = evaluate(np.zeros(len(CHANNELS))).loss
        if not np.isfinite(none):
            raise ValueError("The filter fails without any vibration: look at the record with navigate first.")
        begun = [pool.submit(minimise, evaluate, np.full(len(axes), x)) for x in _STARTS]
        best = min((b.result() for b in begun), key=lambda m: m.loss)
        while True:
            asked = [
                pool.submit(minimise, evaluate, np.where(np.arange(len(axes)) == i, 0.0, best.factors), i) for i in axes
            ]
            held = [a.result() for a in asked]
            lowest = min(held, key=lambda m: m.loss)
            if lowest.loss > best.loss - _OTHER:
                break
            best = minimise(evaluate, lowest.factors)  # there are several minima, and this one is lower
        upper = [pool.submit(likelihood_end, evaluate, best, i, rise, upper=True) for i in axes]
        fall = np.array([h.loss - best.loss for h in held])
        has_low = np.flatnonzero((best.factors > 0) & (fall > rise)).tolist()
        lower = {i: pool.submit(likelihood_end, evaluate, best, i, rise, upper=False) for i in has_low}
        highs, lows = [u.result() for u in upper], {i: u.result() for i, u in lower.items()}
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        bar.close()
    return NoiseInMotion(
        factor=best.factors,
        ci_low=np.array([lows[i][0] if i in lows else 0.0 for i in axes]),
        ci_high=np.array([end for end, _ in highs]),
        ratio=np.where(best.factors > 0, np.maximum(2 * fall, 0.0), 0.0),
        ratio_of_all=max(2 * (none - best.loss), 0.0),
        window=window,
        num_innovations=int(np.asarray(record.timeline.valid).sum()),
        converged=best.converged and all(h.converged for h in held) and all(ok for _, ok in (*highs, *lows.values())),
        level=level,
    )


@bounded
@eqx.filter_jit
def _slopes(
    record: Record, filter: ImuErrors, sensors: tuple[AbstractAiding, ...], point: Float[Array, " P"]
) -> Slopes:
    """Of the loss by the factors; `timeline.shaken` is that of factors of one.

    P filters side by side, as runs of a Monte Carlo, have one factor in motion each: loops are made for runs.
    """
    P, shaken = len(point), record.timeline.shaken
    assert shaken is not None
    spread = partial(jax.tree.map, lambda a: jnp.broadcast_to(a, (*a.shape[:-1], P)))
    inputs = Inputs(*map(spread, record.inputs))

    def stated(factors: Array) -> tuple[Array, Array]:
        timeline = eqx.tree_at(lambda t: t.shaken, record.timeline, shaken * factors[None, None])
        outcome = run_record(timeline, sensors, inputs, filter, record.initial)
        is_fix = record.timeline.valid[:, :, None] > 0
        return jnp.where(is_fix, outcome.innovation, 0.0), jnp.where(is_fix, outcome.variance, 1.0)

    found, slopes = jax.jvp(stated, (jnp.broadcast_to(point[:, None], (P, P)),), (jnp.eye(P),))
    nu, s, d_nu, d_s = (a.reshape(-1, P) for a in (*found, *slopes))
    return slopes_of(nu[:, 0], s[:, 0], d_nu, d_s)
