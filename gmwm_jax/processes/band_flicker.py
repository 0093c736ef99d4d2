"""Flicker noise up to a corner frequency: the bias instability of IEEE 952 with its cutoff f0.

With x = pi f0 n, n = tau/2, and f0 in cycles per sample, the Allan variance of IEEE Std 952-1997, eq. C.10, is

    (2 B^2/pi) [log 2 - sin(x)^3/(2 x^2) (sin x + 4 x cos x) + Ci(2x) - Ci(4x)] = (2 B^2/pi) int_0^x sin(u)^4/u^3 du

for a sensor whose samples are means over the sample (see `_power_law`), and the wavelet variance is half of it. The
generalised covariance of the integrated noise (see `_haar`), less multiples of m^2, is with X = 2 pi f0 m

    K(m) = (B^2/pi) m^2 [log(m)/2 - Ci(X)/2 + sin(X)/(2X) + (1 - cos X)/(2 X^2)].

It serves for filters that are long beside 1/f0 and overlap. Otherwise the covariance is the integral over the band

    int_0^f0 g(f) exp(2 pi i f c) df,    g(f) = sin(pi f n_j)^2 sin(pi f n_k)^2/(pi^3 f^3 n_j n_k),

c the distance of the filters' centres: by Gauss's rule where few waves fit into it, and else by the two ends of the
contour turned into the upper half plane, of which f = 0 gives the flicker noise without corner.
"""

import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Float

from gmwm_jax._internal.host import namespace
from gmwm_jax._internal.typing import PRNGKey, Scalar
from gmwm_jax.processes._maths import power_law as _power_law
from gmwm_jax.processes._maths.circulant import draw_stationary
from gmwm_jax.processes._maths.cosine_integral import cosine_integral
from gmwm_jax.processes._maths.haar import Points, nine_terms
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.continuous_form import ContinuousForm, Quantity
from gmwm_jax.processes.flicker import BI
from gmwm_jax.processes.parameter import Limit, Parameter
from gmwm_jax.processes.state_space import StateSpace

# Lower than the first corner, seen from the longest span, it is a drift, and higher than the second flicker noise, to
# all digits a fit can see; within 1 % for the other two.
_SMALLEST_CORNER_TAU = 1e-5
_LARGEST_CORNER = 1e4
_DRIFT_CORNER_TAU = 0.1
_FLICKER_CORNER = 2.0
_SERIES = [(-1) ** k * (16**k - 4 * 4**k) / (8 * math.factorial(2 * k) * (2 * k - 2)) for k in range(2, 15)]
"""Of int_0^x sin(u)^4/u^3 du, less its factor x^2, in x^2."""
_FEW_WAVES = 2.5
"""In the band, as many as Gauss's rule resolves."""
_LEGENDRE = np.stack(np.polynomial.legendre.leggauss(16), axis=1)
_LAGUERRE = np.stack(np.polynomial.laguerre.laggauss(20), axis=1)
"""Nodes and weights."""
_EMBEDDING = 4
"""Half the length of the circulant of a simulation, in records."""


_CORNER = Quantity("f0", "corner frequency", None, lambda f0, B, f: f0 * f, unit="1/s", gyro=("Hz",), accel=("Hz",))
_COEFFICIENT = Quantity(
    "B", "bias instability", "", lambda f0, B, f: 1.0 * B, reads=(1,), determined_at=Limit.FLICKER_NOISE
)


