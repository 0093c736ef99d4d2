"""The empirical wavelet variance of recordings: one object for one or several channels."""

import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, fields
from typing import Any, overload

import numpy as np
from jaxtyping import Bool, Float

from gmwm_jax._internal.checks import (
    agreed_rate,
    confidence,
    integer,
    positive,
    sampling_rate,
    spans,
    time_first,
    unmasked,
)
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.labelled import UNIT_OF_CHANNEL, Arrays, Labelled, Values
from gmwm_jax._internal.pytrees import pytree
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax._internal.typing import Numbers
from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.datasheet import Datasheet
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.units import require_si
from gmwm_jax.variance.bands import LOCAL, WEIGHTS, Bands
from gmwm_jax.variance.blocked import blocks_to_file
from gmwm_jax.variance.estimator import METHODS, AbstractEstimator, as_estimator, from_shorthands
from gmwm_jax.variance.haar import interval_factors, scales
from gmwm_jax.variance.robust import error_of_log_ratio

_INTERVALS = ("ci_low", "ci_high")
_ARRAYS = ("variance", *_INTERVALS, "present", "classic")
"""What transformations see of a wavelet variance; its scales are static."""
_FAR, _SURE = 4.0, 4.0
"""By which factor, and how many standard errors of a clean record, a robust variance is far below the classic one."""


def _check(wv: "AbstractWaveletVariance") -> None:
    """Raise a ValueError for what no record has, in a file."""
    spans(wv.scales)
    positive("variance", wv.variance)
    num = 1 if wv.variance.ndim == 1 else wv.variance.shape[1]
    if len(wv.channels) != num or len(wv.units) != num:
        raise ValueError(f"It has {num} channels, the names {wv.channels} and the units {wv.units}.")
    for unit in wv.units:
        require_si(unit)


