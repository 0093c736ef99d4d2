"""The attitude of a moving record by least squares, from any first guess, and what is known of it at the end.

Unknown are the attitude and the velocity at the beginning (with positions, the position too), and the biases. What
noise of the samples turns and pushes between the fixes correlates what is left of them, and is weighed so. At the end
of the window some of it is known from the fixes: conditional means and covariances of Gaussian variables.

Noise of the samples makes vectors of its own. Gauss-Newton takes them for a motion that tells a heading, which they are
not: fixes do not show them. What is claimed is therefore by the whole second derivative, in which vectors count as far
as samples and fixes agree on them.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float64

from nav_jax.imu.imu import Imu
from nav_jax.kinematics import rotation
from nav_jax.recorded import _window
from nav_jax.recorded._wahba import davenport
from nav_jax.statistics.distributions import chi2_quantile

_ITERATIONS = 30
_SMALL = 1e-10
"""Square of a last step in standard deviations."""
_ODD = 0.999
"""Probability of misfits that are taken for chance; beyond, what is claimed grows with them."""
_DOWN = 5
"""The vertical part of v_0 among what is unknown."""
_CLIMB = 3.0
"""m/s, standard deviation of that where no fix has a vertical velocity."""
_SINGULAR = 1e-12
"""Smallest eigenvalue of information in units of what each unknown alone would have."""


class Window(NamedTuple):
    """The part of a record that is fitted."""

    imu: Imu
    first: Float64[np.ndarray, "3"]
    """Position of the first fix."""
    when: Float64[np.ndarray, " K"]
    """Of the fixes, s since the first epoch."""
    known: _window.Known
    aim: Float64[np.ndarray, "K 3"]
    """What v_0 + C_0 beta, or its integral, should be."""
    told: Bool[np.ndarray, "K 3"]
    """Which components are fitted: not the vertical one where a fix has none, which is taken for zero at first."""
    noise: Float64[np.ndarray, "K 3 3"]
    arm: Float64[np.ndarray, "3"]
    positions: bool
    """Whether positions are fitted; otherwise velocities."""


class Belief(NamedTuple):
    """What is stated of the IMU, of accelerometers and of gyros."""

    biases: tuple[float, float]
    """Standard deviations, m/s^2 and rad/s."""
    densities: tuple[float, float]
    """Of white noise, m/s^2/sqrt(Hz) and rad/s/sqrt(Hz)."""


class Fitted(NamedTuple):
    """At the end of a window, in n."""

    position: Float64[np.ndarray, "3"] | None
    """None where velocities are fitted."""
    velocity: Float64[np.ndarray, "3"]
    attitude: Float64[np.ndarray, "3 3"]
    covariance: Float64[np.ndarray, "n n"] | None
    """Of position (where it is fitted), velocity, attitude; None where the attitude is not told at all."""
    accel_bias: Float64[np.ndarray, "3"]
    gyro_bias: Float64[np.ndarray, "3"]
    misfit: float


class _State(NamedTuple):
    """What is unknown, at the beginning of a window."""

    attitude: Float64[np.ndarray, "3 3"]
    steady: Float64[np.ndarray, "one_or_two 3"]
    """v_0, and p_0 where positions are fitted."""
    biases: Float64[np.ndarray, "2 3"]


class _Linear(NamedTuple):
    """The problem about a state; whitened are what is left and its slopes by biases in their standard deviations."""

    motion: _window.Motion
    noise: _window.Kicks
    kicked: Float64[np.ndarray, "rows kicks"]
    root: Float64[np.ndarray, "rows rows"]
    """Lower factor of the covariance of what is left."""
    slope: Float64[np.ndarray, "rows unknown"]
    left: Float64[np.ndarray, " rows"]
    value: Float64[np.ndarray, "K 3"]


def fitted(w: Window, belief: Belief) -> Fitted:
    """Fit a window, and lead what it says to its end."""
    told = w.told.ravel()
    R = _block_diagonal(w.noise)[np.ix_(told, told)]
    epochs = w.imu.epochs - w.imu.epochs[0]
    grid = np.unique(np.concatenate([[0.0], np.clip(w.when, 0.0, epochs[-1]), epochs[-1:]]))
    # kicks are turns first, then pushes
    Q = np.repeat((np.square(belief.densities)[::-1, None] * np.diff(grid)).ravel(), 3)
    unit, prior = _units(w, belief)
    state, converged = _first_guess(w), False
    for _ in range(_ITERATIONS):
        line = _linearised(w, state, grid, Q, R, told, unit)
        H = line.slope.T @ line.slope + np.diag(prior)
        gradient = line.slope.T @ line.left - prior * _in_units(state, unit)
        step = _solved(H, gradient)
        if step @ gradient < _SMALL:
            converged = True
            break
        x = step * unit
        state = _State(
            np.asarray(_window.matrices(jnp.asarray(x[:3]))) @ state.attitude,
            state.steady + x[3:-6].reshape(-1, 3),
            state.biases + x[-6:].reshape(2, 3),
        )
    return _at_end(w, state, line, H, Q, told, unit, converged=converged)


def _units(w: Window, belief: Belief) -> tuple[np.ndarray, np.ndarray]:
    """Of what is unknown, biases in their standard deviations, and its information before any fix."""
    n = 9 if w.positions else 6
    prior = np.concatenate([np.zeros(n), np.ones(6)])
    if not w.told[:, 2].any():
        prior[_DOWN] = 1 / _CLIMB**2
    return np.concatenate([np.ones(n), np.repeat(belief.biases, 3)]), prior


def _in_units(state: _State, unit: np.ndarray) -> Float64[np.ndarray, " unknown"]:
    """What is unknown, the attitude apart, in its units."""
    known = np.concatenate([np.zeros(3), state.steady.ravel(), state.biases.ravel()])
    return known / np.where(unit > 0, unit, 1.0)


def _first_guess(w: Window) -> _State:
    """Wahba's answer, without biases, from what velocity and position at the beginning leave of the vectors."""
    m = _window.motion(w.imu, np.zeros(3), np.zeros(3))
    basis = _steady_parts(w)
    beta = _window.at(m.time, m.gamma if w.positions else m.beta, w.when)
    across = np.linalg.qr(basis)[0]
    alpha, beta = (x - across @ (across.T @ x) for x in (w.aim, beta))
    C = np.asarray(rotation.dcm_from_quat(jnp.asarray(davenport(alpha, beta))))
    return _State(C, np.zeros((basis.shape[1], 3)), np.zeros((2, 3)))


