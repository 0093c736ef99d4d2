"""Noise in motion: its likelihood and intervals by other means, what it says of records, and errors."""

import dataclasses
import math
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import Told, assert_same_result
from nav.recorded.test_tuning import RATE, START, TRUTH, drive
from nav.synthetic_analysis import make_noise_in_motion
from scipy.optimize import minimize
from scipy.stats import chi2

import nav_jax as nj
from nav_jax.recorded._factors import Found, Minimum, likelihood_end, minimise, scoring_step
from nav_jax.recorded.likelihood import Record, innovation_loss
from nav_jax.recorded.navigation import prepare_navigation

SECONDS = 100.0
WINDOW = 0.5
RATES = np.array([0.5, 0.1, 0.3, 0.4, 0.1, 0.3])
"""Of the vibration: part that is white noise."""


def shaken(seed, kappa=RATES, size=(0.3, 0.03)):
    """A record whose IMU vibrates, most in its middle: of the variance of each axis a part is white.

    The rest is the difference of white noise of two samples, whose sum between fixes is zero.
    """
    imu, fixes, start = drive(seed, SECONDS)
    rng = np.random.default_rng(1000 + seed)
    level = np.repeat(size, 3) * (0.2 + np.sin(np.pi * np.arange(len(imu) + 1) / len(imu)))[:, None]
    e = level * rng.standard_normal((len(imu) + 1, 6))
    e[:: round(RATE)] = 0.0  # nothing is left of it between fixes
    white = level[1:] * rng.standard_normal((len(imu), 6))
    noise = np.sqrt(kappa) * white + np.sqrt((1 - kappa) / 2) * np.diff(e, axis=0)
    imu = dataclasses.replace(imu, accel=imu.accel + noise[:, :3], gyro=imu.gyro + noise[:, 3:])
    return imu, fixes, start, kappa * level[1:] ** 2 / RATE


@pytest.fixture(scope="module")
def record():
    return shaken(1)


@pytest.fixture(scope="module")
def found(record):
    imu, fixes, start, _ = record
    return nj.recorded.noise_in_motion(imu, fixes, TRUTH, window=WINDOW, every=4, **start)


@pytest.fixture(scope="module")
def loss(record):
    """The loss by factors, through `innovation_loss`, and its gradient in reverse mode: another way to both."""
    imu, fixes, start, _ = record
    rest = {k: v for k, v in start.items() if k != "initial"}
    vibration = nj.imu.VibrationNoise(1.0, 1.0, WINDOW)
    done = prepare_navigation(
        imu, fixes, TRUTH, every=4, output_interval=SECONDS, earth=nj.FlatEarth(), vibration=vibration, **rest
    )
    whole = Record(done.timeline, done.inputs, START)

    def of(kappa):
        now = eqx.tree_at(lambda r: r.timeline.shaken, whole, whole.timeline.shaken * kappa[None, None, :, None])
        return innovation_loss(now, TRUTH, done.sensors)

    return jax.jit(jax.value_and_grad(of))


def least(loss, held):
    """The least loss with some factors held, by a quasi-Newton method."""
    free = [i for i in range(6) if i not in held]
    scale = 0.1

    def of(x):
        kappa = np.zeros(6)
        kappa[free] = scale * x
        for i, value in held.items():
            kappa[i] = value
        value, slope = loss(jnp.asarray(kappa))
        return float(value), scale * np.asarray(slope)[free]

    return minimize(of, np.full(len(free), 1.0), jac=True, method="L-BFGS-B", bounds=[(0, 1 / scale)] * len(free)).fun


