"""Second- and third-order Gauss-Markov processes, which are the Matern processes of smoothness 3/2 and 5/2.

White noise through p equal low-pass filters of time constant 1/beta has the spectrum 1/(omega^2 + beta^2)^p. p = 1 is
the GM; p = 2 and 3 are the second- and third-order Gauss-Markov processes of navigation (Gelb 1974, table 2.2-1), and
in R's MAT(sigma2, lambda, alpha) lambda = beta and alpha = p. Other smoothness has no finite state and is left out.

Derivation. With x = beta |h| and D = beta d/dbeta,

    (1 + x) exp(-x) = (1 - D) exp(-x),    (1 + x + x^2/3) exp(-x) = (1 - D) (1 - D/3) exp(-x),

so everything that is linear in the autocovariance follows from the GM's by differentiation. For its generalised
covariance s (1 - exp(-beta m)) - (m/2) coth(beta/2), s = 1/(4 sinh(beta/2)^2), they are, with x = beta m and less
multiples of 1 and m^2, which no Haar coefficient sees,

    second order: s [T + q C + m L],    third order: s [U + (2/3) q T + w C + m Z],

    C = 1 - e - x + x^2/2,    T = 3 (1 - e) - x e - 2 x + x^2/2,    U = (5 T - x dT/dx)/3,    e = exp(-x),
    q = beta coth(beta/2) - 2,                      w = (beta^2 + 6 beta^2 s - 3 beta coth(beta/2))/3,
    L = beta (1 + q) - sinh(beta),                  Z = beta^3 (1/3 + 2 s) - beta - sinh(beta).

For small beta each of these is a high power of x or beta times a series: C ~ x^3/6, T ~ x^4/24, U ~ x^4/72,
q ~ beta^2/6, w ~ beta^4/90, L ~ -beta^5/90, Z ~ -beta^7/1890. The wavelet variance (2 K(2n) - 8 K(n))/tau^2 is then
a sum of positive terms. Where the filters do not overlap the GM's covariance is a product of powers, of which D takes
the logarithmic derivative. For the PSD the GM's is beta f(y), y = beta^2, and they are -2 beta^3 df/dy and
(4/3) beta^5 d^2f/dy^2.
"""

from collections.abc import Callable
from math import comb, factorial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import scipy.special
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.typing import PRNGKey, Scalar
from gmwm_jax.processes._maths.haar import gap, second_differences
from gmwm_jax.processes._maths.recursion import first_order_recursion
from gmwm_jax.processes._series import (
    exp_cubic,
    exp_ratio,
    exp_tail,
    four_sinh_squared,
    haar_exp,
    series_or,
    sinh_ratio,
)
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.continuous_form import ContinuousForm
from gmwm_jax.processes.gauss_markov import GM
from gmwm_jax.processes.parameter import Limit, Parameter
from gmwm_jax.processes.state_space import StateSpace

# Nearer to white noise than this, a fit reports it: the wavelet variance differs by less than 1 %.
_WHITE_NOISE_BETA = 10.0
_DRIFT_BETA_TAU = 1e-2
_LARGEST_BETA = 60.0
"""Beyond it the spectrum is flat in all digits, and cosh(beta) would overflow in the end."""


_BERNOULLI = [float(b) / factorial(2 * k) for k, b in enumerate(scipy.special.bernoulli(22)[::2])]
"""B_2k/(2k)!: half beta coth(beta/2) is the sum of these times beta^2k, and beta^2 s that of -(2k - 1) times them."""


