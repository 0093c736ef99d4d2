"""Tuning by the innovations likelihood: slopes, recovery of a known truth, and what a record does not show."""

import dataclasses

import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from helpers import CountTraces, Told

import gmwm_jax as gj
import nav_jax as nj
from gmwm_jax._internal.progress import progress_bar
from nav_jax.filter.parameters import AidingLines, ErrorLines
from nav_jax.kinematics.rotation import quat_from_rotvec, quat_multiply
from nav_jax.recorded import _search as tuning_search
from nav_jax.recorded import likelihood
from nav_jax.recorded._information import observable_parameters, standard_errors, whitening
from nav_jax.recorded._search import Found, Objective, search
from nav_jax.recorded.likelihood import Model, Record, loss_and_slopes
from nav_jax.recorded.navigation import _whitening, prepare_navigation
from nav_jax.recorded.tuning import _applied

RATE = 20.0
SECONDS = 200.0
START = nj.InitialUncertainty(0.05, 0.02, np.deg2rad(0.3))
TRUTH = nj.ImuErrors(gj.WN(4e-4), gj.WN(1.2e-5) + gj.GM(5e-3, 1e-6), RATE)
GUESS = nj.ImuErrors(gj.WN(2e-3), gj.WN(6e-5) + gj.GM(5e-3, 3e-7), RATE)
SENSORS = (nj.GnssPosition(1.0, horizontal=0.02, vertical=0.04), nj.GnssVelocity(1.0, horizontal=0.01, vertical=0.02))


def drive(seed, seconds=SECONDS, truth=TRUTH):
    """A record of sensors with the true noise: IMU, fixes, and the start as far as it is known."""
    imu, reference = nj.perfect_imu(nj.motions.lemniscate(seconds, RATE), RATE, nj.FlatEarth())
    keys = jax.random.split(jax.random.key(seed), 6)
    noise = np.stack([np.asarray(gj.simulate(m, len(imu), key=k)) for m, k in zip(truth.models, keys, strict=True)], 1)
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
    return nj.tune(imu, fixes, GUESS, every=4, **start)


def log(errors):
    return np.asarray(ErrorLines(errors).start)


@pytest.mark.slow
def test_slopes_are_those_of_differences(record):
    """Gradient 1e-5 by central differences of fourth order; the information is about the curvature."""
    imu, fixes, start = record
    initial = start.pop("initial")
    done = prepare_navigation(imu, fixes, TRUTH, every=4, output_interval=SECONDS, earth=nj.FlatEarth(), **start)
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
    assert found.loss == pytest.approx(float(nj.recorded.innovation_loss(record, TRUTH, done.sensors)), rel=1e-10)


@pytest.mark.slow
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


@pytest.mark.slow
def test_what_the_record_does_not_show_is_held(record):
    """A random walk of the accelerometers far below the rest: no sign of it in 200 s."""
    imu, fixes, start = record
    weak = nj.ImuErrors(gj.WN(4e-4) + gj.RW(1e-18), TRUTH.models[3], RATE)
    found = nj.tune(imu, fixes, weak, every=4, hold=["gyro GM beta"], **start)
    seen = dict(zip(found.names, found.observable, strict=True))
    assert not seen["accel RW gamma2"]
    assert not seen["gyro GM beta"]
    assert seen["accel WN sigma2"]
    values = dict(zip(found.names, found.value, strict=True))
    assert values["accel RW gamma2"] == pytest.approx(1e-18, rel=1e-9)
    assert np.isnan(found.se[found.names.index("accel RW gamma2")])
    assert found.held == ("gyro GM beta",)
    remarks = dict(zip(found.names, found.remarks, strict=True))
    assert remarks["accel RW gamma2"] == "not observable: held"
    assert remarks["gyro GM beta"] == "held"
    assert remarks["accel WN sigma2"] == ""
    assert repr(found).endswith("given the values of what is held.")