class FLK(AbstractProcess):
    """Bias instability with a corner: flicker noise with the two-sided PSD B^2/(2 pi f) up to the frequency f0.

    Parameters
    ----------
    f0
        Corner (cutoff) frequency, cycles/sample. The noise before the sensor averages over a sample has nothing above.
    B
        Coefficient of bias instability, u, as of `BI`.

    Notes
    -----
    Towards high f0 it is `BI`, towards low f0 a drift. Its Allan deviation rises as time up to 1/(pi f0) and is flat
    beyond, 0.664 B. Not stationary; a simulation starts from zero. It has no finite state: `flicker_ladder` up to f0
    is a sum of GM that approximates it.

    Examples
    --------
    >>> gj.FLK(f0=0.01, B=1.0)
    FLK(f0=0.01, B=1)
    """

    f0: Scalar | None
    B: Scalar | None

    kind: ClassVar[str] = "FLK"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("f0", "1/sample", "corner frequency"),
        Parameter("B", "{u}", "bias instability", determined_at=Limit.FLICKER_NOISE),
    )
    continuous: ClassVar[ContinuousForm | None] = ContinuousForm(
        filter=(_CORNER, _COEFFICIENT),
        datasheet=(
            _CORNER._replace(symbol="f_0"),
            _COEFFICIENT._replace(gyro=("deg/h", "deg/s"), accel=("ug", "mg")),
        ),
        inverse=lambda f0, B, f: (f0 / f, 1.0 * B),
    )

    def __init__(self, f0: Any = None, B: Any = None):
        self._set(f0=f0, B=B)

    @staticmethod
    def amplitude_of(value: Any) -> Any:  # noqa: D102
        return BI.amplitude_of(value)

    @staticmethod
    def value_of(amplitude: Any) -> Any:  # noqa: D102
        return BI.value_of(amplitude)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):  # noqa: D102
        return _haar_integral(jnp.pi * shape[0] * tau / 2) / jnp.pi

    @classmethod
    def unit_psd(cls, shape, frequency):
        """As of `BI`, without the aliases that lie above the corner."""
        total = jnp.zeros_like(frequency)
        for first in (frequency, 1 - frequency):
            num = jnp.maximum(jnp.floor(shape[0] - first) + 1, 0.0)
            total = total + _power_law.hurwitz(3.0, first) - _power_law.hurwitz(3.0, first + num)
        return (jnp.sin(jnp.pi * frequency) / jnp.pi) ** 2 * total / (2 * jnp.pi)

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):
        """By one of three formulas, see the file."""
        return _haar_covariance(shape[0], lag, parity, n_j, n_k)

    @classmethod
    def ringing(cls, shape):
        """The edge of the band rings, and falls as 1/lag only: at three turns the covariance keeps four digits."""
        return 20.0

    @classmethod
    def shape_from_coordinate(cls, coordinate):  # noqa: D102
        return (namespace(coordinate).exp(coordinate),)

    @classmethod
    def coordinate_from_shape(cls, shape):  # noqa: D102
        return namespace(*shape).log(*shape)

    @classmethod
    def coordinate_bounds(cls, tau_max):  # noqa: D102
        return math.log(_SMALLEST_CORNER_TAU / tau_max), math.log(_LARGEST_CORNER)

    @classmethod
    def limit_of(cls, shape, tau_max):  # noqa: D102
        if shape[0] > _FLICKER_CORNER:
            return Limit.FLICKER_NOISE
        return Limit.DRIFT if shape[0] * tau_max < _DRIFT_CORNER_TAU else Limit.NONE

    @classmethod
    def start_nodes(cls, tau_max, num):  # noqa: D102
        drift, flicker = cls.coordinate_bounds(tau_max)
        return drift, *(float(z) for z in np.linspace(math.log(0.1 / tau_max), 0.0, num - 2)), flicker

    @classmethod
    def correlation_time(cls, shape):
        """A radian of the corner."""
        return 1 / (2 * jnp.pi * shape[0])

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:
        """As of `BI`, but not exact: the edge of the band leaves eigenvalues of the circulant negative, and they go.

        The steps get up to 0.01/(f0 N) too much variance for that, and 5 % where f0 N is below 1.
        """
        self.require_complete()
        lag = jnp.arange(_EMBEDDING * num_samples + 1, dtype=jnp.float64)
        one = jnp.ones_like(lag)
        autocovariance = 4 * self.unit_haar_covariance(self.shape, lag, one, one, one)
        # lags beyond the record are free: faded out, they ring less
        beyond = jnp.maximum(lag / num_samples - 1, 0.0) / (_EMBEDDING - 1)
        faded = autocovariance * jnp.cos(jnp.pi / 2 * beyond) ** 2
        steps = draw_stationary(jnp.where(self.shape[0] * num_samples > 1, faded, autocovariance), key)[:num_samples]
        return jnp.sqrt(self.amplitude) * jnp.cumsum(steps)

    def state_space(self) -> StateSpace | None:
        """None: it has a memory on all time scales above 1/f0."""
        self.require_complete()
        return None


