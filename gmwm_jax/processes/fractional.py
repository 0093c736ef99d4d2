"""Fractional Gaussian noise: a spectrum that is a power of frequency."""

import math
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.special import gamma
from jaxtyping import Float

from gmwm_jax._internal.host import namespace
from gmwm_jax._internal.typing import PRNGKey, Scalar
from gmwm_jax.processes._maths import power_law as _power_law
from gmwm_jax.processes._maths.circulant import draw_stationary
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.continuous_form import ContinuousForm, Quantity
from gmwm_jax.processes.parameter import Limit, Parameter
from gmwm_jax.processes.state_space import StateSpace

_END = math.log(1e9)
"""Bounds of the logit of H: nearer to 0 or 1 the wavelet variance of 2^24 samples changes by less than 4e-8."""


def density(H: Any) -> Any:
    """Return h of the spectrum h |f|^(1-2H) for variance 1, f in cycles per sample."""
    # sin(pi H), by whichever of H and 1 - H is the smaller
    return jnp.sin(jnp.pi * jnp.minimum(H, 1 - H)) * gamma(2 * H + 1) * (2 * jnp.pi) ** (1 - 2 * H)


def _density_at_1_hz(H: Any, sigma2: Any, f: Any) -> Any:
    # h |f|^(1-2H) in cycles per sample, of which there are f in a second
    return sigma2 * density(H) * f ** (2 * H - 2)


_HURST = Quantity("H", "Hurst exponent", None, lambda H, sigma2, f: 1.0 * H, unit="1", gyro=("1",), accel=("1",))


class FGN(AbstractProcess):
    """Fractional Gaussian noise: the means over a sample of noise with the spectrum |f|^(1-2H) at all frequencies.

    White noise for H = 1/2; towards H = 1 flicker noise (`BI`), towards H = 0 quantisation noise.

    Parameters
    ----------
    H
        Hurst exponent, 0 < H < 1.
    sigma2
        Variance of a sample, u^2.

    Notes
    -----
    Wavelet variance sigma2 n^(2H-2) (1 - 2^(2H-2)), n = tau/2 (Mandelbrot & Van Ness 1968). R's FGN(sigma2, H).

    Examples
    --------
    >>> gj.FGN(H=0.5, sigma2=1.0).autocovariance(np.array([0, 1])).round(9).tolist()  # white noise, at H = 1/2
    [1.0, 0.0]
    """

    H: Scalar | None
    sigma2: Scalar | None

    kind: ClassVar[str] = "FGN"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("H", "1", "Hurst exponent", upper=1.0),
        Parameter("sigma2", "({u})^2", "variance", determined_at=Limit.QUANTISATION_NOISE),
    )
    continuous: ClassVar[ContinuousForm | None] = ContinuousForm(
        filter=(_HURST, Quantity("S_1", "PSD at 1 Hz", "^2/Hz", _density_at_1_hz, reads=(0, 1))),
        datasheet=(
            _HURST,
            Quantity("N_1", "density at 1 Hz", "/sqrt(Hz)",
                     lambda H, sigma2, f: jnp.sqrt(_density_at_1_hz(H, sigma2, f)),
                     gyro=("deg/sqrt(h)", "deg/s/sqrt(Hz)"), accel=("ug/sqrt(Hz)", "m/s/sqrt(h)"), reads=(0, 1)),
        ),
        inverse=lambda H, S, f: (H, S / _density_at_1_hz(H, 1.0, f)),
    )  # fmt: skip

    def __init__(self, H: Any = None, sigma2: Any = None):
        self._set(H=H, sigma2=sigma2)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):  # noqa: D102
        # K = -|m|^(2H)/2 is P times 1 - H
        (H,) = shape
        return (1 - H) * _power_law.wavelet_variance(2 * H, tau)

    @classmethod
    def unit_psd(cls, shape, frequency):  # noqa: D102
        (H,) = shape
        return density(H) * _power_law.psd(2 * H + 1, frequency)

    @classmethod
    def unit_autocovariance(cls, shape, lag):  # noqa: D102
        return _power_law.autocovariance(2 * shape[0], lag)

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):  # noqa: D102
        (H,) = shape
        return (1 - H) * _power_law.haar_covariance(2 * H, lag, n_j, n_k)

    @classmethod
    def shape_from_coordinate(cls, coordinate):  # noqa: D102
        return (1 / (1 + namespace(coordinate).exp(-coordinate)),)

    @classmethod
    def coordinate_from_shape(cls, shape):  # noqa: D102
        xp = namespace(*shape)
        return xp.log(shape[0]) - xp.log1p(-shape[0])

    @classmethod
    def coordinate_bounds(cls, tau_max):  # noqa: D102
        return -_END, _END

    @classmethod
    def limit_of(cls, shape, tau_max):  # noqa: D102
        # the exponent times the logarithm of the spans: where the variance differs by less than 1 %
        span = 2 * math.log(tau_max / 2)
        if (1 - shape[0]) * span < 0.01:
            return Limit.FLICKER_NOISE
        return Limit.QUANTISATION_NOISE if shape[0] * span < 0.01 else Limit.NONE

    @classmethod
    def start_nodes(cls, tau_max, num):  # noqa: D102
        # H from 0.01 to 0.99
        inner = np.linspace(-4.6, 4.6, num - 2)
        return -_END, *(float(z) for z in inner), _END

    @classmethod
    def correlation_time(cls, shape):
        """Infinite: the correlation is a power of the lag."""
        return namespace(*shape).full_like(shape[0], math.inf)

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:  # noqa: D102
        self.require_complete()
        lag = jnp.arange(num_samples + 1, dtype=jnp.float64)
        return jnp.sqrt(self.amplitude) * draw_stationary(self.unit_autocovariance(self.shape, lag), key)

    def state_space(self) -> StateSpace | None:
        """None: it has a memory on all time scales at once."""
        self.require_complete()
        return None
