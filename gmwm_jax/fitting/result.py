"""What a fit is: the estimates, how sure they are, in which units, and how well they describe the data."""

import enum
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax._internal.cached import cached_property
from gmwm_jax._internal.checks import agreed_rate, sampling_rate
from gmwm_jax._internal.chi_square import ChiSquare, chi_square, misses
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.labelled import UNIT_OF_PARAMETER, Arrays, Labelled, Values, import_pandas
from gmwm_jax._internal.pytrees import pytree
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.fitting.bias import WhiteAndBias, summary_rows, white_and_bias
from gmwm_jax.fitting.boundary import Boundary, Quantities
from gmwm_jax.fitting.contradictions import contradictions
from gmwm_jax.fitting.exports.noise import ChannelNoise
from gmwm_jax.fitting.exports.registry import format_of
from gmwm_jax.fitting.misfit import (
    amplitudes_of,
    largest_pull,
    misfit_sentence,
    sentence_of,
    unit_variances,
    with_amplitudes_again,
)
from gmwm_jax.fitting.outcome import Outcome
from gmwm_jax.fitting.standard_errors import (
    Linearised,
    delta_method,
    linearised,
    parameter_covariance,
    with_errors_and_components,
)
from gmwm_jax.fitting.tables import EstimateTable, LogQuantities, continuous_table, parameter_table
from gmwm_jax.fitting.weights import AbstractWeights, Covariance, TwoStep, root_of
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.datasheet import Datasheet
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.white_noise import WN
from gmwm_jax.variance.bands import Bands
from gmwm_jax.variance.wavelet import WaveletVariance

if TYPE_CHECKING:
    import pandas


class Status(enum.Enum):
    """How the search for the minimum ended."""

    converged = "converged"
    stalled = "stopped at the step limit with a slope left: the objective is close to its minimum, not at it"
    unsettled = "the iterated weights still change after 20 rounds"
    non_finite = "no finite objective: the wavelet variance or the weights are beyond floating point"


def _check(fit: "Fit") -> None:
    """Raise a ValueError for what no estimator makes, in a file."""
    if len(fit.omega) != fit.wv.num_scales:
        raise ValueError(f"It has weights for {len(fit.omega)} scales, and {fit.wv.num_scales} scales.")
    for process in fit.model.processes:
        process.require_complete()


