"""Quantisation noise."""

import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.typing import PRNGKey, Scalar
from gmwm_jax.processes._maths.haar import second_differences, where_filters_overlap
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.continuous_form import AllanLine, ContinuousForm, Quantity
from gmwm_jax.processes.parameter import Parameter
from gmwm_jax.processes.state_space import StateSpace


class QN(AbstractProcess):
    """Quantisation noise, x_t = sqrt(12 q2) (Y_t - Y_{t-1}) with Y uniform on (0, 1).

    What is left in a rate when the integrated signal (angle, velocity) is read in steps.

    Parameters
    ----------
    q2
        Variance of the rounding error of the integrated signal, in (u samples)^2.

    Notes
    -----
    Wavelet variance 6 q2/tau^2. In continuous time the IEEE 952 coefficient is Q = sqrt(q2)/f, and one step of
    the output (LSB) is sqrt(12) Q.

    Examples
    --------
    >>> gj.QN(q2=1.0).wavelet_variance(np.array([2.0, 4.0])).tolist()
    [1.5, 0.375]
    """

    q2: Scalar | None

    kind: ClassVar[str] = "QN"
    white_part: ClassVar[int | None] = 1
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("q2", "({u})^2", "variance of the rounding error"),)
    in_filter: ClassVar[bool] = False
    continuous: ClassVar[ContinuousForm | None] = ContinuousForm(
        filter=(Quantity("Q", "quantisation coefficient", "*s", lambda q2, f: jnp.sqrt(q2) / f),),
        datasheet=(
            Quantity("Q", "quantisation coefficient", "*s", lambda q2, f: jnp.sqrt(q2) / f,
                     gyro=("arcsec", "urad"), accel=("m/s", "mm/s")),
            # a rounding error uniform over one step has the variance LSB^2/12 (IEEE 952, C.1.1)
            Quantity("LSB", "increment per bit", "*s", lambda q2, f: jnp.sqrt(12 * q2) / f,
                     gyro=("arcsec", "urad"), accel=("m/s", "mm/s")),
        ),
        inverse=lambda Q, f: ((Q * f) ** 2,),
        allan_line=AllanLine(-1.0, math.sqrt(3.0)),
    )  # fmt: skip

    def __init__(self, q2: Any = None):
        self._set(q2=q2)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):  # noqa: D102
        return 6 / (tau * tau)

    @classmethod
    def unit_psd(cls, shape, frequency):  # noqa: D102
        return 4 * jnp.sin(jnp.pi * frequency) ** 2

    @classmethod
    def unit_autocovariance(cls, shape, lag):  # noqa: D102
        return jnp.where(lag == 0, 2.0, jnp.where(lag == 1, -1.0, 0.0))

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):  # noqa: D102
        # the running sum is white: K is 1 at 0 and 0 elsewhere
        inside = second_differences(lambda m, _: jnp.where(m < 0.25, 1.0, 0.0), lag, parity, n_j, n_k)
        return where_filters_overlap(inside, lag, n_j, n_k)

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:  # noqa: D102
        self.require_complete()
        rounding = jax.random.uniform(key, (num_samples + 1,), dtype=jnp.float64)
        return jnp.sqrt(12 * self.amplitude) * (rounding[1:] - rounding[:-1])

    def state_space(self) -> StateSpace:
        """The last two rounding errors, (Y_t, Y_{t-1}), of which the difference is read."""
        self.require_complete()
        q2 = self.amplitude
        shift, newest = jnp.array([[0.0, 0.0], [1.0, 0.0]]), jnp.array([[1.0, 0.0], [0.0, 0.0]])
        return StateSpace(shift, q2 * newest, jnp.array([1.0, -1.0]), q2 * jnp.eye(2), jnp.zeros(()))

    def bounded_integral(self) -> Any:
        """That of the difference of two rounding errors, the last and the first."""
        self.require_complete()
        return 2 * self.amplitude
