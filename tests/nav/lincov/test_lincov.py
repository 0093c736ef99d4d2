"""Linear covariances: against closed forms, finite sums, Monte Carlo runs and central differences."""

import inspect

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.special
import scipy.stats
from helpers import Told
from nav import setups

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter.joint_covariance import covariances_along, noise_of
from nav_jax.statistics.distributions import weighted_chi2_cdf

START = nj.InitialUncertainty(0.05, 0.02, np.deg2rad([0.1, 0.1, 0.5]))
TRUTH = setups.TRUTH
FILTERS = {
    "right": TRUTH,
    "white": nj.ImuErrors(gj.WN(6e-5), gj.WN(1.5e-6), setups.RATE),
    "fewer": setups.FEWER,
}


def correlation(P, scale=None):
    """P over the standard deviations of `scale`, its own by default."""
    sd = np.sqrt(np.diagonal(P if scale is None else scale, axis1=-2, axis2=-1))
    return np.asarray(P) / sd[..., :, None] / sd[..., None, :]


@pytest.fixture(scope="module")
def experiment():
    return setups.experiment()


@pytest.fixture(scope="module")
def analysis():
    return nj.analyse(setups.SCENARIO, TRUTH, FILTERS)


# -- what it must be ------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("every", [1, 10])
def test_the_right_filter_claims_what_is_true(every):
    """States of several kinds, a turn-on bias and drifts: relative to the standard deviations 1e-8."""
    truth = nj.ImuErrors(
        gj.WN(6e-5) + gj.MAT32(0.01, 1e-5), gj.WN(1.5e-6) + gj.RW(1e-13) + gj.DR(1e-9), setups.RATE, accel_bias_sd=0.01
    )
    scenario = nj.Scenario(nj.motions.lemniscate(4.0, setups.RATE), setups.aiding(2.0, 3.0), START, every=every)
    e = nj.filter.prepare(scenario, rate=setups.RATE)
    found = nj.lincov.linear_covariance(e, truth, truth)
    for true, claimed in zip(found.true, found.claimed, strict=True):
        np.testing.assert_allclose(correlation(true, claimed), correlation(claimed), rtol=0, atol=1e-8)
    used = np.asarray(e.timeline.valid) > 0
    np.testing.assert_allclose(
        np.asarray(found.innovation)[used], np.asarray(found.innovation_claimed)[used], rtol=1e-8
    )


@pytest.mark.slow
def test_what_a_filter_claims_is_its_own_covariance(experiment):
    """That of the filter which runs on the reference, from another program."""
    gains = nj.filter.gains_of(experiment, FILTERS["fewer"])
    found = setups.covariances(TRUTH, FILTERS["fewer"])
    theirs = np.asarray(gains.claim.navigation[..., 0])
    np.testing.assert_allclose(correlation(found.claimed.navigation, theirs), correlation(theirs), atol=1e-9)


STILL = {
    "white": (gj.WN(1e-4), gj.WN(1e-8)),
    "random walk": (gj.RW(1e-8), gj.RW(1e-12)),
    "Gauss-Markov": (gj.GM(1e-4, 1e-4), gj.GM(1e-4, 1e-8)),
}
"""Accelerometers and gyros; so that what they make of horizontal positions is of about one size."""


def of_integrals(model, dt, num, order):
    """Variance of the integral of this order of a held sample, as a sum over the covariance of its samples.

    A sample that holds over [t_k, t_k + dt] makes (T - t)^(order - 1)/(order - 1)! of it: integrated, the difference of
    two powers.
    """
    left = dt * (num - np.arange(num))
    weight = (left**order - (left - dt) ** order) / scipy.special.factorial(order)
    (process,) = model.processes
    if process.kind == "WN":
        return float(process.sigma2) * dt * _white(left, dt, order)
    if process.kind == "RW":
        # the step j is in all samples from j on
        return float(process.gamma2) * np.sum(np.cumsum(weight[::-1]) ** 2)
    beta, variance = (float(v) for v in process.values)
    e = np.exp(-beta * np.arange(num))
    past = np.array([weight[: k + 1] @ e[k::-1] for k in range(num)])
    return variance * (2 * weight @ past - weight @ weight)


def _white(left, dt, order):
    """Mean square of (T - t)^(order - 1)/(order - 1)!, integrated over time."""
    f = scipy.special.factorial(order - 1)
    return np.sum((left ** (2 * order - 1) - (left - dt) ** (2 * order - 1)) / (2 * order - 1)) / f**2


