r"""The fixed-interval smoother: the estimate at every event from the measurements before and after it.

In the form of Bryson and Frazier (Bierman 1973), which inverts no covariance, so that states known exactly do no harm.
Backward through the events and their scalars, with lambda and Lambda zero after the last:

    at an event     x_s = x - P lambda,  P_s = P - P Lambda P                     (x, P after its update)
    its scalars     lambda <- (1 - K h)' lambda - h' nu/s,  Lambda <- (1 - K h)' Lambda (1 - K h) + h' h/s
    the segment     lambda <- Phi' lambda,  Lambda <- Phi' Lambda Phi

It is the smoother of Rauch, Tung and Striebel, linearised about the filter's estimates, whose errors it corrects.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from nav_jax.filter.ekf import inject
from nav_jax.filter.error_model import blocks
from nav_jax.filter.layout import ON_CHANNELS
from nav_jax.filter.measurement import Sensors, measurements
from nav_jax.filter.score import Truth, claim, judge
from nav_jax.filter.timeline import Memory, Outcome, Timeline
from nav_jax.imu.bank import SensorBank, alone
from nav_jax.kinematics.linalg import symmetrise
from nav_jax.kinematics.state import NavState


def smoothed(timeline: Timeline, bank: SensorBank, sensors: Sensors, outcome: Outcome) -> Outcome:
    """The outcome of a filter that remembered, with the smoothed estimate and its covariance in its judgement.

    Raises
    ------
    ValueError
        It did not remember.
    """
    memory = outcome.memory
    if memory is None:
        raise ValueError("A smoother needs what the filter remembers: gains_of(experiment, filter, smooth=True).")
    aiding = measurements(timeline, sensors)
    constant = None if memory.H is not None else aiding.constant()
    valid = timeline.valid
    if outcome.passed is not None:
        sizes = np.array([len(s.axes) for s in sensors])
        taken = jnp.repeat(outcome.passed, sizes, axis=1, total_repeat_length=valid.shape[1])
        valid = jnp.where(taken, valid[:, :, None], 0.0)
    state, P = smooth_events(valid, constant, outcome)
    sensed = timeline.sensed[:, :, None]
    lasting = jax.vmap(bank.errors)(outcome.state.x, sensed) - outcome.judgement.error[:, ON_CHANNELS]

    def one(state: NavState, P: Array, truth: Truth, lasting: Array, sensed: Array):
        return judge(state, claim(blocks(P), alone(bank), sensed), bank, truth, lasting, sensed)

    judgement = jax.vmap(one)(state, P, timeline.truth, lasting, sensed)
    return outcome._replace(judgement=judgement, state=state, memory=memory._replace(P=P))


def smooth_events(
    valid: Float[Array, "M K *R"], H: Float[Array, "K nav 1"] | None, outcome: Outcome
) -> tuple[NavState, Float[Array, "M n n Q"]]:
    """Smoothed estimate of each run and its covariance at the end of each segment.

    Parameters
    ----------
    valid
        1 where a scalar is measured at the end of a segment, and taken; of each run where gates refuse some.
    H
        Derivative of each scalar with respect to the navigation errors; None where the filter remembers one for each
        event.
    outcome
        Of a filter that remembered.
    """
    memory: Memory = outcome.memory  # type: ignore[assignment]
    n, num_covariances = memory.P.shape[1], memory.P.shape[3]
    num_runs = outcome.innovation.shape[2]
    constant = None if H is None else jnp.pad(H, ((0, 0), (0, n - H.shape[1]), (0, 0)))

    def scalar(carry, given):
        lam, Lam = carry
        K, h, nu, s, is_valid = given
        w = is_valid / s
        # (1 - K h)' x = x - h' (K' x)
        lam = lam - h * (jnp.sum(K * lam, axis=0) + w * nu)[None]
        left = Lam - h[:, None] * jnp.sum(K[:, None] * Lam, axis=0)[None]
        Lam = left - jnp.sum(left * K[None], axis=1)[:, None] * h[None]
        return (lam, symmetrise(Lam + h[:, None] * h[None] * w[None, None])), None

    def event(carry, given):
        lam, Lam = carry
        state, P, K, Phi, nu, s, is_valid, h = given
        # P Lambda P, with runs last
        U = jnp.einsum("ijq,jkq->ikq", P, Lam)
        better = symmetrise(P - jnp.einsum("ijq,jkq->ikq", U, P))
        state = inject(state, -jnp.einsum("ijq,jr->ir", P, lam) if P.shape[2] == 1 else -jnp.sum(P * lam[None], axis=1))
        (lam, Lam), _ = jax.lax.scan(
            scalar, (lam, Lam), (K, constant if h is None else h, nu, s, is_valid), reverse=True
        )
        lam = jnp.sum(Phi * lam[:, None], axis=0)
        Lam = symmetrise(jnp.einsum("jiq,jkq,klq->ilq", Phi, Lam, Phi))
        return (lam, Lam), (state, better)

    given = (
        outcome.state,
        memory.P,
        memory.gain,
        memory.transition,
        outcome.innovation,
        outcome.variance,
        valid,
        memory.H,
    )
    start = (jnp.zeros((n, num_runs)), jnp.zeros((n, n, num_covariances)))
    return jax.lax.scan(event, start, given, reverse=True)[1]
