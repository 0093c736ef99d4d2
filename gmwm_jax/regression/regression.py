"""Regression with dependent errors, y = X b + e: e a composite noise that is fitted by its wavelet variance.

In the spirit of GMWMX (Cucci, Voirol, Kermarrec, Montillet & Guerrier 2023, J. Geodesy 97:14), in O(N log N):

1. Ordinary least squares (OLS), and a GMWM fit of the noise to the wavelet variance of its residuals.
2. Generalised least squares (GLS) with the covariance Sigma of that noise, by whitening (`processes.whitening`):
   b = C X' Sigma^-1 y and C = (X' Sigma^-1 X)^-1, its covariance.
3. The noise again, from the wavelet variance of the GLS residuals; back to 2 until nothing changes.

Regression takes power out of the residuals, most at the scales on which the regressors live. Given y, e has the mean
y - X b and the covariance X C X', hence

    E(nu_j^2(e) | y) = nu_j^2(y - X b) + sum_c nu_j^2(X C^{1/2})_c,

the wavelet variance of the residuals plus that of the p columns of X C^{1/2}: this is what is fitted. Its mean is that
of the noise, since the residuals have the covariance (I - H) Sigma (I - H)' = Sigma - X C X', H = X C X' Sigma^-1. (A
trend takes a third from a random walk at the coarsest scale.)

Missing samples: skipped in the whitening, and a wavelet variance by pairs of samples
(`gmwm_jax.variance.gaps`).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float

from gmwm_jax._internal.cached import cached_property
from gmwm_jax._internal.checks import agreed_rate, confidence, require_x64, sampling_rate
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.fitting.estimator import fit
from gmwm_jax.fitting.result import Fit
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model
from gmwm_jax.processes.whitening import GeneralisedLeastSquares, covariance_times, generalised_least_squares
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.regression.regressors import Design, checked_record, checked_time, design
from gmwm_jax.units import require_si
from gmwm_jax.variance.blocked import host_wavelet_variance
from gmwm_jax.variance.estimator import Modwt, Pairs
from gmwm_jax.variance.gaps import (
    find_pairs,
    gap_degrees_of_freedom,
    gap_wavelet_variance,
    positive_levels,
    white_widening,
)
from gmwm_jax.variance.haar import degrees_of_freedom, interval_factors, scales
from gmwm_jax.variance.wavelet import WaveletVariance

_MAX_ROUNDS = 20
_UNCHANGED = 1e-3
"""Relative change of the fitted wavelet variance at which the rounds end: standard errors have half of it."""

_EXACT = 1e-13
"""Residuals of this size relative to the record are rounding."""


class Coefficient(NamedTuple):
    """One coefficient with its standard error and interval."""

    value: float
    standard_error: float
    ci_low: float
    ci_high: float
    unit: str


@saved()
@dataclass(frozen=True, repr=False)
class Coefficients(Mapping[str, Coefficient]):
    """Estimates of b by name of the regressor, with their joint covariance."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    estimates: Float[np.ndarray, " p"]
    covariance: Float[np.ndarray, "p p"]
    level: float

    @property
    def standard_errors(self) -> Float[np.ndarray, " p"]:
        """Square roots of the diagonal of the covariance."""
        return np.sqrt(np.diag(self.covariance))

    def __getitem__(self, name: str) -> Coefficient:
        if name not in self.names:
            raise KeyError(f"No regressor {name!r}; there are {', '.join(self.names)}.")
        i = self.names.index(name)
        value, error = float(self.estimates[i]), float(self.standard_errors[i])
        half = normal_quantile(self.level) * error
        return Coefficient(value, error, value - half, value + half, self.units[i])

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        """A row a coefficient."""
        head = ["regressor", "estimate", "std. error", f"{100 * self.level:g} % low", "high", "unit"]
        rows = [[name, *(number(x) for x in c[:4]), c.unit] for name, c in self.items()]
        return format_table(head, rows)