@pytest.mark.slow
@pytest.mark.parametrize("case", STILL)
def test_unaided_and_at_rest_the_integrals_of_the_noise_come_out(case):
    """Accelerometer errors integrate once and twice, gyro errors tilt and pull gravity in (Blum & Dambeck 2020): 1e-6.

    Samples are held: their integrals are finite sums. In continuous time white noise has q t^(2n-1)/((2n-1) (n-1)!^2),
    from which the sums differ by (dt/t)^2. Down there are accelerometer errors alone, north both.
    """
    seconds, rate = 60.0, 50.0
    num, dt, g2 = round(seconds * rate), 1 / rate, setups.GRAVITY**2
    models = STILL[case]
    scenario = nj.Scenario(nj.motions.static(seconds, rate), earth=nj.FlatEarth(setups.GRAVITY))
    believed = nj.ImuErrors(gj.WN(1e-4), gj.WN(1e-8), rate)
    c = nj.analyse(scenario, nj.ImuErrors(*models, rate), believed)["filter"]
    accel, gyro = ({n: of_integrals(gj.Composite((m,)), dt, num, n) for n in (1, 2, 3)} for m in models)
    expected = {
        "position d": (2, accel[2]),
        "velocity d": (5, accel[1]),
        "tilt": (6, gyro[1]),
        "heading": (8, gyro[1]),
        "velocity n": (3, accel[1] + g2 * gyro[2]),
        "position n": (0, accel[2] + g2 * gyro[3]),
    }
    for name, (column, value) in expected.items():
        assert c.sd[-1, column] ** 2 == pytest.approx(value, rel=1e-6), name
    if case == "white":
        powers = {
            n: float(m.sigma2) * dt * seconds ** (2 * n - 1) / (2 * n - 1) / scipy.special.factorial(n - 1) ** 2
            for m, n in zip(models, (2, 3), strict=True)
        }
        assert c.sd[-1, 2] ** 2 == pytest.approx(powers[2], rel=1e-6)
        assert c.sd[-1, 0] ** 2 == pytest.approx(powers[2] + g2 * powers[3], rel=1e-6)


@pytest.mark.slow
def test_a_few_runs_have_the_size_of_the_covariances(experiment, analysis):
    """16 runs: of all their fixes together the variance of innovations; epoch by epoch 800 are in tests/validation.

    A variance of 16 draws has a standard error of 35 %, of many fixes some 10 %.
    """
    inputs = nj.filter.draw_inputs(experiment, TRUTH, nj.filter.run_keys(jax.random.key(5), 0, 16))
    gains = nj.filter.gains_of(experiment, FILTERS["fewer"])
    runs = nj.filter.run_filter(experiment, FILTERS["fewer"], inputs, gains)
    position = np.sqrt(np.mean(np.sum(np.square(np.asarray(runs.judgement.error)[:, :3]), axis=1), axis=1))
    assert 0.5 < np.sqrt(np.mean(position**2) / np.mean(analysis["fewer"].rms("position") ** 2)) < 2


# -- derivatives and vectorisation ----------------------------------------------------------------------------------


def like_fewer(white, beta, bias=5e-5):
    """Of the structure of `FEWER`: one alone is no other program."""
    return nj.ImuErrors(gj.WN(white) + gj.GM(beta, 1e-5), gj.WN(3e-6), setups.RATE, gyro_bias_sd=bias)


@pytest.mark.slow
def test_many_filters_at_once_compile_once():
    """Each is what it is alone; other numbers need no other program."""

    @eqx.filter_jit
    def position(white, beta):
        count.append(1)
        found = jax.vmap(lambda *x: setups.covariances(TRUTH, like_fewer(*x)))(white, beta)
        return found.true.navigation[:, -1, 0, 0]

    count = []
    whites, betas = np.array([6e-5, 1e-4, 3e-4]), np.array([1e-2, 3e-2, 1e-3])
    alone = setups.covariances(TRUTH, like_fewer(whites[1], betas[1]))
    together = position(whites, betas)
    position(2 * whites, 2 * betas)
    assert count == [1]
    assert together[1] == pytest.approx(float(alone.true.navigation[-1, 0, 0]), rel=1e-9)


