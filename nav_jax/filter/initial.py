"""How well a run's start is known."""

import warnings
from typing import Any

import equinox as eqx
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.checks import as_float, concrete, positive
from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.states import saved
from nav_jax.filter.layout import NAVIGATION

_LARGEST = np.deg2rad(10.0)
"""rad of an attitude whose errors are linear enough: with fixes of a vehicle that turns, the mean NEES of the attitude
is 1.0 to 1.6 times what it should be at 10 deg of heading, 1.4 to 4 at 20, 5 to 22 at 30, hundreds and more from 60 on.
"""


class LinearisationWarning(UserWarning):
    """A warning that an initial attitude is too uncertain for filters that linearise about their estimate."""


@saved()
class InitialUncertainty(eqx.Module):
    """The covariance of the navigation error at the start; runs draw from it, and the filter knows it.

    Parameters
    ----------
    position_sd, velocity_sd, attitude_sd
        Standard deviations in m, m/s and rad: one number, or three (north, east, down). 0: known exactly.
    covariance
        Instead of them the whole matrix (9, 9), in the order position, velocity, attitude.

    Raises
    ------
    ValueError
        A negative standard deviation, or a matrix that is not symmetric and positive semi-definite.

    Examples
    --------
    >>> start = nj.InitialUncertainty(position_sd=0.1, velocity_sd=0.05, attitude_sd=(0.01, 0.01, 0.05))
    >>> start.covariance.shape
    (9, 9)
    """

    covariance: Float[Array, "nav nav"]

    def __init__(
        self,
        position_sd: Any = 0.0,
        velocity_sd: Any = 0.0,
        attitude_sd: Any = 0.0,
        *,
        covariance: Any = None,
    ):
        given = {"position_sd": position_sd, "velocity_sd": velocity_sd, "attitude_sd": attitude_sd}
        if covariance is None:
            for block in NAVIGATION.blocks:
                name, value = block.start, given[block.start]
                positive(name, value, zero_ok=True)
                if np.shape(value) not in ((), (block.size,)):
                    raise ValueError(f"{name} is one number or three, and has the shape {np.shape(value)}.")
            values = known(*(as_float(given[b.start]) for b in NAVIGATION.blocks))
            xp = namespace(*values)
            sd = [xp.broadcast_to(v, (b.size,)) for v, b in zip(values, NAVIGATION.blocks, strict=True)]
            self.covariance = as_float(xp.diag(xp.concatenate(sd) ** 2))
            return
        if any(concrete(v) is None or np.any(concrete(v)) for v in given.values()):
            raise ValueError("Give standard deviations or the covariance of the initial error, not both.")
        self.covariance = as_float(covariance)
        wanted = (NAVIGATION.size, NAVIGATION.size)
        if self.covariance.shape != wanted:
            raise ValueError(f"The covariance of the initial error is {wanted}, and this one {self.covariance.shape}.")
        seen = concrete(self.covariance)
        if seen is None:
            return
        if not np.isfinite(seen).all() or not np.allclose(seen, seen.T, rtol=1e-9, atol=0):
            raise ValueError("The covariance of the initial error must be finite and symmetric.")
        scale = np.sqrt(np.diag(seen).clip(0))
        correlation = seen / np.where(scale > 0, scale, 1)[:, None] / np.where(scale > 0, scale, 1)[None, :]
        lowest = np.linalg.eigvalsh(correlation).min()
        if lowest < -1e-9 or np.any(np.diag(seen) < 0):
            raise ValueError(
                "The covariance of the initial error is not positive semi-definite: the smallest eigenvalue of its "
                f"correlations is {lowest:.3g}."
            )


def warn_of_attitude(initial: InitialUncertainty, *, stacklevel: int = 4) -> None:
    """Warn where an attitude is less certain than a linearisation holds."""
    P = concrete(initial.covariance)
    largest = 0.0 if P is None else float(np.sqrt(np.diagonal(P)[list(NAVIGATION.columns("attitude"))].max()))
    if largest > _LARGEST * (1 + 1e-9):
        warnings.warn(
            f"The attitude at the start has a standard deviation of {np.rad2deg(largest):.3g} deg, and a Kalman filter "
            f"linearises about its estimate: beyond {np.rad2deg(_LARGEST):.3g} deg its claims are too small and runs "
            "may diverge. Align first (course, velocity matching, two antennas), and start from what that leaves.",
            LinearisationWarning,
            stacklevel=stacklevel,
        )
