"""Transition and noise of a covariance step: against the perturbed mechanisation, brute force, and a right Van Loan."""

import contextlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nav import setups, textbook
from scipy.spatial.transform import Rotation

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter.ekf import mechanise, mechanise_with_motion
from nav_jax.filter.error_model import blocks, full, propagate
from nav_jax.imu.bank import alone, step_noise
from nav_jax.kinematics.earth import EarthInLoops
from nav_jax.kinematics.rotation import quat_conjugate, quat_from_rotvec, quat_multiply, quat_to_rotvec
from nav_jax.kinematics.state import NavState

DT = 0.01
EARTH = EarthInLoops(nj.FlatEarth(setups.GRAVITY))
ERRORS = nj.ImuErrors(
    gj.WN(6e-5) + gj.AR1(0.99, 1e-9),
    [gj.WN(1.5e-6) + gj.AR1(0.98, 1e-9), gj.WN(1.5e-6), gj.WN(1.5e-6) + gj.RW(1e-9)],
    100.0,
)
BANK = ERRORS.bank()
M = len(BANK.states)
N = 9 + M


def motion(n, seed=1, rough=False):
    """n samples of a manoeuvre of 1 rad/s and 12 m/s^2, and a state to start from."""
    rng = np.random.default_rng(seed)
    size = (n, 6) if rough else (1, 6)
    imu = np.array([3.0, -2.0, -11.0, 0.4, -0.6, 0.8]) + rng.normal(size=size) * [3, 3, 3, 0.3, 0.3, 0.3]
    imu = np.broadcast_to(imu, (n, 6))
    if not rough:
        imu = imu + np.linspace(0, 0.2, n)[:, None]
    q = Rotation.from_euler("ZYX", [0.7, 0.2, -0.4]).as_quat(scalar_first=True)
    start = NavState(
        jnp.asarray([[1.0], [2.0], [3.0]]),
        jnp.asarray([[8.0], [-3.0], [1.0]]),
        jnp.asarray(q)[:, None],
        jnp.zeros((M, 1)),
    )
    return jnp.asarray(imu)[:, :, None], start


def perturbed(state, delta):
    p, v, q, x = state
    q = quat_multiply(quat_from_rotvec(delta[6:9, None]), q)
    return NavState(p + delta[:3, None], v + delta[3:6, None], q, x + delta[9:, None])


def difference(one, two):
    psi = quat_to_rotvec(quat_multiply(one.q, quat_conjugate(two.q)))
    return jnp.concatenate([one.p - two.p, one.v - two.v, psi, one.x - two.x])[:, 0]


def step_of(n):
    return step_noise(alone(BANK), jnp.full(n, DT), jnp.ones(n))


@jax.jit
def one_sample(imu, start):
    """The state after a sample, and the derivative of its errors with respect to those at the start."""
    dt, ends = jnp.full(1, DT), jnp.ones(1)
    end = mechanise(start, imu, dt, ends, BANK, EARTH, None)

    def after(delta):
        return difference(mechanise(perturbed(start, delta), imu, dt, ends, BANK, EARTH, None), end)

    return end, jax.jacfwd(after)(jnp.zeros(N))


def true_transition(imu, start):
    """Derivative of the mechanised errors with respect to those at the start, by automatic differentiation."""
    Phi = np.eye(N)
    for sample in imu:
        start, one = one_sample(sample[None], start)
        Phi = np.asarray(one) @ Phi
    return Phi


@jax.jit
def propagated(P, imu, start):
    _, along = mechanise_with_motion(start, imu, jnp.full(len(imu), DT), jnp.ones(len(imu)), BANK, EARTH, None)
    along = jax.tree.map(lambda a: jnp.broadcast_to(a, (*a.shape[:-1], P.shape[-1])), along)
    return full(propagate(blocks(P), along, step_of(len(imu))))


def transition_and_noise(imu, start):
    """Phi and Q of `propagate`: Q from P = 0, the columns of Phi from P = e_i e_i', which goes to column column'."""
    P = np.zeros((N, N, N + 1))
    P[np.arange(N), np.arange(N), np.arange(N)] = 1.0
    out = np.asarray(propagated(jnp.asarray(P), imu, start))
    Q = out[:, :, N]
    # every state keeps a good part of itself over a step, and its sign
    columns = [(out[:, i, i] - Q[:, i]) / np.sqrt(out[i, i, i] - Q[i, i]) for i in range(N)]
    return np.stack(columns, axis=1), Q