def _steady_parts(w: Window) -> Float64[np.ndarray, "K one_or_two"]:
    """By what v_0, and p_0, are multiplied."""
    one = np.ones(len(w.when))
    return np.column_stack([w.when, one]) if w.positions else one[:, None]


def _linearised(
    w: Window, state: _State, grid: np.ndarray, Q: np.ndarray, R: np.ndarray, told: np.ndarray, unit: np.ndarray
) -> _Linear:
    m = _window.motion(w.imu, *state.biases)
    noise = _window.kicks(m, grid)
    seen = _window.rows(m, state.attitude, w.when, w.arm, noise, positions=w.positions, place=w.positions)
    J, F = (x.reshape(-1, x.shape[-1])[told] for x in (seen.slope, seen.kicks))
    left = (w.aim - seen.value - _steady_parts(w) @ state.steady).ravel()[told]
    root = np.linalg.cholesky(R + (F * Q) @ F.T)
    white = np.linalg.solve(root, np.column_stack([J * unit, left]))
    return _Linear(m, noise, F, root, white[:, :-1], white[:, -1], seen.value)


def _at_end(
    w: Window,
    state: _State,
    line: _Linear,
    H: np.ndarray,
    Q: np.ndarray,
    told: np.ndarray,
    unit: np.ndarray,
    *,
    converged: bool,
) -> Fitted:
    m, C = line.motion, state.attitude
    u = _in_units(state, unit)[-6:]
    dof = len(line.left) - (len(unit) - 6)
    misfit = float((line.left @ line.left + u @ u) / dof)
    ends = _end_rows(w, state, line)
    E = np.concatenate([x.slope[0] for x in ends]) * unit
    F = np.concatenate([x.kicks[0] for x in ends])
    shared = np.linalg.solve(line.root, ((F * Q) @ line.kicked.T).T).T
    more = shared @ line.left  # what the fixes tell of the noise since the beginning
    back, t = w.known.turned[-1].T, m.time[-1]
    attitude = back @ np.asarray(_window.matrices(jnp.asarray(more[-3:]))) @ C @ m.turned[-1]
    velocity = back @ (ends[-2].value[0] + state.steady[0] + more[-6:-3] - w.known.added[0][-1])
    position = None
    if w.positions:
        way = ends[0].value[0] + t * state.steady[0] + state.steady[1] + more[:3] - w.known.added[1][-1]
        position = w.first + back @ way
    observed = H.copy()
    observed[:3, :3] -= _curvature(np.linalg.solve(line.root.T, line.left), line.value, told)
    P = _inverse(observed, np.sqrt(np.diag(H))) if converged else None
    covariance = None
    if P is not None:
        M = E - shared @ line.slope
        covariance = M @ P @ M.T + (F * Q) @ F.T - shared @ shared.T
        turn = np.kron(np.eye(len(ends)), back)
        covariance = turn @ covariance @ turn.T
        if misfit > chi2_quantile(_ODD, dof) / dof:
            covariance = misfit * covariance
    return Fitted(position, velocity, attitude, covariance, state.biases[0], state.biases[1], misfit)


