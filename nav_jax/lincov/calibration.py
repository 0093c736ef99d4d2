"""From the uncertainty of a calibration to that of the navigation error: would a longer static recording help?

The parameters of a sensor are known as well as its recording let them be. Every set of them that the recording allows
is taken for the truth once. The filter believes the estimate: its error is what may have to be expected. A filter that
knew the truth would be better by so much: that is the most that a longer recording could bring.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Float64, Int, Key

from gmwm_jax._internal.checks import integer, typed_key
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.programs import bounded
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from nav_jax.filter.error_model import Motion
from nav_jax.filter.experiment import Experiment, Setup
from nav_jax.filter.joint_covariance import covariances_of_many, motion_of, noise_of
from nav_jax.filter.layout import QUANTITIES
from nav_jax.filter.parameters import ErrorLines
from nav_jax.filter.scenario import Scenario
from nav_jax.imu.errors import ImuErrors
from nav_jax.lincov.derivatives import rms_of
from nav_jax.statistics.epochs import Judged

_ZERO = "at boundary: zero"
"""What a fit says of a component that is zero."""
_END = "at boundary: end of its range"
"""And of one whose shape is where the search for it ends."""
_AT_ONCE = 16
"""Draws in one vectorised call."""


@saved()
@dataclass(frozen=True, eq=False, repr=False)
class CalibrationEffect(Judged, Drawable, Saved):
    """The result of `calibration_effect`: what the uncertainty of noise parameters does to navigation.

    Attributes
    ----------
    time
        Epochs in s, shape (E,).
    rms
        Quantity -> RMS error if the estimate is true, SI, shape (E,).
    used
        Quantity -> RMS errors of the filter that believes the estimate, if each of D draws is true, shape (D, E).
    best
        Quantity -> those of a filter that knew each of them, shape (D, E).
    delta_sd
        Quantity -> standard deviation of the logarithm of `used` by the delta method, shape (E,).
    outages, fixes
        Of each aiding sensor, s.
    """

    time: Float64[np.ndarray, " E"]
    rms: Mapping[str, Float64[np.ndarray, " E"]]
    used: Mapping[str, Float64[np.ndarray, "D E"]]
    best: Mapping[str, Float64[np.ndarray, "D E"]]
    delta_sd: Mapping[str, Float64[np.ndarray, " E"]]
    outages: Mapping[str, tuple[tuple[float, float], ...]]
    fixes: Mapping[str, Float64[np.ndarray, " _"]]

    def interval(self, quantity: str, level: float = 0.95) -> Float64[np.ndarray, "2 E"]:
        """Interval of the RMS error: quantiles over the draws."""
        return np.quantile(self.used[quantity], [(1 - level) / 2, (1 + level) / 2], axis=0)

    def loss(self, quantity: str) -> Float64[np.ndarray, " E"]:
        """How much larger the RMS error is, on average, than that of a filter that knows the parameters; relative."""
        used, best = self.used[quantity], self.best[quantity]
        return np.mean(np.divide(used, best, out=np.ones_like(used), where=best > 0), axis=0) - 1

    def table(self, at: float | None = None, level: float = 0.95) -> str:
        """RMS errors with their intervals, and what perfect knowledge would bring, at an epoch."""
        k, rows = self.epoch(at), []
        for q, (_, unit, f) in QUANTITIES.items():
            low, high = self.interval(q, level)
            width = f"{100 * self.delta_sd[q][k]:.2g}"
            values = [number(float(f * x[k]), 4) for x in (self.rms[q], low, high)]
            rows.append([q, unit, *values, width, f"{100 * self.loss(q)[k]:.2g}"])
        p = f"{100 * level:g} %"
        head = ["RMS error", "unit", "estimate", f"{p} low", f"{p} high", "sd by delta [%]", "loss [%]"]
        return format_table(head, rows, left=2)

    def plot(
        self, *, quantities: Sequence[str] = ("position", "heading"), level: float = 0.95, axes: GivenAxes | None = None
    ) -> Figure:
        """Draw what the calibration leaves open of the errors, and what its estimate costs.

        Parameters
        ----------
        quantities
            A column each, of `nav_jax.filter.layout.QUANTITIES`.
        level
            Of the bands.
        axes
            Three Axes a quantity to draw into, of shape (3, quantities); a new figure if left out.

        Returns
        -------
        Figure
            See `nav_jax.plotting.plot_calibration`.
        """
        return self._draw(quantities=quantities, level=level, axes=axes)

    def __repr__(self) -> str:
        num = len(next(iter(self.used.values())))
        k = self.epoch()
        most = 100 * max(self.loss(q)[k] for q in QUANTITIES)
        return (
            f"Navigation error at {self.time[k]:g} s over what the calibration leaves open ({num} draws)\n"
            f"{self.table()}\nA perfect calibration would make errors smaller by {most:.2g} % at most, on average; "
            "the interval narrows with the root of the length of the recording."
        )


def calibration_effect(
    scenario: Scenario,
    accel: Any,
    gyro: Any,
    *,
    key: Key[Any, ""],
    num_draws: int = 200,
    **options: Any,
) -> CalibrationEffect:
    """Carry the uncertainty of fits, from covariance or replicates, into intervals of the navigation error.

    Parameters
    ----------
    scenario
        Trajectory, aiding, start and Earth; the filter knows of its start what is true.
    accel, gyro
        What `gmwm_jax` has found: a fit or its bootstrap, one for all axes, or three of them. Of a fit, parameters are
        drawn from the normal distribution of its estimates on the real line; of a bootstrap, its replicates are. A
        component at zero (without a shape) is drawn as far from zero as the recording leaves it, and the others go
        along.
    key
        ``jax.random.key(seed)``.
    num_draws
        How many.
    options
        Turn-on biases and start, see `ImuErrors`.

    Raises
    ------
    ValueError
        A fit with a component at its limit, or without covariance; fewer than 20 draws; as of `nav_jax.analyse`.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> models = {"m/s^2": "WN(sigma2=1e-4)", "rad/s": "WN(sigma2=1e-8)"}  # of accelerometer and gyro
    >>> draws = {unit: gj.simulate(model, 2000, key=jax.random.key(0)) for unit, model in models.items()}
    >>> records = [gj.Recording.from_array(np.asarray(x), rate=20.0, units=unit) for unit, x in draws.items()]
    >>> accel, gyro = (gj.fit(gj.wavelet_variance(rec), "WN") for rec in records)
    >>> effect = nj.calibration_effect(scenario, accel, gyro, key=jax.random.key(1), num_draws=20)
    """
    typed_key(key)
    num_draws = integer("num_draws", num_draws, 20)
    results = [*_per_axis(accel), *_per_axis(gyro)]
    fits = [getattr(r, "fit", r) for r in results]
    models = [_model(f) for f in fits]
    errors = ImuErrors(models[:3], models[3:], _rate(fits), **options)
    lines = ErrorLines(errors)
    draws, covariance = _draws(lines, results, fits, key, num_draws)
    setup = Setup(scenario, errors.rate)
    experiment, at = setup.experiment, jnp.asarray(setup.output_segments)
    motion = motion_of(experiment)
    along = (experiment, motion, lines, at)
    slope, at_estimate = map(np.asarray, _slope(*along))
    filled = np.concatenate([draws, np.repeat(draws[-1:], -len(draws) % _AT_ONCE, axis=0)])
    parts = [_used_and_best(*along, jnp.asarray(filled[i : i + _AT_ONCE])) for i in range(0, len(filled), _AT_ONCE)]
    used, best = (np.concatenate([np.asarray(p[i]) for p in parts])[: len(draws)] for i in range(2))
    sd = np.sqrt(np.einsum("qep,pr,qer->qe", slope, covariance, slope))
    sd = np.divide(sd, at_estimate, out=np.zeros_like(sd), where=at_estimate > 0)
    arrays = (at_estimate, np.moveaxis(used, 1, 0), np.moveaxis(best, 1, 0), sd)
    rms_found, used_of, best_of, sd_of = (dict(zip(QUANTITIES, a, strict=True)) for a in arrays)
    return CalibrationEffect(setup.output_times, rms_found, used_of, best_of, sd_of, setup.outages, setup.fixes)


def _rms(
    experiment: Experiment,
    motion: Motion,
    lines: ErrorLines,
    at: Int[Array, " E"],
    true: Float[Array, "#D P"],
    believed: Float[Array, "#D P"],
) -> Float[Array, "D Q E"]:
    """RMS at the segments `at`, of vectors of truths and of filters, or of one of either."""
    noises = jax.vmap(lambda x: noise_of(experiment, lines.build(x)))(true)
    banks = jax.vmap(lambda x: lines.build(x).bank())(believed)
    found = covariances_of_many(experiment, motion, noises, banks, experiment.initial)
    return rms_of(found.true.navigation[:, at])


@bounded
@eqx.filter_jit
def _used_and_best(
    experiment: Experiment, motion: Motion, lines: ErrorLines, at: Int[Array, " E"], true: Float[Array, "D P"]
) -> tuple[Array, Array]:
    """RMS under truths, of the filter that believes the estimate and of those that believe the truth."""
    used = _rms(experiment, motion, lines, at, true, lines.start[None])
    return used, _rms(experiment, motion, lines, at, true, true)


@bounded
@eqx.filter_jit
def _slope(
    experiment: Experiment, motion: Motion, lines: ErrorLines, at: Int[Array, " E"]
) -> tuple[Float[Array, "Q E P"], Float[Array, "Q E"]]:
    """Derivative of the RMS along the truth at the estimate, which the filter believes, and the RMS there."""

    def of_truth(true: Array) -> tuple[Array, Array]:
        found = _rms(experiment, motion, lines, at, true[None], lines.start[None])[0]
        return found, found

    return jax.jacfwd(of_truth, has_aux=True)(lines.start)


def _per_axis(given: Any) -> list[Any]:
    """Fits of x, y, z."""
    if isinstance(given, Mapping):
        given = [given[axis] for axis in "xyz"]
    results = list(given) if isinstance(given, Sequence) else [given] * 3
    for r in results:
        fit = getattr(r, "fit", r)
        if not hasattr(fit, "covariance") or not hasattr(fit, "at_boundary"):
            raise ValueError(f"A fit of gmwm_jax or its bootstrap is wanted, one or three of them, and this is {r!r}.")
    if len(results) != 3:
        raise ValueError(f"One fit for all axes or three of them are wanted, and these are {len(results)}.")
    return results


def _rate(fits: Sequence[Any]) -> float:
    rates = {f.rate for f in fits}
    if None in rates or len(rates) != 1:
        raise ValueError(f"The fits must know their rate and have one in common; they are {sorted(map(str, rates))}.")
    return rates.pop()


def _draws(
    lines: ErrorLines, results: Sequence[Any], fits: Sequence[Any], key: Any, num: int
) -> tuple[Float64[np.ndarray, "D P"], Float64[np.ndarray, "P P"]]:
    """Parameters on the real line that the recordings allow, and their covariance."""
    rng = np.random.default_rng(np.asarray(jax.random.key_data(key)))
    start = np.asarray(lines.start)
    draws, covariance, at = np.repeat(start[None], num, axis=0), np.zeros((len(start), len(start))), 0
    for group in lines.groups:
        fit, result = fits[group.channels[0]], results[group.channels[0]]
        kept = _kept_parameters(fit)
        if not kept:
            continue
        part = slice(at, at + len(kept))
        C = np.zeros((fit.model.num_parameters,) * 2)
        if fit.covariance is None:
            raise ValueError("A fit has no covariance: there is no theory for its wavelet variance or weights.")
        C[np.ix_(fit.active, fit.active)] = fit.covariance
        if result is fit:
            C = C[np.ix_(kept, kept)]
            if not np.isfinite(C).all():
                unknown = [name for name, v in zip(lines.names[part], np.diag(C), strict=True) if not np.isfinite(v)]
                raise ValueError(
                    f"A fit has no standard error of {', '.join(unknown)}, which its data do not determine: fit a "
                    f"model without it, {fit.reduced!r}."
                )
            deviation = rng.multivariate_normal(np.zeros(len(C)), C, size=num, method="eigh")
            if near := fit.boundary():
                deviation += near.moves(rng, num)[:, kept]
        else:
            chosen = result.good[rng.integers(0, len(result.good), size=num)]
            deviation = _on_lines(fit.model, chosen)[:, kept] - start[part]
            # a replicate whose amplitude is zero has no logarithm
            C = np.atleast_2d(np.cov(deviation[np.isfinite(deviation).all(axis=1)], rowvar=False))
        draws[:, part] += deviation
        covariance[part, part] = C
        at = part.stop
    return draws, covariance


def _model(fit: Any) -> Any:
    """The model of a fit, with next to nothing for components at zero: the truth may have a little of them."""
    near = None if fit.covariance is None else fit.boundary()
    return fit.model if near is None else near.lifted


def _kept_parameters(fit: Any) -> list[int]:
    """Positions of the parameters of components that are not zero, or may be other than zero."""
    kept, at = [], 0
    model = _model(fit)
    for label, process in zip(model.labels, model.processes, strict=True):
        size = len(process.parameters)
        if float(process.amplitude) > 0:
            note = fit.at_boundary.get(label)
            if note and note != _ZERO:
                # of an end that has no name there is no model of its own
                other = "with its shape held there, or without it" if note == _END else repr(fit.reduced)
                raise ValueError(
                    f"{label} of a fit is at its limit ({note}), where it has no distribution: fit the model that the "
                    f"data show, {other}."
                )
            kept += range(at, at + size)
        at += size
    return kept


def _on_lines(model: Any, values: Float64[np.ndarray, "D P"]) -> Float64[np.ndarray, "D P"]:
    """Parameters of replicates on the real line."""
    lines, at = [], 0
    for process in model.processes:
        size = len(process.parameters)
        lines += process.to_lines([jnp.asarray(values[:, i]) for i in range(at, at + size)])
        at += size
    return np.stack([np.asarray(line) for line in lines], axis=1)