@saved(not_finite=("data",))
@dataclass(frozen=True, repr=False)
class Regression(Drawable, Saved):
    """The result of `regress`: a regression with dependent errors.

    Attributes
    ----------
    coefficients
        Generalised least squares, with the covariance (X' Sigma^-1 X)^-1 under the fitted noise.
    ols
        Ordinary least squares, with the sandwich (X'X)^-1 X' Sigma X (X'X)^-1 under the same noise.
    noise
        The fit of the noise. Its wavelet variance is that of the residuals with what the regression took out added.
    time
        Seconds, shape (N,).
    data, fitted
        y and X b, shape (N,), in the unit of the record; y is NaN where a sample is missing.
    present
        False where a sample is missing, shape (N,).
    log_likelihood
        Gaussian log-likelihood of y at `coefficients` and `noise`.
    num_rounds, converged
        How often noise and coefficients were estimated in turn; did the noise no longer change in the last round?
    """

    coefficients: Coefficients
    ols: Coefficients
    noise: Fit
    time: Float[np.ndarray, " N"]
    data: Float[np.ndarray, " N"]
    fitted: Float[np.ndarray, " N"]
    present: Bool[np.ndarray, " N"]
    log_likelihood: float
    num_rounds: int
    converged: bool

    @cached_property
    def residuals(self) -> Float[np.ndarray, " N"]:
        """The data without what the regressors explain, y - X b; NaN where a sample is missing."""
        return self.data - self.fitted

    @property
    def num_missing(self) -> int:
        """Number of missing samples."""
        return len(self.present) - int(np.sum(self.present))

    def __getitem__(self, name: str) -> Coefficient:
        """One coefficient of the generalised least squares."""
        return self.coefficients[name]

    def __repr__(self) -> str:
        """Coefficients and noise as tables."""
        wv, num = self.noise.wv, len(self.present)
        missing = f" ({self.num_missing} missing, {100 * self.num_missing / num:.3g} %)" if self.num_missing else ""
        end = "noise and coefficients agree" if self.converged else "STILL CHANGING: the noise is hardly determined"
        return "\n".join(
            [
                f"Regression of {wv.channels[0]} [{wv.units[0]}] with {' + '.join(self.noise.model.labels)} noise, "
                f"{num} samples{missing} at {wv.rate:g} Hz",
                f"generalised least squares; {end} after {self.num_rounds} rounds",
                "",
                str(self.coefficients),
                "",
                f"Noise: {self.noise.parameters()}",
            ]
        )