@dataclass(frozen=True, repr=False)
class AbstractWaveletVariance(Drawable, Saved, Labelled):
    """What the wavelet variances of one channel and of several have in common.

    Attributes
    ----------
    scales
        tau_j, spans of the filters in samples, shape (J,). The averaging time of the Allan variance is half of it.
    variance, ci_low, ci_high
        nu_j^2 and an interval, in squared `units`: the one that weights of fits are from, which is wider than its
        level says. `bands` has those of the nominal level.
    num_samples
        N, or None where only published values are known: without it there is no covariance and no standard error.
    level
        Confidence of the intervals.
    rate
        Hz, or None if not stated (times are then in samples).
    channels, units
        Name and SI unit of each channel.
    """

    scales: Float[np.ndarray, " J"]
    variance: Float[Numbers, "J *C"]
    ci_low: Float[Numbers, "J *C"]
    ci_high: Float[Numbers, "J *C"]
    num_samples: int | None = None
    level: float = 0.95
    rate: float | None = None
    channels: tuple[str, ...] = ("x",)
    units: tuple[str, ...] = ("1",)
    name: str = ""
    estimator: AbstractEstimator = METHODS["modwt"]
    """How it was estimated."""
    present: Bool[np.ndarray, "N *C"] | None = None
    """False where a sample is missing, see `gmwm_jax.variance.gaps`; None for a complete record."""
    classic: Float[np.ndarray, "J *C"] | None = None
    """The classic wavelet variance of the same record, beside a robust one."""

    @property
    def num_scales(self) -> int:
        """Number of scales, J."""
        return self.scales.shape[0]

    @property
    def efficiency(self) -> float | None:
        """Of the robust estimator on clean data; None for another estimator."""
        return self.estimator.efficiency

    @property
    def has_theory(self) -> bool:
        """Whether its covariance is known: a MODWT at all scales 2, 4 ... 2^J of a record of known length."""
        dyadic = np.array_equal(self.scales, 2.0 ** np.arange(1, self.num_scales + 1))
        return self.num_samples is not None and self.estimator.has_theory and dyadic

    def require_theory(self, what: str) -> int:
        """Return N, or raise a ValueError: `what` needs the covariance of this wavelet variance, which is not known."""
        if self.num_samples is None or not self.has_theory:
            raise ValueError(
                f"{what} need the covariance of the wavelet variance: the number of samples, all scales 2 .. 2^J, and "
                "the MODWT."
            )
        return self.num_samples

    def covariance_under(self, model: Composite) -> Float[np.ndarray, "J J"] | None:
        """Covariance of the wavelet variance of one channel under a model; None where there is no theory for it.

        Parameters
        ----------
        model
            All parameters given; SIN is not ergodic and has no theory, nor has a process of one's own whose class does
            not determine a covariance.
        """
        if not all(p.ergodic and p.determines_covariance for p in model.processes):
            return None
        num_samples = self.num_samples if self.has_theory else None
        return self.estimator.covariance(model, num_samples, self.num_scales, self.present)

    def bands(self, model: Composite | None = None, *, level: float | None = None) -> Bands:
        """Return the intervals that hold the truth as often as they say.

        ``ci_low`` and ``ci_high``, from which fits take their weights, have the same degrees of freedom for every noise
        and hold it in 98 to 100 % where 95 % is said.

        Parameters
        ----------
        model
            Of one channel: a fitted model, whose exact covariance gives the degrees of freedom. By default they are
            those of the power law that each scale has with its neighbours.
        level
            Confidence, by default that of this wavelet variance.

        Raises
        ------
        ValueError
            No number of samples, the DWT, missing samples without a model, a model without theory, or one for several
            channels.

        Examples
        --------
        >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
        >>> bool(np.all(wv.bands().high < wv.ci_high))
        True
        """
        level = self.level if level is None else level
        if model is None:
            dof = self._local_dof
            if dof is None:
                raise ValueError(
                    "Intervals at their nominal level need the number of samples, the MODWT, and a complete record or "
                    "a model of one channel: wv.bands(fit.model)."
                )
            return Bands.of(self.variance, dof, level, LOCAL)
        if self.variance.ndim > 1:
            raise ValueError(f"A model belongs to one channel: choose it, as in wv[{self.channels[0]!r}].bands(...).")
        V = self.covariance_under(model)
        if V is None:
            raise ValueError(
                "Intervals under a model need its theory: the number of samples, all scales 2 .. 2^J, the MODWT, and "
                "no SIN."
            )
        dof = 2 * np.asarray(model.wavelet_variance(self.scales)) ** 2 / np.diag(V)
        return Bands.of(self.variance, dof, level, " + ".join(p.kind for p in model.processes))

    @property
    def _local_dof(self) -> Float[np.ndarray, "J *C"] | None:
        if self.num_samples is None or not self.estimator.overlaps:
            return None
        return self.estimator.local_dof(self.variance, self.num_samples, self.scales, self.present)

    @property
    def shown(self) -> Bands:
        """What prints and figures show: `bands` where they are known, else the intervals of the weights."""
        if self._local_dof is not None:
            return self.bands()
        unknown = np.full_like(self.variance, np.nan)
        return Bands(self.ci_low, self.ci_high, unknown, self.level, WEIGHTS)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence for each channel whose robust variance lies far below the classic one, beyond chance."""
        if self.classic is None or self.efficiency is None or self.num_samples is None:
            return ()
        num, J = self.variance.reshape(self.num_scales, -1).shape[1], self.num_scales
        ratio = (np.asarray(self.classic) / np.asarray(self.variance)).reshape(J, num)
        error = error_of_log_ratio(self.efficiency, self.num_samples, J)
        far = (ratio > _FAR) & (np.log(ratio) > _SURE * error[:, None])
        unit = "s" if self.rate else "samples"
        found = []
        for i in np.flatnonzero(np.any(far, axis=0)):
            j = int(np.argmax(np.where(far[:, i], ratio[:, i], 0.0)))
            found.append(
                f"the robust wavelet variance of {self.channels[i]} is {ratio[j, i]:.3g} times below the classic one "
                f"at a span of {self.times[j]:.4g} {unit}: either most of that variance is outliers', or few degrees "
                "of freedom have misled it, and fits would believe it. See gmwm_jax.variance.compare_robust"
            )
        return tuple(found)

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
        known = {f.name: getattr(self, f.name) for f in fields(self)}
        columns = {k: known[k] for k in ("variance", "ci_low", "ci_high", "present", "classic") if known[k] is not None}
        if self.variance.ndim > 1:
            known |= {k: np.ascontiguousarray(v[:, channel]) for k, v in columns.items()}
        return WaveletVariance(**{**known, "channels": (self.channels[channel],), "units": (self.units[channel],)})

    def items(self) -> Iterable[tuple[str, "WaveletVariance"]]:
        """Iterate over pairs of channel name and its wavelet variance."""
        return ((name, self[i]) for i, name in enumerate(self.channels))

    def _arrays(self) -> Arrays:
        """A row a scale, and of several channels a row a scale and channel."""
        several = self.variance.ndim > 1
        dims, of = (("scale", "channel"), "channel") if several else (("scale",), ())
        unit = UNIT_OF_CHANNEL if several else f"({self.units[0]})^2"
        names, units = (self.channels, self.units) if several else (self.channels[0], self.units[0])
        values = {name: Values(dims, getattr(self, name), unit) for name in ("variance", "ci_low", "ci_high")}
        shown = self.shown
        low, high = (v if shown.nominal else np.full_like(v, np.nan) for v in (shown.low, shown.high))
        values |= {"nominal_low": Values(dims, low, unit), "nominal_high": Values(dims, high, unit)}
        values["dof"] = Values(dims, shown.dof)
        coordinates = {
            "scale": Values("scale", self.scales, "samples"),
            "time": Values("scale", self.times, "s" if self.rate else "samples"),
            "channel": Values(of, names),
            "unit": Values(of, units),
        }
        known = {"rate": self.rate, "num_samples": self.num_samples, "level": self.level, "name": self.name}
        attributes = {k: v for k, v in known.items() if v} | {"estimator": self.estimator.name}
        return Arrays(values, coordinates, attributes, dims)

    def plot(self, *, datasheet: Datasheet | None = None, axes: GivenAxes | None = None) -> Figure:
        """Draw wavelet variances over scale with their intervals, a frame for each unit.

        Parameters
        ----------
        datasheet
            A model of what the datasheet promises, drawn as a line; by unit if there are several:
            ``{"rad/s": ..., "m/s^2": ...}``.
        axes
            An Axes for each unit to draw into; a new figure if left out.

        Returns
        -------
        Figure
            See `gmwm_jax.plotting.plot_wavelet_variance`.
        """
        return self._draw(datasheet=datasheet, axes=axes)

    def __repr__(self) -> str:
        """A table: a row a scale, a column a channel (with the interval if there is only one)."""
        time = "tau [s]" if self.rate else "tau [samples]"
        if self.variance.ndim == 1:
            shown = self.shown
            head = [time, f"WV [({self.units[0]})^2]", f"{100 * self.level:g} % low", "high", "dof"]
            columns = np.column_stack([self.times, self.variance, shown.low, shown.high, shown.dof])
            foot = shown.remark
        else:
            head = [time, *(f"{c} [({u})^2]" for c, u in zip(self.channels, self.units, strict=True))]
            columns, foot = np.column_stack([self.times, self.variance]), ""
        what = self.name or ", ".join(self.channels)
        missing = f" ({self.missing})" if self.missing else ""
        samples = f", {self.num_samples} samples{missing}" if self.num_samples else ""
        rate = f" at {self.rate:g} Hz" if self.rate else ""
        table = format_table(head, [[number(x) for x in row] for row in columns], left=0)
        foot += "".join(f"\nwarning: {text}" for text in self.warnings)
        return f"{self.estimator.title}Haar wavelet variance of {what}{samples}{rate}\n{table}{foot}"


@pytree(*_ARRAYS)
@saved(not_finite=_INTERVALS, added=("classic",), check=_check)
@dataclass(frozen=True, repr=False)
class WaveletVariance(AbstractWaveletVariance):
    """The Haar wavelet variance of one channel, in arrays of shape (J,), or of C channels, (J, C)."""

    def __post_init__(self) -> None:
        if np.ndim(self.variance) > 1:
            raise ValueError(f"Arrays {np.shape(self.variance)} of several channels make a WaveletVariances.")

    @overload
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
    ) -> "WaveletVariance": ...
    @overload
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
        unit: str | Sequence[str] = "1",
        name: str = "",
        channels: Sequence[str],
    ) -> "WaveletVariances": ...
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
        unit: str | Sequence[str] = "1",
        name: str = "",
        channels: Sequence[str] | None = None,
    ) -> "WaveletVariance | WaveletVariances":
        """Build a wavelet variance from published values.

        Parameters
        ----------
        scales
            Spans tau = 2, 4, 8 ... in *samples* (multiply by the rate if the table has seconds).
        variance, ci_low, ci_high
            Haar MODWT wavelet variance, half the Allan variance at tau/2, and the ends of its interval: shape (J,), or
            (J, C) with the names of C channels.
        num_samples
            Length of the record, needed for standard errors; at least the longest span.
        level
            Confidence of the interval.
        rate, unit
            Sampling rate in Hz and SI unit of the signal (``rad/s``, ``m/s^2`` or ``1``), one a channel if they differ.
        name
            Of the table.
        channels
            Names of the columns.

        Returns
        -------
        WaveletVariance, or WaveletVariances where channels are named.

        Raises
        ------
        ValueError
            Different shapes, spans that are not even numbers of samples in increasing order, variances that are
            negative, zero or not finite, an interval that does not hold its variance, a record shorter than a span, a
            level outside 0 to 1, another unit, other numbers of names and units than columns.

        Examples
        --------
        >>> both = gj.variance.WaveletVariance.from_table(
        ...     [2, 4],
        ...     variance=[[1.0, 3.0], [0.5, 1.5]],
        ...     ci_low=[[0.9, 2.7], [0.4, 1.2]],
        ...     ci_high=[[1.1, 3.3], [0.6, 1.8]],
        ...     channels=["x", "y"],
        ... )
        >>> both["y"].variance.tolist()
        [3.0, 1.5]
        """
        columns = {"variance": variance, "ci_low": ci_low, "ci_high": ci_high}
        tau = np.asarray(scales, dtype=np.float64)
        arrays = {k: np.asarray(v, dtype=np.float64) for k, v in columns.items()}
        shapes = {"scales": tau.shape} | {k: a.shape for k, a in arrays.items()}
        expected = tau.shape if channels is None else (*tau.shape, len(channels))
        if tau.ndim != 1 or not tau.size or any(a.shape != expected for a in arrays.values()):
            several = "" if channels is None else f", with a column for each of {', '.join(channels)}"
            raise ValueError(
                f"scales, variance, ci_low and ci_high must be equally long lists{several}; they are {shapes}."
                + (" Name the columns: channels=[...]." if channels is None and len(shapes["variance"]) == 2 else "")
            )
        for k, a in ({"scales": tau} | arrays).items():
            if not np.all(np.isfinite(a)):
                first = np.unravel_index(np.argmin(np.isfinite(a)), a.shape)
                raise ValueError(f"{k} must be finite, and is {a[first]} at {', '.join(map(str, first))}.")
        spans(tau)
        if np.any(np.diff(tau) <= 0):
            raise ValueError(f"scales must be in increasing order, and are {tau}.")
        positive("variance", arrays["variance"])
        positive("ci_low", arrays["ci_low"], zero_ok=True)
        outside = ~((arrays["ci_low"] < arrays["variance"]) & (arrays["variance"] < arrays["ci_high"]))
        if np.any(outside):
            raise ValueError(
                f"The interval at scale {tau[np.argwhere(outside)[0][0]]:g} does not hold its variance inside it."
            )
        if rate is not None:
            rate = sampling_rate(rate)
        if num_samples is not None:
            num_samples = integer("num_samples", num_samples, int(tau[-1]))
        level = confidence(level)
        names = (name or "x",) if channels is None else tuple(channels)
        units = (unit,) * len(names) if isinstance(unit, str) else tuple(unit)
        if len(units) != len(names):
            raise ValueError(f"There are the channels {', '.join(names)} and the units {', '.join(units)}.")
        for one in units:
            require_si(one)
        kind = WaveletVariance if channels is None else WaveletVariances
        values = (arrays["variance"], arrays["ci_low"], arrays["ci_high"])
        return kind(tau, *values, num_samples, level, rate, channels=names, units=units, name=name)


@pytree(*_ARRAYS)
@saved(not_finite=_INTERVALS, added=("classic",), check=_check)
@dataclass(frozen=True, repr=False)
class WaveletVariances(AbstractWaveletVariance):
    """Haar wavelet variances of C channels, arrays of shape (J, C); ``wv["gyro_x"]`` is that of one."""

    def __post_init__(self) -> None:
        if np.ndim(self.variance) != 2:
            raise ValueError(f"Arrays {np.shape(self.variance)} of one channel make a WaveletVariance.")


def wavelet_variance(
    record: Any,
    *,
    estimator: AbstractEstimator | str | None = None,
    num_levels: int | None = None,
    method: str = "modwt",
    efficiency: float | None = None,
    gaps: str | None = None,
    level: float = 0.95,
    rate: float | None = None,
    unit: str = "1",
    scratch: str | os.PathLike | None = None,
) -> WaveletVariance | WaveletVariances:
    """Compute the Haar wavelet variance of a recording, with chi-square confidence intervals.

    Parameters
    ----------
    record
        A `Recording`; an array or list of shape (N,) or (N, C), `numpy.memmap` included, its masked samples taken as
        missing; or an iterator of one-dimensional blocks, which is one channel (several: a memory map, or one call
        each).
    estimator
        An object such as ``gj.variance.Robust(0.6)``: `Modwt` (the default), `Dwt`, `Robust` or `Pairs` of
        `gmwm_jax.variance`, or one of the texts ``modwt``, ``dwt``, ``robust``, ``pairs``. A `Recording` that allows
        gaps takes `Pairs` in place of the default.
    num_levels
        J, by default floor(log2 N) - 1.
    method
        Shorthand for two estimators: ``modwt`` (every coefficient) or ``dwt`` (every 2^j-th: less precise, but hardly
        correlated).
    efficiency
        Shorthand for ``Robust(efficiency)``: a number between 0.5 and 0.99, usually 0.6. The robust estimator gives
        outliers no weight and for it has, on clean data with independent coefficients, this efficiency. See
        `gmwm_jax.variance.robust`, and `compare_robust` for both side by side.
    gaps
        Shorthand: ``pairs`` for ``Pairs()``, the MODWT's from all pairs of samples that are there (see
        `gmwm_jax.variance.gaps`); unbiased as long as what is missing does not depend on the noise. Intervals widen as
        the gaps of this record ask for, but hold for noise that is white or has more power at long spans; else they are
        a bound. With other estimators a missing sample (NaN, masked) is an error.
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
    WaveletVariance or WaveletVariances
        The first for one channel, with arrays (J,); the other for several, with arrays (J, C). With gaps, J is by
        default less where a lag below 2^J has no pair of samples, or a variance came out negative.

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
    if estimator is not None and (method, efficiency, gaps) != ("modwt", None, None):
        raise ValueError("Give the estimator as an object, or by the shorthands method, efficiency, gaps: not by both.")
    if isinstance(record, Recording) and record.gaps and estimator is None:
        gaps = "pairs"
    chosen = from_shorthands(method, efficiency, gaps) if estimator is None else as_estimator(estimator)
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
        options = {"num_levels": num_levels, "estimator": chosen, "level": level}
        return _from_blocks(record, scratch, rate=rate, unit=unit, **options)

    if chosen.bears_gaps and not np.any(np.isnan(data)):
        chosen = chosen.of_complete
    nu, dof, present, classic = chosen.estimate(data, channels, num_levels, scratch=scratch)
    low, high = interval_factors(dof, level)
    if low.ndim < nu.ndim:
        low, high = low[:, None], high[:, None]
    values = (scales(len(nu)), nu, nu * low, nu * high, data.shape[0], level, rate)
    several = WaveletVariance if nu.ndim == 1 else WaveletVariances
    return several(*values, tuple(channels), tuple(units), name, chosen, present, classic)