ROTATION = 1.1
"""rad/s of `motion`, about."""


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 10])
def test_transition_is_that_of_the_mechanisation(n):
    """Of navigation errors exactly; what sensor states do, to a quarter of the rotation in a step (0.01 or 0.1 rad).

    Entries are relative to what is natural for their units: T and T^2/2 times a specific force of 10 m/s^2.
    """
    imu, start = motion(n)
    Phi, _ = transition_and_noise(imu, start)
    true = true_transition(imu, start)
    T, f = n * DT, 10.0
    row = np.concatenate([np.full(3, f * T**2 / 2), np.full(3, f * T), np.ones(3), np.ones(M)])
    column = np.concatenate([row[:9], [f if s.channel < 3 else 1 / T for s in BANK.states]])
    off = np.abs(Phi - true) / row[:, None] * column[None, :]
    assert off[:, :9].max() < 1e-10
    assert off[9:].max() < 1e-10
    assert off.max() < 0.25 * ROTATION * T
    # what accelerometers do to velocity, and gyros to attitude, is right to the second order
    accel = [9 + i for i, s in enumerate(BANK.states) if s.channel < 3]
    gyro = [9 + i for i, s in enumerate(BANK.states) if s.channel >= 3]
    assert off[3:6, accel].max() < 0.1 * (ROTATION * T) ** 2
    assert off[6:9, gyro].max() < 0.1 * (ROTATION * T) ** 2


