"""A static recording: samples in SI with their rate, channel names and units.

This is the door through which data enters. The unit is stated by whoever made the record and is never guessed; it also
tells rates (``deg/s``, ``g``) from increments per sample (``deg``, ``m/s``), which are multiplied by the sampling rate.
"""

import operator
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, SupportsIndex

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import finite_record, present_samples, sampling_rate, time_first
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax._internal.typing import FloatLike, Names
from gmwm_jax.recordings.understood import Understood
from gmwm_jax.units import SI_SIGNALS, SignalUnit, signal_unit


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Drawable):
    """Samples of one or several sensors, taken together at one rate. Build it with `from_array`.

    Attributes
    ----------
    data
        Shape (N, C), in the SI unit of each channel. Stored channel by channel and read-only.
    rate
        Sampling rate in Hz.
    channels
        Names of the C channels. What precedes the last ``_`` is the group: ``gyro`` of ``gyro_x``.
    units
        SI unit of each channel: ``rad/s``, ``m/s^2`` or ``1``.
    name
        Of the recording, for tables and figures.
    gaps
        Does NaN mark missing samples? Else it is an error.
    understood
        Of one that was read from a file: the format, columns, units and time that were understood.

    Raises
    ------
    ValueError
        Fewer than two samples, more channels than samples, NaN (without `gaps`) or infinite samples, a channel that is
        constant or all missing, names or units that do not match the channels, or no positive rate.

    Examples
    --------
    >>> x = np.random.default_rng(0).normal(size=(500, 2))
    >>> rec = gj.Recording.from_array(x, rate=100.0, units="deg/s", channels=["gyro_x", "gyro_y"])
    >>> rec.duration, rec.units
    (5.0, ('rad/s', 'rad/s'))
    """

    data: Float64[np.ndarray, "samples channels"]
    rate: float
    channels: tuple[str, ...]
    units: tuple[str, ...]
    name: str = ""
    gaps: bool = False
    understood: Understood | None = None

    def __post_init__(self) -> None:
        _check_shape(self.data)
        sampling_rate(self.rate)
        _check_names(self.channels, self.num_channels)
        if len(self.units) != self.num_channels or not set(self.units) <= set(SI_SIGNALS):
            raise ValueError(
                f"Each of the {self.num_channels} channels has one of the units {', '.join(SI_SIGNALS)}, and they are "
                f"{self.units}: Recording.from_array converts others."
            )
        for name, samples in self.items():
            what = f"channel {name!r}"
            if self.gaps:
                present_samples(samples, what)
            else:
                finite_record(samples, what)
            first = samples[np.argmin(np.isnan(samples))]
            if np.nanmin(samples) == first == np.nanmax(samples):
                raise ValueError(
                    f"channel {name!r} is constant ({first:g} in all {len(samples)} samples): it has no noise to "
                    "model. The sensor was off, saturated or not connected; leave the channel out."
                )

    @classmethod
    def from_array(
        cls,
        data: Any,
        *,
        rate: FloatLike | None,
        units: str | Sequence[str] | Mapping[str, str] | None,
        channels: Names | None = None,
        name: str = "",
        gaps: bool = False,
    ) -> "Recording":
        """Make a recording from an array, converting to SI. The array is copied once and left as it is.

        Parameters
        ----------
        data
            Shape (N,) or (N, C): integers or floats of any size, time on axis 0.
        rate
            Sampling rate in Hz.
        units
            Unit of the samples: one for all channels, one per channel, or a mapping from channel or group to unit, as
            in ``{"gyro": "deg/s", "accel": "g"}``. Increments (``rad``, ``deg``, ``arcsec``, ``m/s``) become rates.
        channels
            Channel names; ``channel_0``, ``channel_1`` ... unless given.
        name
            Name of the recording.
        gaps
            Does NaN, or a mask, mark missing samples? Else they are an error.

        Raises
        ------
        ValueError
            See the class; and a unit that is missing, unknown or no sensor signal, or data that are no real numbers.
        """
        samples = _as_columns(data)
        _check_shape(samples)
        count = samples.shape[1]
        if channels is None:
            channels = [f"channel_{i}" for i in range(count)]
        names = (channels,) if isinstance(channels, str) else tuple(channels)
        _check_names(names, count)
        f = sampling_rate(rate)
        signals = _signals(units, names)
        samples *= np.array([s.factor * (f if s.increments else 1.0) for s in signals])
        samples.flags.writeable = False
        return cls(samples, f, names, tuple(s.si for s in signals), name, gaps)

    @property
    def num_channels(self) -> int:
        """Number of channels."""
        return self.data.shape[1]

    @property
    def duration(self) -> float:
        """Length in seconds: N / rate."""
        return len(self) / self.rate

    @property
    def num_missing(self) -> dict[str, int]:
        """Missing samples of each channel."""
        return {name: int(np.sum(np.isnan(x))) if self.gaps else 0 for name, x in self.items()}

    def time(self) -> Float64[np.ndarray, " samples"]:
        """Time of each sample in seconds, from 0."""
        return np.arange(len(self)) / self.rate

    def column(self, name: str | SupportsIndex) -> Float64[np.ndarray, " samples"]:
        """Return the samples of one channel, shape (N,), contiguous and read-only.

        Raises
        ------
        KeyError
            No channel has this name.
        """
        positions = self._positions(name)
        if len(positions) > 1:
            raise KeyError(f"{name!r} is a group of {len(positions)} channels; one of: {', '.join(self.channels)}")
        return self.data[:, positions[0]]

    def items(self) -> Iterator[tuple[str, Float64[np.ndarray, " samples"]]]:
        """Iterate over (channel name, samples of shape (N,))."""
        return ((name, self.data[:, i]) for i, name in enumerate(self.channels))

    def __getitem__(self, key: str | SupportsIndex | Sequence[str | SupportsIndex]) -> "Recording":
        """Select channels by name, group, position, or a list of these.

        Raises
        ------
        KeyError
            No channel or group has this name.
        IndexError
            No channel at this position.
        """
        keys = [key] if isinstance(key, (str, SupportsIndex)) else key
        positions = [position for k in keys for position in self._positions(k)]
        if not positions:
            raise KeyError(f"no channel is asked for; the channels are: {', '.join(self.channels)}")
        neighbours = range(positions[0], positions[-1] + 1)
        if positions == list(neighbours):  # a view, no copy
            data = self.data[:, neighbours.start : neighbours.stop]
        else:
            data = np.asfortranarray(self.data[:, positions])
            data.flags.writeable = False
        return replace(
            self,
            data=data,
            channels=tuple(self.channels[i] for i in positions),
            units=tuple(self.units[i] for i in positions),
        )

    def _positions(self, key: str | SupportsIndex) -> list[int]:
        """Return the column numbers of a channel, a group or a position."""
        if not isinstance(key, str):
            return [range(self.num_channels)[operator.index(key)]]
        if key in self.channels:
            return [self.channels.index(key)]
        members = [i for i, name in enumerate(self.channels) if _group(name) == key]
        if not members:
            raise KeyError(f"no channel or group {key!r}; the channels are: {', '.join(self.channels)}")
        return members

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.data, dtype=dtype, copy=copy)

    def __len__(self) -> int:
        return len(self.data)

    def __iter__(self) -> Iterator[str]:
        return iter(self.channels)

    def __repr__(self) -> str:
        head = ["channel", "unit", "mean", "std"]
        pairs = zip(self.items(), self.units, strict=True)
        rows = [
            [name, unit, number(float(np.nanmean(x)), 6), number(float(np.nanstd(x)), 6)] for (name, x), unit in pairs
        ]
        if self.gaps:
            head.append("missing")
            rows = [[*row, str(count)] for row, count in zip(rows, self.num_missing.values(), strict=True)]
        title = f"Recording {self.name!r}" if self.name else "Recording"
        what = f"{len(self)} samples at {self.rate:g} Hz, {self.duration:g} s"
        read = [] if self.understood is None else [self.understood.in_short()]
        return "\n".join([f"{title}: {what}", format_table(head, rows, left=2), *read])


