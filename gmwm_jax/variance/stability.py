"""Modified Allan and Hadamard deviations, overlapping, with intervals at their nominal level.

With x the phase, the running sum of the samples over the rate (Riley & Howe 2008, NIST Special Publication 1065):

* the modified Allan variance averages second differences of the phase over m of them, and so tells white noise of the
  phase (quantisation: slope -3) from flicker noise of the phase;
* the Hadamard variance is of third differences, so that a drift of the samples, R t, is not in it.

Degrees of freedom are those of the power law that each scale has with its neighbours, see
`gmwm_jax.variance.power_law`.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.checks import agreed_rate, confidence, finite_record, sampling_rate, time_first, unmasked
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.units import require_si
from gmwm_jax.variance.bands import LOCAL, Bands
from gmwm_jax.variance.power_law import HADAMARD, MODIFIED_ALLAN, Statistic, local_degrees_of_freedom


@saved(not_finite=("ci_low", "ci_high"))
@dataclass(frozen=True, repr=False)
class StabilityDeviation(Drawable, Saved):
    """A deviation over averaging time, in arrays (J,) for one channel and (J, C) for several.

    Attributes
    ----------
    kind
        ``modified Allan`` or ``Hadamard``.
    times
        Averaging times m/f in seconds, m = 1, 2, 4 ...
    deviation, ci_low, ci_high
        And its interval, at its nominal level, in signal units.
    dof
        Degrees of freedom of the variance.
    level
        Confidence of the interval.
    rate
        Hz.
    num_samples
        N.
    channels, units
        Name and SI unit of each channel.
    name
        Of the recording.
    """

    kind: str
    times: Float[np.ndarray, " J"]
    deviation: Float[np.ndarray, "J *C"]
    ci_low: Float[np.ndarray, "J *C"]
    ci_high: Float[np.ndarray, "J *C"]
    dof: Float[np.ndarray, "J *C"]
    level: float
    rate: float
    num_samples: int
    channels: tuple[str, ...]
    units: tuple[str, ...]
    name: str = ""

    def __getitem__(self, channel: str | int) -> "StabilityDeviation":
        """One channel, by name or number."""
        if isinstance(channel, str):
            if channel not in self.channels:
                raise KeyError(f"No channel {channel!r}; there are {', '.join(self.channels)}.")
            channel = self.channels.index(channel)
        names = ("deviation", "ci_low", "ci_high", "dof")
        columns: dict[str, Any] = {k: getattr(self, k).reshape(len(self.times), -1)[:, channel] for k in names}
        return replace(self, **columns, channels=(self.channels[channel],), units=(self.units[channel],))

    @property
    def shown(self) -> Bands:
        """Its interval, with its degrees of freedom and where they are from."""
        return Bands(self.ci_low, self.ci_high, self.dof, self.level, LOCAL)

    def __repr__(self) -> str:
        """A row a time, a column a channel (with the interval if there is only one)."""
        head = ["T [s]", *(f"{c} [{u}]" for c, u in zip(self.channels, self.units, strict=True))]
        columns = [self.times[:, None], self.deviation.reshape(len(self.times), -1)]
        if len(self.channels) == 1:
            head += [f"{100 * self.level:g} % low", "high", "dof"]
            columns += [v.reshape(-1, 1) for v in (self.ci_low, self.ci_high, self.dof)]
        rows = [[number(x) for x in row] for row in np.hstack(columns)]
        foot = f"\nintervals at their nominal level, dof of the {LOCAL}" * (len(self.channels) == 1)
        title = f"Overlapping {self.kind} deviation at {self.rate:g} Hz"
        return f"{title}\n{format_table(head, rows, left=0)}{foot}"


def modified_allan_deviation(
    record: Any, *, rate: float | None = None, level: float = 0.95, unit: str = "1"
) -> StabilityDeviation:
    """Compute the modified Allan deviation with confidence intervals.

    Parameters
    ----------
    record
        A `Recording`, or an array of shape (N,) or (N, C): rates, as gyroscopes and accelerometers have them
        (frequency, for clocks), without missing samples.
    rate
        Sampling rate in Hz where the data do not know theirs.
    level
        Confidence of the intervals.
    unit
        SI unit of an array.

    Returns
    -------
    StabilityDeviation
        At averaging times of 1, 2, 4 .. samples, up to a quarter of the record.

    Raises
    ------
    ValueError
        Fewer than 8 samples, missing ones, no rate, a unit that is not SI.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> gj.variance.modified_allan_deviation(rec).times[:3].tolist()
    [0.01, 0.02, 0.04]
    """
    return _deviation("modified Allan", MODIFIED_ALLAN, _modified, record, rate, level, unit)


def hadamard_deviation(
    record: Any, *, rate: float | None = None, level: float = 0.95, unit: str = "1"
) -> StabilityDeviation:
    """Compute the overlapping Hadamard deviation with confidence intervals.

    A linear drift of the samples is not in it. Parameters, what is returned and what is raised are those of
    `modified_allan_deviation`.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> gj.variance.hadamard_deviation(rec).times[:3].tolist()
    [0.01, 0.02, 0.04]
    """
    return _deviation("Hadamard", HADAMARD, _hadamard, record, rate, level, unit)


def _deviation(
    kind: str, statistic: Statistic, of: Any, record: Any, rate: float | None, level: float, unit: str
) -> StabilityDeviation:
    level = confidence(level)
    if isinstance(record, Recording):
        rate = agreed_rate(record.rate, rate)
        data, channels, units, name = record.data, record.channels, record.units, record.name
    else:
        require_si(unit)
        data = np.asarray(unmasked(record))
        if data.ndim not in (1, 2) or data.dtype.kind not in "fiu":
            raise ValueError(f"A record holds real numbers in the shape (N,) or (N, C); this one has {data.shape}.")
        data = data.reshape(len(data), -1)
        time_first(*data.shape)
        several = data.shape[1] > 1
        channels = tuple(f"channel_{i}" for i in range(data.shape[1])) if several else ("x",)
        units, name = (unit,) * len(channels), ""
    f, N = sampling_rate(rate), len(data)
    if N < 8:
        raise ValueError(f"A {kind} deviation needs at least 8 samples, and the record has {N}.")
    m = 2 ** np.arange(N.bit_length() - 2)
    columns = []
    for i, channel in enumerate(channels):
        x = np.asarray(data[:, i], dtype=np.float64)
        finite_record(x, channel)
        # a constant changes no difference, and without it the sums stay small
        phase = np.concatenate([[0.0], np.cumsum(x - np.mean(x))])
        columns.append([of(phase, int(n)) for n in m])
        if not np.all(np.array(columns[-1]) > 0):
            raise ValueError(f"{channel} has a {kind} variance of zero: it does not change, or is coarsely quantised.")
    variance = np.array(columns).T
    band = Bands.of(variance, local_degrees_of_freedom(statistic, N, m.astype(float), variance), level, LOCAL)
    all_channels = StabilityDeviation(
        kind,
        m / f,
        np.sqrt(variance),
        np.sqrt(band.low),
        np.sqrt(band.high),
        band.dof,
        level,
        f,
        N,
        tuple(channels),
        tuple(units),
        name,
    )
    return all_channels[0] if len(channels) == 1 else all_channels


def _modified(phase: Float[np.ndarray, " M"], m: int) -> float:
    """Mean square of the sums of m second differences, over 2 m^4."""
    second = phase[2 * m :] - 2 * phase[m:-m] + phase[: -2 * m]
    sums = np.concatenate([[0.0], np.cumsum(second)])
    moving = sums[m:] - sums[:-m]
    return float(moving @ moving / (2.0 * m**4 * len(moving)))


def _hadamard(phase: Float[np.ndarray, " M"], m: int) -> float:
    """Mean square of third differences, over 6 m^2."""
    third = phase[3 * m :] - 3 * phase[2 * m : -m] + 3 * phase[m : -2 * m] - phase[: -3 * m]
    return float(third @ third / (6.0 * m**2 * len(third)))
