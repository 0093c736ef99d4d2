"""Random walk."""

import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.typing import PRNGKey, Scalar
from gmwm_jax.processes._maths.haar import second_differences, where_filters_overlap
from gmwm_jax.processes._maths.recursion import first_order_recursion
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.continuous_form import AllanLine, ContinuousForm, Quantity
from gmwm_jax.processes.parameter import Parameter
from gmwm_jax.processes.state_space import StateSpace, scalar_state


class RW(AbstractProcess):
    """A random walk, x_t = x_{t-1} + gamma e_t from x_0 = 0: the rate random walk of a gyro.

    Parameters
    ----------
    gamma2
        Variance of one step, u^2.

    Notes
    -----
    Wavelet variance gamma2 (tau^2 + 2)/(12 tau) (Guerrier et al. 2013). In continuous time q = gamma2 f, K = sqrt(q).

    Examples
    --------
    >>> gj.RW(gamma2=12.0).wavelet_variance(np.array([2.0, 4.0])).tolist()
    [3.0, 4.5]
    """

    gamma2: Scalar | None

    kind: ClassVar[str] = "RW"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("gamma2", "({u})^2", "variance of a step"),)
    continuous: ClassVar[ContinuousForm | None] = ContinuousForm(
        filter=(Quantity("q", "PSD of the driving noise", "^2/s", lambda gamma2, f: gamma2 * f),),
        datasheet=(
            Quantity("K", "rate random walk", "/sqrt(s)", lambda gamma2, f: jnp.sqrt(gamma2 * f),
                     gyro=("deg/h/sqrt(h)", "deg/s/sqrt(h)"), accel=("m/s/h/sqrt(h)", "ug/sqrt(s)")),
        ),
        inverse=lambda q, f: (q / f,),
        allan_line=AllanLine(0.5, 1 / math.sqrt(3.0)),
    )  # fmt: skip

    def __init__(self, gamma2: Any = None):
        self._set(gamma2=gamma2)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):  # noqa: D102
        return (tau * tau + 2) / (12 * tau)

    @classmethod
    def unit_psd(cls, shape, frequency):  # noqa: D102
        return 1 / (4 * jnp.sin(jnp.pi * frequency) ** 2)

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):  # noqa: D102
        inside = second_differences(lambda m, _: (m * m * m - m) / 12, lag, parity, n_j, n_k)
        return where_filters_overlap(inside, lag, n_j, n_k)

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:  # noqa: D102
        self.require_complete()
        steps = jnp.sqrt(self.amplitude) * jax.random.normal(key, (num_samples,), dtype=jnp.float64)
        return first_order_recursion(jnp.ones(()), steps)

    def state_space(self) -> StateSpace:  # noqa: D102
        self.require_complete()
        return scalar_state(jnp.ones(()), self.amplitude, self.amplitude)