def _derivative(f: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda x: jax.jvp(f, (x,), (jnp.ones_like(x),))[1]


def _coth(beta: Any) -> Any:
    return beta / jnp.tanh(beta / 2)


def _q(beta: Any) -> Any:
    """q/beta^2."""
    series = [2 * b for b in _BERNOULLI[1:]]
    return series_or(beta * beta, series, lambda y: (_coth(jnp.sqrt(y)) - 2) / y)


def _w(beta: Any) -> Any:
    """w/beta^4."""
    series = [-4 * k * b for k, b in enumerate(_BERNOULLI)][2:]

    def direct(y: Any) -> Any:
        return (y + 6 * y / four_sinh_squared(y) - 3 * _coth(jnp.sqrt(y))) / (3 * y * y)

    return series_or(beta * beta, series, direct)


def _L(beta: Any) -> Any:
    """L/beta^5."""
    series = [2 * b - 1 / factorial(2 * k + 1) for k, b in enumerate(_BERNOULLI)][2:]
    return series_or(beta * beta, series, lambda y: (_coth(jnp.sqrt(y)) - 1 - sinh_ratio(y)) / (y * y))


def _Z(beta: Any) -> Any:
    """Z/beta^7."""
    series = [-2 * (2 * k - 1) * b - 1 / factorial(2 * k + 1) for k, b in enumerate(_BERNOULLI)][3:]

    def direct(y: Any) -> Any:
        return (y / 3 + 2 * y / four_sinh_squared(y) - 1 - sinh_ratio(y)) / (y * y * y)

    return series_or(beta * beta, series, direct)


def _T(x: Any) -> Any:
    """T/x^4."""
    series = [(-1) ** k * (k - 3) / factorial(k) for k in range(4, 23)]
    return series_or(x, series, lambda y: (-3 * jnp.expm1(-y) - y * (jnp.exp(-y) + 2 - y / 2)) / y**4, 1.0)


def _U(x: Any) -> Any:
    """U/x^4."""
    series = [(-1) ** k * (k - 3) * (5 - k) / (3 * factorial(k)) for k in range(4, 23)]

    def direct(y: Any) -> Any:
        return (-5 * jnp.expm1(-y) - y * ((7 + y) * jnp.exp(-y) + 8 - 1.5 * y) / 3) / y**4

    return series_or(x, series, direct, 1.0)


def _haar_T(x: Any) -> Any:
    """(T(2x) - 4 T(x))/x^4, the response of the wavelet variance."""
    series = [(-1) ** k * (2.0**k - 4) * (k - 3) / factorial(k) for k in range(4, 29)]

    def direct(y: Any) -> Any:
        e = jnp.exp(-y)
        return (-9 + e * (12 - 3 * e) + y * (4 + e * (4 - 2 * e))) / y**4

    return series_or(x, series, direct, 1.0)


def _haar_U(x: Any) -> Any:
    """(U(2x) - 4 U(x))/x^4."""
    series = [(-1) ** k * (2.0**k - 4) * (k - 3) * (5 - k) / (3 * factorial(k)) for k in range(4, 29)]

    def direct(y: Any) -> Any:
        e = jnp.exp(-y)
        return (-15 + e * (20 - 5 * e) + y * (16 + e * (28 - 14 * e) + y * e * (4 - 4 * e)) / 3) / y**4

    return series_or(x, series, direct, 1.0)


class _Matern(AbstractProcess):
    """What the two have in common: the parameters of GM, and a cascade of `order` low-pass filters."""

    beta: Scalar | None
    variance: Scalar | None

    order: ClassVar[int]
    parameters: ClassVar[tuple[Parameter, ...]] = GM.parameters
    repeatable: ClassVar[bool] = True

    def __init__(self, beta: Any = None, variance: Any = None):
        self._set(beta=beta, variance=variance)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):
        beta, n = jnp.minimum(shape[0], _LARGEST_BETA), tau / 2
        x, q = beta * n, beta * beta * _q(beta)
        if cls.order == 2:
            smooth, cubic, linear = _haar_T(x), _q(beta), _L(beta)
        else:
            smooth, cubic, linear = _haar_U(x) + 2 / 3 * q * _haar_T(x), beta * beta * _w(beta), beta * beta * _Z(beta)
        terms = x * x * smooth + beta * beta * x * cubic * haar_exp(x) - 2 * beta**3 * linear / n
        return jnp.exp(-beta) * terms / (2 * exp_ratio(beta) ** 2)

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):
        beta = jnp.minimum(shape[0], _LARGEST_BETA)
        safe_beta = jnp.maximum(beta, 1e-30)
        s = jnp.exp(-beta) / exp_ratio(beta) ** 2  # times beta^2
        q, w = beta * beta * _q(beta), beta**4 * _w(beta)
        linear = beta**3 * (_L(beta) if cls.order == 2 else beta * beta * _Z(beta))

        def slow(m: Any, _: Any) -> Any:
            x = beta * m
            smooth = _T(x) if cls.order == 2 else _U(x) + 2 / 3 * q * _T(x)
            cubic = _q(beta) if cls.order == 2 else beta * beta * _w(beta)
            return m * (x * x * m * smooth + beta * x * x * cubic * exp_cubic(x) + linear)

        def fast(m: Any, _: Any) -> Any:
            x = beta * m
            if cls.order == 2:
                decaying, steady = 3 + q + x, 2 + q
            else:
                decaying, steady = 5 + 2 * q + w + x * (7 + 2 * q + x) / 3, (8 + 4 * q) / 3 + w
            return m * linear - (decaying * jnp.exp(-x) + steady * x) / (safe_beta * safe_beta)

        ones = jnp.ones_like(lag)
        # with or without the m^2 term, whichever leaves the smaller numbers to cancel
        overlapping = jnp.where(
            beta * (n_j + n_k) < 2,
            second_differences(slow, lag, ones, n_j, n_k),
            second_differences(fast, lag, ones, n_j, n_k),
        )
        # filters apart: the GM's covariance is a product, D of its logarithm is a sum
        between = gap(lag, n_j, n_k)
        x_0, x_j, x_k = beta * jnp.maximum(between, 0.0), beta * n_j, beta * n_k
        e_j, e_k = exp_ratio(x_j), exp_ratio(x_k)
        r_j, r_k = jnp.exp(-x_j) / e_j, jnp.exp(-x_k) / e_k
        slope = 2 * (r_j + r_k) - (2 + q) - x_0
        factor = 1 - slope
        if cls.order == 3:
            curvature = 2 * (r_j * (1 - x_j - r_j) + r_k * (1 - x_k - r_k)) - (2 + q - 2 * s) - x_0
            factor = 1 + (slope * (slope - 4) + curvature) / 3
        apart = -beta * beta * jnp.exp(-x_0) * (n_j * e_j * e_j) * (n_k * e_k * e_k) / 4 * factor
        return s * jnp.where(between >= 0, apart, overlapping)

    @classmethod
    def unit_psd(cls, shape, frequency):
        beta = jnp.minimum(shape[0], _LARGEST_BETA)
        chord = 4 * jnp.sin(jnp.pi * frequency) ** 2
        slope = _derivative(lambda y: 2 * sinh_ratio(y) / (four_sinh_squared(y) + chord))
        if cls.order == 2:
            return -2 * beta**3 * slope(beta * beta)
        return 4 / 3 * beta**5 * _derivative(slope)(beta * beta)

    @classmethod
    def unit_autocovariance(cls, shape, lag):
        x = shape[0] * lag
        return (1 + x + (x * x / 3 if cls.order == 3 else 0.0)) * jnp.exp(-x)

    @classmethod
    def shape_from_coordinate(cls, coordinate):
        return GM.shape_from_coordinate(coordinate)

    @classmethod
    def coordinate_from_shape(cls, shape):
        return GM.coordinate_from_shape(shape)

    @classmethod
    def coordinate_bounds(cls, tau_max):
        return GM.coordinate_bounds(tau_max)

    @classmethod
    def limit_of(cls, shape, tau_max):
        if shape[0] > _WHITE_NOISE_BETA:
            return Limit.WHITE_NOISE
        return Limit.DRIFT if shape[0] * tau_max < _DRIFT_BETA_TAU else Limit.NONE

    @classmethod
    def start_nodes(cls, tau_max, num):
        return GM.start_nodes(tau_max, num)

    @classmethod
    def correlation_time(cls, shape):
        return 1 / shape[0]

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:
        form = self.state_space()
        e = jax.random.normal(key, (num_samples + 1, self.order), dtype=jnp.float64)
        start = jnp.linalg.cholesky(form.initial) @ e[0]
        # rows and columns of equal size before the factorisation: the variances differ by powers of beta
        size = jnp.sqrt(jnp.diagonal(form.driving))
        size = jnp.where(size > 0, size, 1.0)
        factor = size[:, None] * jnp.linalg.cholesky(form.driving / (size[:, None] * size[None, :]))
        driving = e[1:] @ factor.T
        # from the input of the cascade (the last state) to its output, each a first-order recursion in those before
        states: list[Array] = []
        for i in reversed(range(self.order)):
            total = driving[:, i]
            for j, before in zip(reversed(range(i + 1, self.order)), states, strict=True):
                total = total + form.transition[i, j] * jnp.concatenate([start[j : j + 1], before[:-1]])
            states.append(first_order_recursion(form.transition[i, i], total, start[i]))
        return states[-1]

    def state_space(self) -> StateSpace:
        """The outputs of the low-pass filters, the last filter (which is the process) first."""
        self.require_complete()
        beta, variance = self.values
        # Filter a = 1..p has the response (beta t)^(a-1)/(a-1)! exp(-beta t) to white noise of PSD 2 beta: hence
        # Cov(a, b) = C(a+b-2, a-1)/2^(a+b-2), of which the last sample has driven the share exp_tail(a+b-1, 2 beta).
        at = range(self.order, 0, -1)
        share = variance / (comb(2 * self.order - 2, self.order - 1) / 4 ** (self.order - 1))
        initial = share * jnp.array([[comb(a + b - 2, a - 1) / 2 ** (a + b - 2) for b in at] for a in at])
        driven = jnp.stack([jnp.stack([exp_tail(a + b - 1, 2 * beta) for b in at]) for a in at])
        powers = [jnp.ones_like(beta), beta, beta * beta / 2]
        zero = jnp.zeros_like(beta)
        transition = jnp.stack([jnp.stack([powers[a - b] if a >= b else zero for b in at]) for a in at])
        readout = jnp.zeros(self.order).at[0].set(1.0)
        return StateSpace(jnp.exp(-beta) * transition, initial * driven, readout, initial, jnp.zeros(()))


