"""The first-order Gauss-Markov process in its two parametrisations: GM(beta, variance) and AR1(phi, sigma2).

Derivation of the wavelet variance. Unit variance, autocovariance phi^|h|, phi = exp(-beta), d = 1 - phi. The variance
of a sum of m samples is V(m) = m (1+phi)/d - 2 phi (1-phi^m)/d^2, and K(m) = -V(m)/2 (see `_haar`). The textbook
result (Guerrier et al. 2013), with e = 1 - phi^n and tau = 2n,

    (n d (1+phi) - phi e (2+e)) / (2 n^2 d^2),

is a difference of two nearly equal numbers once n beta is small: at phi = 0.999999 it has no digit left. Writing
d (1+phi) = 2 phi sinh(beta) splits the numerator into two terms that are both positive,

    n d (1+phi) - phi e (2+e) = phi [g(n beta) + 2n (sinh beta - beta)],    g(x) = 2x - 3 + 4 exp(-x) - exp(-2x),

and g(x) = x^3 G(x), sinh(beta) - beta ~ beta^3/6 have series where they cancel (`_safe`). With E = d/beta:

    nu^2 = beta [n phi G(n beta) + 2 exp(-beta) (sinh beta - beta)/beta^3 / n] / (2 E^2),

which is beta (tau^2+2)/(6 tau), a random walk, for beta -> 0 and 1/tau, white noise, for beta -> infinity. Likewise

    K(m) = beta [phi |m|^3 C(beta |m|) - |m| exp(-beta) (sinh beta - beta)/beta^3] / E^2

with C(x) = (1 - exp(-x) - x + x^2/2)/x^3, after a multiple of m^2 has been dropped.
"""

import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.host import namespace
from gmwm_jax._internal.typing import PRNGKey, Scalar
from gmwm_jax.processes._maths.haar import gap, second_differences
from gmwm_jax.processes._maths.recursion import first_order_recursion
from gmwm_jax.processes._series import exp_cubic, exp_ratio, haar_exp, sinh_excess
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.continuous_form import ContinuousForm, Quantity
from gmwm_jax.processes.parameter import Limit, Parameter
from gmwm_jax.processes.state_space import StateSpace, scalar_state

# Beyond these the process is a random walk (beta tau -> 0) or white noise (phi -> 0) to all digits a fit can see.
_SMALLEST_BETA_TAU = 1e-9
_LARGEST_BETA = 50.0
# Nearer to those ends than this, a fit reports the limit: the wavelet variance differs from it by less than 1 %.
_RANDOM_WALK_BETA_TAU = 1e-2
_WHITE_NOISE_BETA = 6.0


def wavelet_variance_over_beta(beta: Any, tau: Any) -> Any:
    """Wavelet variance for unit variance, divided by beta: finite at beta = 0."""
    n = tau / 2
    E = exp_ratio(beta)
    return (n * jnp.exp(-beta) * haar_exp(n * beta) + 2 * sinh_excess(beta) / n) / (2 * E * E)


def haar_covariance_over_beta(beta: Any, lag: Any, n_j: Any, n_k: Any) -> Any:
    """Cross-covariance of Haar coefficients for unit variance, divided by beta."""
    phi, E, excess = jnp.exp(-beta), exp_ratio(beta), sinh_excess(beta)
    ones = jnp.ones_like(lag)
    # Filters that overlap: with or without the m^2 term, whichever leaves the smaller numbers to cancel.
    slow = second_differences(lambda m, _: phi * m * m * m * exp_cubic(beta * m) - m * excess, lag, ones, n_j, n_k)
    safe_beta = jnp.maximum(beta, 1e-30)
    fast = second_differences(
        lambda m, _: phi * (-jnp.expm1(-safe_beta * m) / safe_beta - m) / (safe_beta * safe_beta) - m * excess,
        lag,
        ones,
        n_j,
        n_k,
    )
    overlapping = jnp.where(beta * (n_j + n_k) < 2, slow, fast)
    # Filters apart: exp(-beta m) is an eigenfunction of every difference, nothing cancels.
    between = gap(lag, n_j, n_k)
    e_j, e_k = n_j * exp_ratio(beta * n_j), n_k * exp_ratio(beta * n_k)
    apart = -phi * jnp.exp(-beta * jnp.maximum(between, 0.0)) * beta * e_j**2 * e_k**2 / (4 * n_j * n_k)
    return jnp.where(between >= 0, apart, overlapping) / (E * E)


