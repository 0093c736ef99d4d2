"""The empirical wavelet variance of recordings: one object for one or several channels."""

import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from gmwm_jax._internal.checks import (
    agreed_rate,
    as_float,
    confidence,
    finite_record,
    integer,
    positive,
    sampling_rate,
    spans,
    time_first,
    unmasked,
)
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.units import require_si
from gmwm_jax.variance.blocked import blocks_to_file, host_wavelet_variance
from gmwm_jax.variance.gaps import variance_by_pairs
from gmwm_jax.variance.haar import check_num_levels, degrees_of_freedom, haar_dwt_variance, interval_factors, scales
from gmwm_jax.variance.robust import biweight, robust_wavelet_variance, widening


@dataclass(frozen=True, repr=False)
class WaveletVariance(Drawable):
    """The Haar wavelet variance of one channel, in arrays of shape (J,), or of C channels, (J, C).

    Attributes
    ----------
    scales
        tau_j, spans of the filters in samples, shape (J,). The averaging time of the Allan variance is half of it.
    variance, ci_low, ci_high
        nu_j^2 and its confidence interval, in squared `units`.
    num_samples
        N, or None where only published values are known: without it there is no covariance and no standard error.
    level
        Confidence of the interval.
    rate
        Hz, or None if not stated (times are then in samples).
    channels, units
        Name and SI unit of each channel.
    """

    scales: Float[np.ndarray, " J"]
    variance: Float[np.ndarray, "J *C"]
    ci_low: Float[np.ndarray, "J *C"]
    ci_high: Float[np.ndarray, "J *C"]
    num_samples: int | None = None
    level: float = 0.95
    rate: float | None = None
    channels: tuple[str, ...] = ("x",)
    units: tuple[str, ...] = ("1",)
    name: str = ""
    method: str = "modwt"
    """``modwt`` or ``dwt``."""
    efficiency: float | None = None
    """Of the robust estimator on clean data, see `gmwm_jax.variance.robust`; None for the classic one."""
    present: Bool[np.ndarray, "N *C"] | None = None
    """False where a sample is missing, see `gmwm_jax.variance.gaps`; None for a complete record."""

    @classmethod
    def from_table(
        cls,
        scales: Any,
        variance: Any,
        ci_low: Any,
        ci_high: Any,
        *,
        num_samples: int | None = None,
        level: float = 0.95,
        rate: float | None = None,
        unit: str = "1",
        name: str = "",
    ) -> "WaveletVariance":
        """Build a wavelet variance from published values of one channel.

        Parameters
        ----------
        scales
            Spans tau = 2, 4, 8 ... in *samples* (multiply by the rate if the table has seconds).
        variance, ci_low, ci_high
            Haar MODWT wavelet variance, half the Allan variance at tau/2, and the ends of its interval.
        num_samples
            Length of the record, needed for standard errors; at least the longest span.
        level
            Confidence of the interval.
        rate, unit
            Sampling rate in Hz and SI unit of the signal (``rad/s``, ``m/s^2`` or ``1``).

        Raises
        ------
        ValueError
            Different lengths, spans that are not even numbers of samples in increasing order, variances that are
            negative, zero or not finite, an interval that does not hold its variance, a record shorter than a span, a
            level outside 0 to 1, another unit.
        """
        columns = {"scales": scales, "variance": variance, "ci_low": ci_low, "ci_high": ci_high}
        arrays = {k: np.asarray(v, dtype=np.float64) for k, v in columns.items()}
        shapes = {k: a.shape for k, a in arrays.items()}
        if len(set(shapes.values())) > 1 or arrays["scales"].ndim != 1 or not arrays["scales"].size:
            raise ValueError(f"scales, variance, ci_low and ci_high must be equally long lists; they are {shapes}.")
        for k, a in arrays.items():
            if not np.all(np.isfinite(a)):
                raise ValueError(f"{k} must be finite, and is {a[~np.isfinite(a)][0]} at {np.argmin(np.isfinite(a))}.")
        tau = arrays["scales"]
        spans(tau)
        if np.any(np.diff(tau) <= 0):
            raise ValueError(f"scales must be in increasing order, and are {tau}.")
        positive("variance", arrays["variance"])
        positive("ci_low", arrays["ci_low"], zero_ok=True)
        outside = ~((arrays["ci_low"] < arrays["variance"]) & (arrays["variance"] < arrays["ci_high"]))
        if np.any(outside):
            raise ValueError(f"The interval at scale {tau[outside][0]:g} does not hold its variance inside it.")
        if rate is not None:
            rate = sampling_rate(rate)
        if num_samples is not None:
            num_samples = integer("num_samples", num_samples, int(tau[-1]))
        level = confidence(level)
        require_si(unit)
        values = (arrays["variance"], arrays["ci_low"], arrays["ci_high"])
        return cls(tau, *values, num_samples, level, rate, channels=(name or "x",), units=(unit,), name=name)

    @property
    def num_scales(self) -> int:
        """Number of scales, J."""
        return self.scales.shape[0]

    @property
    def is_single(self) -> bool:
        """Whether this is one channel, with arrays of shape (J,)."""
        return self.variance.ndim == 1

    @property
    def has_theory(self) -> bool:
        """Whether its covariance is known: a MODWT at all scales 2, 4 ... 2^J of a record of known length."""
        dyadic = np.array_equal(self.scales, 2.0 ** np.arange(1, self.num_scales + 1))
        return self.num_samples is not None and self.method == "modwt" and dyadic

    def require_theory(self, what: str) -> int:
        """Return N, or raise a ValueError: `what` needs the covariance of this wavelet variance, which is not known."""
        if self.num_samples is None or not self.has_theory:
            raise ValueError(
                f"{what} need the covariance of the wavelet variance: the number of samples, all scales 2 .. 2^J, and "
                "the MODWT."
            )
        return self.num_samples

    @property
    def missing(self) -> str:
        """The number of missing samples in words; "" if none is missing."""
        if self.present is None:
            return ""
        counts = np.sum(~self.present, axis=0).ravel()
        lowest, highest = int(np.min(counts)), int(np.max(counts))
        share = f"{100 * highest / len(self.present):.3g} %"
        return f"{highest} missing, {share}" if lowest == highest else f"{lowest} to {highest} missing, up to {share}"

    @property
    def times(self) -> Float[np.ndarray, " J"]:
        """Spans in seconds (in samples where the rate is not known)."""
        return self.scales / (self.rate or 1.0)

    def __getitem__(self, channel: str | int) -> "WaveletVariance":
        """One channel, by name or number."""
        if isinstance(channel, str):
            if channel not in self.channels:
                raise KeyError(f"No channel {channel!r}; there are {', '.join(self.channels)}.")
            channel = self.channels.index(channel)
        columns = {k: getattr(self, k) for k in ("variance", "ci_low", "ci_high")}
        if not self.is_single:
            columns |= {} if self.present is None else {"present": self.present}
            columns = {k: np.ascontiguousarray(v[:, channel]) for k, v in columns.items()}
        return replace(self, **columns, channels=(self.channels[channel],), units=(self.units[channel],))

    def items(self) -> Iterable[tuple[str, "WaveletVariance"]]:
        """Iterate over pairs of channel name and its wavelet variance."""
        return ((name, self[i]) for i, name in enumerate(self.channels))

    def __repr__(self) -> str:
        """A table: a row a scale, a column a channel (with the interval if there is only one)."""
        time = "tau [s]" if self.rate else "tau [samples]"
        if self.is_single:
            head = [time, f"WV [({self.units[0]})^2]", f"{100 * self.level:g} % low", "high"]
            columns = np.column_stack([self.times, self.variance, self.ci_low, self.ci_high])
        else:
            head = [time, *(f"{c} [({u})^2]" for c, u in zip(self.channels, self.units, strict=True))]
            columns = np.column_stack([self.times, self.variance])
        what = self.name or ", ".join(self.channels)
        missing = f" ({self.missing})" if self.missing else ""
        samples = f", {self.num_samples} samples{missing}" if self.num_samples else ""
        rate = f" at {self.rate:g} Hz" if self.rate else ""
        table = format_table(head, [[number(x) for x in row] for row in columns], left=0)
        robust = f"Robust (efficiency {self.efficiency:g}) " if self.efficiency else ""
        return f"{robust}Haar wavelet variance of {what}{samples}{rate}\n{table}"


