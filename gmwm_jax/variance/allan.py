"""Allan deviation, exactly the wavelet variance in other clothes, and what is read off it.

The overlapping Allan variance at the averaging time n samples is twice the Haar MODWT wavelet variance at the span
tau = 2n (Percival & Guttorp 1994): AVAR(n) = 2 nu^2(2n), the same estimator and the same confidence interval.

Reading coefficients off slopes (IEEE Std 952-1997, annex C) and averaging along slopes (AVLR) are what the GMWM is an
alternative to: both see one process at a time and are biased where two overlap. They are here as the baseline.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.checks import agreed_rate, sampling_rate
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.processes.base import Composite
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.bands import Bands
from gmwm_jax.variance.wavelet import WaveletVariance, WaveletVariances, as_wavelet_variance

FLICKER_FLOOR = math.sqrt(2 * math.log(2) / math.pi)
"""0.664: the Allan deviation of flicker noise (bias instability) of coefficient B is 0.664 B at its flat bottom."""


@saved(not_finite=("ci_low", "ci_high"))
@dataclass(frozen=True, repr=False)
class AllanDeviation(Drawable, Saved):
    """The overlapping Allan deviation, in arrays (J,) for one channel and (J, C) for several.

    Attributes
    ----------
    times
        Averaging times n/f in seconds, n = 1, 2, 4 ...
    deviation, ci_low, ci_high
        sqrt(AVAR) and the interval of the wavelet variance's weights, in signal units; `bands` are those of the nominal
        level.
    wv
        The wavelet variance that it is.
    """

    times: Float[np.ndarray, " J"]
    deviation: Float[np.ndarray, "J *C"]
    ci_low: Float[np.ndarray, "J *C"]
    ci_high: Float[np.ndarray, "J *C"]
    wv: WaveletVariance | WaveletVariances

    def __getitem__(self, channel: str | int) -> "AllanDeviation":
        """One channel, by name or number."""
        return allan_deviation(self.wv[channel], rate=sampling_rate(self.wv.rate))

    def bands(self, model: Composite | None = None, *, level: float | None = None) -> Bands:
        """Return the intervals that hold the truth as often as they say, see `gmwm_jax.variance.WaveletVariance.bands`.

        Examples
        --------
        >>> adev = gj.allan_deviation(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
        >>> bool(np.all(adev.bands().high < adev.ci_high))
        True
        """
        return self.wv.bands(model, level=level).of_deviation

    @property
    def shown(self) -> Bands:
        """What prints and figures show: `bands` where they are known, else the intervals of the weights."""
        return self.wv.shown.of_deviation

    def plot(self, *, regression: Any = None, readings: bool = True, axes: GivenAxes | None = None) -> Figure:
        """Draw the Allan deviation over averaging time, a frame for each unit.

        Parameters
        ----------
        regression
            A `gmwm_jax.fitting.SlopeRegression` of one channel: its slopes, and the deviation they imply together.
        readings
            Draw what `gmwm_jax.fitting.read_off` reads, where there is no regression.
        axes
            An Axes for each unit to draw into; a new figure if left out.

        Returns
        -------
        Figure
            See `gmwm_jax.plotting.plot_allan_deviation`.
        """
        return self._draw(regression=regression, readings=readings, axes=axes)

    def __repr__(self) -> str:
        """A row a time, a column a channel."""
        head = ["T [s]", *(f"{c} [{u}]" for c, u in zip(self.wv.channels, self.wv.units, strict=True))]
        columns = [self.times[:, None], self.deviation.reshape(len(self.times), -1)]
        if isinstance(self.wv, WaveletVariance):
            head += [f"{100 * self.wv.level:g} % low", "high", "dof"]
            columns += [v[:, None] for v in (self.shown.low, self.shown.high, self.shown.dof)]
        rows = [[number(x) for x in row] for row in np.hstack(columns)]
        foot = self.shown.remark if isinstance(self.wv, WaveletVariance) else ""
        title = f"Overlapping Allan deviation at {sampling_rate(self.wv.rate):g} Hz"
        return f"{title}\n{format_table(head, rows, left=0)}{foot}"


def allan_deviation(
    data: WaveletVariance | WaveletVariances | Recording, *, rate: float | None = None
) -> AllanDeviation:
    """Compute the overlapping Allan deviation with confidence intervals.

    Parameters
    ----------
    data
        A wavelet variance, or a recording.
    rate
        Sampling rate in Hz where the data do not know theirs.

    Returns
    -------
    AllanDeviation
        At averaging times of 1, 2, 4 .. samples.

    Examples
    --------
    >>> adev = gj.allan_deviation(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> adev.times[:3].tolist()
    [0.01, 0.02, 0.04]
    """
    wv = as_wavelet_variance(data, "allan_deviation")
    if not wv.estimator.overlaps:
        raise ValueError(
            f"The overlapping Allan deviation is the MODWT wavelet variance; this one is of the {wv.estimator.name}."
        )
    f = sampling_rate(agreed_rate(wv.rate, rate))
    deviation, low, high = (np.sqrt(2 * v) for v in (wv.variance, wv.ci_low, wv.ci_high))
    return AllanDeviation(wv.scales / (2 * f), deviation, low, high, replace(wv, rate=f))