# GM and AR1 are one process: beta per sample with phi = exp(-beta), and variance = sigma2/(1 - phi^2).
# dx/dt = -beta_c x + w with E[w w'] = q delta has the variance q/(2 beta_c); hence q = 2 beta_c variance. (The online
# platform shows variance * f for q, too large by 1/(2 beta).)
_CONTINUOUS = ContinuousForm(
    filter=(
        Quantity("beta", "inverse correlation time", None, lambda beta, variance, f: beta * f, unit="1/s"),
        Quantity("q", "PSD of the driving noise", "^2/s", lambda beta, variance, f: 2 * beta * f * variance,
                 reads=(0, 1), determined_at=Limit.RANDOM_WALK),
    ),
    datasheet=(
        Quantity("sigma", "standard deviation", "", lambda beta, variance, f: jnp.sqrt(variance),
                 gyro=("deg/h", "deg/s"), accel=("ug", "mg"), reads=(1,), determined_at=Limit.WHITE_NOISE),
        Quantity("tau_c", "correlation time", None, lambda beta, variance, f: 1 / (beta * f), unit="s",
                 gyro=("s", "h"), accel=("s", "h"), in_both=True),
        Quantity("sqrt(q)", "driving noise density", "/sqrt(s)",
                 lambda beta, variance, f: jnp.sqrt(2 * beta * f * variance),
                 gyro=("deg/h/sqrt(h)", "deg/s/sqrt(h)"), accel=("m/s/h/sqrt(h)", "ug/sqrt(s)"), reads=(0, 1),
                 determined_at=Limit.RANDOM_WALK),
        # Below its corner the PSD is flat: over times much longer than tau_c the process is white noise. The PSD of
        # the *sampled* process at 0 is variance (1+phi)/(1-phi)/f; in continuous time, or for a slow process, q/beta^2.
        Quantity("N_0", "density as white noise, far beyond tau_c", "/sqrt(Hz)",
                 lambda beta, variance, f: jnp.sqrt(variance / (jnp.tanh(beta / 2) * f)),
                 gyro=("deg/sqrt(h)", "deg/s/sqrt(Hz)"), accel=("ug/sqrt(Hz)", "m/s/sqrt(h)"), reads=(0, 1),
                 determined_at=Limit.WHITE_NOISE),
    ),
    inverse=lambda beta, q, f: (beta / f, q / (2 * beta)),
)  # fmt: skip


def _of_ar1(quantity: Quantity) -> Quantity:
    """A quantity of GM from the parameters of AR1."""

    def value(phi: Any, sigma2: Any, f: Any) -> Any:
        return quantity.value(-jnp.log(phi), sigma2 / ((1 - phi) * (1 + phi)), f)

    return quantity._replace(value=value, reads=(0,) if quantity.suffix is None else (0, 1))


class GM(AbstractProcess):
    """A first-order Gauss-Markov process by inverse correlation time and variance: a bias that wanders and returns.

    Parameters
    ----------
    beta
        Inverse correlation time, 1/samples: autocovariance variance * exp(-beta |h|).
    variance
        Variance of the process itself, u^2 (not the PSD of its driving noise, which is q = 2 beta f variance).

    Examples
    --------
    >>> np.asarray(gj.GM(beta=0.01, variance=2.0).autocovariance(np.array([0, 100]))).round(6).tolist()
    [2.0, 0.735759]
    >>> gj.GM(beta=gj.Fixed(0.01))  # to be estimated, with its correlation time held
    GM(beta=0.01 fixed)
    """

    beta: Scalar | None
    variance: Scalar | None

    kind: ClassVar[str] = "GM"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("beta", "1/sample", "inverse correlation time"),
        Parameter("variance", "({u})^2", "variance of the process", determined_at=Limit.WHITE_NOISE),
    )
    repeatable: ClassVar[bool] = True
    continuous: ClassVar[ContinuousForm | None] = _CONTINUOUS

    def __init__(self, beta: Any = None, variance: Any = None):
        self._set(beta=beta, variance=variance)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):  # noqa: D102
        return shape[0] * wavelet_variance_over_beta(shape[0], tau)

    @classmethod
    def unit_psd(cls, shape, frequency):  # noqa: D102
        (beta,) = shape
        d = -jnp.expm1(-beta)
        return -jnp.expm1(-2 * beta) / (d * d + 4 * jnp.exp(-beta) * jnp.sin(jnp.pi * frequency) ** 2)

    @classmethod
    def unit_autocovariance(cls, shape, lag):  # noqa: D102
        return jnp.exp(-shape[0] * lag)

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):  # noqa: D102
        return shape[0] * haar_covariance_over_beta(shape[0], lag, n_j, n_k)

    @classmethod
    def shape_from_coordinate(cls, coordinate):  # noqa: D102
        return (namespace(coordinate).exp(coordinate),)

    @classmethod
    def coordinate_from_shape(cls, shape):  # noqa: D102
        return namespace(*shape).log(*shape)

    @classmethod
    def coordinate_bounds(cls, tau_max):  # noqa: D102
        return math.log(_SMALLEST_BETA_TAU / tau_max), math.log(_LARGEST_BETA)

    @classmethod
    def limit_of(cls, shape, tau_max):  # noqa: D102
        if shape[0] > _WHITE_NOISE_BETA:
            return Limit.WHITE_NOISE
        return Limit.RANDOM_WALK if shape[0] * tau_max < _RANDOM_WALK_BETA_TAU else Limit.NONE

    @classmethod
    def start_nodes(cls, tau_max, num):  # noqa: D102
        random_walk, white_noise = cls.coordinate_bounds(tau_max)
        return random_walk, *_log_beta_nodes(tau_max, num - 2), white_noise

    @classmethod
    def correlation_time(cls, shape):  # noqa: D102
        return 1 / shape[0]

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:  # noqa: D102
        self.require_complete()
        beta, variance = self.values
        return _simulate(jnp.exp(-beta), -jnp.expm1(-2 * beta), variance, num_samples, key)

    def state_space(self) -> StateSpace:  # noqa: D102
        self.require_complete()
        beta, variance = self.values
        return scalar_state(jnp.exp(-beta), -jnp.expm1(-2 * beta) * variance, variance)