@pytest.mark.slow
def test_a_prior_holds_back(record, tuned):
    imu, fixes, start = record
    held = nj.tune(imu, fixes, GUESS, every=4, prior=1e-4, **start)
    assert held.observable.all()
    assert (held.se < 1e-4).all()
    np.testing.assert_allclose(log(held.errors), log(GUESS), atol=1e-4)
    assert tuned.loss < held.loss < held.loss_start + 1e-6


@pytest.mark.slow
def test_aiding_too(record):
    imu, fixes, start = record
    wrong = [
        nj.Fixes(nj.GnssPosition(1.0, horizontal=0.05, vertical=0.04), fixes[0].time, fixes[0].value),
        fixes[1],
    ]
    found = nj.tune(imu, wrong, TRUTH, every=4, tune_aiding=True, hold=ErrorLines(TRUTH).names, **start)
    k = found.names.index("gnss_position n, e sd")
    assert found.value[k] == pytest.approx(0.4, abs=4 * 0.4 * found.se[k])
    assert found.se[k] < 0.1
    np.testing.assert_allclose(found.aiding[0].believed[0], 0.05 * found.value[k])


@pytest.mark.slow
def test_what_receivers_say_of_themselves_is_corrected(record):
    """Covariances of the fixes' own that are 2.5 times too large, and correlated; nothing else is sought."""
    imu, fixes, start = record
    told = np.array([[1.0, 0.6, 0.0], [0.6, 1.0, 0.0], [0.0, 0.0, 4.0]]) * 0.05**2
    modest = nj.Fixes(fixes[0].sensor, fixes[0].time, fixes[0].value, np.broadcast_to(told, (len(fixes[0].time), 3, 3)))
    found = nj.tune(imu, [modest, fixes[1]], TRUTH, every=4, tune_aiding=True, hold=["accel", "gyro"], **start)
    assert found.held == ErrorLines(TRUTH).names
    k = found.names.index("gnss_position d sd")
    assert found.value[k] == pytest.approx(0.4, abs=4 * 0.4 * found.se[k])
    better, same = found.applied([modest, fixes[1]])
    factor = np.array([*[found.value[found.names.index("gnss_position n, e sd")]] * 2, found.value[k]])
    np.testing.assert_allclose(better.covariance[7], told * np.outer(factor, factor), rtol=1e-12)
    assert same.covariance is None
    np.testing.assert_array_equal(same.sensor.believed, found.aiding[1].believed)
    # a filter of these fixes is that of the tuning
    again = nj.tune(imu, [better, same], TRUTH, every=4, tune_aiding=True, hold=["accel", "gyro"], **start)
    assert again.loss_start == pytest.approx(found.loss, rel=1e-9)
    with pytest.raises(ValueError, match="tuning is of gnss_position, gnss_velocity, and the fixes are of gnss_vel"):
        found.applied([same])


