"""Flicker noise, the bias instability of data sheets, and its approximation by Gauss-Markov processes for filters."""

import math
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.checks import as_float, integer, positive
from gmwm_jax._internal.host import namespace
from gmwm_jax._internal.typing import PRNGKey, Scalar
from gmwm_jax.processes._maths import power_law as _power_law
from gmwm_jax.processes._maths.circulant import draw_stationary
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.continuous_form import ContinuousForm, Quantity
from gmwm_jax.processes.gauss_markov import GM
from gmwm_jax.processes.parameter import Parameter
from gmwm_jax.processes.state_space import StateSpace

_POINTS_PER_GM = 30
_STRETCHES = np.geomspace(1.0, 3.0, 13)
"""By how much the outermost corners of a ladder may lie outside its band: the best is taken."""


class BI(AbstractProcess):
    """Bias instability: flicker noise with the two-sided PSD B^2/(2 pi f), whose Allan deviation is flat, 0.664 B.

    As a sensor samples it that integrates over each sample (see `_power_law`). The definition of IEEE 952, annex
    C.1.3, without a cutoff frequency f0: with one, the Allan deviation falls below the flat part at times below 1/f0,
    where the white noise of any sensor hides it. No corner is needed at low frequencies either.

    Parameters
    ----------
    B
        Coefficient of bias instability, u. The same at every sampling rate.

    Notes
    -----
    Wavelet variance B^2 log(2)/pi at all scales. Not stationary (its variance grows with the logarithm of time); a
    simulation starts from zero. It has no finite state: `flicker_ladder` is a sum of GM that approximates it.

    Examples
    --------
    >>> nu2 = gj.BI(B=1.0).wavelet_variance(np.array([1024.0]))
    >>> round(float(np.sqrt(2 * nu2[0])), 3)  # the flat of its Allan deviation
    0.664
    """

    B: Scalar | None

    kind: ClassVar[str] = "BI"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("B", "{u}", "bias instability"),)
    continuous: ClassVar[ContinuousForm | None] = ContinuousForm(
        filter=(Quantity("B", "bias instability", "", lambda B, f: 1.0 * B),),
        datasheet=(
            Quantity("B", "bias instability", "", lambda B, f: 1.0 * B, gyro=("deg/h", "deg/s"), accel=("ug", "mg")),
            Quantity("floor", "flat Allan deviation", "", lambda B, f: jnp.sqrt(2 * jnp.log(2.0) / jnp.pi) * B,
                     gyro=("deg/h", "deg/s"), accel=("ug", "mg")),
        ),
        inverse=lambda B, f: (1.0 * B,),
    )  # fmt: skip

    def __init__(self, B: Any = None):
        self._set(B=B)

    @staticmethod
    def amplitude_of(value: Any) -> Any:  # noqa: D102
        return value * value

    @staticmethod
    def value_of(amplitude: Any) -> Any:  # noqa: D102
        xp, positive = namespace(amplitude), amplitude > 0
        return xp.where(positive, xp.sqrt(xp.where(positive, amplitude, 1.0)), 0.0)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):  # noqa: D102
        return jnp.full_like(tau, math.log(2) / math.pi)

    @classmethod
    def unit_psd(cls, shape, frequency):  # noqa: D102
        return _power_law.psd(3.0, frequency) / (2 * math.pi)

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):  # noqa: D102
        # the generalised covariance m^2 log|m|/(2 pi) has the wavelet variance log(2)/pi
        return _power_law.haar_covariance(jnp.asarray(2.0), lag, n_j, n_k) / (2 * math.pi)

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:  # noqa: D102
        self.require_complete()
        lag = jnp.arange(num_samples + 1, dtype=jnp.float64)
        one = jnp.ones_like(lag)
        # the steps x_t - x_{t-1} are twice the Haar coefficients of level 1
        steps = draw_stationary(4 * self.unit_haar_covariance((), lag, one, one, one), key)
        return jnp.sqrt(self.amplitude) * jnp.cumsum(steps)

    def state_space(self) -> StateSpace | None:
        """None: it has a memory on all time scales at once."""
        self.require_complete()
        return None


def flicker_ladder(B: Any, low: float, high: float, num: int) -> Composite:
    """Approximate flicker noise by a sum of Gauss-Markov processes, which a filter can have as states.

    Flicker noise is the sum of GM of all correlation times, each with the same variance B^2/pi per unit of log(beta)
    (van der Ziel 1950); a ladder takes a few, evenly spaced in log(beta).

    Parameters
    ----------
    B
        Coefficient of bias instability, u, see `BI`.
    low, high
        Band in cycles per sample in which the PSD is to agree, 0 < low < high <= 1/10; in Hz divided by the rate.
    num
        Number of GM, 2 or more. The largest relative error of the PSD in the band is below 8 % with one GM a decade and
        one more, below 1 % with two a decade and one more.

    Returns
    -------
    A sum of GM. Below the band its spectrum is flat, above it falls faster than that of flicker noise.

    Raises
    ------
    ValueError
        A band outside that range, fewer than 2 processes, a negative B.

    Examples
    --------
    >>> ladder = gj.processes.flicker_ladder(B=1.0, low=1e-4, high=1e-2, num=3)
    >>> ladder.labels
    ('GM_1', 'GM_2', 'GM_3')
    >>> bool(abs(ladder.psd(1e-3) / gj.BI(B=1.0).psd(1e-3) - 1) < 0.08)
    True
    """
    from scipy.optimize import nnls

    num = integer("num", num, 2)
    positive("B", B, zero_ok=True)
    if not 0 < low < high <= 0.1:
        raise ValueError(f"The band must lie in 0 < low < high <= 0.1 cycles per sample, and is {low!r} to {high!r}.")
    frequency = np.geomspace(low, high, _POINTS_PER_GM * num)
    flicker = np.asarray(BI(1.0).psd(frequency))
    best = np.inf
    for stretch in _STRETCHES:
        candidates = 2 * math.pi * np.geomspace(low / stretch, high * stretch, num)
        spectra = np.stack([GM.unit_psd((beta,), jnp.asarray(frequency)) for beta in candidates], axis=1)
        weights, _ = nnls(spectra / flicker[:, None], np.ones(len(frequency)))
        error = np.max(np.abs(spectra @ weights / flicker - 1))
        if error < best:
            best, betas, variances = error, candidates, weights
    return Composite([GM(b, as_float(B) ** 2 * v) for b, v in zip(betas, variances, strict=True)])