def _end_rows(w: Window, state: _State, line: _Linear) -> list[_window.Rows]:
    """Of position (where it is fitted), velocity and attitude of the IMU at the last epoch."""
    m, zero = line.motion, np.zeros(3)
    kinds = (True, False) if w.positions else (False,)
    return [
        *(
            _window.rows(m, state.attitude, m.time[-1:], zero, line.noise, positions=kind, place=w.positions)
            for kind in kinds
        ),
        _window.attitude_rows(m, state.attitude, len(line.noise.time), place=w.positions),
    ]


def _curvature(weighted: np.ndarray, value: Float64[np.ndarray, "K 3"], told: np.ndarray) -> Float64[np.ndarray, "3 3"]:
    """What the second derivative of turned vectors adds: sum of sym(d a') - (d'a) 1, with d the weighted rest."""
    d = np.zeros(told.shape)
    d[told] = weighted
    B = d.reshape(-1, 3).T @ value
    return 0.5 * (B + B.T) - np.trace(B) * np.eye(3)


def _solved(H: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """The least solution of equations that may be singular, in units of what each unknown alone would have."""
    size = np.sqrt(np.diag(H))
    size = np.where(size > 0, size, 1.0)
    return np.linalg.lstsq(H / np.outer(size, size), gradient / size, rcond=_SINGULAR)[0] / size


def _inverse(H: np.ndarray, size: np.ndarray) -> np.ndarray | None:
    """None where it is not positive definite."""
    if not (size > 0).all():
        return None
    scaled = H / np.outer(size, size)
    if np.linalg.eigvalsh(scaled)[0] < _SINGULAR:
        return None
    return np.linalg.inv(scaled) / np.outer(size, size)


def _block_diagonal(blocks: Float64[np.ndarray, "K 3 3"]) -> Float64[np.ndarray, "rows rows"]:
    K = len(blocks)
    whole = np.zeros((K, 3, K, 3))
    whole[np.arange(K), :, np.arange(K), :] = blocks
    return whole.reshape(3 * K, 3 * K)