def wavelet_variance(
    record: Any,
    *,
    num_levels: int | None = None,
    method: str = "modwt",
    efficiency: float | None = None,
    gaps: str | None = None,
    level: float = 0.95,
    rate: float | None = None,
    unit: str = "1",
    scratch: str | os.PathLike | None = None,
) -> WaveletVariance:
    """Compute the Haar wavelet variance of a recording, with chi-square confidence intervals.

    Parameters
    ----------
    record
        A `Recording`; an array or list of shape (N,) or (N, C), `numpy.memmap` included, its masked samples taken as
        missing; or an iterator of one-dimensional blocks, which is one channel (several: a memory map, or one call
        each).
    num_levels
        J, by default floor(log2 N) - 1.
    method
        ``modwt`` (every coefficient) or ``dwt`` (every 2^j-th: less precise, but hardly correlated).
    efficiency
        None for the classic estimator, the mean of squares. A number between 0.5 and 0.99, usually 0.6, for the robust
        one of the MODWT, which gives outliers no weight and for it has, on clean data with independent coefficients,
        this efficiency. See `gmwm_jax.variance.robust`, and `compare_robust` for both side by side.
    gaps
        None: a missing sample (NaN, masked) is an error, unless the `Recording` allows gaps. ``pairs``: the MODWT's
        from all pairs of samples that are there, see `gmwm_jax.pairs`; unbiased as long as what is missing does not
        depend on the noise. Intervals widen as the gaps of this record ask for, but hold for noise that is white or
        has more power at long spans; else they are a bound.
    level
        Confidence of the intervals.
    rate, unit
        Sampling rate in Hz and SI unit (``rad/s``, ``m/s^2`` or ``1``) of a record that is not a `Recording` (which
        knows them).
    scratch
        A folder for temporary files, for records that are larger than memory: an iterable of blocks is spooled there
        (in the system's temporary folder if none is given), and so are the running sums.

    Returns
    -------
    WaveletVariance
        Arrays (J,) for one channel, (J, C) for several. With gaps, J is by default less where a lag below 2^J has no
        pair of samples, or a variance came out negative.

    Raises
    ------
    ValueError
        Too short, turned (more channels than samples), constant or coarsely quantised, masked, NaN or inf (the first is
        named), unknown method, a unit that is not SI; an efficiency not on offer, or for the DWT, or with
        gaps; gaps with the DWT, or that leave too little for the levels asked for; robust: coefficients
        of which half are zero, or that are too far from Gaussian to have a scale.
    TypeError
        A record of another kind.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> wv = gj.wavelet_variance(rec)
    >>> wv.scales[:3].tolist(), wv.times[:3].tolist()
    ([2.0, 4.0, 8.0], [0.02, 0.04, 0.08])
    """
    if method not in ("modwt", "dwt"):
        raise ValueError(f"method must be 'modwt' or 'dwt', and is {method!r}.")
    if efficiency is not None:
        biweight(efficiency)  # raises if it is not on offer
        if method != "modwt":
            raise ValueError("The robust wavelet variance is that of the MODWT: leave method out, or efficiency.")
    if isinstance(record, Recording) and record.gaps:
        gaps = "pairs"
    if gaps not in (None, "pairs"):
        raise ValueError(f"gaps is None (a missing sample is an error) or 'pairs', and is {gaps!r}.")
    if gaps and method != "modwt":
        raise ValueError("The wavelet variance by pairs is that of the MODWT: leave method out, or gaps.")
    if gaps and efficiency is not None:
        raise ValueError("The robust wavelet variance needs a complete record: leave efficiency out, or gaps.")
    require_si(unit)
    is_array = isinstance(record, Sequence) or hasattr(record, "__array__")
    if isinstance(record, (str, bytes, Mapping, Set)) or not (is_array or isinstance(record, Iterable)):
        raise TypeError(f"A record is a Recording, an array or an iterator of blocks, and no {type(record).__name__}.")
    if isinstance(record, Recording):
        data, channels, units, name = record.data, record.channels, record.units, record.name
        rate = agreed_rate(record.rate, rate)
        if record.num_channels == 1:
            data = data[:, 0]
    elif is_array:
        data = _as_array(record)
        if data.ndim not in (1, 2) or data.size == 0:
            raise ValueError(f"A record has the shape (N,) or (N, C) and is not empty; this one has {data.shape}.")
        if data.dtype.kind not in "fiu":
            raise ValueError(f"A record holds real numbers, and this one has the dtype {data.dtype}.")
        data = unmasked(data)
        num = 1 if data.ndim == 1 else data.shape[1]
        time_first(data.shape[0], num)
        channels = ("x",) if data.ndim == 1 else tuple(f"channel_{i}" for i in range(num))
        units, name = (unit,) * num, ""
        rate = None if rate is None else sampling_rate(rate)
    else:
        options = {"num_levels": num_levels, "method": method, "efficiency": efficiency, "gaps": gaps, "level": level}
        return _from_blocks(record, scratch, rate=rate, unit=unit, **options)

    num_samples = data.shape[0]
    if gaps and np.any(np.isnan(data)):
        present = ~np.isnan(data)
        nu, eta = variance_by_pairs(np.asarray(data, dtype=np.float64), channels, num_levels)
        low, high = interval_factors(eta, level)
        values = (scales(len(nu)), nu, nu * low, nu * high, num_samples, level, rate)
        return WaveletVariance(*values, tuple(channels), tuple(units), name, present=present)
    J = check_num_levels(num_samples, num_levels)
    matrix = data[:, None] if data.ndim == 1 else data
    columns = []
    for i, channel in enumerate(channels):
        x = matrix[:, i]
        if efficiency is not None:
            nu = robust_wavelet_variance(x, J, efficiency=efficiency, scratch=scratch, name=channel)
        elif method == "modwt":
            nu = host_wavelet_variance(x, J, scratch=scratch, name=channel)
        else:
            finite_record(np.asarray(x), channel)
            nu = np.asarray(haar_dwt_variance(as_float(x), J))
        _require_noise(nu, channel)
        columns.append(nu)
    nu = columns[0] if data.ndim == 1 else np.column_stack(columns)
    eta = degrees_of_freedom(num_samples, J, decimated=method == "dwt")
    low, high = interval_factors(eta if efficiency is None else eta / widening(efficiency, J), level)
    if nu.ndim == 2:
        low, high = low[:, None], high[:, None]
    values = (scales(J), nu, nu * low, nu * high, num_samples, level, rate)
    return WaveletVariance(*values, tuple(channels), tuple(units), name, method, efficiency)