@jax.custom_jvp
def _haar_integral(x: Float[Array, "*J"]) -> Float[Array, "*J"]:
    """The integral of sin(u)^4/u^3 from 0 to x."""
    small = x < 0.5
    y = jnp.where(small, x, 0.0)
    z = jnp.where(small, 0.5, x)
    sine = jnp.sin(z)
    direct = jnp.log(2.0) - sine**3 / (2 * z * z) * (sine + 4 * z * jnp.cos(z))
    direct = direct + cosine_integral(2 * z) - cosine_integral(4 * z)
    return jnp.where(small, y * y * _power_law.sum_powers(y * y, _SERIES), direct)


@_haar_integral.defjvp
def _haar_integral_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    return _haar_integral(x), x * jnp.sinc(x / jnp.pi) ** 4 * dx  # its terms would cancel as 1/x


@jax.jit
def _haar_covariance(f0: Any, lag: Points, parity: Points, n_j: Points, n_k: Points) -> Points:
    c = jnp.abs(lag - n_j + n_k)
    reach = n_j + n_k
    few = f0 * (c + reach) < _FEW_WAVES
    apart = (c > 2 * reach) & ~few
    overlapping = _by_differences(f0, lag, parity, n_j, n_k)
    band = _by_quadrature(jnp.minimum(f0, _FEW_WAVES / (c + reach)), c, n_j, n_k)
    far = BI.unit_haar_covariance((), lag, parity, n_j, n_k)
    far = far - _end_of_contour(f0, jnp.where(apart, c, 4 * reach + 4 / f0), n_j, n_k)
    return jnp.where(few, band, jnp.where(apart, far, overlapping))


def _by_differences(f0: Any, lag: Points, parity: Points, n_j: Points, n_k: Points) -> Any:
    """From K, all nine of them at once."""
    m, _, weights = nine_terms(lag, parity, n_j, n_k)
    X = 2 * jnp.pi * f0 * jnp.where(m > 0, m, 1.0)
    half = jnp.sin(X / 2) / X
    K = m * m * (jnp.log(jnp.where(m > 0, m, 1.0)) - cosine_integral(X) + jnp.sin(X) / X + 2 * half * half) / 2
    return jnp.tensordot(weights, K, 1) / (4 * jnp.pi * n_j * n_k)


def _by_quadrature(f0: Points, c: Points, n_j: Points, n_k: Points) -> Any:
    """The integral over the band up to f0."""

    def add(total: Array, node: Float[Array, "2"]) -> tuple[Array, None]:
        f = f0 * (node[0] + 1) / 2
        sines = jnp.sin(jnp.pi * f * n_j) * jnp.sin(jnp.pi * f * n_k)
        return total + node[1] / 2 * f0 * sines**2 / f**3 * jnp.cos(2 * jnp.pi * f * c), None

    total, _ = lax.scan(add, jnp.zeros_like(c), jnp.asarray(_LEGENDRE))
    return total / (jnp.pi**3 * n_j * n_k)


def _end_of_contour(f0: Any, c: Points, n_j: Points, n_k: Points) -> Any:
    """Re int g(f) exp(2 pi i f c) df from f0 upwards in the complex plane, as exp(-2 pi s (c - n_j - n_k)) decays."""
    decay = 2 * jnp.pi * (c - n_j - n_k)
    wave = jnp.exp(lax.complex(0 * c, f0 * decay))

    def add(total: Array, node: Float[Array, "2"]) -> tuple[Array, None]:
        s = node[0] / decay
        # exp(2 pi i f n) - 1 = 2i sin(pi f n) exp(i pi f n), squared and divided by -4 exp(2 pi i f n)
        phases = [2 * jnp.pi * n for n in (n_j, n_k)]
        factors = [jnp.expm1(lax.complex(-phase * s, phase * f0)) for phase in phases]
        value = (factors[0] * factors[1]) ** 2 * wave / lax.complex(f0 + 0 * s, s) ** 3
        return total - node[1] * value.imag, None

    total, _ = lax.scan(add, jnp.zeros_like(c), jnp.asarray(_LAGUERRE))
    return total / (16 * decay * jnp.pi**3 * n_j * n_k)
