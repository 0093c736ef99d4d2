"""What is kept of a run at an output: errors against the truth, what the filter claims, and whether the two agree."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from nav_jax.filter.error_model import Covariance
from nav_jax.filter.layout import ATTITUDE, GROUPS, NAVIGATION, POSITION, VELOCITY
from nav_jax.imu.bank import SensorBank, by_channel, multiples
from nav_jax.kinematics.linalg import matmul3, root, transpose, whiten
from nav_jax.kinematics.rotation import quat_conjugate, quat_multiply, quat_to_rotvec
from nav_jax.kinematics.state import NavState

_POSE = len(NAVIGATION.columns(*GROUPS["pose"]))


class Truth(NamedTuple):
    """The reference at one time, the same for all runs."""

    p: Float[Array, "3 1"]
    v: Float[Array, "3 1"]
    q: Float[Array, "4 1"]
    axes: Float[Array, "3 3 1"] | None = None
    """From n to the axes along which errors are judged, where these are others."""


class Claim(NamedTuple):
    """What a filter says of its errors: of navigation, and of the errors of the six channels."""

    navigation: Float[Array, "nav nav Q"]
    sensors: Float[Array, "ch ch Q"]

    @property
    def sd(self) -> Float[Array, "judged Q"]:
        """Standard deviations, columns `JUDGED`."""
        return root(jnp.concatenate([_diagonal(self.navigation), _diagonal(self.sensors)]))

    def along(self, truth: Truth) -> "Claim":
        """The same along the axes in which errors are judged."""
        if truth.axes is None:
            return self
        return self._replace(navigation=_turned(truth.axes, transpose(_turned(truth.axes, self.navigation))))


class Judgement(NamedTuple):
    """Errors and normalised squared errors (NEES) of R runs."""

    error: Float[Array, "col R"]
    """Estimate minus truth: position, velocity, attitude, six channels."""
    sd: Float[Array, "col Q"]
    position_covariance: Float[Array, "3 3 Q"]
    nees: Float[Array, "groups R"]
    """Of `GROUPS`; NaN where the covariance is singular."""


def claim(P: Covariance, banks: SensorBank, sensed: Float[Array, "seen 1"]) -> Claim:
    """Marginal covariances that filters claim; `banks` has a leading axis, of 1 where runs share it.

    Errors of the channels are those at the reading `sensed` of the IMU.
    """
    h = (banks.readout.T * multiples(banks.states, sensed) if banks.depends else banks.readout.T)[:, None]
    rows = by_channel(banks.channels, h * P.sensors)
    return Claim(P.navigation, by_channel(banks.channels, h * transpose(rows)))


def judge(
    state: NavState,
    claim: Claim,
    bank: SensorBank,
    truth: Truth,
    lasting: Float[Array, "ch R"],
    sensed: Float[Array, "seen 1"],
) -> Judgement:
    """Compare an estimate with the truth, where the IMU senses this."""
    psi = quat_to_rotvec(quat_multiply(state.q, quat_conjugate(jnp.broadcast_to(truth.q, state.q.shape))))
    sensors = bank.errors(state.x, sensed) - lasting
    navigation = jnp.concatenate([state.p - truth.p, state.v - truth.v, psi])
    if truth.axes is not None:
        navigation = _turned(truth.axes, navigation[:, None])[:, 0]
    claim = claim.along(truth)
    error, N = jnp.concatenate([navigation, sensors]), claim.navigation
    # the factor of a matrix holds those of its leading blocks: position, pose, navigation at once
    order = jnp.array(NAVIGATION.columns("position", "attitude", "velocity"))
    y = jnp.cumsum(whiten(N[order][:, order], error[order]) ** 2, axis=0)
    velocity = jnp.sum(whiten(N[VELOCITY, VELOCITY], error[VELOCITY]) ** 2, axis=0)
    attitude = jnp.sum(whiten(N[ATTITUDE, ATTITUDE], error[ATTITUDE]) ** 2, axis=0)
    seen = jnp.array(sorted({s.channel for s in bank.states if s.is_of_imu}), dtype=int)
    if len(seen):
        of_sensors = jnp.sum(whiten(claim.sensors[seen][:, seen], sensors[seen]) ** 2, axis=0)
    else:
        of_sensors = jnp.full_like(velocity, jnp.nan)
    known = {
        "position": y[POSITION.stop - 1], "velocity": velocity, "attitude": attitude, "pose": y[_POSE - 1],
        "navigation": y[-1], "sensors": of_sensors,
    }  # fmt: skip
    return Judgement(error, claim.sd, N[POSITION, POSITION], jnp.stack([known[group] for group in GROUPS]))


def _turned(axes: Float[Array, "3 3 1"], X: Float[Array, "nav K Q"]) -> Float[Array, "nav K Q"]:
    """Position, velocity and attitude along other axes."""
    return jnp.concatenate([matmul3(axes, X[part]) for part in (POSITION, VELOCITY, ATTITUDE)])


def _diagonal(P: Float[Array, "K K Q"]) -> Float[Array, "K Q"]:
    return jnp.stack([P[i, i] for i in range(P.shape[0])])