def _continuous(power: int, factor: float, dimension: str, white: Callable[..., Any]) -> ContinuousForm:
    """Low-pass filters in a row: q = factor beta^power variance drives (d/dt + beta)^p x (Gelb 1974)."""
    assert GM.continuous is not None
    beta, q = GM.continuous.filter
    sigma, time, _, density = GM.continuous.datasheet
    return ContinuousForm(
        filter=(
            beta,
            q._replace(
                suffix=f"^2/{dimension}",
                value=lambda beta, variance, f: factor * (beta * f) ** power * variance,
                determined_at=Limit.DRIFT,
            ),
        ),
        datasheet=(
            sigma,
            time._replace(meaning="time constant"),
            density._replace(value=lambda beta, variance, f: jnp.sqrt(white(beta) * variance / f)),
        ),
        inverse=lambda beta, q, f: (beta / f, q / (factor * beta**power)),
    )


# the PSD at frequency 0, by differentiating that of GM, coth(beta/2): see the head of this file
def _white_32(beta: Any) -> Any:
    return 1 / jnp.tanh(beta / 2) + beta / 2 / jnp.sinh(beta / 2) ** 2


def _white_52(beta: Any) -> Any:
    squared = jnp.sinh(beta / 2) ** 2
    return (1 + beta * beta / 6 / squared) / jnp.tanh(beta / 2) + beta / 2 / squared


