"""A sinusoid of unknown phase: a vibration, a daily cycle."""

import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.host import namespace
from gmwm_jax._internal.typing import PRNGKey, Scalar
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.continuous_form import ContinuousForm, Quantity
from gmwm_jax.processes.parameter import Limit, Parameter
from gmwm_jax.processes.state_space import StateSpace

# Slower than the first, it is a drift to all digits a fit can see; slower than the second, a drift within 1 %.
_SMALLEST_BETA_TAU = 1e-4
_DRIFT_BETA_TAU = 0.4


class SIN(AbstractProcess):
    """A sinusoid, x_t = sqrt(alpha2) sin(beta t + U), whose phase U is uniform on (0, 2 pi).

    Parameters
    ----------
    beta
        Angular frequency, rad/sample, between 0 and pi.
    alpha2
        Square of the amplitude, u^2.

    Notes
    -----
    Wavelet variance alpha2 sin(beta n/2)^4 / (2 n^2 sin(beta/2)^2), n = tau/2. Stationary, but neither Gaussian nor
    ergodic: a record has one phase, and its wavelet variance hardly scatters. There is no covariance of the wavelet
    variance, and a model that has one gets no intervals from theory.

    Examples
    --------
    >>> gj.SIN(beta=np.pi / 2, alpha2=2.0).autocovariance(np.array([0, 2])).round(9).tolist()
    [1.0, -1.0]
    """

    beta: Scalar | None
    alpha2: Scalar | None

    kind: ClassVar[str] = "SIN"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("beta", "rad/sample", "angular frequency", upper=math.pi),
        Parameter("alpha2", "({u})^2", "square of the amplitude"),
    )
    repeatable: ClassVar[bool] = True
    ergodic: ClassVar[bool] = False
    driven: ClassVar[bool] = False
    continuous: ClassVar[ContinuousForm | None] = ContinuousForm(
        filter=(
            Quantity("omega", "angular frequency", None, lambda beta, alpha2, f: beta * f, unit="rad/s"),
            Quantity("alpha2", "square of the amplitude", "^2", lambda beta, alpha2, f: 1.0 * alpha2, reads=(1,)),
        ),
        datasheet=(
            Quantity("f_0", "frequency", None, lambda beta, alpha2, f: beta * f / (2 * jnp.pi), unit="1/s",
                     gyro=("Hz",), accel=("Hz",)),
            Quantity("alpha", "amplitude", "", lambda beta, alpha2, f: jnp.sqrt(alpha2), reads=(1,),
                     gyro=("deg/h", "deg/s"), accel=("ug", "mg")),
        ),
        inverse=lambda omega, alpha2, f: (omega / f, 1.0 * alpha2),
    )  # fmt: skip

    def __init__(self, beta: Any = None, alpha2: Any = None):
        self._set(beta=beta, alpha2=alpha2)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):  # noqa: D102
        return _gain(shape[0], tau / 2) ** 2 / 2

    @classmethod
    def unit_psd(cls, shape, frequency):  # noqa: D102
        raise ValueError("SIN is a line in the spectrum: it has no power spectral density. Use wavelet_variance().")

    @classmethod
    def unit_autocovariance(cls, shape, lag):  # noqa: D102
        return jnp.cos(shape[0] * lag) / 2

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):  # noqa: D102
        # both coefficients are sinusoids, in phase with the samples at the middle of their filters
        (beta,) = shape
        return _gain(beta, n_j) * _gain(beta, n_k) * jnp.cos(beta * (lag - n_j + n_k)) / 2

    @classmethod
    def shape_from_coordinate(cls, coordinate):  # noqa: D102
        return (math.pi / (1 + namespace(coordinate).exp(-coordinate)),)

    @classmethod
    def coordinate_from_shape(cls, shape):  # noqa: D102
        log = namespace(*shape).log
        return log(shape[0]) - log(math.pi - shape[0])

    @classmethod
    def coordinate_bounds(cls, tau_max):  # noqa: D102
        return math.log(_SMALLEST_BETA_TAU / tau_max), math.log(1e6)

    @classmethod
    def limit_of(cls, shape, tau_max):  # noqa: D102
        return Limit.DRIFT if shape[0] * tau_max < _DRIFT_BETA_TAU else Limit.NONE

    @classmethod
    def start_nodes(cls, tau_max, num):  # noqa: D102
        slow, fast = cls.coordinate_bounds(tau_max)
        # from a quarter of a period in the longest span on
        return slow, *(float(z) for z in np.linspace(math.log(0.5 / tau_max), 4.0, num - 2)), fast

    @classmethod
    def correlation_time(cls, shape):
        """A radian of its period: it never decorrelates."""
        return 1 / shape[0]

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:  # noqa: D102
        self.require_complete()
        beta, alpha2 = self.values
        phase = jax.random.uniform(key, (), dtype=jnp.float64, maxval=2 * math.pi)
        return jnp.sqrt(alpha2) * jnp.sin(beta * jnp.arange(1, num_samples + 1, dtype=jnp.float64) + phase)

    def state_space(self) -> StateSpace:
        """The sinusoid and its quadrature, turned by beta a sample: no driving noise, only an unknown start."""
        self.require_complete()
        beta, alpha2 = self.values
        c, s = jnp.cos(beta), jnp.sin(beta)
        transition = jnp.stack([jnp.stack([c, s]), jnp.stack([-s, c])])
        return StateSpace(transition, jnp.zeros((2, 2)), jnp.array([1.0, 0.0]), alpha2 / 2 * jnp.eye(2), jnp.zeros(()))


def _gain(beta: Any, n: Any) -> Any:
    """|(1 - z^n)^2/(1 - z)|/(2n) at z = exp(-i beta): the Haar filter of half span n on a sinusoid."""
    return jnp.sin(beta * n / 2) ** 2 / (n * jnp.sin(beta / 2))
