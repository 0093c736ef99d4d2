"""The state-space form of a process: what a Kalman filter asks for."""

from typing import Any, NamedTuple

import jax.numpy as jnp


class StateSpace(NamedTuple):
    """A process as samples y_k = h' x_k + v_k of a Markov chain x_{k+1} = Phi x_k + w_k, all per sample.

    w_k ~ N(0, Q) and v_k ~ N(0, r) are white and independent of each other and of x_0 ~ N(0, P_0), which is the
    stationary distribution where there is one, and else the law of the first sample.

    Examples
    --------
    >>> form = gj.GM(beta=np.log(2.0), variance=1.0).state_space()
    >>> form.transition.round(9).tolist(), form.driving.round(9).tolist()
    ([[0.5]], [[0.75]])
    """

    transition: Any
    """Phi, (d, d)."""
    driving: Any
    """Q, (d, d)."""
    readout: Any
    """h, (d,)."""
    initial: Any
    """P_0, (d, d)."""
    white: Any
    """r, variance of the part that has no memory."""


def scalar_state(phi: Any, driving: Any, initial: Any) -> StateSpace:
    """One state that is the process itself."""
    return StateSpace(
        jnp.reshape(phi, (1, 1)), jnp.reshape(driving, (1, 1)), jnp.ones(1), jnp.reshape(initial, (1, 1)), jnp.zeros(())
    )


def no_state(variance: Any) -> StateSpace:
    """White noise."""
    none = jnp.zeros((0, 0))
    return StateSpace(none, none, jnp.zeros(0), none, variance)