def regress(
    y: Any,
    regressors: Mapping[str, Any],
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    unit: str = "1",
    name: str = "y",
    time: Any = None,
    present: Any = None,
    intercept: bool = True,
    level: float = 0.95,
) -> Regression:
    """Regress a record on known columns, with errors that depend on each other.

    Parameters
    ----------
    y
        Record at equal steps of time, shape (N,), missing samples NaN or masked; or a `Recording` of one channel, which
        knows rate, unit and name.
    regressors
        Name -> column: merged from `trend`, `seasonal`, `step` and `polynomial`, or any `Regressor` or array (N,).
    model
        The noise, as for `fit`; no drift, which is a trend among the regressors.
    rate, unit, name
        Sampling rate in Hz, SI unit (``rad/s``, ``m/s^2`` or ``1``) and name of a record that is an array.
    time
        Time of each sample in seconds, for figures and to be checked against the rate; by default from 0.
    present
        False where a sample is missing or to be left out, shape (N,).
    intercept
        Put a column of ones first.
    level
        Confidence of the intervals.

    Returns
    -------
    Regression

    Raises
    ------
    ValueError
        A record that is no array of reals, too short, infinite or all missing; a rate that is missing or contradicts
        the time; regressors that are constant, collinear, of another length or not finite, or that describe the record
        exactly; a drift in the model, or a model that is too large for the record.
    RuntimeError
        x64 is off, or the fit of the noise did not converge.

    Notes
    -----
    Intervals take the fitted noise as known: where few samples tell a slow component they are a little short (93 %
    instead of 95). That samples are missing must not depend on their noise.

    Examples
    --------
    >>> t = np.arange(2000.0)
    >>> y = 0.5 * t + np.asarray(gj.simulate("WN(sigma2=1.0)", 2000, key=jax.random.key(0)))
    >>> result = gj.regress(y, gj.regression.trend(t), "WN", rate=1.0)
    >>> round(result.coefficients["trend"].value, 2)
    0.5
    """
    require_x64()
    level = confidence(level)
    model = as_model(model)
    for process in model.processes:
        if process.deterministic:
            raise ValueError(
                f"{process.kind} is a trend of unknown sign, and no noise here: put trend(time) among the regressors."
            )
    if isinstance(y, Recording):
        if y.num_channels != 1:
            raise ValueError(f"Regress one channel at a time, as in recording[{y.channels[0]!r}]: {y.channels}.")
        rate, unit, name, y = agreed_rate(y.rate, rate), y.units[0], y.channels[0], y.data[:, 0]
    rate = sampling_rate(rate)
    require_si(unit)
    y, present = checked_record(y, present)
    time = checked_time(time, len(y), rate)
    X = design(regressors, present, intercept=intercept)

    pairs = None if np.all(present) else find_pairs(present)
    estimator = Modwt() if pairs is None else Pairs()
    white = None if pairs is None else white_widening(pairs)

    def noise_of(residual: Float[np.ndarray, " N"], spread: Float[np.ndarray, "N p"]) -> Fit:
        records = np.column_stack([residual, spread]).T
        if pairs is None or white is None:
            nu = np.sum([host_wavelet_variance(x) for x in records], axis=0)
            eta = degrees_of_freedom(len(y), len(nu))
        else:
            nu = np.sum(gap_wavelet_variance(records, pairs), axis=0)
            nu = nu[: positive_levels(nu)]
            eta = gap_degrees_of_freedom(pairs, nu, white)
        low, high = interval_factors(eta)
        values = (scales(len(nu)), nu, nu * low, nu * high, len(y), 0.95, rate)
        wv = WaveletVariance(
            *values, (name,), (unit,), name, estimator=estimator, present=None if pairs is None else present
        )
        return fit(wv, model, weights="two-step", level=level)

    def least_squares(noise: Fit) -> GeneralisedLeastSquares:
        return jax.tree.map(np.asarray, generalised_least_squares(noise.reduced, rest, X.basis, present))

    # in the orthonormal basis: X b = Q beta
    z = np.where(present, y, 0.0)
    ols = X.basis.T @ z
    rest = z - X.basis @ ols  # what is left is whitened, as digits would be lost in a large mean
    if np.linalg.norm(rest) <= _EXACT * np.linalg.norm(z):
        raise ValueError("The regressors describe the record exactly: there is no noise to model.")
    noise, converged, num_rounds = noise_of(rest, np.zeros((len(y), 0))), False, 0
    while not converged and num_rounds < _MAX_ROUNDS:
        num_rounds += 1
        gls = least_squares(noise)
        spread = X.basis @ np.linalg.cholesky(gls.covariance)
        last, noise = noise, noise_of(rest - X.basis @ gls.estimates, spread)
        shared = slice(min(noise.wv.num_scales, last.wv.num_scales))
        converged = bool(np.all(np.abs(noise.fitted[shared] / last.fitted[shared] - 1) < _UNCHANGED))
    gls = least_squares(noise)
    sandwich = X.basis.T @ np.asarray(covariance_times(noise.reduced, X.basis))
    coefficients = _coefficients(X, ols + gls.estimates, np.asarray(gls.covariance), unit, level)
    return Regression(
        coefficients=coefficients,
        ols=_coefficients(X, ols, sandwich, unit, level),
        noise=noise,
        time=time,
        data=np.where(present, y, np.nan),
        fitted=X.columns @ coefficients.estimates,
        present=present,
        log_likelihood=float(gls.log_likelihood),
        num_rounds=num_rounds,
        converged=converged,
    )


def _coefficients(
    X: Design, beta: Float[np.ndarray, " p"], covariance: Float[np.ndarray, "p p"], unit: str, level: float
) -> Coefficients:
    """From the basis back to the regressors."""
    back = np.linalg.inv(X.triangle)
    units = tuple(unit if u == "1" else f"({unit})/{u}" if "/" in unit else f"{unit}/{u}" for u in X.units)
    return Coefficients(X.names, units, back @ beta, back @ covariance @ back.T, level)