@pytest.mark.slow
def test_many_truths_and_filters_as_the_last_axis():
    """Stacked models, as jax.vmap builds them, are each what they are alone."""
    several = jnp.array([[6e-5, 1e-2, 1e-4], [1e-4, 3e-2, 2e-4], [3e-4, 1e-3, 1e-5]])
    stacked, one = jax.vmap(lambda x: like_fewer(*x))(several), setups.FEWER
    each = [like_fewer(*x) for x in np.asarray(several)]
    cases = {
        "truths": ((stacked, one), [(x, one) for x in each]),
        "filters": ((one, stacked), [(one, x) for x in each]),
        "both": ((stacked, stacked), [(x, x) for x in each]),
    }
    for case, (pair, pairs) in cases.items():
        found = jax.tree.map(np.asarray, setups.covariances(*pair))
        for i, (truth, believed) in enumerate(pairs):
            alone = setups.covariances(truth, believed)
            for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(alone), strict=True):
                np.testing.assert_allclose(a[i], b, rtol=1e-8, atol=1e-21, err_msg=case)

    with pytest.raises(ValueError, match="3 truths and 2 filters"):
        setups.covariances(stacked, jax.tree.map(lambda a: a[:2], stacked))


@pytest.mark.slow
def test_reverse_mode_through_several_filters():
    """Central differences of fourth order: 1e-5. By everything, and against forward mode, in tests/validation."""

    def sizes(x):
        filters = jax.vmap(lambda x: like_fewer(*jnp.exp(x)))(x)
        found = setups.covariances(setups.FEWER, filters).true.navigation[:, -1]
        return jnp.log(jnp.trace(found, axis1=1, axis2=2))

    start, h = np.log([[6e-5, 1e-2, 1e-4], [1e-4, 3e-2, 2e-4], [3e-4, 1e-3, 1e-5]]), 2e-3
    at = {k: np.stack([sizes(start + k * h * d) for d in np.eye(3)], axis=1) for k in (-2, -1, 1, 2)}
    differences = (8 * (at[1] - at[-1]) - at[2] + at[-2]) / (12 * h)
    found = jax.jit(jax.grad(lambda x: jnp.sum(sizes(x))))(start)
    np.testing.assert_allclose(found, differences, rtol=1e-5, atol=1e-8)


@pytest.mark.parametrize(("side", "negative"), [("truth", True), ("filter", True), ("filter", False)])
def test_a_negative_variance_is_seen(side, negative):
    """As an optimiser may try it, where nothing can be raised: in numbers that are put in past all checks."""

    def moved(errors):
        change = -1.0 if negative else 2.0
        return eqx.tree_at(lambda e: e.models[0].processes[1].variance, errors, replace_fn=lambda v: change * v)

    pair = (moved(TRUTH), setups.FEWER) if side == "truth" else (TRUTH, moved(setups.FEWER))
    assert bool(setups.covariances(*pair).valid.all()) is not negative


@pytest.mark.slow
def test_second_moments_are_linear_in_the_noise(experiment):
    """Four times the noise, four times the mean squares, with the gains of the same filter."""
    noise, bank, motion = noise_of(experiment, TRUTH), FILTERS["fewer"].bank(), setups.motion()
    compiled = eqx.filter_jit(covariances_along)
    once, twice = (compiled(experiment, motion, n, bank, START).true.navigation for n in (noise, _louder(noise)))
    np.testing.assert_allclose(twice, 4 * once, rtol=1e-9, atol=1e-18)


def _louder(noise):
    forms = tuple(
        f._replace(driving=4 * f.driving, initial=4 * f.initial, white=4 * f.white) for f in noise.aiding.forms
    )
    imu = noise.imu
    return eqx.tree_at(
        lambda n: (n.start, n.imu.driving, n.imu.initial, n.imu.white, n.aiding.forms),
        noise,
        (4 * noise.start, 4 * imu.driving, 4 * imu.initial, 4 * imu.white, forms),
    )


# -- the law of the NEES, results, errors ----------------------------------------------------------------------------