@pytest.mark.parametrize("n", [1, 10])
def test_any_covariance_goes_by_that_transition(n):
    """Phi P Phi' + Q, with one Phi and one Q for all P."""
    imu, start = motion(n)
    Phi, Q = transition_and_noise(imu, start)
    A = np.random.default_rng(3).normal(size=(N, N))
    P = np.broadcast_to((A @ A.T)[:, :, None], (N, N, N + 1))
    out = np.asarray(propagated(jnp.asarray(P), imu, start))[:, :, 0]
    np.testing.assert_allclose(out, Phi @ P[:, :, 0] @ Phi.T + Q, rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(out, out.T, rtol=1e-11, atol=1e-13)


def brute_force(imu, start):
    """Phi and Q of n samples, one exact textbook step after the other."""
    bank = textbook.Bank(BANK)
    C = np.asarray(Rotation.from_quat(np.asarray(start.q)[:, 0], scalar_first=True).as_matrix())
    Phi, Q = np.eye(N), np.zeros((N, N))
    for sample in np.asarray(imu)[:, :, 0]:
        one, noise = textbook.discretise(C, sample[3:], sample[:3], bank, DT)
        C = C @ Rotation.from_rotvec(sample[3:] * DT).as_matrix()
        jump = np.eye(N)
        jump[9:, 9:] = bank.Phi
        Q = jump @ (one @ Q @ one.T + noise) @ jump.T
        Q[9:, 9:] += bank.Q
        Phi = jump @ one @ Phi
    return Phi, Q


def test_the_textbook_is_the_derivative_of_the_mechanisation():
    """Matrix exponentials in body axes and automatic differentiation: two ways to one transition."""
    imu, start = motion(10, rough=True)
    np.testing.assert_allclose(brute_force(imu, start)[0], true_transition(imu, start), rtol=0, atol=1e-11)


@pytest.mark.parametrize("rough", [False, True])
@pytest.mark.parametrize("n", [1, 10])
def test_noise_is_that_of_brute_force(n, rough):
    """Relative to standard deviations of Q, to a quarter of the rotation in a step.

    Also where the specific force jumps by 3 m/s^2 from sample to sample, which no quadrature over the step would see.
    """
    imu, start = motion(n, rough=rough)
    _, Q = transition_and_noise(imu, start)
    _, expected = brute_force(imu, start)
    sd = np.sqrt(np.diag(expected))
    keep = sd > 0
    off = (Q - expected)[np.ix_(keep, keep)] / np.outer(sd[keep], sd[keep])
    if n == 1:
        # of a single sample: half before and half after makes T^3/2 of T^3/3 in the position
        np.testing.assert_allclose(off[:3, :3], np.eye(3) / 2, rtol=0, atol=1e-4)
        off[:3, :3] = 0.0
    assert np.abs(off).max() < 0.25 * ROTATION * n * DT
    # variances and what is within velocity or attitude: second order
    assert np.abs(np.diag(off)).max() < 0.5 * (ROTATION * n * DT) ** 2


def to_rotation_vector(euler):
    _, p, y = euler
    cp, sp, cy, sy = np.cos(p), np.sin(p), np.cos(y), np.sin(y)
    return np.array([[cp * cy, -sy, 0.0], [cp * sy, cy, 0.0], [-sp, 0.0, 1.0]])


@pytest.mark.slow
def test_step_is_that_of_van_loan_in_r(shared):
    """R's F and W at one epoch of its run, discretised rightly, in its Euler angles: to first order in dt.

    The angles' error is a rotation vector after multiplication with a matrix that itself turns with the motion.
    """
    errors = setups.imu_errors("right")
    bank = errors.bank()
    with np.load(shared / "reference" / "nav_exact.npz") as r:
        X, imu = r["full_m2_X"], r["in_lemniscate_s1_full_imu"][1:, 1000]
        Phi_r, Q_r = r["full_m2_Phi1001_vanloan"], r["full_m2_Q1001_vanloan"]
    # R's order: the first process of all axes that have one, then the second; ours: axis by axis
    of_r = [(c, k) for k in range(3) for c in range(6) if k < (3 if c < 3 else 2)]
    ours = [(s.channel, [t.channel for t in bank.states[:i]].count(s.channel)) for i, s in enumerate(bank.states)]
    to_ours = np.array([9 + of_r.index(s) for s in ours])
    pick = np.concatenate([np.arange(9), to_ours])
    # the compensated sensors, and the state before the step
    x = X[:, 1000]
    sensed = imu - np.array([x[9:][[i for i, (c, _) in enumerate(of_r) if c == channel]].sum() for channel in range(6)])
    C = Rotation.from_euler("ZYX", x[[8, 7, 6]])
    start = NavState(
        *(jnp.asarray(a)[:, None] for a in (x[:3], x[3:6], C.as_quat(scalar_first=True), x[9:][to_ours - 9]))
    )
    dt, one = jnp.full(1, DT), jnp.ones(1)
    end, along = mechanise_with_motion(start, jnp.asarray(imu)[None, :, None], dt, one, bank, EARTH, None)
    n = len(pick)
    P = np.zeros((n, n, n + 1))
    P[np.arange(n), np.arange(n), np.arange(n)] = 1.0
    along = jax.tree.map(lambda a: jnp.broadcast_to(a, (*a.shape[:-1], n + 1)), along)
    out = np.asarray(
        jax.jit(lambda P: full(propagate(blocks(P), along, step_noise(alone(bank), dt, one))))(jnp.asarray(P))
    )
    Q = out[:, :, n]
    Phi = np.stack([(out[:, i, i] - Q[:, i]) / np.sqrt(out[i, i, i] - Q[i, i]) for i in range(n)], axis=1)
    after = Rotation.from_quat(np.asarray(end.q)[:, 0], scalar_first=True).as_euler("ZYX")[::-1]
    before, then = np.eye(n), np.eye(n)
    before[6:9, 6:9], then[6:9, 6:9] = to_rotation_vector(x[6:9]), to_rotation_vector(after)
    Phi_r = then @ Phi_r[np.ix_(pick, pick)] @ np.linalg.inv(before)
    Q_r = then @ Q_r[np.ix_(pick, pick)] @ then.T
    f = 10.0
    row = np.concatenate([np.full(3, f * DT**2 / 2), np.full(3, f * DT), np.ones(3), np.ones(n - 9)])
    column = np.concatenate([row[:9], [f if c < 3 else 1 / DT for c, _ in ours]])
    off = np.abs(Phi - Phi_r) / row[:, None] * column[None, :]
    sd = np.sqrt(np.diag(Q_r))
    off_Q = np.abs(Q - Q_r) / np.outer(sd, sd)
    off_Q[:3, :3] = 0.0  # see above
    turn = np.linalg.norm(sensed[3:]) * DT
    assert off.max() < turn
    assert off_Q.max() < turn


def rough_reference():
    """Positions quantised to 0.2 mm: several m/s^2 of noise in the specific force."""
    smooth = nj.motions.lemniscate(20.0, 100.0)
    return nj.Trajectory.from_quaternion(smooth.time, np.round(smooth.position / 2e-4) * 2e-4, smooth.quaternion)


@pytest.mark.slow
@pytest.mark.parametrize("rough", [False, True])
def test_fewer_covariance_steps_make_the_same_covariance(rough):
    """Every 10th sample against every one, over 20 s with an outage of 10 s: standard deviations to 1e-4."""
    reference = rough_reference() if rough else nj.motions.lemniscate(20.0, 100.0)
    errors = setups.imu_errors("partial")
    start = nj.InitialUncertainty(0.1, 0.05, np.deg2rad([0.2, 0.2, 1.0]))
    sd = []
    for every in (1, 10):
        with pytest.warns(nj.imu.NoisyReferenceWarning) if rough else contextlib.nullcontext():
            e = nj.filter.prepare(nj.Scenario(reference, setups.aiding(8.0, 18.0), start, every=every), rate=100.0)
        sd.append(
            np.sqrt(np.diagonal(np.asarray(nj.filter.gains_of(e, errors).claim.navigation)[..., 0], axis1=1, axis2=2))
        )
    np.testing.assert_allclose(sd[1], sd[0], rtol=1e-4)