@pytest.mark.slow
def test_estimates_and_ratios_are_those_of_another_search(found, loss):
    """To the hundredths of the loss at which searches end."""
    assert found.converged
    best = least(loss, {})
    value, slope = loss(jnp.asarray(found.factor))
    assert float(value) == pytest.approx(best, abs=5e-3)
    assert np.all(np.asarray(slope)[found.factor == 0] > 0)
    assert np.all(np.asarray(slope)[found.factor == 1] < 0)
    assert found.ratio_of_all == pytest.approx(2 * (float(loss(jnp.zeros(6))[0]) - best), abs=0.02)
    for i in (0, 5):
        assert found.ratio[i] == pytest.approx(max(2 * (least(loss, {i: 0.0}) - best), 0.0), abs=0.02)


@pytest.mark.slow
def test_intervals_end_where_the_likelihood_has_fallen(found, loss):
    """By z^2/2, with the other factors most likely: 1.9207 for 95 %."""
    best = least(loss, {})
    for i in (0, 3):
        for end, edge in ((found.ci_low[i], 0.0), (found.ci_high[i], 1.0)):
            rise = least(loss, {i: end}) - best
            assert rise == pytest.approx(1.9207, abs=0.06) or (end == edge and rise < 1.9207)
    assert np.any((found.ci_low > 0) & (found.ci_high < 1))


@pytest.mark.slow
def test_what_is_found_is_what_the_filter_believes(record, found):
    """The filter with these factors has innovations that are as large as it says, and is told so by `navigate`."""
    imu, fixes, start, density = record
    kappa = density.sum(axis=0) / nj.imu.VibrationNoise(1.0, 1.0, WINDOW).densities(imu).sum(axis=0)
    assert np.all((found.ci_low < 1.5 * kappa) & (kappa / 1.5 < found.ci_high))
    assert found.p_of_all < 1e-4
    assert "does not hold in motion" in repr(found)

    def nis(**options):
        return np.concatenate(list(nj.navigate(imu, fixes, TRUTH, every=4, **start, **options).nis.values())).mean() / 3

    assert nis() > 1.1
    assert nis(vibration=found.vibration) == pytest.approx(1.0, abs=4 * np.sqrt(2 / found.num_innovations))


@pytest.mark.slow
def test_a_record_at_rest_noise_is_not_contradicted():
    imu, fixes, start = drive(1, SECONDS)
    found = nj.recorded.noise_in_motion(imu, fixes, TRUTH, every=4, **start)
    assert found.p_of_all > 0.05
    assert "is not contradicted" in repr(found)
    np.testing.assert_array_equal(found.p[found.ratio == 0], 1.0)
    np.testing.assert_array_equal(found.ci_low[found.ratio < 3.84], 0.0)


def parabola(at, J):
    """The loss (x - at)' J (x - at) / 2 about a point."""

    def evaluate(x):
        return Found(float((x - at) @ J @ (x - at) / 2), J @ (x - at), J)

    return evaluate


def test_of_a_parabola_all_is_known():
    """Its least value within x >= 0 by its slopes, and the ends of an interval in closed form."""
    rng = np.random.default_rng(0)
    A = rng.standard_normal((6, 6))
    J, at = 100 * (A @ A.T + np.eye(6)), np.array([0.3, 0.2, 0.4, 0.3, 0.5, 0.2])
    best = minimise(parabola(at, J), np.zeros(6))
    assert best.converged
    np.testing.assert_allclose(best.factors, at, atol=0.005)
    sd = np.sqrt(np.diag(np.linalg.inv(J)))
    rise = 0.02  # near enough that no factor comes to zero
    for i in range(6):
        for upper, sign in ((True, 1), (False, -1)):
            end, is_known = likelihood_end(parabola(at, J), Minimum(at, 0.0, J, True), i, rise, upper=upper)
            assert is_known
            assert end == pytest.approx(at[i] + sign * sd[i] * math.sqrt(2 * rise), rel=0.01)
    at[2] = -0.1
    best = minimise(parabola(at, J), np.ones(6))
    slope = J @ (best.factors - at)
    assert np.all(slope[best.factors == 0] > 0)
    assert best.factors[2] == 0
    np.testing.assert_allclose(slope[best.factors > 0], 0.0, atol=1.0)
    held = minimise(parabola(at, J), np.where(np.arange(6) == 4, 0.0, best.factors), 4)
    assert held.factors[4] == 0
    assert held.loss > best.loss
    np.testing.assert_allclose((J @ (held.factors - at))[held.factors > 0], 0.0, atol=1.0)