def test_distribution_of_weighted_squares():
    """Equal weights are chi-square to 1e-11; two exponentials have a closed form; others against 400,000 draws."""
    for k in (1, 2, 3, 6, 9):
        x = float(scipy.stats.chi2.ppf(0.95, k))
        for scale in (1e-3, 0.3, 1.0, 40.0):
            seen = weighted_chi2_cdf(np.full(k, scale), x)
            assert seen == pytest.approx(scipy.stats.chi2.cdf(x / scale, k), abs=1e-11)
    a, b, x = 2.0, 7.0, 11.0  # two degrees of freedom each: exponentials of means 2 a, 2 b
    exact = 1 - (a * np.exp(-x / (2 * a)) - b * np.exp(-x / (2 * b))) / (a - b)
    assert weighted_chi2_cdf(np.array([a, a, b, b]), x) == pytest.approx(exact, abs=1e-11)
    weights = np.array([30.0, 2.0, 0.5, 1e-3, 0.0])
    draws = np.random.default_rng(1).standard_normal((400_000, 5)) ** 2 @ weights
    for x in (0.5, 5.0, 50.0):
        p = weighted_chi2_cdf(weights, x)
        assert np.mean(draws <= x) == pytest.approx(p, abs=4.5 * np.sqrt(p * (1 - p) / 400_000))


@pytest.mark.slow
def test_progress_is_told_and_cancels():
    told = Told()
    nj.analyse(setups.SCENARIO, TRUTH, FILTERS, progress=told)
    told.assert_whole(len(FILTERS))
    with pytest.raises(LookupError, match="enough"):
        nj.analyse(setups.SCENARIO, TRUTH, FILTERS, progress=Told(1))


def test_results_say_what_they_are(analysis):
    text = repr(analysis)
    assert all(name in text for name in FILTERS)
    c = analysis["white"]
    assert "claimed rms" in repr(c)
    assert c.dof("sensors") == 0
    assert analysis["right"].dof("sensors") == 6
    np.testing.assert_allclose(analysis["right"].nees("navigation"), 9.0, rtol=1e-6)
    np.testing.assert_allclose(analysis["right"].coverage("pose", 0.9), 0.9, rtol=1e-6)
    np.testing.assert_allclose(analysis["right"].nis_ratio("barometer"), 1.0, rtol=1e-8)
    assert c.epoch() == 19
    assert list(analysis) == list(FILTERS)
    with pytest.raises(KeyError, match="No filter 'left'"):
        analysis["left"]
    with pytest.raises(ValueError, match="none of the groups"):
        c.nees("spin")


AT_REST = nj.Scenario(nj.motions.static(2.0, setups.RATE), every=10, output_interval=0.1)
"""From a start that is known."""


@pytest.mark.slow
def test_states_of_what_is_not_there_are_noted():
    white, walk = gj.WN(1e-4), gj.WN(1e-4) + gj.RW(1e-9)
    truth, believed = (
        nj.ImuErrors(accel, gj.WN(1e-6), setups.RATE)
        for accel in ([walk, white, white], [walk + gj.GM(0.1, 1e-5), walk, walk])
    )
    c = nj.analyse(AT_REST, truth, believed)["filter"]
    assert c.notes == (
        "The filter estimates errors of accel y, accel z, which truly are white or none.",
        "The filter has more states for accel x than the truth, which cannot excite all.",
    )


@pytest.mark.slow
def test_a_start_that_is_known_has_no_nees():
    c = nj.analyse(AT_REST, TRUTH)["filter"]
    # position is known exactly until noise has gone through twice
    assert np.isfinite(c.nees("velocity")).all()
    quiet = nj.ImuErrors(gj.WN(0.0), gj.WN(1e-6), setups.RATE)
    c = nj.analyse(AT_REST, quiet)["filter"]
    assert np.isnan(c.nees("velocity")).all()
    assert np.isnan(c.coverage("navigation")).all()


@pytest.mark.parametrize(
    ("truth", "filters", "message"),
    [
        (
            nj.ImuErrors("WN(sigma2=1e-4) + BI(B=1e-3)", "WN(sigma2=1e-6)", 100.0),
            None,
            "BI of accel x has no state-space",
        ),
        (TRUTH, {}, "at least one filter"),
        (nj.RecordedErrors(np.zeros((9, 3)), np.zeros((9, 3)), 100.0), {"a": TRUTH}, "truth is ImuErrors"),
        (TRUTH, nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-6)", 50.0), "belongs to 50 Hz"),
    ],
)
def test_bad_input(truth, filters, message):
    with pytest.raises(ValueError, match=message):
        inspect.unwrap(nj.analyse)(setups.SCENARIO, truth, filters)  # below the type checks of the test run
