"""Runs in which filters are linear, and what such runs are on average, which takes none of them.

A run on the gains of the reference whose errors are `SMALL` times those of another run has errors that are `SMALL`
times the linear part of that run's, to a relative `SMALL`^2 on average (what is of second order in the draws does not
change its sign with them, so that it is uncorrelated with what is of first order). Made large again, they are Gaussian
with the covariance of `linear_covariance` at every epoch. The mean of a statistic of them is known by it, and the
statistic goes with that of the run with errors of full size.
"""

import copy
from collections.abc import Mapping
from dataclasses import replace

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Float64

from gmwm_jax._internal.compiling import compiled_quickly
from nav_jax.filter.experiment import Setup
from nav_jax.filter.joint_covariance import linear_covariance, motion_of, noise_of
from nav_jax.filter.layout import GROUPS, NAVIGATION
from nav_jax.filter.small_errors import with_errors
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.recorded import RecordedErrors
from nav_jax.kinematics.linalg import log_det_and_trace
from nav_jax.simulation.runs import Runs
from nav_jax.statistics.distributions import mean_length

SMALL = 1e-3
"""Errors so many times as large are linear to a millionth, and far above rounding."""

_NOTE = "Filters are linear in these runs: their errors are what follows to first order from those that were drawn."

KnownMeans = Mapping[str, Float64[np.ndarray, " E"]]
"""Statistic -> its mean over linear runs, at every epoch."""


def small(setup: Setup, truth: ImuErrors) -> tuple[Setup, ImuErrors]:
    """What runs with errors `SMALL` times as large are drawn from."""
    found = copy.copy(setup)
    found.experiment, errors = with_errors(setup.experiment, truth, SMALL)
    return found, errors


def enlarged(runs: Runs) -> Runs:
    """Such runs as if their errors had full size."""
    return replace(
        runs,
        error=runs.error / SMALL,
        nees={group: nees / SMALL**2 for group, nees in runs.nees.items()},
        innovation={sensor: nu / SMALL for sensor, nu in runs.innovation.items()},
        nis={sensor: nis / SMALL**2 for sensor, nis in runs.nis.items()},
        notes=(*runs.notes, _NOTE),
    )


def known_means(
    setup: Setup, truth: ImuErrors | RecordedErrors, filters: Mapping[str, ImuErrors], *, smooth: bool
) -> dict[str, KnownMeans] | None:
    """Means of the statistics of `nav_jax.simulation.levels` over linear runs, by filter; None where nobody knows them.

    Nobody does of a smoother, of a recording, and of noise that has no state-space form; nor where a sensor depends on
    the motion of the body, as what the IMU says of that is in no covariance (`AbstractAiding.uses_body`).
    """
    if smooth or isinstance(truth, RecordedErrors) or any(s.uses_body for s in setup.experiment.sensors):
        return None
    try:
        eqx.filter_eval_shape(noise_of, setup.experiment, truth)
    except ValueError:  # that says which process has no such form
        return None
    motion = motion_of(setup.experiment)
    found = {}
    for name, believed in filters.items():
        result = linear_covariance(
            setup.experiment, truth, believed, believed_initial=setup.experiment.initial, motion=motion
        )
        if not np.all(result.valid):
            return None
        true, claimed = (np.asarray(c.navigation)[setup.output_segments] for c in (result.true, result.claimed))
        found[name] = _means(true, claimed)
    return found


def _means(true: Float64[np.ndarray, "E nav nav"], claimed: Float64[np.ndarray, "E nav nav"]) -> KnownMeans:
    """From the covariance of the errors and from what the filter says of it."""
    lengths = {b: mean_length(true[:, NAVIGATION[b], NAVIGATION[b]]) for b in NAVIGATION.names}
    pose = np.array(NAVIGATION.columns(*GROUPS["pose"]))
    P, S = (np.moveaxis(C[:, pose][:, :, pose], 0, -1) for C in (claimed, true))
    return lengths | {"nees": np.asarray(_mean_nees(P, S)) / len(pose)}


@compiled_quickly()
def _mean_nees(P: Float[Array, "K K E"], S: Float[Array, "K K E"]) -> Float[Array, " E"]:
    """E e' P^-1 e = tr(P^-1 S) for errors e of covariance S; NaN where P is singular."""
    return log_det_and_trace(P, S)[1]