def test_a_step_does_not_leave_what_is_possible():
    step, gain = scoring_step(np.array([0.1, 0.0, 0.9]), np.array([5.0, 1.0, -5.0]), np.eye(3))
    np.testing.assert_allclose(step, [-0.1, 0.0, 0.1], atol=1e-12)
    assert gain == pytest.approx(2 * (0.5 - 0.005))


def test_a_step_that_gains_nothing_is_halved():
    """The information says that the loss is flatter than it is."""
    steep = parabola(np.full(6, 0.3), 1000 * np.eye(6))
    best = minimise(lambda x: steep(x)._replace(information=300 * np.eye(6)), np.zeros(6))
    assert best.converged
    np.testing.assert_allclose(best.factors, 0.3, atol=0.01)
    assert not minimise(lambda x: Found(0.0, np.ones(6), np.eye(6)), np.ones(6)).converged


def test_an_end_that_the_record_does_not_set_is_one():
    """The last factor changes nothing, and that before it little."""
    J = np.diag([100.0, 100.0, 100.0, 100.0, 10.0, 0.0])
    at = np.full(6, 0.4)
    ends = [likelihood_end(parabola(at, J), Minimum(at, 0.0, J, True), i, 1.92, upper=True) for i in range(6)]
    assert all(is_found for _, is_found in ends)
    expected = np.append(np.full(4, 0.4 + math.sqrt(2 * 1.92 / 100)), [1.0, 1.0])
    np.testing.assert_allclose([end for end, _ in ends], expected, atol=0.002)


def test_probabilities_are_those_of_the_edge():
    one = make_noise_in_motion(ratio=np.array([0.0, 2.7055, 3.8415, 6.6349, 0.1, 1.0]))
    np.testing.assert_allclose(one.p[:4], [1.0, 0.05, 0.025, 0.005], rtol=1e-4)
    weights = [math.comb(6, k) / 64 for k in range(7)]
    expected = sum(w * chi2.sf(9.0, k) for k, w in enumerate(weights) if k)
    assert make_noise_in_motion(ratio_of_all=9.0).p_of_all == pytest.approx(expected, rel=1e-12)
    assert make_noise_in_motion(ratio_of_all=0.0).p_of_all == 1.0


def test_it_prints_draws_saves_and_tells_the_filter(tmp_path):
    given = make_noise_in_motion()
    text = repr(given)
    assert re.search(r"gyro z +0\.1 +0\.05 +1 ", text)
    assert "NOT converged" in repr(make_noise_in_motion(converged=False))
    for suffix in (".npz", ".json"):
        assert_same_result(nj.load(given.save(tmp_path / f"x{suffix}")), given)
    assert given.vibration == nj.imu.VibrationNoise((0.1, 0.2, 0.1), (0.0, 0.3, 0.1), 0.25)
    (ax,) = given.plot().axes
    assert [t.get_text() for t in ax.get_xticklabels()] == list(nj.imu.channels.CHANNELS)
    with pytest.raises(ValueError, match="factor has the shape"):
        make_noise_in_motion(factor=np.zeros(5)).save(tmp_path / "bad.npz")


def test_errors_and_progress(record):
    imu, fixes, start, _ = record
    with pytest.raises(ValueError, match="Without aiding"):
        nj.recorded.noise_in_motion(imu, [], TRUTH, **start)
    with pytest.raises(ValueError, match="window"):
        nj.recorded.noise_in_motion(imu, fixes, TRUTH, window=0.0, **start)

    told = Told(most=3)
    with pytest.raises(LookupError):
        nj.recorded.noise_in_motion(imu, fixes, TRUTH, every=4, window=WINDOW, progress=told, **start)
    assert all(total is None for _, total in told.heard)