class MAT32(_Matern):
    """A second-order, critically damped Gauss-Markov process, also known as the Matern process of smoothness 3/2.

    Autocovariance variance (1 + beta |h|) exp(-beta |h|): a bias that wanders without kinks, unlike GM.

    Parameters
    ----------
    beta
        Inverse time constant, 1/samples.
    variance
        Variance of the process, u^2.

    Notes
    -----
    In continuous time x'' + 2 beta x' + beta^2 x = w with the PSD q = 4 beta^3 variance of w (Gelb 1974). R's MAT with
    alpha = 2, lambda = beta.

    Examples
    --------
    >>> np.asarray(gj.MAT32(beta=0.5, variance=1.0).autocovariance(np.array([0, 2]))).round(6).tolist()
    [1.0, 0.735759]
    """

    kind: ClassVar[str] = "MAT32"
    order: ClassVar[int] = 2
    continuous: ClassVar[ContinuousForm | None] = _continuous(3, 4.0, "s^3", _white_32)


class MAT52(_Matern):
    """A third-order Gauss-Markov process, also known as the Matern process of smoothness 5/2.

    Autocovariance variance (1 + beta |h| + (beta h)^2/3) exp(-beta |h|).

    Parameters
    ----------
    beta
        Inverse time constant, 1/samples.
    variance
        Variance of the process, u^2.

    Notes
    -----
    In continuous time (d/dt + beta)^3 x = w with the PSD q = 16/3 beta^5 variance of w (Gelb 1974). R's MAT with
    alpha = 3, lambda = beta.

    Examples
    --------
    >>> np.asarray(gj.MAT52(beta=0.5, variance=1.0).autocovariance(np.array([0, 2]))).round(6).tolist()
    [1.0, 0.858385]
    """

    kind: ClassVar[str] = "MAT52"
    order: ClassVar[int] = 3
    continuous: ClassVar[ContinuousForm | None] = _continuous(5, 16 / 3, "s^5", _white_52)