def _as_array(record: Any) -> np.ndarray:
    if isinstance(record, (np.memmap, np.ma.MaskedArray)):
        return record
    try:
        return np.asarray(record)
    except ValueError as error:
        raise ValueError(f"The list is no array ({error}). Blocks of one channel are given as iter(blocks).") from None


def as_wavelet_variance(data: Any, caller: str) -> WaveletVariance | WaveletVariances:
    """Return a wavelet variance as it is and that of a recording; raise a TypeError for anything else."""
    if isinstance(data, Recording):
        return wavelet_variance(data)
    if not isinstance(data, WaveletVariance | WaveletVariances):
        raise TypeError(
            f"{caller}() takes a WaveletVariance or a Recording, not {type(data).__name__}; for an array, "
            f"call {caller}(wavelet_variance(array, rate=...), ...)."
        )
    return data


def _from_blocks(
    blocks: Iterable[np.ndarray], scratch: str | os.PathLike | None, **options: Any
) -> WaveletVariance | WaveletVariances:
    """Spool the blocks to a scratch file and take the wavelet variance of its memory map."""
    with tempfile.TemporaryDirectory(dir=scratch) as folder:
        spooled = blocks_to_file(map(unmasked, blocks), os.path.join(folder, "record.f64"))
        result = wavelet_variance(spooled, scratch=folder, **options)
        del spooled
    return result
