"""Second- and third-order Gauss-Markov processes, which are the Matern processes of smoothness 3/2 and 5/2.

White noise through p equal low-pass filters of time constant 1/beta has the spectrum 1/(omega^2 + beta^2)^p. p = 1 is
the GM; p = 2 and 3 are the second- and third-order Gauss-Markov processes of navigation (Gelb 1974, table 2.2-1), and
in R's MAT(sigma2, lambda, alpha) lambda = beta and alpha = p. Other smoothness has no finite state and is left out.

Derivation. With x = beta |h|,

    (1 + x) exp(-x) = (1 - beta d/dbeta) exp(-x),    (1 + x + x^2/3) exp(-x) = (1 - beta d + beta^2 d^2/3) exp(-x),

so everything that is linear in the autocovariance follows from the GM's by differentiation. Where the GM's is beta f,

    second order: -beta^2 f',    third order: beta^2 (beta f'' - f')/3,

and the stable f of `gauss_markov` gives stable results: f' < 0 < f'' and nothing cancels. For the PSD f is a function
of y = beta^2, and they are -2 beta^3 df/dy and (4/3) beta^5 d^2f/dy^2.
"""

from collections.abc import Callable
from math import comb
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax._safe import exp_tail, four_sinh_squared, sinh_ratio
from gmwm_jax._typing import PRNGKey, Scalar
from gmwm_jax.processes._base import AbstractProcess
from gmwm_jax.processes._parameter import Parameter
from gmwm_jax.processes._recursion import first_order_recursion
from gmwm_jax.processes._state_space import StateSpace
from gmwm_jax.processes.gauss_markov import GM, haar_covariance_over_beta, wavelet_variance_over_beta

# Nearer to white noise than this, a fit reports it: the wavelet variance differs by less than 1 %.
_WHITE_NOISE_BETA = 10.0
_DRIFT_BETA_TAU = 1e-2
_LARGEST_BETA = 60.0
"""Beyond it the spectrum is flat in all digits, and cosh(beta) would overflow in the end."""


def _derivative(f: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda x: jax.jvp(f, (x,), (jnp.ones_like(x),))[1]


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
    def _from_gauss_markov(cls, f: Callable[[Any], Any], beta: Any) -> Any:
        """A linear function of the autocovariance from that of the GM, divided by beta."""
        slope = _derivative(f)
        if cls.order == 2:
            return -beta * beta * slope(beta)
        return beta * beta * (beta * _derivative(slope)(beta) - slope(beta)) / 3

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):
        return cls._from_gauss_markov(lambda beta: wavelet_variance_over_beta(beta, tau), shape[0])

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):
        return cls._from_gauss_markov(lambda beta: haar_covariance_over_beta(beta, lag, n_j, n_k), shape[0])

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
            return "white noise"
        return "drift" if shape[0] * tau_max < _DRIFT_BETA_TAU else ""

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


class MAT32(_Matern):
    """Second-order Gauss-Markov process (critically damped), or Matern process of smoothness 3/2.

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
    """

    kind: ClassVar[str] = "MAT32"
    order: ClassVar[int] = 2


class MAT52(_Matern):
    """Third-order Gauss-Markov process, or Matern process of smoothness 5/2.

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
    """

    kind: ClassVar[str] = "MAT52"
    order: ClassVar[int] = 3
