"""Drift (rate ramp)."""

import math
from typing import Any, ClassVar

import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.host import namespace
from gmwm_jax._internal.typing import PRNGKey, Scalar
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.continuous_form import AllanLine, ContinuousForm, Quantity
from gmwm_jax.processes.parameter import Parameter
from gmwm_jax.processes.state_space import StateSpace


class DR(AbstractProcess):
    """A drift, x_t = omega t, which has no randomness but its unknown sign.

    Parameters
    ----------
    omega
        Slope per sample, u. Its sign cannot be seen in a variance and is taken as positive.

    Notes
    -----
    Wavelet variance omega^2 tau^2/16. In continuous time the slope is omega f.

    Examples
    --------
    >>> gj.DR(omega=1.0).wavelet_variance(np.array([2.0, 4.0])).tolist()
    [0.25, 1.0]
    """

    omega: Scalar | None

    kind: ClassVar[str] = "DR"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("omega", "{u}", "slope"),)
    deterministic: ClassVar[bool] = True
    driven: ClassVar[bool] = False
    continuous: ClassVar[ContinuousForm | None] = ContinuousForm(
        filter=(Quantity("R", "rate ramp", "/s", lambda omega, f: omega * f),),
        datasheet=(
            Quantity("R", "rate ramp", "/s", lambda omega, f: omega * f,
                     gyro=("deg/h/h", "deg/s/h"), accel=("ug/h", "mg/h")),
        ),
        inverse=lambda R, f: (R / f,),
        allan_line=AllanLine(1.0, 1 / math.sqrt(2.0)),
    )  # fmt: skip

    def __init__(self, omega: Any = None):
        self._set(omega=omega)

    @staticmethod
    def amplitude_of(value: Any) -> Any:  # noqa: D102
        return value * value

    @staticmethod
    def value_of(amplitude: Any) -> Any:  # noqa: D102
        xp, positive = namespace(amplitude), amplitude > 0
        return xp.where(positive, xp.sqrt(xp.where(positive, amplitude, 1.0)), 0.0)

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):  # noqa: D102
        return tau * tau / 16

    @classmethod
    def unit_psd(cls, shape, frequency):  # noqa: D102
        raise ValueError("DR is deterministic: it has no power spectral density. Use wavelet_variance().")

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):  # noqa: D102
        return jnp.zeros_like(lag)

    @classmethod
    def unit_haar_mean(cls, n_j):  # noqa: D102
        # half the difference of two means that lie n samples apart
        return n_j / 2

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:  # noqa: D102
        self.require_complete()
        return self.values[0] * jnp.arange(1, num_samples + 1, dtype=jnp.float64)

    def state_space(self) -> StateSpace:
        """Value and slope. The sign of the slope is unknown: as a random variable it has mean 0, variance omega^2."""
        self.require_complete()
        transition = jnp.array([[1.0, 1.0], [0.0, 1.0]])
        initial = self.amplitude * jnp.ones((2, 2))
        return StateSpace(transition, jnp.zeros((2, 2)), jnp.array([1.0, 0.0]), initial, jnp.zeros(()))

    @classmethod
    def state_names(cls, num: int) -> tuple[str, ...]:  # noqa: D102
        return "", "slope"
