"""Several records of one sensor: may they be taken together, and the quadratic form that they make together.

The joint objective sum_i (nu_i - nu)' Omega_i (nu_i - nu) over records i (Bakalli et al. 2023) is, but for a constant,
one form (nu_bar - nu)' Omega (nu_bar - nu) with Omega = sum_i Omega_i and nu_bar = Omega^-1 sum_i Omega_i nu_i: the
sum is estimated as a single record is. A short record has no weight at scales that it does not have.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.checks import agreed_rate
from gmwm_jax._internal.states import saved
from gmwm_jax.processes.base import Composite
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.estimator import AbstractEstimator, Estimated
from gmwm_jax.variance.wavelet import AbstractWaveletVariance, WaveletVariance, WaveletVariances, as_wavelet_variance


def as_records(data: Any, caller: str) -> tuple[WaveletVariance, ...] | tuple[WaveletVariances, ...]:
    """Return the wavelet variances of records of one sensor.

    Parameters
    ----------
    data
        Wavelet variances or recordings.
    caller
        Name of the function for messages.

    Raises
    ------
    ValueError
        Fewer than two; records of different channels, units, rates, scales, levels of their intervals or estimators
        (robust and classic, MODWT and DWT); values that are not finite.
    TypeError
        One record instead of several, or something else.
    """
    if isinstance(data, AbstractWaveletVariance | Recording) or not isinstance(data, Sequence) or isinstance(data, str):
        raise TypeError(
            f"{caller}() takes a list of WaveletVariances or Recordings, one a record, not {type(data).__name__}; "
            "fit() takes a single one."
        )
    if len(data) < 2:
        raise ValueError(f"{caller}() takes two records or more, and there are {len(data)}: fit() takes a single one.")
    records: Any = tuple(as_wavelet_variance(record, caller) for record in data)
    first = records[0]
    longest = max(records, key=lambda wv: wv.num_scales)
    for i, wv in enumerate(records, start=1):
        for what, fact, own in (
            ("the channels", wv.channels, first.channels),
            ("the units", wv.units, first.units),
            ("the estimator", wv.estimator.name, first.estimator.name),
            ("intervals at the level", wv.level, first.level),
        ):
            if fact != own:
                raise ValueError(f"Record {i} has {what} {fact}, and record 1 {own}: they cannot be taken together.")
        if not _same_rate(wv.rate, first.rate):
            raise ValueError(
                f"Record {i} has the rate {_hertz(wv.rate)}, and record 1 {_hertz(first.rate)}: parameters per sample "
                "differ between rates. Decimate the faster one, or fit them apart and compare in continuous time."
            )
        if not np.array_equal(wv.scales, longest.scales[: wv.num_scales]):
            raise ValueError(
                f"Record {i} has the scales {wv.scales}, which are not the first of the longest list, {longest.scales}."
            )
        if not all(np.all(np.isfinite(a)) for a in (wv.variance, wv.ci_low, wv.ci_high)):
            raise ValueError(f"Record {i} has a wavelet variance or an interval that is not finite.")
    return records


def _same_rate(a: float | None, b: float | None) -> bool:
    if a is None or b is None:
        return a is b
    try:
        agreed_rate(a, b)
    except ValueError:
        return False
    return True


def _hertz(rate: float | None) -> str:
    return "unknown" if rate is None else f"{rate:g} Hz"


def record_names(records: Sequence[WaveletVariance]) -> tuple[str, ...]:
    """The names of the records where each has one of its own, else their numbers from 1."""
    names = tuple(wv.name for wv in records)
    return names if all(names) and len(set(names)) == len(names) else tuple(str(i + 1) for i in range(len(records)))


class Pool(NamedTuple):
    """R records of one channel on the scales of the longest, zero where a record has no such scale."""

    variances: Float[np.ndarray, "*B R J"]
    omegas: Float[np.ndarray, "*B R J J"]

    @property
    def moments(self) -> Float[np.ndarray, "*B R J"]:
        """Omega_i nu_i."""
        return np.einsum("...jk,...k->...j", self.omegas, self.variances)

    def objectives(self, fitted: Float[np.ndarray, "B J"]) -> Float[np.ndarray, "B R"]:
        """The quadratic form of each record at each of B theoretical wavelet variances."""
        residuals = self.variances - fitted[:, None, :]
        return np.sum(residuals * np.einsum("...rjk,...rk->...rj", self.omegas, residuals), axis=-1)


def pool(records: Sequence[WaveletVariance], omegas: Sequence[Float[np.ndarray, "_ _"]]) -> Pool:
    """Put records of one channel and their weights on common scales."""
    J = max(wv.num_scales for wv in records)
    variances, padded = np.zeros((len(records), J)), np.zeros((len(records), J, J))
    for i, (wv, omega) in enumerate(zip(records, omegas, strict=True)):
        variances[i, : wv.num_scales] = wv.variance
        padded[i, : wv.num_scales, : wv.num_scales] = omega
    return Pool(variances, padded)


def whitened(
    omega: Float[np.ndarray, "B J J"], moment: Float[np.ndarray, "B J"]
) -> tuple[Float[np.ndarray, "B J J"], Float[np.ndarray, "B J"]]:
    """L' and y = L' nu_bar of B forms with weights Omega = L L' and moments Omega nu_bar; zero at scales of no weight.

    Scaled to a unit diagonal first: weights span many orders of magnitude.
    """
    scale = np.sqrt(np.einsum("bjj->bj", omega))
    seen = scale > 0
    safe = np.where(seen, scale, 1.0)
    correlation = omega / safe[:, :, None] / safe[:, None, :] + np.where(seen, 0.0, 1.0)[:, :, None] * np.eye(
        omega.shape[1]
    )
    lower = np.linalg.cholesky(correlation)
    y = np.linalg.solve(lower, np.where(seen, moment / safe, 0.0)[:, :, None])[:, :, 0]
    return np.swapaxes(lower, 1, 2) * scale[:, None, :], y


@saved()
@dataclass(frozen=True, eq=False)
class MeanOfRecords(AbstractEstimator):
    """nu_bar = Omega^-1 sum_i Omega_i nu_i as an estimator, whose covariance is known if that of the records is."""

    has_theory: ClassVar[bool] = False  # of a record that could be replicated
    records: tuple[WaveletVariance, ...]
    omegas: tuple[Float[np.ndarray, "_ _"], ...]

    @property
    def of_record(self) -> AbstractEstimator:
        """That of every record."""
        return self.records[0].estimator

    @property
    def name(self) -> str:
        """In words."""
        return f"mean of {len(self.records)} records, {self.of_record.name}"

    @property
    def efficiency(self) -> float | None:
        """That of every record."""
        return self.of_record.efficiency

    @property
    def title(self) -> str:
        """That of every record."""
        return self.of_record.title

    def estimate(self, data: Any, names: Any, num_levels: Any, *, scratch: Any = None) -> Estimated:
        """Raise a ValueError: it takes wavelet variances, not a record."""
        raise ValueError("A mean of records is made by fit_records(), from the wavelet variances of all.")

    def require_fittable(self, model: Composite) -> None:
        """Raise a ValueError for a model that the estimator of the records is biased under."""
        self.of_record.require_fittable(model)

    def covariance(self, model: Composite, num_samples: Any, num_levels: int, present: Any) -> Any:
        """Omega^-1 (sum_i Omega_i V_i Omega_i) Omega^-1, if the records are independent."""
        covariances = covariances_of(self.records, model)
        return None if covariances is None else mean_covariance(self.omegas, covariances, num_levels)


def mean_of(wv: WaveletVariance) -> MeanOfRecords:
    """Return the mean that a wavelet variance is."""
    assert isinstance(wv.estimator, MeanOfRecords)
    return wv.estimator


def covariances_of(records: Sequence[WaveletVariance], model: Composite) -> tuple[Float[np.ndarray, "_ _"], ...] | None:
    """Covariance of each record's wavelet variance under a model; None where one has no theory."""
    known: dict[Any, Any] = {}
    for wv in records:
        length = wv.num_samples, wv.num_scales
        if length not in known:
            known[length] = wv.covariance_under(model)
        if known[length] is None:
            return None
    return tuple(known[wv.num_samples, wv.num_scales] for wv in records)