class AR1(AbstractProcess):
    """A first-order autoregression, x_t = phi x_{t-1} + sigma e_t.

    Parameters
    ----------
    phi
        Coefficient in (-1, 1). For phi > 0 the process is GM(beta = -log(phi), sigma2/(1 - phi^2)).
    sigma2
        Variance of the innovations, u^2.

    Examples
    --------
    >>> gj.AR1(phi=0.5, sigma2=3.0).autocovariance(np.array([0, 1])).tolist()
    [4.0, 2.0]
    """

    phi: Scalar | None
    sigma2: Scalar | None

    kind: ClassVar[str] = "AR1"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("phi", "1", "coefficient", lower=-1.0, upper=1.0),
        Parameter("sigma2", "({u})^2", "variance of the innovations", determined_at=Limit.RANDOM_WALK),
    )
    repeatable: ClassVar[bool] = True
    other_form: ClassVar[type[AbstractProcess] | None] = GM
    continuous: ClassVar[ContinuousForm | None] = ContinuousForm(
        filter=tuple(map(_of_ar1, _CONTINUOUS.filter)),
        datasheet=(
            *map(_of_ar1, _CONTINUOUS.datasheet[:-1]),
            # the same without the logarithm, which phi < 0 has not
            _CONTINUOUS.datasheet[-1]._replace(value=lambda phi, sigma2, f: jnp.sqrt(sigma2 / f) / (1 - phi)),
        ),
        # sigma2 = variance (1 - phi^2), by expm1 since phi may be 1 - 1e-12
        inverse=lambda beta, q, f: (jnp.exp(-beta / f), -q / (2 * beta) * jnp.expm1(-2 * beta / f)),
        undefined="none for phi <= 0",
    )

    def __init__(self, phi: Any = None, sigma2: Any = None):
        self._set(phi=phi, sigma2=sigma2)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):  # noqa: D102
        (phi,) = shape
        slow, beta = _beta_where_slow(phi)
        # sigma2/variance = (1 - phi)(1 + phi) = beta E (1 + phi)
        near_one = wavelet_variance_over_beta(beta, tau) / (exp_ratio(beta) * (1 + jnp.exp(-beta)))
        # the textbook form, free of cancellation here
        f, n = jnp.where(slow, 0.25, phi), tau / 2
        d, e = 1 - f, _one_minus_power(f, n)
        direct = (n * d * (1 + f) - f * e * (2 + e)) / (2 * n * n * d * d * d * (1 + f))
        return jnp.where(slow, near_one, direct)

    @classmethod
    def unit_psd(cls, shape, frequency):  # noqa: D102
        (phi,) = shape
        # of the two forms the one whose terms are both positive
        half = jnp.pi * frequency
        low, high = (1 - phi) ** 2 + 4 * phi * jnp.sin(half) ** 2, (1 + phi) ** 2 - 4 * phi * jnp.cos(half) ** 2
        return 1 / jnp.where(phi < 0, high, low)

    @classmethod
    def unit_autocovariance(cls, shape, lag):  # noqa: D102
        (phi,) = shape
        # phi^0 apart: its derivative at phi = 0 would be NaN
        power = jnp.where(lag == 0, 1.0, phi ** jnp.where(lag == 0, 1.0, lag))
        return power / ((1 - phi) * (1 + phi))

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):  # noqa: D102
        (phi,) = shape
        slow, beta = _beta_where_slow(phi)
        near_one = haar_covariance_over_beta(beta, lag, n_j, n_k) / (exp_ratio(beta) * (1 + jnp.exp(-beta)))
        f = jnp.where(slow, 0.25, phi)
        d = 1 - f
        overlapping = second_differences(
            lambda m, sign: -m * (1 + f) / (2 * d) - f / (d * d) * _real_power(f, m, sign),
            lag,
            parity,
            n_j,
            n_k,
        )
        between = gap(lag, n_j, n_k)
        e_j, e_k = _one_minus_power(f, n_j), _one_minus_power(f, n_k)
        decay = _real_power(f, jnp.maximum(between, 0.0), parity)
        apart = -f / (d * d) * decay * e_j**2 * e_k**2 / (4 * n_j * n_k)
        direct = jnp.where(between >= 0, apart, overlapping) / (d * (1 + f))
        return jnp.where(slow, near_one, direct)

    @classmethod
    def shape_from_coordinate(cls, coordinate):  # noqa: D102
        return (namespace(coordinate).tanh(coordinate / 2),)

    @classmethod
    def coordinate_from_shape(cls, shape):  # noqa: D102
        return 2 * namespace(*shape).arctanh(*shape)

    @classmethod
    def coordinate_bounds(cls, tau_max):  # noqa: D102
        smallest_d = max(_SMALLEST_BETA_TAU / tau_max, 1e-14)
        # at phi -> -1 the process alternates: nothing below 1 - |phi| = 1e-6 is a sensor's noise
        return -math.log(2e6), math.log(2 / smallest_d)

    @classmethod
    def limit_of(cls, shape, tau_max):  # noqa: D102
        return Limit.RANDOM_WALK if (1 - shape[0]) * tau_max < _RANDOM_WALK_BETA_TAU else Limit.NONE

    @classmethod
    def start_nodes(cls, tau_max, num):  # noqa: D102
        alternating, random_walk = cls.coordinate_bounds(tau_max)
        # phi = -0.99, -0.8, -0.5, -0.2, -0.05, -0.01; not 0, which beside a WN is a stationary point
        few = (alternating, -5.3, -2.2, -1.1, -0.4, -0.1, -0.02)
        positive = sorted(-np.log(np.tanh(np.exp(_log_beta_nodes(tau_max, num - 8)) / 2)))
        return *few, *(float(z) for z in positive), random_walk

    @classmethod
    def correlation_time(cls, shape):  # noqa: D102
        xp = namespace(*shape)
        return -1 / xp.log(xp.maximum(xp.abs(*shape), 1e-300))

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:  # noqa: D102
        self.require_complete()
        phi, sigma2 = self.values
        remainder = (1 - phi) * (1 + phi)
        return _simulate(phi, remainder, sigma2 / remainder, num_samples, key)

    def state_space(self) -> StateSpace:  # noqa: D102
        self.require_complete()
        phi, sigma2 = self.values
        return scalar_state(phi, sigma2, sigma2 / ((1 - phi) * (1 + phi)))