@pytree("model", "wv", "objective", "omega")
@saved(not_finite=("objective",), check=_check)
@dataclass(frozen=True, repr=False)
class Fit(Drawable, Saved, Labelled):
    """A model fitted to the wavelet variance of one channel.

    Attributes
    ----------
    model
        The estimated model, parameters per sample, components of a kind from the shortest correlation time on. A
        component that the data push to zero stays in it with amplitude 0.
    wv
        What it was fitted to.
    objective
        Q = (nu_hat - nu)' Omega (nu_hat - nu) at the estimate.
    omega
        Omega, shape (J, J).
    weights
        Where Omega is from, see `gmwm_jax.fitting.weights`.
    status
        How the search ended.
    at_boundary
        Label of a component -> what became of it: its amplitude is zero, or its correlation time has left the range
        that the record can show.
    agreement
        Share of the descents that came to this same minimum.
    rate
        Hz, None if unknown.
    level
        Confidence of the intervals.
    """

    model: Composite
    wv: WaveletVariance
    objective: float
    omega: Float[np.ndarray, "J J"]
    weights: AbstractWeights
    status: Status
    at_boundary: Mapping[str, Outcome] = field(default_factory=dict)
    agreement: float = 1.0
    rate: float | None = None
    level: float = 0.95

    # -- the fit --------------------------------------------------------------------------------------------------

    @property
    def unit(self) -> str:
        """SI unit of the signal."""
        return self.wv.units[0]

    @cached_property
    def fitted(self) -> Float[np.ndarray, " J"]:
        """Wavelet variance of the fitted model, nu(theta_hat), at the scales of the data."""
        # added up by NumPy: each sum of two arrays of JAX would be a program
        return np.sum(list(self.decomposition().values()), axis=0)

    @property
    def residuals(self) -> Float[np.ndarray, " J"]:
        """Residuals of the wavelet variance, nu_hat - nu(theta_hat)."""
        return np.asarray(self.wv.variance) - self.fitted

    @cached_property
    def whitener(self) -> Float[np.ndarray, "J J"]:
        """L' with Omega = L L'."""
        return root_of(self.omega)

    @cached_property
    def whitened_residuals(self) -> Float[np.ndarray, " J"]:
        """The residuals L' (nu_hat - nu) with Omega = L L'; the objective is the sum of their squares."""
        return self.whitener @ self.residuals

    def decomposition(self) -> dict[str, Float[np.ndarray, " J"]]:
        """Return the wavelet variance of each component by its label; together they add up to `fitted`."""
        tau = self.wv.scales
        return {
            label: np.asarray(p.wavelet_variance(tau))
            for label, p in zip(self.model.labels, self.model.processes, strict=True)
        }

    @cached_property
    def reduced(self) -> Composite:
        """The model that the data show, for filters and simulations: no zeros, limits as what they are.

        A Gauss-Markov process whose correlation time has left the range is its random walk or white noise here, added
        to those of the model.
        """
        kept: list[AbstractProcess] = []
        limits: dict[type[AbstractProcess], float] = {}
        for label, p in zip(self.model.labels, self.model.processes, strict=True):
            outcome = self.at_boundary.get(label)
            form = p.state_space() if outcome in (Outcome.RANDOM_WALK, Outcome.WHITE_NOISE) else None
            if form is not None and outcome is Outcome.RANDOM_WALK:
                limits[RW] = limits.get(RW, 0.0) + float(form.driving[0, 0])
            elif form is not None:
                limits[WN] = limits.get(WN, 0.0) + float(form.readout @ form.initial @ form.readout)
            elif outcome is not Outcome.ZERO:
                kept.append(p)
        for cls, amplitude in limits.items():
            amplitude += sum(float(p.amplitude) for p in kept if isinstance(p, cls))
            build: Any = cls
            kept = [*(p for p in kept if not isinstance(p, cls)), build(amplitude)]
        return Composite(kept or [WN(0.0)])

    @cached_property
    def contradictions(self) -> tuple[str, ...]:
        """Sentences about held values that the data contradict by orders of magnitude; mostly none."""
        return contradictions(self.model, self.wv, self.omega, self.objective)

    # -- does the model describe the data? ------------------------------------------------------------------------

    @cached_property
    def chi_square(self) -> ChiSquare | None:
        """The test of fit: statistic, degrees of freedom, p-value and the pull of each scale, see `goodness_of_fit`.

        The pulls are those of this fit; statistic and p are of its model with the amplitudes that weights of its own
        give it, see `gmwm_jax.fitting.misfit`. None where there is no theory of the wavelet variance, or no estimate to
        test.
        """
        V = self.wv_covariance
        if V is None or not (np.isfinite(self.objective) and np.all(np.isfinite(V)) and np.all(np.diag(V) > 0)):
            return None
        own = chi_square(*self._residuals, V)
        if self.weighs_covariances:
            return own
        again, V_again = self._again
        tested = chi_square(*again._residuals, V_again)
        return ChiSquare(tested.statistic, tested.dof, tested.p_value, own.pulls)

    @property
    def weighs_covariances(self) -> bool:
        """Is Omega no diagonal, but the inverse of a covariance, by which the objective itself is the test of fit?"""
        return bool(np.any(self.omega - np.diag(np.diag(self.omega))))

    @cached_property
    def misfit(self) -> str:
        """A sentence if the data are beyond what chance does under the model; "" if they are not, or nobody knows.

        Of right models fewer than one in a hundred, and mostly fewer than one in a thousand, is said to miss its data.
        """
        V = self.wv_covariance
        if self.chi_square is None or V is None or not misses(*self._residuals, V, self._linearised.variance):
            return ""
        again, V_again = self._again
        if not misses(*again._residuals, V_again, again._linearised.variance):
            return ""
        return misfit_sentence(self.chi_square, self.wv.times, self._unit_of_time)

    def with_amplitudes_again(
        self, V: Float[np.ndarray, "J J"], unit: Float[np.ndarray, "C J"] | None = None
    ) -> "tuple[Fit, Float[np.ndarray, 'J J']]":
        """The model with the amplitudes that weights of its own give it, and its covariance of the wavelet variance.

        Parameters
        ----------
        V
            Covariance of the wavelet variance under this fit.
        unit
            Wavelet variance of each component for unit amplitude, if it is known.
        """
        unit = unit_variances(self.model, self.wv.scales) if unit is None else unit
        nu = amplitudes_of(self.model) @ unit
        error = np.where(np.diag(self.omega) > 0, np.sqrt(np.diag(V)) / nu, np.inf)  # what is left out stays so
        model, omega = with_amplitudes_again(self.model, self.wv.variance, unit, error)
        kept = {label: o for label, o in self.at_boundary.items() if o is not Outcome.ZERO}
        parts = zip(model.labels, model.processes, strict=True)
        zero = {label: Outcome.ZERO for label, p in parts if not float(p.amplitude) > 0}
        again = replace(self, model=model, omega=omega, at_boundary={**kept, **zero})
        # the errors in proportion: another covariance would take longer than all the rest
        ratio = amplitudes_of(model) @ unit / nu
        return again, V * np.outer(ratio, ratio)

    @cached_property
    def _again(self) -> "tuple[Fit, Float[np.ndarray, 'J J']]":
        V = self.wv_covariance
        if V is None:
            raise RuntimeError("There is no theory of this wavelet variance.")
        return self.with_amplitudes_again(V, self._linearised.unit)

    @property
    def _residuals(self) -> tuple[Float[np.ndarray, " J"], Float[np.ndarray, "J J"]]:
        """Residuals, and the matrix M by which errors of the wavelet variance are in them."""
        nu, A, B, _ = self._linearised
        return self.wv.variance - nu, np.eye(self.wv.num_scales) - A @ B

    @property
    def _unit_of_time(self) -> str:
        return "s" if self.wv.rate else "samples"

    # -- uncertainty ----------------------------------------------------------------------------------------------

    @cached_property
    def active(self) -> tuple[int, ...]:
        """Positions of the parameters that were estimated and lie inside their range."""
        positions, at = [], 0
        for label, p in zip(self.model.labels, self.model.processes, strict=True):
            outcome = self.at_boundary.get(label)
            for q in p.parameters:
                inside = not outcome or (outcome is not Outcome.ZERO and q is p.parameters[-1])
                if inside and q.name not in p.fixed:
                    positions.append(at)
                at += 1
        return tuple(positions)

    @cached_property
    def wv_covariance(self) -> Float[np.ndarray, "J J"] | None:
        """Covariance of the wavelet variance under the fitted model; None where there is no theory for it.

        It needs the length of the record, all scales 2 .. 2^J, the MODWT, and a model without SIN.
        """
        return self.wv.covariance_under(self.model)

    @cached_property
    def shown(self) -> Bands:
        """Intervals of the wavelet variance at their nominal level, by the covariance under the fitted model.

        Without theory those of the power law that each scale has with its neighbours, or of the weights.
        """
        V = self.wv_covariance
        if V is None or not np.all(np.diag(V) > 0):
            return self.wv.shown
        return Bands.of(self.wv.variance, 2 * self.fitted**2 / np.diag(V), self.wv.level, "fitted model")

    @cached_property
    def covariance(self) -> Float[np.ndarray, "P P"] | None:
        """Covariance of the active parameters on the real line (log; logit for phi); None as `wv_covariance`."""
        if self.wv_covariance is None or not self.active:
            return None
        return np.asarray(
            parameter_covariance(self.model, self.active, self.wv.scales, self.whitener, self.wv_covariance)
        )

    @property
    def derivatives(self) -> tuple[Float[np.ndarray, "J P"], Float[np.ndarray, "P J"]]:
        """A = d nu/d eta and B = d eta_hat/d nu_hat at the estimate, eta the active parameters on the real line."""
        return self._linearised.slopes, self._linearised.estimator

    @cached_property
    def _linearised(self) -> Linearised:
        """The model at its estimates, by the program that `covariance` runs."""
        return linearised(self.model, self.active, self.wv.scales, self.whitener)

    def weights_efficiency(self, omega: Float[np.ndarray, "J J"] | None = None) -> Float[np.ndarray, " P"] | None:
        """Return, for each active parameter, the smallest variance that weights can give over that with `omega`.

        Parameters
        ----------
        omega
            Weights, by default those of this fit.

        Returns
        -------
        Between 0 and 1; None where there is no theory of the wavelet variance.
        """
        V = self.wv_covariance
        if V is None or not self.active:
            return None
        best, used = Covariance().omega(self.wv, self.model, V), self.omega if omega is None else omega
        variances = [
            np.diag(parameter_covariance(self.model, self.active, self.wv.scales, root_of(o), V)) for o in (best, used)
        ]
        return variances[0] / variances[1]

    # -- tables ---------------------------------------------------------------------------------------------------

    def parameters(self) -> EstimateTable:
        """Return the parameters per sample, with intervals symmetric on the log (for phi: logit) scale."""
        errors = np.full(self.model.num_parameters, np.nan)
        if self.covariance is not None:
            errors[list(self.active)] = np.sqrt(np.diag(self.covariance))
            if any(p.num_coordinates > 1 for p in self.model.processes):  # the real line mixes their parameters
                errors = np.asarray(delta_method(_lines, self.model, self.active, self.covariance))
        near = self.boundary()
        ends = None if near is None else near.ends
        return parameter_table(self.model, self.unit, errors=errors, ends=ends, **self._at_level())

    def continuous(self, rate: float | None = None) -> EstimateTable:
        """Return the continuous-time quantities in SI that a Kalman filter takes.

        WN: q [u^2/Hz]; QN: Q [u s]; RW: q [u^2/s]; DR: R [u/s]; GM and AR1: beta [1/s], q of the driving noise [u^2/s]
        and the correlation time 1/beta [s].

        Parameters
        ----------
        rate
            Sampling rate in Hz, if the data do not know theirs.
        """
        return self._continuous(rate, datasheet=False)

    def datasheet(self, rate: float | None = None) -> EstimateTable:
        """Return the quantities of datasheets: N, K, Q, LSB, R, and sigma, correlation time, drive of each GM."""
        return self._continuous(rate, datasheet=True)

    def white_and_bias(
        self, rate: float | None = None, *, step: float | None = None, interval: float | None = None
    ) -> WhiteAndBias:
        """Return the model as white noise and a bias: what is my angle or velocity random walk, and my bias?

        N sums the densities of all components that are white at the step of the filter, whichever of them the fit gave
        the noise to; K is the random walk that stands for the others; B is the lowest Allan deviation over 0.664. See
        `gmwm_jax.fitting.bias` for the definitions.

        Parameters
        ----------
        rate
            Sampling rate in Hz, if the data do not know theirs.
        step, interval
            In seconds, see `gmwm_jax.fitting.white_and_bias`.
        """
        rate = sampling_rate(agreed_rate(self.rate, rate))
        options: Any = {"step": step, "interval": interval, "scales": self.wv.scales, "level": self.level}
        if self.covariance is not None:
            values, _, covariance, components = self._tables(LogQuantities.of(self.model, rate))
            options |= {"logs": (np.asarray(values), np.asarray(covariance)), "components": np.asarray(components)}
        near, first = self.boundary(rate), self.model.num_parameters
        if near is not None:
            options["ends"] = lambda at: near.root_sum_of_squares([first + i for i in at])
        return white_and_bias(self.model, rate, self.unit, **options)

    def _tables(self, quantities: LogQuantities) -> tuple[Array, ...]:
        """What all tables in continuous time ask of this fit, by one program."""
        return with_errors_and_components(quantities, self.model, self.active, self.covariance, self.wv.scales)

    def boundary(self, rate: float | None = None) -> Boundary | None:
        """Return what intervals are where a component is at a boundary or near one; None elsewhere.

        Parameters
        ----------
        rate
            Sampling rate in Hz, if the data do not know theirs.
        """
        rate = float(rate or self.rate or 1.0)  # without one only parameters are asked for
        if rate not in self._boundaries:
            self._boundaries[rate] = self._boundary_at(rate)
        return self._boundaries[rate]

    @cached_property
    def _boundaries(self) -> dict[float, Boundary | None]:
        """By rate."""
        return {}

    def _boundary_at(self, rate: float) -> Boundary | None:
        if self.covariance is None:
            return None
        found = Boundary(self, Quantities(LogQuantities.of(self.model, rate)))
        return found if found.is_near else None

    @property
    def log_quantities(self) -> LogQuantities:
        """The logs of all continuous-time quantities, as a function of the model; per sample without a rate."""
        return LogQuantities.of(self.model, float(self.rate or 0.0))

    def _continuous(self, rate: float | None, *, datasheet: bool) -> EstimateTable:
        rate = sampling_rate(agreed_rate(self.rate, rate))

        def errors(logs: Any) -> tuple[np.ndarray, np.ndarray]:
            values, sd, *_ = self._tables(logs)
            return np.asarray(values), np.asarray(sd)

        near, first = self.boundary(rate), self.model.num_parameters
        return continuous_table(
            self.model,
            rate,
            self.unit,
            datasheet=datasheet,
            errors=None if self.covariance is None else errors,
            ends=None if near is None else (near.ends[0][first:], near.ends[1][first:]),
            **self._at_level(),
        )

    def _at_level(self) -> dict[str, Any]:
        return {"z": normal_quantile(self.level), "level": self.level, "boundary": self.at_boundary}

    @property
    def search(self) -> str:
        """How the search ended, in words: nothing of it says that the model is right."""
        ended = "the search converged" if self.status is Status.converged else self.status.value
        return f"{ended}, {100 * self.agreement:.0f} % of the descents came to this minimum"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences that stand before the estimates: of the data, of held values that they contradict, of a misfit."""
        return (*self.wv.warnings, *self.contradictions, *filter(None, [self.misfit]))

    @property
    def verdict(self) -> list[str]:
        """The test of fit and the warnings, a line each."""
        test = self.chi_square
        lines = [] if test is None else [sentence_of(test, self.wv.times, self._unit_of_time)]
        return lines + [f"warning: {text}" for text in self.warnings]

    def summary(self) -> str:
        """Return all of it as text."""
        wv = self.wv
        missing = f" ({wv.missing})" if wv.missing else ""
        samples = f", {wv.num_samples} samples{missing}" if wv.num_samples else ""
        rate = f" at {self.rate:g} Hz" if self.rate else ""
        free = self.model.num_free
        lines = [
            f"{wv.estimator.title}GMWM fit of {' + '.join(self.model.labels)} to {wv.channels[0]} "
            f"[{self.unit}]{samples}{rate}",
            f"objective {self.objective:.8g} ({self.weights.name} weights) with {free} free parameters on "
            f"{wv.num_scales} scales; {self.search}",
            *self.verdict,
            "",
            str(self.parameters()),
        ]
        if self.rate:
            lines += ["", str(self.continuous()), "", str(self.datasheet()), "", str(self.white_and_bias())]
        diagonal = self.weights_efficiency(TwoStep().omega(wv, self.model)) if self.weights.inverts_covariance else None
        if diagonal is not None:
            shares = ", ".join(f"{100 * e:.0f} %" for e in diagonal)
            lines += ["", f"Weights on the diagonal only would have an efficiency of {shares} in these parameters."]
        if self.wv_covariance is None:
            lines += ["", "No intervals: they need num_samples, the scales 2 .. 2^J, the MODWT, no SIN."]
        return "\n".join(lines)

    def plot(self, *, datasheet: Datasheet | None = None, axes: GivenAxes | None = None) -> Figure:
        """Draw data, model and its components over scale, and the residuals.

        Parameters
        ----------
        datasheet
            A model of what the datasheet promises, drawn as a line; by unit if there are several:
            ``{"rad/s": ..., "m/s^2": ...}``.
        axes
            Two Axes to draw into; a new figure if left out.

        Returns
        -------
        Figure
            See `gmwm_jax.plotting.plot_fit`.
        """
        return self._draw(datasheet=datasheet, axes=axes)

    def __repr__(self) -> str:
        return self.summary()

    @classmethod
    def table_of(cls, fits: Sequence["Fit"], /) -> str:
        """Fits of several channels as text: objective, search, test of fit and the parameters per sample of each."""
        symbols = [f"{e.component}.{e.symbol}" for e in fits[0].parameters()]
        head = ["channel", "unit", "objective", "search", "p of fit", *symbols]
        rows = [
            [f.wv.channels[0], f.unit, number(f.objective, 7), f.status.name]
            + ["-" if f.chi_square is None else number(f.chi_square.p_value, 2)]
            + [number(e.value) + ("*" if e.at_boundary else "") for e in f.parameters()]
            for f in fits
        ]
        foot = "\n* at its boundary" if any(f.at_boundary for f in fits) else ""
        foot += "".join(f"\nwarning: {f.wv.channels[0]}: {text}" for f in fits for text in f.warnings)
        text = f"GMWM fits, parameters per sample\n{format_table(head, rows, left=2)}{foot}"
        timed = [f for f in fits if f.rate]
        if not timed:
            return text
        head, rows = summary_rows([f.wv.channels[0] for f in timed], [f.white_and_bias() for f in timed])
        return f"{text}\n\nWhite noise and bias, at a step of one sample\n{format_table(head, rows)}"

    def export(
        self,
        format: str,
        *,
        path: str | os.PathLike[str] | None = None,
        rate: float | None = None,
        step: float | None = None,
        interval: float | None = None,
    ) -> str:
        """Return the noise of this channel in the format of another filter; see `export_of`.

        Fits of all channels have the same method, ``gj.fit(rec, model).export("kalibr")``.

        Raises
        ------
        ValueError
            Also where the format wants gyros and accelerometers.
        """
        return self.export_of([self], format, path=path, rate=rate, step=step, interval=interval)

    @classmethod
    def export_of(
        cls,
        fits: Sequence["Fit"],
        /,
        format: str,
        *,
        path: str | os.PathLike[str] | None = None,
        rate: float | None = None,
        step: float | None = None,
        interval: float | None = None,
    ) -> str:
        """Return the noise of several channels in the format of another filter, as text for a file of its own.

        Parameters
        ----------
        fits
            Of gyros and accelerometers, told apart by their units.
        format
            ``kalibr``, ``openvins``, ``vins``, ``kf-gins``, ``pyins``, ``gtsam``, ``px4``, ``ros`` or ``nav-jax``, see
            `gmwm_jax.fitting.exports`.
        path
            A file to write the text to; it is there whole or not at all.
        rate
            Sampling rate in Hz, if the data do not know theirs.
        step
            Of the filter in seconds, by default that of the filter as it comes, or else the sampling interval: what is
            white at it is white noise.
        interval
            Averaging time in seconds at which a random walk stands for the bias, see `gmwm_jax.fitting.white_and_bias`.

        Returns
        -------
        The text. Its comments say rate, step, units, what was left out and which approximation was made.

        Raises
        ------
        ValueError
            An unknown format, no rate, a unit of no sensor, gyros or accelerometers that are missing, axes that their
            names do not tell, a number that the format refuses.

        Examples
        --------
        >>> fits = gj.fit(gj.datasets.simulated("mti-g", 4000, channels=["gyro_x", "accel_x"]), "WN + RW")
        >>> text = fits.export("kalibr", path="imu.yaml")
        >>> [line for line in text.splitlines() if line.startswith("update_rate")]
        ['update_rate: 100.0  # Hz']
        """
        chosen = format_of(format)
        noises = []
        for f in fits:
            own = sampling_rate(agreed_rate(f.rate, rate))
            filters = f.white_and_bias(own, step=chosen.step_at(own) if step is None else step, interval=interval)
            parts = dict(zip(f.model.labels, f.model.processes, strict=True))
            bounded = {label: parts[label].bounded_integral() for label in filters.without}
            sd = {label: np.nan if v is None else float(np.sqrt(v)) / own for label, v in bounded.items()}
            name = " ".join(f.wv.channels[0].split())  # it stands in comments, which end with the line
            noises.append(ChannelNoise(name, filters, f._processes(), sd, f.warnings))
        text = chosen.text(noises)
        if path is not None:
            write_atomically(path, lambda file: file.write(text.encode()))
        return text

    def _nominal(self) -> dict[str, Any]:
        """Intervals of the wavelet variance at their nominal level for JSON, where they are known."""
        shown = self.shown
        known = {"nominal_low": shown.low, "nominal_high": shown.high, "dof": shown.dof}
        return {**{k: v.tolist() for k, v in known.items()}, "dof_of": shown.basis} if shown.nominal else {}

    def _test(self) -> dict[str, Any] | None:
        """The test of fit for JSON, which has no NaN."""
        test = self.chi_square
        if test is None:
            return None
        j = largest_pull(test)
        return {
            "statistic": test.statistic,
            "dof": test.dof,
            "p_value": test.p_value if test.dof else None,
            "pulls": [float(p) if np.isfinite(p) else None for p in test.pulls],
            "largest_pull": None if j is None else float(test.pulls[j]),
            "at_scale": None if j is None else float(self.wv.scales[j]),
        }

    def _processes(self) -> list[dict[str, Any]]:
        """The components that the data show, for filters and simulations."""
        return [
            {"kind": p.kind, **{q.name: float(v) for q, v in zip(p.parameters, p.values, strict=True)}}
            for p in self.reduced.processes
        ]

    def to_pandas(self) -> "pandas.DataFrame":
        """A row an estimate, per sample and with a rate also in continuous time and as a datasheet has it.

        It needs the extra ``io``.
        """
        pandas = import_pandas()
        tables = {"per sample": self.parameters()}
        if self.rate:
            tables |= {"continuous": self.continuous(), "datasheet": self.datasheet()}
        rows = [{"form": form, **row} for form, table in tables.items() for row in table.to_list()]
        return pandas.DataFrame(rows).astype({name: float for name in ("value", "ci_low", "ci_high")})

    def _test_values(self) -> dict[str, Values]:
        """The test of fit as variables; NaN where there is none."""
        test = self.chi_square or ChiSquare(np.nan, 0, np.nan, np.full(self.wv.num_scales, np.nan))
        return {
            "chi_square": Values((), test.statistic),
            "chi_square_dof": Values((), test.dof),
            "p_value": Values((), test.p_value),
            "pull": Values("scale", test.pulls, "1"),
            "misfit": Values((), self.misfit),
        }

    def _arrays(self) -> Arrays:
        """What was fitted and what came out, a row a scale; and the parameters per sample."""
        wv, table = self.wv._arrays(), self.parameters()
        unit = wv.variables["variance"].unit
        variables = {
            **wv.variables,
            "fitted": Values("scale", self.fitted, unit),
            "residual": Values("scale", self.residuals, unit),
            "component_variance": Values(("component", "scale"), list(self.decomposition().values()), unit),
            "estimate": Values("parameter", [e.value for e in table], UNIT_OF_PARAMETER),
            "estimate_low": Values("parameter", [e.ci_low for e in table], UNIT_OF_PARAMETER),
            "estimate_high": Values("parameter", [e.ci_high for e in table], UNIT_OF_PARAMETER),
            "note": Values("parameter", [str(e.note) for e in table]),
            "objective": Values((), self.objective),
            "agreement": Values((), self.agreement),
            "status": Values((), self.status.name),
            **self._test_values(),
        }
        coordinates = {
            **wv.coordinates,
            "component": Values("component", self.model.labels),
            "parameter": Values("parameter", [f"{e.component} {e.symbol}" for e in table]),
            "parameter_unit": Values("parameter", [e.unit for e in table]),
        }
        attributes = {
            **wv.attributes,
            "model": " + ".join(p.kind for p in self.model.processes),
            "weights": self.weights.name,
            "level": self.level,
        }
        return Arrays(variables, coordinates, attributes, ("scale",))

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers and texts, for JSON; what is not identified is None."""
        result = {
            "channel": self.wv.channels[0],
            "unit": self.unit,
            "rate": self.rate,
            "num_samples": self.wv.num_samples,
            "efficiency": self.wv.efficiency,
            "model": " + ".join(p.kind for p in self.model.processes),
            # for filters and simulations
            "processes": self._processes(),
            "objective": self.objective,
            "weights": self.weights.name,
            "level": self.level,
            "status": self.status.value,
            "agreement": self.agreement,
            "contradictions": list(self.contradictions),
            "misfit": self.misfit,
            "test_of_fit": self._test(),
            "parameters": self.parameters().to_list(),
            "scales": self.wv.scales.tolist(),
            "variance": self.wv.variance.tolist(),
            "ci_low": self.wv.ci_low.tolist(),
            "ci_high": self.wv.ci_high.tolist(),
            **self._nominal(),
            "fitted": self.fitted.tolist(),
            "residuals": self.residuals.tolist(),
            "components": {k: v.tolist() for k, v in self.decomposition().items()},
        }
        if self.rate:
            result["continuous"] = self.continuous().to_list()
            result["datasheet"] = self.datasheet().to_list()
            result["white_and_bias"] = self.white_and_bias().to_dict()
        return result


def _lines(model: Composite) -> Array:
    return model.parameter_lines()
