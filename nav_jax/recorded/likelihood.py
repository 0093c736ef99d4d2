r"""The likelihood of the innovations of a filter over a record, and its derivatives by noise parameters.

Innovations of a filter that believes the truth are independent and Gaussian with the variances s that it states, so

    -2 log L = sum nu^2/s + log s      over all scalars that are measured (Schweppe 1965),

as a function of the parameters through the whole filter, of which autodiff makes the derivatives.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from gmwm_jax._internal.programs import bounded
from nav_jax.aiding.base import AbstractAiding
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.parameters import AidingLines, ErrorLines
from nav_jax.filter.timeline import Inputs, Timeline
from nav_jax.imu.errors import ImuErrors
from nav_jax.recorded.navigation import run_record


class Record(eqx.Module):
    """A recorded run as arrays."""

    timeline: Timeline
    inputs: Inputs
    initial: InitialUncertainty


class Model(eqx.Module):
    """What is tuned, as a function of a vector: the errors of the IMU, and if asked for the aiding sensors."""

    errors: ErrorLines
    aiding: AidingLines
    with_aiding: bool = eqx.field(static=True)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters."""
        return (*self.errors.names, *(self.aiding.names if self.with_aiding else ()))

    @property
    def start(self) -> Float[Array, " P"]:
        """The vector of what is given."""
        return jnp.concatenate([self.errors.start, jnp.zeros(len(self.aiding.names) * self.with_aiding)])

    def build(self, vector: Float[Array, " P"]) -> tuple[ImuErrors, tuple[AbstractAiding, ...]]:
        """Errors and sensors."""
        size = len(self.errors.names)
        sensors = self.aiding.believe(vector[size:]) if self.with_aiding else self.aiding.sensors
        return self.errors.build(vector[:size]), sensors


def innovations(
    record: Record, filter: ImuErrors, sensors: tuple[AbstractAiding, ...]
) -> tuple[Float[Array, "M K"], Float[Array, "M K"]]:
    """Innovations of the filter, each given those before it, and their variances; 0 and 1 where there are none."""
    outcome = run_record(record.timeline, sensors, record.inputs, filter, record.initial)
    is_fix = record.timeline.valid > 0
    nu, s = outcome.innovation[:, :, 0], outcome.variance[:, :, 0]
    return jnp.where(is_fix, nu, 0.0), jnp.where(is_fix, s, 1.0)


def innovation_loss(record: Record, filter: ImuErrors, sensors: tuple[AbstractAiding, ...]) -> Float[Array, ""]:
    """Compute minus the logarithm of the likelihood of the innovations, less a constant.

    Pure and differentiable in every parameter of `filter` and in the standard deviations that `sensors` believe.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> rng = np.random.default_rng(0)
    >>> imu = nj.Imu(samples.time, samples.gyro, samples.accel + rng.normal(0.0, 0.2, (200, 3)), 20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20] + rng.normal(0.0, 0.02, (10, 3)))
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> start["initial"] = nj.InitialUncertainty(position_sd=0.1, velocity_sd=0.1, attitude_sd=0.01)
    >>> from nav_jax.recorded.likelihood import Record
    >>> from nav_jax.recorded.navigation import prepare_navigation
    >>> initial = start.pop("initial")
    >>> done = prepare_navigation(imu, [fixes], filter, every=1, output_interval=1.0, earth=nj.FlatEarth(), **start)
    >>> record = Record(done.timeline, done.inputs, initial)
    >>> loss = nj.recorded.innovation_loss(record, filter, done.sensors)
    """
    nu, s = innovations(record, filter, sensors)
    return 0.5 * jnp.sum(nu**2 / s + jnp.log(s))


class Slopes(NamedTuple):
    """The loss about a vector of parameters."""

    loss: Float[Array, ""]
    gradient: Float[Array, " P"]
    information: Float[Array, "P P"]
    """Expected second derivative, in which products of derivatives of nu take the place of their expectation."""


@bounded
@eqx.filter_jit
def loss_and_slopes(
    record: Record, model: Model, vector: Float[Array, " P"], along: Float[Array, "P k"] | None = None
) -> Slopes:
    """The loss of `innovation_loss`, its gradient and the information, by forward mode through the filter.

    Each direction costs a filter: of orthonormal ones `along` which alone derivatives are wanted, all others are zero.

    With w = nu/sqrt(s): gradient sum w d nu/sqrt(s) + (1 - w^2) d log s/2, information sum d nu d nu'/s + d log s
    d log s'/2 (Astrom 1980). Forward mode costs less than reverse for the few parameters that a sensor has.
    """
    basis = jnp.eye(len(vector)) if along is None else along

    def both(way: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        nu, s = innovations(record, *model.build(vector + basis @ way))
        return (nu.ravel(), s.ravel()), (nu.ravel(), s.ravel())

    (d_nu, d_s), (nu, s) = jax.jacfwd(both, has_aux=True)(jnp.zeros(basis.shape[1]))
    return slopes_of(nu, s, d_nu @ basis.T, d_s @ basis.T)


def slopes_of(
    nu: Float[Array, " F"], s: Float[Array, " F"], d_nu: Float[Array, "F P"], d_s: Float[Array, "F P"]
) -> Slopes:
    """The loss of innovations with these variances, from the derivatives of both; see `loss_and_slopes`."""
    w, d_w, d_log_s = nu / jnp.sqrt(s), d_nu / jnp.sqrt(s)[:, None], d_s / s[:, None]
    gradient = w @ d_w + (1 - w**2) @ d_log_s / 2
    return Slopes(jnp.sum(w**2 + jnp.log(s)) / 2, gradient, d_w.T @ d_w + d_log_s.T @ d_log_s / 2)
