"""From one event to the next: the covariance, and the transition if a smoother wants it.

Where nobody looks at a covariance between two events, transition and noise are accumulated (`accumulated`); where a
trace wants it after every step, or states of one process are coupled, it takes every step itself.
"""

from typing import NamedTuple

import equinox as eqx
import jax
from jaxtyping import Array, Float

from nav_jax.filter.accumulated import (
    Accumulated,
    accumulate,
    accumulates,
    covariance_over,
    nothing_yet,
    transition_over,
)
from nav_jax.filter.error_model import Covariance, Motion, propagate, transition
from nav_jax.imu.bank import SensorBank, StepNoise
from nav_jax.kinematics.earth import EarthInLoops


class Underway(NamedTuple):
    """Between two events."""

    P: Covariance
    """At the last event, or after the last step where every step is taken."""
    Phi: Float[Array, "n n Q"] | None
    """The same of the transition, if it is wanted."""
    since: Accumulated | None
    """Since the last event."""


class Between(eqx.Module):
    """How covariances of filters with a bank get from one event to the next."""

    noises: StepNoise
    """Of each kind of step."""
    accumulating: bool = eqx.field(static=True)

    def __init__(self, bank: SensorBank, noises: StepNoise, earth: EarthInLoops, *, at_every_step: bool = False):
        self.noises = noises
        self.accumulating = accumulates(bank, earth) and not at_every_step

    def begin(self, P: Covariance, Phi: Float[Array, "n n Q"] | None = None) -> Underway:
        """At an event, from a covariance and, if it is wanted, a transition to which those that come are applied."""
        return Underway(P, Phi, nothing_yet(self.noises, P.navigation.shape[2]) if self.accumulating else None)

    def step(self, at: Underway, motion: Motion, kind: Array, shaken: Float[Array, "ch #R"] | None = None) -> Underway:
        """After one more step of some kind, with further variance of the integrated noise if there is any."""
        noise = jax.tree.map(lambda a: a[kind], self.noises)
        if shaken is not None:
            noise = eqx.tree_at(lambda n: n.integrated, noise, noise.integrated + shaken)
        if at.since is not None:
            return at._replace(since=accumulate(at.since, motion, noise))
        Phi = None if at.Phi is None else transition(at.Phi, motion, noise)
        return Underway(propagate(at.P, motion, noise), Phi, None)

    def end(self, at: Underway) -> tuple[Covariance, Float[Array, "n n Q"] | None]:
        """Covariance and transition before the next event."""
        P, Phi, since = at
        if since is None:
            return P, Phi
        states = self.noises.states
        return covariance_over(P, since, states), None if Phi is None else transition_over(Phi, since, states)