def test_factors_of_correlated_fixes_are_those_that_were_tuned():
    """What takes fixes to the scalars of the filter stays, while these have other standard deviations."""
    told = np.array([[1.0, 0.3, 0.8], [0.3, 1.5, 0.2], [0.8, 0.2, 2.0]]) * 0.04
    fixes = nj.Fixes(nj.GnssPosition(horizontal=0.2, vertical=0.3), [1.0, 2.0], np.zeros((2, 3)), np.stack([told] * 2))
    tuned = nj.GnssPosition(horizontal=0.4, vertical=0.3)
    found = _applied(fixes, tuned)
    np.testing.assert_allclose(_whitening(found), _whitening(fixes), rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(found.sensor.believed, tuned.believed)


@pytest.mark.slow
def test_vibration_is_the_filters_that_is_tuned(record):
    imu, fixes, start = record
    shaken = nj.imu.VibrationNoise(accel=0.3, gyro=0.3)
    losses = [
        nj.tune(imu, fixes, TRUTH, every=4, tune_aiding=True, hold=["accel", "gyro"], vibration=v, **start).loss_start
        for v in (None, shaken)
    ]
    told = nj.navigate(imu, fixes, TRUTH, every=4, vibration=shaken, **start)
    each = [told.innovation[n] ** 2 / told.innovation_sd[n] ** 2 + 2 * np.log(told.innovation_sd[n]) for n in told.nis]
    assert losses[1] == pytest.approx(sum(x.sum() for x in each) / 2, rel=1e-9)
    assert losses[1] > losses[0] + 0.01


def test_information_and_observability():
    """Two parameters of which only the sum matters: one is given up; standard errors are of the inverse."""
    info = np.array([[4.0, 4.0, 0.0], [4.0, 4.0, 0.0], [0.0, 0.0, 25.0]])
    left = observable_parameters(info, [0, 1, 2])
    assert len(left) == 2
    assert 2 in left
    np.testing.assert_allclose(standard_errors(info, left)[left], [0.5, 0.2])
    assert np.isinf(standard_errors(info, [0, 1, 2])[:2]).all()
    B = whitening(info, left)
    np.testing.assert_allclose(B.T @ info @ B, np.eye(2), atol=1e-10)
    assert observable_parameters(1e-3 * np.eye(2), [0, 1]) == []


def test_of_a_collinear_pair_one_is_given_up():
    """And nothing else, in 200 random matrices; what must be kept is."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        J = rng.standard_normal((200, 6)) * rng.uniform(0.5, 5.0, 6)
        a, b = (int(i) for i in rng.choice(6, 2, replace=False))
        J[:, b] = J[:, a] * rng.choice([1.0, -0.3, 2.7])
        left = observable_parameters(J.T @ J, range(6))
        assert len(left) == 5
        assert set(left) | {a, b} == set(range(6))
        (gone,) = {a, b} - set(observable_parameters(J.T @ J, range(6), keep=[a]))
        assert gone == b


@pytest.mark.slow
def test_of_two_equal_processes_one_is_given_up(record):
    imu, fixes, start = record
    twice = nj.ImuErrors(gj.WN(4e-4), gj.WN(1.2e-5) + gj.GM(5e-3, 5e-7) + gj.GM(5e-3, 5e-7), RATE)
    objective = objective_of(imu, fixes, twice, **start)
    left = observable_parameters(objective(objective.start).information, range(6))
    names = [objective.model.names[i] for i in left]
    assert names[:2] == ["accel WN sigma2", "gyro WN sigma2"]
    assert sorted(name.split()[-1] for name in names[2:]) == ["beta", "variance"]


def objective_of(imu, fixes, errors, initial, **start):
    done = prepare_navigation(imu, fixes, errors, every=4, output_interval=SECONDS, earth=nj.FlatEarth(), **start)
    lines = ErrorLines(errors)
    penalty = np.zeros((len(lines.names),) * 2)
    return Objective(
        Record(done.timeline, done.inputs, initial), Model(lines, AidingLines(done.sensors), False), penalty
    )


class Variances(Objective):
    """Gaussian samples with the variances exp(a) + exp(b), and as many with exp(a)."""

    def __init__(self, start, variances, penalty=0.0):
        self.start, self.variances = np.array(start), np.array(variances)
        self.penalty = penalty * np.eye(2)

    def __call__(self, vector):
        a, b = np.exp(vector)
        d = np.array([[a / (a + b), b / (a + b)], [1.0, 0.0]])
        ratio = self.variances / np.array([a + b, a])
        loss = 500 * np.sum(ratio - np.log(ratio)) + self.penalty_at(vector)
        gradient = 500 * (1 - ratio) @ d + self.penalty @ (vector - self.start)
        return Found(float(loss), gradient, 500 * d.T @ d)


def searched(objective, max_steps=50):
    return search(objective, [0, 1], max_steps, progress_bar(None, "step", False))


def test_what_becomes_observable_on_the_way_is_sought():
    """Under too much of a the start shows nothing of b, the solution does."""
    objective = Variances([4.0, -1.0], [1 + np.exp(-2.0), 1.0])
    assert observable_parameters(objective(objective.start).information, [0, 1]) == [0]
    found = searched(objective)
    assert found.converged
    assert found.observable.all()
    assert not found.lost.any()
    np.testing.assert_allclose(found.vector, [0.0, -2.0], atol=1e-3)


def test_what_is_lost_on_the_way_is_held_where_it_has_got():
    """There is no b: a search for it has no end, though at its start it is in sight. Nothing goes round in circles."""
    objective = Variances([0.5, 0.0], [1.0, 1.0])
    assert observable_parameters(objective(objective.start).information, [0, 1]) == [0, 1]
    for max_steps in (1, 3, 5, 7):
        short = searched(objective, max_steps)
        assert short.converged == (max_steps == 7)
        assert (short.se[short.sought] < 1).all()
    found = searched(objective)
    assert found.converged
    assert found.vector[1] < -3.0
    np.testing.assert_array_equal(found.sought, [True, False])
    np.testing.assert_array_equal(found.lost, [False, True])
    np.testing.assert_array_equal(found.observable, [True, False])
    assert objective(found.vector).gradient[0] == pytest.approx(0.0, abs=0.1)
    assert found.se[0] < 0.1
    assert np.isinf(found.se[1])


def test_what_only_the_prior_knows_is_marked():
    """It is sought and has a standard error, that of the prior; without the prior the record says nothing."""
    found = searched(Variances([0.5, -9.0], [1.0, 1.0], penalty=4.0))
    assert found.converged
    assert found.sought.all()
    np.testing.assert_array_equal(found.observable, [True, False])
    assert found.se[1] == pytest.approx(0.5, rel=1e-3)
    assert found.vector[0] == pytest.approx(0.0, abs=1e-2)


def test_an_interrupted_search_is_as_far_as_it_came():
    """Also where something was lost by then."""

    class Bar:
        def __init__(self, steps):
            self.left = steps

        def update(self, n):
            self.left -= n
            if not self.left:
                raise KeyboardInterrupt

    for objective, steps in ((Variances([4.0, -1.0], [1.1, 1.0]), 2), (Variances([0.5, 0.0], [1.0, 1.0]), 7)):
        found = search(objective, [0, 1], 50, Bar(steps))
        assert not found.converged
        assert objective(found.vector).loss < objective(objective.start).loss
        np.testing.assert_array_equal(found.sought, [True, False])
        assert found.lost[1] == (found.vector[1] != objective.start[1])


@pytest.mark.slow
def test_a_process_that_is_not_there_is_lost(record, monkeypatch):
    """The search drives a random walk of the accelerometers towards zero; one program does all rounds."""
    imu, fixes, start = record
    guess = nj.ImuErrors(gj.WN(4e-4) + gj.RW(2.5e-7), TRUTH.models[3], RATE)
    counted = CountTraces(likelihood.innovations)
    monkeypatch.setattr(likelihood, "innovations", counted)
    rounds = CountTraces(tuning_search._minimise)
    monkeypatch.setattr(tuning_search, "_minimise", rounds)
    found = nj.tune(imu, fixes, guess, every=4, hold=["gyro GM beta"], **start)
    k = found.names.index("accel RW gamma2")
    assert rounds.count > 1
    assert counted.count <= 1
    assert found.remarks[k] == "lost in the search: held there"
    assert repr(found).endswith("the record may do without that process.")
    # what the record contradicts is not kept
    assert found.value[k] < 1e-9
    assert found.loss_start - found.loss > 15
    assert np.isnan([found.se[k], found.ci_low[k], found.ci_high[k]]).all()
    held = ~found.sought & ~found.lost
    np.testing.assert_array_equal(log(found.errors)[held], log(guess)[held])


@pytest.mark.slow
def test_with_a_prior_what_the_record_does_not_show_says_so(record):
    imu, fixes, start = record
    weak = nj.ImuErrors(gj.WN(4e-4) + gj.RW(1e-18), TRUTH.models[3], RATE)
    found = nj.tune(imu, fixes, weak, every=4, prior=0.5, hold=["gyro GM beta"], **start)
    k = found.names.index("accel RW gamma2")
    assert found.remarks[k] == "not observable: from the prior"
    assert not found.observable[k]
    assert found.se[k] == pytest.approx(0.5, rel=1e-3)
    assert found.ci_low[k] < found.value[k] < found.ci_high[k]
    assert found.observable[found.names.index("accel WN sigma2")]


@pytest.mark.slow
def test_channels_without_noise_are_left_alone(record):
    imu, fixes, start = record
    silent = nj.ImuErrors(gj.WN(0.0), GUESS.models[3], RATE)
    found = nj.tune(imu, fixes, silent, every=4, max_steps=2, **start)
    assert found.names == ("gyro WN sigma2", "gyro GM beta", "gyro GM variance")
    assert found.loss < found.loss_start
    assert float(found.errors.models[0].processes[0].sigma2) == 0.0


@pytest.mark.slow
def test_partial_autocorrelations_have_their_own_lines(record):
    """Estimates and intervals are of what the names say: a function of one line, whatever the others are."""
    imu, fixes, start = record
    guess = nj.ImuErrors(gj.WN(4e-4), gj.AR(2)(0.3, 0.2, 2e-5), RATE)
    found = nj.tune(imu, fixes, guess, every=4, max_steps=3, prior=1.0, **start)
    assert found.names[1:] == ("gyro AR(2) phi partial 1", "gyro AR(2) phi partial 2", "gyro AR(2) sigma2")
    np.testing.assert_allclose(found.start[1:], [0.3 / 0.8, 0.2, 2e-5])
    phi1, phi2, sigma2 = (float(v) for v in found.errors.models[3].processes[0].values)
    np.testing.assert_allclose(found.value[1:], [phi1 / (1 - phi2), phi2, sigma2])
    z = 1.959963984540054 * found.se[1:3]
    middle = 2 * np.arctanh(found.value[1:3])
    np.testing.assert_allclose(found.ci_low[1:3], np.tanh((middle - z) / 2), rtol=1e-6)
    np.testing.assert_allclose(found.ci_high[1:3], np.tanh((middle + z) / 2), rtol=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"initial": None}, "initial must be of the class InitialUncertainty"),
        ({"earth": 9.8}, "earth must be of the class AbstractEarth"),
    ],
)
def test_objects_of_another_class(record, options, message, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # which knows better than a user's interpreter
    imu, fixes, start = record
    for run in (nj.tune, nj.navigate):
        with pytest.raises(ValueError, match=message):
            run(imu, fixes, GUESS, **(start | options))


@pytest.mark.slow
def test_steps_are_counted_and_an_interrupt_keeps_where_the_search_is(record):
    imu, fixes, start = record
    told = Told(2, KeyboardInterrupt)
    stopped = nj.tune(imu, fixes, GUESS, every=4, progress=told, **start)
    assert told.heard == [(0, None), (1, None), (2, None)]
    assert not stopped.converged
    with pytest.raises(LookupError, match="enough"):
        nj.tune(imu, fixes, GUESS, every=4, progress=Told(1), **start)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"level": 2.0}, "level is a probability"),
        ({"max_steps": 0}, "max_steps must be an integer of 1 or more"),
        ({"hold": ["gyro colour"]}, "no parameter 'gyro colour'"),
        ({"prior": np.eye(2)}, r"covariance of the prior is \(4, 4\)"),
        ({"prior": -np.eye(4)}, "not positive definite"),
        ({"hold": ErrorLines(GUESS).names}, "determines none"),
    ],
)
def test_bad_input(record, options, message):
    imu, fixes, start = record
    with pytest.raises(ValueError, match=message):
        nj.tune(imu, fixes, GUESS, every=4, **start, **options)


def test_without_fixes_there_is_nothing_to_tune_by(record):
    imu, _, start = record
    with pytest.raises(ValueError, match="no innovations"):
        nj.tune(imu, [], GUESS, **start)