def _group(name: str) -> str:
    return name.rpartition("_")[0]


def _as_columns(data: Any) -> np.ndarray:
    """Copy data to float64 columns, each contiguous in memory since every analysis goes channel by channel."""
    seen = data if isinstance(data, np.ma.MaskedArray) else np.asarray(data)
    if seen.dtype.kind not in "iuf":
        raise ValueError(
            f"A recording holds real numbers, and the data are of dtype {seen.dtype}. Select the numeric columns, and "
            "convert them with .astype(float) if they are numbers written as text or objects."
        )
    if seen.ndim not in (1, 2):
        raise ValueError(f"A recording has the shape (N,) or (N, C), time on axis 0, and the data have {seen.shape}.")
    copy = np.array(seen, dtype=np.float64, order="F")
    copy[np.ma.getmask(seen)] = np.nan  # masked samples are missing: the check for NaN names them
    return copy if copy.ndim == 2 else copy[:, None]


def _check_shape(data: np.ndarray) -> None:
    samples, channels = data.shape
    if not data.size:
        raise ValueError(f"The recording is empty: its shape is {data.shape}.")
    if samples < 2:
        raise ValueError(f"The recording has one sample (shape {data.shape}): noise shows only in a series of them.")
    time_first(samples, channels)


def _check_names(names: tuple[str, ...], count: int) -> None:
    if len(names) != count:
        raise ValueError(f"{len(names)} channel names ({', '.join(names)}) were given for {count} channels.")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"Channel names must differ, and these occur twice: {', '.join(twice)}.")


def _signals(units: str | Sequence[str] | Mapping[str, str] | None, names: tuple[str, ...]) -> list[SignalUnit]:
    """Return the unit of each channel."""
    if units is None:
        raise ValueError(
            'The unit of the samples is missing: give units=..., one unit or as in {"gyro": "deg/s", "accel": "g"}. It '
            "is never guessed, and it tells rates (rad/s, deg/s, deg/h, m/s^2, g, mg, ug) from increments per sample "
            '(rad, deg, arcsec, m/s), which are multiplied by the rate. "1" leaves samples of another kind as they are.'
        )
    if isinstance(units, str):
        return [signal_unit(units)] * len(names)
    if isinstance(units, Mapping):
        return [signal_unit(unit) for unit in _from_mapping(units, names)]
    if len(units) != len(names):
        raise ValueError(f"{len(units)} units ({', '.join(units)}) were given for {len(names)} channels.")
    return [signal_unit(unit) for unit in units]


def _from_mapping(units: Mapping[str, str], names: tuple[str, ...]) -> list[str]:
    """Look up each channel by its name, else by its group; every channel and every key must find its partner."""
    keys = [name if name in units else _group(name) for name in names]
    bare = [name for name, key in zip(names, keys, strict=True) if key not in units]
    if bare:
        raise ValueError(f"No unit is given for: {', '.join(bare)}. The keys of units are: {', '.join(units)}.")
    unused = [key for key in units if key not in keys]
    if unused:
        raise ValueError(f"units names {', '.join(unused)}, and the channels are: {', '.join(names)}.")
    return [units[key] for key in keys]
