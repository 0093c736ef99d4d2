"""R's filter, input for input (navigation 0.0.2, 60 s of lemniscate, reference/nav_exact.npz).

R mechanises by Euler's forward rule, its perfect sensors undo just that rule, and so they are not those of the exact
mechanisation: 1.2 m come of it in an outage of 20 s. Its velocities are those of the middle of the sample that follows.
So its *errors* are taken (its noisy sensors minus its perfect ones, its fixes minus its truth) and added to perfect
sensors of the same trajectory.
"""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.imu.emulation import GivenErrors
from nav_jax.kinematics.rotation import quat_conjugate, quat_from_euler, quat_multiply, quat_to_rotvec

pytestmark = pytest.mark.usefixtures("quick_compilation")

EARTH = nj.FlatEarth(setups.GRAVITY)


@pytest.fixture(scope="module")
def r(shared):
    folder = shared / "reference"
    meta = json.loads((folder / "nav_exact.json").read_text())["cases"]
    with np.load(folder / "nav_exact.npz") as file:
        return dict(file), meta


def rotation_of_euler_errors(euler):
    """Takes small errors of roll, pitch, yaw to the rotation vector in n."""
    _, p, y = euler
    cp, sp, cy, sy = np.cos(p), np.sin(p), np.cos(y), np.sin(y)
    return np.array([[cp * cy, -sy, 0.0], [cp * sy, cy, 0.0], [-sp, 0.0, 1.0]])


def r_deviations(X, P):
    """R's standard deviations of position, velocity and rotation vector at 1, 2 .. 60 s."""
    rows = []
    for k in range(1, 61):
        T = np.eye(9)
        T[6:, 6:] = rotation_of_euler_errors(X[6:9, 100 * k])
        rows.append(np.sqrt(np.diag(T @ P[:9, :9, k] @ T.T)))
    return np.array(rows)


def r_errors(X, reference):
    """R's errors of position, velocity and rotation vector at 1, 2 .. 60 s."""
    X, truth = X[:9, 100::100], reference[100::100].T
    q, q_true = (quat_from_euler(jnp.asarray(a)) for a in (X[6:], truth[4:7]))
    psi = np.asarray(quat_to_rotvec(quat_multiply(q, quat_conjugate(q_true))))
    return np.concatenate([X[:3] - truth[1:4], X[3:6] - truth[7:10], psi]).T


def believed(kind):
    if kind == "full":
        return setups.imu_errors("right", start="zero")
    accel, gyro = gj.WN(setups.ACCEL_WN), gj.WN(setups.GYRO_WN)
    if kind == "rw":
        # R's densities are 1e-8 m^2/s^5 and 1e-10 rad^2/s^3
        accel, gyro = accel + gj.RW(1e-10), gyro + gj.RW(1e-12)
    return nj.ImuErrors(accel, gyro, setups.RATE, start="zero")


def run_ours(r, case, **options):
    """Our filter's errors and standard deviations (60, 9) on the inputs of a case."""
    data, meta = r
    name = meta[case]["inputs"]
    reference = data["ref_lemniscate"]
    trajectory = nj.Trajectory.from_euler(reference[:, 0], reference[:, 1:4], reference[:, 4:7])
    scenario = nj.Scenario(trajectory, setups.aiding(30.0, 50.0, first=0.0), earth=EARTH, **options)
    e = nj.filter.prepare(scenario, rate=setups.RATE)
    model = believed(meta[case]["kf_model"])
    inputs = setups.quiet_inputs(e)
    noise = (data[name + "_imu"] - data["in_lemniscate_s1_full_clean_imu"])[1:, :6000].T
    z = np.array(inputs.z)
    truth = reference[::100]
    for k, *fix in data[name + "_gps"].T:
        z[round(k), :6, 0] += fix - truth[round(k), [1, 2, 3, 7, 8, 9]]
    z[:, 6, 0] += data[name + "_baro"][1] + truth[:, 3]
    errors = noise[setups.samples(e)].reshape(inputs.errors.per_step.shape)
    inputs = inputs._replace(errors=GivenErrors(jnp.asarray(errors), inputs.errors.per_segment), z=jnp.asarray(z))
    judged = jax.tree.map(np.asarray, nj.filter.run_filter(e, model, inputs).judgement)
    return judged.error[1:, :9, 0], judged.sd[1:, :9, 0]


@pytest.mark.parametrize("case", ["clean_full_m2", "wn_m2", "rw_m2", "full_m2"])
def test_standard_deviations_are_those_of_r(r, case):
    """At every second, of position, velocity and attitude (R's Euler angles as a rotation vector)."""
    data, _ = r
    expected = r_deviations(data[case + "_X"], data[case + "_P"])
    _, seen = run_ours(r, case)
    off = np.abs(seen / expected - 1)
    assert off.max() < 1e-3


@pytest.mark.parametrize("case", ["wn_m2", "rw_m2", "full_m2"])
def test_errors_are_those_of_r(r, case):
    """The same noise makes the same errors of up to 3.8 standard deviations, to 4 % of one.

    R's position lags half a sample of velocity error behind: 0.5 mm at the end of the outage, when a fix has 25 mm.
    """
    data, _ = r
    expected = r_errors(data[case + "_X"], data["ref_lemniscate"])
    sd = r_deviations(data[case + "_X"], data[case + "_P"])
    seen, _ = run_ours(r, case)
    off = np.abs(seen - expected) / sd
    assert off.max() < 0.04
    assert (np.abs(expected) / sd).max() > 2


def test_fewer_covariance_steps_are_still_r(r):
    """Every tenth sample, the transition accumulated over all ten."""
    data, _ = r
    _, seen = run_ours(r, "clean_full_m2", every=10)
    expected = r_deviations(data["clean_full_m2_X"], data["clean_full_m2_P"])
    assert np.abs(seen / expected - 1).max() < 2.5e-3
