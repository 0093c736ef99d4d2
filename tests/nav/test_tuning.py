"""Tuning by the innovations likelihood: slopes, recovery of a known truth, and what a record does not show."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.likelihood import Model, Record, loss_and_slopes
from nav_jax.navigate import prepare_navigation
from nav_jax.parameters import AidingLines, ErrorLines
from nav_jax.rotation import quat_from_rotvec, quat_multiply
from nav_jax.tuning import observable_parameters, standard_errors, whitening

pytestmark = pytest.mark.usefixtures("quick_compilation")

RATE = 50.0
SECONDS = 200.0
START = nj.InitialUncertainty(0.05, 0.02, np.deg2rad(0.3))
TRUTH = nj.ImuErrors(gj.WN(1e-3), gj.WN(3e-5) + gj.GM(2e-3, 1e-6), RATE)
GUESS = nj.ImuErrors(gj.WN(3e-3), gj.WN(1e-4) + gj.GM(2e-3, 3e-7), RATE)
SENSORS = (nj.GnssPosition(1.0, horizontal=0.02, vertical=0.04), nj.GnssVelocity(1.0, horizontal=0.01, vertical=0.02))


def drive(seed, seconds=SECONDS):
    """A record of sensors with the true noise: IMU, fixes, and the start as far as it is known."""
    imu, reference = nj.perfect_imu(nj.lemniscate(seconds, RATE), RATE, nj.FlatEarth())
    keys = jax.random.split(jax.random.key(seed), 6)
    noise = np.stack([np.asarray(gj.simulate(m, len(imu), key=k)) for m, k in zip(TRUTH.models, keys, strict=True)], 1)
    imu = dataclasses.replace(imu, accel=imu.accel + noise[:, :3], gyro=imu.gyro + noise[:, 3:])
    rng = np.random.default_rng(seed)
    t = np.arange(1.0, seconds + 1)
    at = np.round(t * RATE).astype(int)
    position = reference.position[at] + rng.standard_normal((len(t), 3)) * np.asarray(SENSORS[0].believed)
    velocity = reference.velocity[at] + rng.standard_normal((len(t), 3)) * np.asarray(SENSORS[1].believed)
    e = rng.standard_normal(9) * np.sqrt(np.diag(START.covariance))
    q = quat_multiply(quat_from_rotvec(jnp.asarray(e[6:])), jnp.asarray(reference.quaternion[0]))
    start = {
        "position": reference.position[0] + e[:3],
        "velocity": reference.velocity[0] + e[3:6],
        "quaternion": np.asarray(q),
        "initial": START,
    }
    return imu, [nj.Fixes(SENSORS[0], t, position), nj.Fixes(SENSORS[1], t, velocity)], start


@pytest.fixture(scope="module")
def record():
    return drive(1)


@pytest.fixture(scope="module")
def tuned(record):
    imu, fixes, start = record
    return nj.tune(imu, fixes, GUESS, every=10, **start)


def log(errors):
    return np.asarray(ErrorLines(errors).start)


def test_slopes_are_those_of_differences(record):
    """Gradient 1e-5 by central differences of fourth order; the information is about the curvature."""
    imu, fixes, start = record
    initial = start.pop("initial")
    done = prepare_navigation(imu, fixes, TRUTH, every=10, output_interval=SECONDS, earth=None, **start)
    start["initial"] = initial
    record = Record(done.timeline, done.inputs, initial)
    model = Model(ErrorLines(TRUTH), AidingLines(done.sensors), with_aiding=False)
    v = model.start
    found = loss_and_slopes(record, model, v)
    h = 1e-2
    for i in range(len(v)):
        d = h * jnp.eye(len(v))[i]
        at = [loss_and_slopes(record, model, v + k * d) for k in (-2, -1, 1, 2)]
        losses, gradients = [x.loss for x in at], [x.gradient for x in at]
        slope = (losses[0] - 8 * losses[1] + 8 * losses[2] - losses[3]) / (12 * h)
        assert found.gradient[i] == pytest.approx(float(slope), rel=1e-5, abs=1e-4)
        curve = (gradients[0] - 8 * gradients[1] + 8 * gradients[2] - gradients[3])[i] / (12 * h)
        assert 0.4 < found.information[i, i] / curve < 2.5
    assert found.loss == pytest.approx(float(nj.innovation_loss(record, TRUTH, done.sensors)), rel=1e-12)


def test_the_truth_is_found(tuned):
    """Within 4 standard errors; the likelihood is above that of the truth, and the guess was far."""
    assert tuned.converged
    assert tuned.observable.all()
    z = (log(tuned.errors) - log(TRUTH)) / tuned.se
    assert np.abs(z).max() < 4
    assert np.abs((log(GUESS) - log(TRUTH)) / tuned.se).max() > 4
    assert tuned.loss < tuned.loss_start - 10
    assert np.all((tuned.ci_low < tuned.value) & (tuned.value < tuned.ci_high))
    assert "converged" in repr(tuned)
    assert tuned.num_innovations == 1200


def test_what_the_record_does_not_show_is_held(record):
    """A random walk of the accelerometers far below the rest: no sign of it in 200 s."""
    imu, fixes, start = record
    weak = nj.ImuErrors(gj.WN(1e-3) + gj.RW(1e-18), TRUTH.models[3], RATE)
    found = nj.tune(imu, fixes, weak, every=10, hold=["gyro GM beta"], **start)
    seen = dict(zip(found.names, found.observable, strict=True))
    assert not seen["accel RW gamma2"]
    assert not seen["gyro GM beta"]
    assert seen["accel WN sigma2"]
    values = dict(zip(found.names, found.value, strict=True))
    assert values["accel RW gamma2"] == pytest.approx(1e-18, rel=1e-9)
    assert np.isnan(found.se[found.names.index("accel RW gamma2")])
    assert found.held == ("gyro GM beta",)
    assert found._remark("accel RW gamma2", False) == "not observable: held"
    assert found._remark("gyro GM beta", False) == "held"


def test_a_prior_holds_back(record, tuned):
    imu, fixes, start = record
    held = nj.tune(imu, fixes, GUESS, every=10, prior=1e-4, **start)
    np.testing.assert_allclose(log(held.errors), log(GUESS), atol=1e-4)
    assert tuned.loss < held.loss < held.loss_start + 1e-6


def test_aiding_too(record):
    imu, fixes, start = record
    wrong = [
        nj.Fixes(nj.GnssPosition(1.0, horizontal=0.05, vertical=0.04), fixes[0].time, fixes[0].value),
        fixes[1],
    ]
    found = nj.tune(imu, wrong, TRUTH, every=10, tune_aiding=True, hold=ErrorLines(TRUTH).names, **start)
    k = found.names.index("gnss_position n, e sd")
    assert found.value[k] == pytest.approx(0.4, abs=4 * 0.4 * found.se[k])
    assert found.se[k] < 0.1
    np.testing.assert_allclose(found.aiding[0].believed[0], 0.05 * found.value[k])


def test_information_and_observability():
    """Two parameters of which only the sum matters: one is given up; standard errors are of the inverse."""
    info = np.array([[4.0, 4.0, 0.0], [4.0, 4.0, 0.0], [0.0, 0.0, 25.0]])
    left = observable_parameters(info, [0, 1, 2])
    assert len(left) == 2
    assert 2 in left
    np.testing.assert_allclose(standard_errors(info, left)[left], [0.5, 0.2])
    assert np.isinf(standard_errors(info, [0, 1, 2])[:2]).all()
    B = whitening(info, left)
    np.testing.assert_allclose(B.T @ info @ B, np.eye(2), atol=1e-12)
    assert observable_parameters(1e-3 * np.eye(2), [0, 1]) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"hold": ["gyro colour"]}, "no parameter 'gyro colour'"),
        ({"prior": np.eye(2)}, r"covariance of the prior is \(4, 4\)"),
        ({"prior": -np.eye(4)}, "not positive definite"),
        ({"hold": ErrorLines(GUESS).names}, "determines none"),
    ],
)
def test_bad_input(record, options, message):
    imu, fixes, start = record
    with pytest.raises(ValueError, match=message):
        nj.tune(imu, fixes, GUESS, every=10, **start, **options)


def test_without_fixes_there_is_nothing_to_tune_by(record):
    imu, _, start = record
    with pytest.raises(ValueError, match="no innovations"):
        nj.tune(imu, [], GUESS, **start)
