"""Outlying samples of a recording, marked as missing.

A robust wavelet variance gives outlying coefficients no weight, but of spans longer than the distance between two
outliers no coefficient is without. There the samples themselves must go, and the wavelet variance be taken by pairs of
those that are left (`gmwm_jax.variance.gaps`).

A sample is an outlier where it is far from the median of the 2w + 1 samples around it (Hampel's identifier), in scales
of what samples deviate from the median of their 2w neighbours. The median follows noise of any correlation as long as
fewer than half of the window are outliers, so a wide window sees bursts and, where the noise is white, small outliers;
a narrow one sees outliers in a random walk, which the wide one takes for a part of it. Each of three widths has its
own scale, and a threshold that clean white noise passes anywhere, at any width, with the chance given. (The deviation
from a median of a random walk has a tail a quarter wider than its middle: of that one sample in 1e5 goes.)

The scale is that of a normal distribution with the same upper quartile of absolute deviations, so that a quarter of
them may be anything. Quantised deviations have been rounded, and their true quartile may be half a step larger: this is
what is taken, and it is a scale also where three quarters of them are zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import ndtri

from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.recordings.recording import Recording


@saved()
@dataclass(frozen=True)
class OutlierRun:
    """A run of neighbouring samples that are outliers."""

    first: int
    """Index of the first of them."""
    last: int
    size: float
    """In robust scales: the largest wavelet coefficient of span 2 (half a step between neighbours), or, of
    `mask_outliers`, deviation from a running median."""


_HALF_WIDTHS = (1, 4, 16)
_PROBED = 1 << 15
"""Windows, evenly spread, whose deviations show the scale."""
_SHOWN = 10
"""Runs in the table."""


@dataclass(frozen=True, repr=False)
class OutliersMasked:
    """The result of `mask_outliers`: the recording with outliers missing, and what was masked.

    Attributes
    ----------
    recording
        With NaN in place of the outliers; it allows gaps, so `wavelet_variance` and `fit` take it as it is.
    runs
        Channel -> its outliers, neighbouring ones together, those farthest out first.
    thresholds
        Channel -> the smallest deviation from a running median that counts as an outlier, in the unit of the channel.
    chance
        That a clean channel has a sample masked.
    """

    recording: Recording
    runs: Mapping[str, tuple[OutlierRun, ...]]
    thresholds: Mapping[str, float]
    chance: float

    @property
    def counts(self) -> dict[str, int]:
        """Number of masked samples in each channel."""
        return {name: sum(run.last - run.first + 1 for run in runs) for name, runs in self.runs.items()}

    @property
    def shares(self) -> dict[str, float]:
        """Share of masked samples in each channel."""
        return {name: count / len(self.recording) for name, count in self.counts.items()}

    def __repr__(self) -> str:
        """Counts a channel, and the largest runs."""
        rec = self.recording
        head = ["channel", "unit", "masked", "share", "runs", "longest", "farthest out", "outliers from"]
        rows = []
        for (name, runs), unit in zip(self.runs.items(), rec.units, strict=True):
            longest = max((run.last - run.first + 1 for run in runs), default=0)
            farthest = f"{runs[0].size:.1f} scales" if runs else ""
            share = f"{100 * self.shares[name]:.2g} %"
            threshold = number(self.thresholds[name])
            rows.append([name, unit, str(self.counts[name]), share, str(len(runs)), str(longest), farthest, threshold])
        lines = [
            f"Outliers masked{f' in {rec.name}' if rec.name else ''}: {len(rec)} samples, now missing where a clean "
            f"channel would show one with a chance of {100 * self.chance:g} %",
            format_table(head, rows, left=2),
        ]
        every = sorted(((n, run) for n, runs in self.runs.items() for run in runs), key=lambda pair: -pair[1].size)
        if every:
            rows = [
                [name, str(run.first), str(run.last), f"{run.first / rec.rate:.2f}", f"{run.size:.1f}"]
                for name, run in every[:_SHOWN]
            ]
            lines += ["", format_table(["channel", "first", "last", "time [s]", "scales"], rows, left=1)]
        return "\n".join(lines)


def mask_outliers(recording: Any, *, chance: float = 0.05, max_share: float = 0.1) -> OutliersMasked:
    """Mark outlying samples of each channel as missing.

    Parameters
    ----------
    recording
        A `Recording` of any number of channels, each judged alone. Its gaps stay gaps.
    chance
        That a clean channel of Gaussian white noise has any sample masked: smaller masks less.
    max_share
        The largest share of a channel that may be masked.

    Returns
    -------
    OutliersMasked
        With the recording, and a report of what was masked: print it.

    Raises
    ------
    TypeError
        No recording.
    ValueError
        More than `max_share` of a channel would be masked; a chance that is not between 0 and 1, or a share that is not
        between 0 and 1/4.

    Notes
    -----
    Bursts of up to about ten samples are seen as a whole. Outliers within the threshold stay, of which there are many
    if their sizes scatter around zero: this is for outliers that stand out. Noise with heavy tails loses them.

    Examples
    --------
    >>> x = np.array(gj.simulate("WN(sigma2=1.0)", 2000, key=jax.random.key(0)))
    >>> x[700] = 50.0
    >>> seen = gj.recordings.mask_outliers(gj.Recording.from_array(x, rate=100.0, units="1"))
    >>> np.flatnonzero(np.isnan(seen.recording.data[:, 0])).tolist()
    [700]
    """
    if not isinstance(recording, Recording):
        raise TypeError(
            f"mask_outliers() takes a Recording, not {type(recording).__name__}: Recording.from_array makes one."
        )
    if not 0 < chance < 1:
        raise ValueError(f"chance lies between 0 and 1, and is {chance!r}.")
    if not 0 < max_share <= 0.25:
        raise ValueError(f"max_share lies between 0 and 1/4, and is {max_share!r}: the medians need a clear majority.")
    data, runs, thresholds = np.array(recording.data, order="F"), {}, {}
    for i, (name, x) in enumerate(recording.items()):
        size, thresholds[name] = _sizes(x, chance)
        outlying = size > 0
        share = np.mean(outlying)
        if share > max_share:
            raise ValueError(
                f"{100 * share:.3g} % of the samples of {name!r} stand out, and max_share allows {100 * max_share:g} "
                "%: these are no outliers in noise. It may change its size (vibration, temperature), or the "
                "record has many large steps: cut it to its undisturbed part, or raise max_share."
            )
        runs[name] = _runs(size)
        data[outlying, i] = np.nan
    data.flags.writeable = False
    return OutliersMasked(replace(recording, data=data, gaps=True), runs, thresholds, chance)


def _sizes(x: Float[np.ndarray, " N"], chance: float) -> tuple[Float[np.ndarray, " N"], float]:
    """How far out each outlier is, in scales (zero for other samples), and the lowest threshold."""
    from scipy.ndimage import median_filter

    present = ~np.isnan(x)
    at = np.arange(len(x))
    filled = x if np.all(present) else np.interp(at, at[present], x[present])
    step = _step(x[present])
    widths = [w for w in _HALF_WIDTHS if 2 * w < len(x)]
    z = float(-ndtri(chance / (2 * len(widths) * len(x))))
    size, thresholds = np.zeros(len(x)), []
    for w in widths:
        deviation = np.abs(filled - median_filter(filled, 2 * w + 1, mode="mirror"))
        scale = _scale(filled, present, w, step)
        outlying = present & (deviation > z * scale)
        size[outlying] = np.maximum(size[outlying], deviation[outlying] / scale)
        thresholds.append(z * scale)
    return size, min(thresholds)


def _scale(x: Float[np.ndarray, " N"], present: Bool[np.ndarray, " N"], w: int, step: float) -> float:
    """Robust standard deviation of samples around the median of their 2w neighbours."""
    windows = np.lib.stride_tricks.sliding_window_view(x, 2 * w + 1)
    inner = np.flatnonzero(present[w : len(x) - w])
    windows = windows[inner[:: -(-len(inner) // _PROBED) or 1]]
    neighbours = np.median(np.delete(windows, w, axis=1), axis=1)
    deviation = np.abs(windows[:, w] - neighbours)
    return float((np.quantile(deviation, 0.75) + step / 2) / ndtri(0.875))


def _step(x: Float[np.ndarray, " N"]) -> float:
    """The quantisation step: the smallest difference between two values, next to nothing if there is none."""
    values = np.unique(x)
    steps = np.diff(values)
    # values that were converted differ by their rounding
    real = steps[steps > 1e-9 * (values[-1] - values[0])]
    return float(np.min(real)) if len(real) else 0.0


def _runs(size: Float[np.ndarray, " N"]) -> tuple[OutlierRun, ...]:
    """Runs of neighbouring outliers, the farthest out first."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], size > 0, [False]]).astype(np.int8)))
    runs = [OutlierRun(int(a), int(b) - 1, float(np.max(size[a:b]))) for a, b in edges.reshape(-1, 2)]
    return tuple(sorted(runs, key=lambda run: -run.size))