def mean_covariance(
    omegas: Sequence[np.ndarray], covariances: Sequence[np.ndarray], J: int
) -> Float[np.ndarray, "J J"]:
    """Omega^-1 (sum_i Omega_i V_i Omega_i) Omega^-1 on J scales."""
    total, scatter = np.zeros((J, J)), np.zeros((J, J))
    for omega, V in zip(omegas, covariances, strict=True):
        own = slice(len(omega))
        total[own, own] += omega
        scatter[own, own] += omega @ V @ omega
    d = np.sqrt(np.diag(total))
    inverse = np.linalg.inv(total / np.outer(d, d))
    return (inverse @ (scatter / np.outer(d, d)) @ inverse) / np.outer(d, d)


def pooled(
    records: Sequence[WaveletVariance], omegas: Sequence[Float[np.ndarray, "_ _"]]
) -> tuple[WaveletVariance, Float[np.ndarray, "J J"]]:
    """nu_bar as a wavelet variance, and Omega.

    Its intervals are those of a mean of independent records, on the log scale; no record of any length stands behind
    it, so it has no number of samples.
    """
    longest, both = max(records, key=lambda wv: wv.num_scales), pool(records, omegas)
    omega = both.omegas.sum(axis=0)
    whitener, y = whitened(omega[None], both.moments.sum(axis=0)[None])
    mean = np.linalg.solve(whitener[0], y[0])
    information = np.zeros((2, longest.num_scales))
    for wv in records:
        with np.errstate(divide="ignore"):
            half = np.abs(np.log([wv.ci_low / wv.variance, wv.ci_high / wv.variance]))
        information[:, : wv.num_scales] += 1 / half**2
    with np.errstate(divide="ignore"):
        below, above = np.exp(-1 / np.sqrt(information[0])), np.exp(1 / np.sqrt(information[1]))
    values = (longest.scales, mean, mean * below, mean * above, None, longest.level, longest.rate)
    estimator = MeanOfRecords(tuple(records), tuple(omegas))
    return WaveletVariance(*values, longest.channels, longest.units, "", estimator), omega