def _log_beta_nodes(tau_max: float, num: int) -> list[float]:
    """From ten times the longest span to a twelfth of a sample, ends left out."""
    return [float(x) for x in np.linspace(math.log(0.1 / tau_max), math.log(12.0), num + 2)[1:-1]]


def _simulate(phi: Any, remainder: Any, variance: Any, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:
    """x_t = phi x_{t-1} + sqrt(remainder variance) e_t from x_0 ~ N(0, variance); remainder = 1 - phi^2."""
    e = jax.random.normal(key, (num_samples + 1,), dtype=jnp.float64)
    return first_order_recursion(phi, jnp.sqrt(remainder * variance) * e[1:], jnp.sqrt(variance) * e[0])


def _beta_where_slow(phi: Any) -> tuple[Any, Any]:
    """Where phi > 1/2 (1 - phi is then exact in floating point), and beta = -log(phi) there."""
    slow = phi > 0.5
    return slow, -jnp.log1p(-(1 - jnp.where(slow, phi, 0.75)))


def _real_power(phi: Any, m: Any, sign: Any) -> Any:
    """phi^m for real m >= 0 and either sign of phi, extended smoothly between integers of one parity `sign`."""
    size = jnp.abs(phi)
    power = jnp.where(size > 0, jnp.where(size > 0, size, 1.0) ** m, jnp.where(m == 0, 1.0, 0.0))
    return jnp.where(phi < 0, sign, 1.0) * power


def _one_minus_power(phi: Any, n: Any) -> Any:
    """1 - phi^n for integer n >= 1 given as float; by expm1 where phi^n is near 1, and derivative right at phi = 0."""
    odd = jnp.mod(n, 2) == 1
    near = jnp.abs(phi) > 0.5
    safe = jnp.where(near, phi, 0.75)
    by_expm1 = -jnp.expm1(n * jnp.log(jnp.abs(safe)))
    by_expm1 = jnp.where(odd & (safe < 0), 2 - by_expm1, by_expm1)
    direct = 1 - phi * _real_power(phi, n - 1, jnp.where(odd, 1.0, -1.0))
    return jnp.where(near, by_expm1, direct)