def _as_array(record: Any) -> np.ndarray:
    if isinstance(record, (np.memmap, np.ma.MaskedArray)):
        return record
    try:
        return np.asarray(record)
    except ValueError as error:
        raise ValueError(f"The list is no array ({error}). Blocks of one channel are given as iter(blocks).") from None


def as_wavelet_variance(data: Any, caller: str) -> WaveletVariance:
    """Return a wavelet variance as it is and that of a recording; raise a TypeError for anything else."""
    if isinstance(data, Recording):
        return wavelet_variance(data)
    if not isinstance(data, WaveletVariance):
        raise TypeError(
            f"{caller}() takes a WaveletVariance or a Recording, not {type(data).__name__}; for an array, "
            f"call {caller}(wavelet_variance(array, rate=...), ...)."
        )
    return data


def _require_noise(nu: Float[np.ndarray, " J"], channel: str) -> None:
    """Raise if the wavelet variance vanishes at a scale, by chance or because nothing changes."""
    zero = nu <= 0
    if np.all(zero):
        raise ValueError(
            f"{channel} does not change: a constant or stuck channel has no noise to model. Check the column and the "
            "sensor."
        )
    if np.any(zero):
        empty = ", ".join(str(2 ** (j + 1)) for j in np.flatnonzero(zero))
        raise ValueError(
            f"{channel} changes, and yet its wavelet variance is zero at spans of {empty} samples: the samples are "
            "coarsely quantised, or repeat a pattern. Leave these scales out by num_levels=..., or take more samples. "
            "(The robust one is zero already where half of the coefficients are: then use the classic one.)"
        )


def _from_blocks(blocks: Iterable[np.ndarray], scratch: str | os.PathLike | None, **options: Any) -> WaveletVariance:
    """Spool the blocks to a scratch file and take the wavelet variance of its memory map."""
    with tempfile.TemporaryDirectory(dir=scratch) as folder:
        spooled = blocks_to_file(map(unmasked, blocks), os.path.join(folder, "record.f64"))
        result = wavelet_variance(spooled, scratch=folder, **options)
        del spooled
    return result
