"""White noise."""

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
from gmwm_jax.processes.state_space import StateSpace, no_state


class WN(AbstractProcess):
    """White noise, x_t = sigma e_t with e standard normal: the angle or velocity random walk of a sensor.

    Parameters
    ----------
    sigma2
        Variance of a sample, u^2.

    Notes
    -----
    Wavelet variance sigma2/tau (Percival 1995). In continuous time q = sigma2/f, N = sqrt(q) in u/sqrt(Hz).

    Examples
    --------
    >>> gj.WN(sigma2=4.0).wavelet_variance(np.array([2.0, 4.0])).tolist()
    [2.0, 1.0]
    """

    sigma2: Scalar | None

    kind: ClassVar[str] = "WN"
    white_part: ClassVar[int | None] = 0
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("sigma2", "({u})^2", "variance"),)
    continuous: ClassVar[ContinuousForm | None] = ContinuousForm(
        filter=(Quantity("q", "PSD", "^2/Hz", lambda sigma2, f: sigma2 / f),),
        datasheet=(
            Quantity("N", "random walk (ARW, VRW)", "/sqrt(Hz)", lambda sigma2, f: jnp.sqrt(sigma2 / f),
                     gyro=("deg/sqrt(h)", "deg/s/sqrt(Hz)"), accel=("ug/sqrt(Hz)", "m/s/sqrt(h)")),
        ),
        inverse=lambda q, f: (q * f,),
        allan_line=AllanLine(-0.5, 1.0),
    )  # fmt: skip

    def __init__(self, sigma2: Any = None):
        self._set(sigma2=sigma2)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):  # noqa: D102
        return 1 / tau

    @classmethod
    def unit_psd(cls, shape, frequency):  # noqa: D102
        return jnp.ones_like(frequency)

    @classmethod
    def unit_autocovariance(cls, shape, lag):  # noqa: D102
        return jnp.where(lag == 0, 1.0, 0.0)

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):  # noqa: D102
        inside = second_differences(lambda m, _: -m / 2, lag, parity, n_j, n_k)
        return where_filters_overlap(inside, lag, n_j, n_k)

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:  # noqa: D102
        self.require_complete()
        return jnp.sqrt(self.amplitude) * jax.random.normal(key, (num_samples,), dtype=jnp.float64)

    def state_space(self) -> StateSpace:  # noqa: D102
        self.require_complete()
        return no_state(self.amplitude)
