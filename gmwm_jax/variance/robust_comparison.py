"""Classic against robust wavelet variance of one channel: at which scales they disagree, and which samples are why.

The test of a scale is Hausman's (1978): the robust estimator is the efficient one plus an error that is uncorrelated
with it (in the expansion of `variance.robust`: the powers of rho^2 beyond the first), so that on clean data the
variance of the difference of the logarithms is the difference of the variances, 2/eta_j (widening_j - 1).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import ndtri

from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.recordings.outliers import OutlierRun
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.robust import biweight, error_of_log_ratio
from gmwm_jax.variance.wavelet import WaveletVariance, wavelet_variance

_CHANCE = 0.05
"""That a clean record has a scale marked, or that it has a sample marked: each over all scales or samples together."""
_SHOWN = 10
"""Runs of outliers in the table."""


@saved(not_finite=("z",))
@dataclass(frozen=True, repr=False)
class RobustComparison(Drawable, Saved):
    """The result of `compare_robust`, for one channel and J scales.

    Attributes
    ----------
    classic, robust
        Both wavelet variances.
    z
        log(classic/robust) in standard errors of a clean record; positive where outliers add to the classic one.
    weightless
        Share of the coefficients of each scale that have no weight in the robust one.
    runs
        Outlying samples, those of the largest coefficient first: steps between neighbours that one clean record in
        twenty would show once.
    """

    classic: WaveletVariance
    robust: WaveletVariance
    z: Float[np.ndarray, " J"]
    weightless: Float[np.ndarray, " J"]
    runs: tuple[OutlierRun, ...]

    @property
    def significant(self) -> Bool[np.ndarray, " J"]:
        """Scales that differ by more than one clean record in twenty does at any of its scales."""
        return np.abs(self.z) > _two_sided(len(self.z))

    @property
    def num_outliers(self) -> int:
        """Samples in all runs."""
        return sum(run.last - run.first + 1 for run in self.runs)

    def plot(self, *, cleaned: WaveletVariance | None = None, axes: GivenAxes | None = None) -> Figure:
        """Draw both wavelet variances, and their difference in standard errors.

        Parameters
        ----------
        cleaned
            A third curve: the wavelet variance of the same channel without its outliers, see `mask_outliers`.
        axes
            Two Axes to draw into; a new figure if left out.

        Returns
        -------
        Figure
            See `gmwm_jax.plotting.plot_robust_comparison`.
        """
        return self._draw(cleaned=cleaned, axes=axes)

    def __repr__(self) -> str:
        """Two tables: scales, and the largest runs of outliers."""
        c, r = self.classic, self.robust
        head = ["tau [s]" if c.rate else "tau [samples]", f"classic [({c.units[0]})^2]", "robust", "z", "no weight", ""]
        columns = zip(c.times, c.variance, r.variance, self.z, self.weightless, self.significant, strict=True)
        rows = [
            [number(t), number(a), number(b), f"{z:+.1f}", f"{100 * w:.3g} %", "differs" if s else ""]
            for t, a, b, z, w, s in columns
        ]
        share = 100 * self.num_outliers / (c.num_samples or 1)
        lines = [
            f"Classic against robust (efficiency {r.efficiency:g}) wavelet variance of {c.name or c.channels[0]}",
            format_table(head, rows, left=0),
            "",
            f"{self.num_outliers} outlying samples ({share:.2g} %) in {len(self.runs)} runs",
        ]
        if self.runs:
            head = ["first", "last", *(["time [s]"] if c.rate else []), "size"]
            rows = [
                [str(run.first), str(run.last), *([f"{run.first / c.rate:.2f}"] if c.rate else []), f"{run.size:.1f}"]
                for run in self.runs[:_SHOWN]
            ]
            lines[-1] += f", the {len(rows)} largest:" if len(self.runs) > _SHOWN else ":"
            lines.append(format_table(head, rows, left=0))
        return "\n".join(lines)


def compare_robust(
    record: Any,
    *,
    efficiency: float = 0.6,
    num_levels: int | None = None,
    level: float = 0.95,
    rate: float | None = None,
    unit: str = "1",
) -> RobustComparison:
    """Compare the classic and the robust wavelet variance of one channel, with a report of the outliers.

    Parameters
    ----------
    record
        A `Recording` of one channel, or an array of shape (N,).
    efficiency
        Of the robust estimator.
    num_levels, level, rate, unit
        As of `wavelet_variance`.

    Raises
    ------
    ValueError
        Several channels; and see `wavelet_variance`.

    Examples
    --------
    >>> x = np.array(gj.simulate("WN(sigma2=1.0)", 2000, key=jax.random.key(0)))
    >>> x[700] = 50.0
    >>> gj.variance.compare_robust(x).num_outliers
    1
    """
    options: dict[str, Any] = {"num_levels": num_levels, "level": level, "rate": rate, "unit": unit}
    x = record.data if isinstance(record, Recording) else np.asarray(record)
    if x.size != x.shape[0]:
        raise ValueError(f"Outliers belong to one channel: choose it, for the record has the shape {x.shape}.")
    classic = wavelet_variance(record, **options)[0]
    robust = wavelet_variance(record, efficiency=efficiency, **options)[0]
    weightless, coefficients = _weightless(x.ravel(), np.asarray(robust.variance), biweight(efficiency).c)
    error = error_of_log_ratio(efficiency, x.shape[0], robust.num_scales)
    z = np.log(classic.variance / robust.variance) / error
    return RobustComparison(classic, robust, z, weightless, _runs(coefficients / np.sqrt(robust.variance[0])))


def _two_sided(count: int) -> float:
    """What the largest of `count` standard normal variables exceeds by chance at most once in twenty (Bonferroni)."""
    return float(-ndtri(_CHANCE / (2 * count)))


def _weightless(
    x: np.ndarray, variance: Float[np.ndarray, " J"], c: float
) -> tuple[Float[np.ndarray, " J"], Float[np.ndarray, " M"]]:
    """Share of the coefficients of each level beyond c scales, and those of the first level."""
    S = x - np.mean(x)
    coefficients, shares = np.diff(S) / 2, []
    for j, scale in enumerate(np.sqrt(variance)):
        n = 1 << j
        shares.append(np.mean(np.abs(S[n:] - S[:-n]) > 2 * n * c * scale))
        S = S[n:] + S[:-n]
    return np.array(shares), coefficients


def _runs(r: Float[np.ndarray, " M"]) -> tuple[OutlierRun, ...]:
    """Runs of samples from the coefficients of span 2 in scales: r[t] is half of the step from sample t to t + 1."""
    beyond = np.concatenate([[False], np.abs(r) > _two_sided(r.size), [False]])
    starts, stops = np.flatnonzero(np.diff(beyond.astype(np.int8))).reshape(-1, 2).T
    # samples p .. q that stand out have large steps from p - 1 to p and on, up to that from q to q + 1
    runs = [
        OutlierRun(int(a) + 1, max(int(b) - 1, int(a) + 1), float(np.max(np.abs(r[a:b]))))
        for a, b in zip(starts, stops, strict=True)
    ]
    return tuple(sorted(runs, key=lambda run: -run.size))
