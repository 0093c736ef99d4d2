"""An experiment whose errors are all so small that nothing bends: by it filters are linear, with the same numbers."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp

from gmwm_jax._internal.typing import Real
from nav_jax.filter.experiment import Experiment
from nav_jax.filter.parameters import constants_of
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.noise_models import scaled


def with_errors(experiment: Experiment, truth: ImuErrors, factor: Real) -> tuple[Experiment, ImuErrors]:
    """What `draw_inputs` draws from, with all standard deviations so many times as large.

    The same keys give the same numbers times the factor. What filters believe of aiding sensors stays as it was; their
    gains are those of the experiment as it was. A step of an output is the noise that covariances take it for.

    Parameters
    ----------
    experiment, truth
        See `draw_inputs`.
    factor
        Of all errors: of the start, of the IMU, of aiding sensors and of their own states.
    """
    drawn = experiment.timeline.drawn
    sensors = tuple(
        eqx.tree_at(lambda s: s.noise, sensor, tuple(scaled(model, factor) for model in sensor.noise))
        for sensor in experiment.sensors
    )
    new: tuple[Any, ...] = (
        factor**2 * experiment.initial.covariance, drawn.scaled(jnp.full(len(drawn.names), factor)), sensors,
    )  # fmt: skip
    small = eqx.tree_at(lambda e: (e.initial.covariance, e.timeline.drawn, e.sensors), experiment, new)
    return small, _errors(truth.linear, factor)


def _errors(truth: ImuErrors, factor: Real) -> ImuErrors:
    """The errors of an IMU, so many times as large."""
    num = len(truth.deterministic)
    constants = [factor * sd for sd in constants_of(truth, num)]
    if truth.gravity is not None:
        constants[-1] = truth.gravity.distance  # over which it is correlated, and not how large it is
    models = tuple(scaled(model, factor) for model in truth.models)
    new = [models, factor * truth.bias_sd, *constants]
    return eqx.tree_at(lambda e: [e.models, e.bias_sd, *constants_of(e, num)], truth, new)
