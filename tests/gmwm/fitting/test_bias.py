"""A model as white noise and bias: each number against its definition, by sums over autocovariances."""

import jax
import numpy as np
import pytest
import scipy.linalg

import gmwm_jax as gj
from gmwm_jax.fitting import white_and_bias

RATE = 100.0
DEMO = (
    "WN(sigma2=0) + RW(gamma2=2.7878e-12) + GM(beta=2.0573, variance=5.119e-5) + GM(beta=9.0303e-4, variance=1.3274e-7)"
)
"""What the demonstration fits to a gyro: a Gauss-Markov process of half a sample has taken over the white noise."""


def integral_variance(autocovariance, n):
    """Of the sum of n samples over the rate, an angle or a velocity, by its definition."""
    h = np.arange(n)
    weights = np.where(h == 0, 1.0, 2.0) * (n - h)
    return float(np.sum(weights * autocovariance(h))) / RATE**2


def allan_variance(autocovariance, n):
    """Half the mean square of the difference of two neighbouring means of n samples, by its definition."""
    weights = np.concatenate([-np.ones(n), np.ones(n)]) / n
    products = np.convolve(weights, weights[::-1])[2 * n - 1 :]
    h = np.arange(2 * n)
    return float(np.sum(np.where(h == 0, 1.0, 2.0) * products * autocovariance(h))) / 2


def gm(beta, variance):
    return lambda h: variance * np.exp(-beta * np.abs(h))


def test_the_angle_random_walk_of_the_demonstration():
    short = white_and_bias(DEMO, RATE, "rad/s")
    assert short.white == ("GM_1",)
    assert short.table()["white", "N"].unit == "deg/sqrt(h)"
    assert short.table()["white", "N"].value == pytest.approx(2.797, abs=5e-4)
    # the standard deviation of an angle after an hour, by definition and in degrees, from the summed autocovariance
    summed = 5.119e-5 * (1 + 2 * np.sum(np.exp(-2.0573 * np.arange(1, 200)))) / RATE
    assert short.table()["white", "N"].value == pytest.approx(np.rad2deg(np.sqrt(summed * 3600)), rel=1e-9)


def test_white_noise_is_the_growth_of_the_integral():
    """N^2 t is the variance of an angle after many samples, but for a constant of the order of the correlation time."""
    model = "WN(sigma2=2e-5) + GM(beta=1.5, variance=5e-5) + GM(beta=3, variance=1e-5)"
    short = white_and_bias(model, RATE, "m/s^2")
    assert short.white == ("WN", "GM_1", "GM_2")
    assert short.bias == ()
    assert short.K == 0

    def autocovariance(h):
        return np.where(h == 0, 2e-5, 0.0) + gm(1.5, 5e-5)(h) + gm(3.0, 1e-5)(h)

    grown = integral_variance(autocovariance, 2000) - integral_variance(autocovariance, 1000)
    assert pytest.approx(np.sqrt(grown / (1000 / RATE)), rel=1e-9) == short.N


def test_a_step_decides_what_is_white():
    model = "WN(sigma2=1e-6) + GM(beta=0.2, variance=1e-6) + RW(gamma2=1e-12)"
    fast, slow = white_and_bias(model, RATE, "rad/s"), white_and_bias(model, RATE, "rad/s", step=0.05)
    assert (fast.white, fast.bias) == (("WN",), ("GM", "RW"))
    assert (slow.white, slow.bias) == (("WN", "GM"), ("RW",))
    assert np.sqrt(1e-6 / RATE) == pytest.approx(fast.N, rel=1e-12)
    assert np.sqrt((1e-6 + 1e-6 / np.tanh(0.1)) / RATE) == pytest.approx(slow.N, rel=1e-12)
    assert white_and_bias(model, RATE, "rad/s", step=0.01).N == fast.N
    with pytest.raises(ValueError, match=r"step=\.\.\. is 0.005 s, and the samples of the model are 0.01 s apart"):
        white_and_bias(model, RATE, "rad/s", step=0.005)


@pytest.mark.parametrize("interval", [None, 0.01, 5.0, 1000.0])
def test_a_random_walk_stands_for_itself(interval):
    short = white_and_bias("WN(sigma2=1e-6) + RW(gamma2=4e-12)", RATE, "rad/s", interval=interval)
    assert pytest.approx(np.sqrt(4e-12 * RATE), rel=1e-12) == short.K


def test_a_slow_gauss_markov_process_is_the_random_walk_of_its_drive():
    short = white_and_bias("WN(sigma2=1e-6) + GM(beta=1e-7, variance=1e-5)", RATE, "rad/s", interval=10.0)
    assert pytest.approx(np.sqrt(2 * 1e-7 * RATE * 1e-5), rel=1e-3) == short.K
    assert pytest.approx(np.sqrt(1e-5) * np.sqrt(2 * 1e-7 * RATE), rel=1e-3) == short.K


@pytest.mark.parametrize("n", [2, 16, 512])
def test_the_bias_has_the_allan_deviation_of_its_random_walk(n):
    """Of a process in between, by sums; and of a sampled random walk by the autocovariance of its Haar differences."""
    parts = gm(0.01, 3e-7), gm(2e-3, 5e-7)
    model = "WN(sigma2=1e-4) + GM(beta=0.01, variance=3e-7) + GM(beta=0.002, variance=5e-7)"
    short = white_and_bias(model, RATE, "rad/s", interval=n / RATE)
    assert short.interval == n / RATE
    bias = sum(allan_variance(part, n) for part in parts)
    # a difference of neighbouring means of a random walk: steps weighed by a triangle
    triangle = np.concatenate([np.arange(1, n + 1), np.arange(n - 1, 0, -1)]) / n
    walk = np.sum(triangle**2) / 2
    assert pytest.approx(np.sqrt(bias / walk * RATE), rel=1e-9) == short.K
    at = int(np.argmin(np.abs(short.times - n / RATE)))
    assert short.bias_deviation[at] == pytest.approx(np.sqrt(bias), rel=1e-9)


def test_the_interval_is_where_the_bias_comes_to_the_white_noise():
    short = white_and_bias("WN(sigma2=1e-4) + RW(gamma2=1e-10)", RATE, "rad/s")
    # N^2/T = K^2 T/3 at T = sqrt(3) N/K, and the next power of two samples is taken
    meeting = np.sqrt(3) * np.sqrt(1e-4 / RATE) / np.sqrt(1e-10 * RATE)
    assert short.interval == 2 ** np.ceil(np.log2(meeting * RATE)) / RATE
    assert "comes to" in short.chosen
    never = white_and_bias("WN(sigma2=1) + GM(beta=0.01, variance=1e-12)", RATE, "rad/s")
    assert never.interval == never.times[-1]
    always = white_and_bias("RW(gamma2=1e-10)", RATE, "rad/s")
    assert (always.N, always.white, always.interval) == (0.0, (), 0.01)
    assert "nothing is white" in str(always)
    late = white_and_bias("WN(sigma2=1e-12) + RW(gamma2=1e-10)", RATE, "rad/s", step=0.5)
    assert late.interval == 0.64


def test_a_filter_with_these_two_numbers_is_honest():
    """One that watches a bias for long and then goes on without: what its angle really does, over what it claims.

    Truth and filter by their covariances. K alone would leave the Gauss-Markov process out, and the sum of all driving
    noises would let it grow for ever.
    """
    f, sigma2, gamma2, beta, variance = 10.0, 6.6e-6, 2.8e-11, 9e-3, 1.3e-7
    model = f"WN(sigma2={sigma2}) + RW(gamma2={gamma2}) + GM(beta={beta}, variance={variance})"
    short = white_and_bias(model, f, "rad/s")
    assert short.interval == 25.6

    def real_over_claimed(K, seconds):
        q = K**2 / f
        P = (q + np.sqrt(q * q + 4 * q * sigma2)) / 2  # of the prediction, P = P - P^2/(P + sigma2) + q
        gain = P / (P + sigma2)
        claimed = np.diag([P * (1 - gain), 0.0])
        phi, drive = np.exp(-beta), variance * (1 - np.exp(-2 * beta))
        noise = np.diag([gamma2, drive, sigma2])
        # error of the estimated bias, and the process itself, of which the filter knows nothing
        step = np.array([[1 - gain, (1 - gain) * (1 - phi)], [0.0, phi]])
        enter = np.array([[gain - 1, gain - 1, gain], [0.0, 1.0, 0.0]])
        real = np.zeros((3, 3))
        real[:2, :2] = scipy.linalg.solve_discrete_lyapunov(step, enter @ noise @ enter.T)
        alone = np.array([[1.0, 1 - phi, 0.0], [0.0, phi, 0.0], [1 / f, (1 - phi) / f, 1.0]])
        driven = np.array([[-1.0, -1.0, 0.0], [0.0, 1.0, 0.0], [-1 / f, -1 / f, 1 / f]])
        walk, fed = np.array([[1.0, 0.0], [1 / f, 1.0]]), np.array([[1.0, 0.0], [1 / f, 1 / f]])
        for _ in range(round(seconds * f)):
            real = alone @ real @ alone.T + driven @ noise @ driven.T
            claimed = walk @ claimed @ walk.T + fed @ np.diag([q, sigma2]) @ fed.T
        return np.sqrt(real[2, 2] / claimed[1, 1])

    for seconds in (1.0, 10.0, 25.6):
        assert 0.8 < real_over_claimed(short.K, seconds) < 1.2
    assert real_over_claimed(short.K, 250.0) < 0.8
    assert real_over_claimed(np.sqrt(gamma2 * f), 25.6) > 1.5
    assert real_over_claimed(np.sqrt(gamma2 * f + 2 * beta * f * variance), 25.6) < 0.8


def test_the_bias_instability_is_the_lowest_allan_deviation():
    short = white_and_bias("WN(sigma2=1e-4) + BI(B=1e-4) + RW(gamma2=1e-12)", RATE, "rad/s")
    n = 2.0 ** np.arange(20)
    by_hand = 1e-4 / n + 2 * np.log(2) / np.pi * 1e-8 + 1e-12 * (2 * n * n + 1) / (6 * n)
    k = int(np.argmin(by_hand))
    assert pytest.approx(np.sqrt(by_hand[k]) / 0.66428, rel=1e-4) == short.B
    assert short.lowest == n[k] / RATE
    assert not short.upper_bound
    assert short.bias == ("BI", "RW")
    falling = white_and_bias("WN(sigma2=1e-4)", RATE, "rad/s")
    assert falling.upper_bound
    assert "an upper bound" in falling.table()["all", "B"].note


def test_every_process_is_white_bias_or_neither():
    model = (
        "QN(q2=1e-4) + DR(omega=1e-9) + SIN(beta=0.01, alpha2=1e-8) + FGN(H=0.9, sigma2=1e-8) + FLK(f0=0.01, B=1e-5)"
        " + MAT32(beta=0.01, variance=1e-8) + MAT52(beta=5, variance=1e-8) + ARMA(2,1)(phi1=0.5, phi2=0.2, theta1=0.4,"
        " sigma2=1e-8)"
    )
    short = white_and_bias(model, RATE, "rad/s", step=0.1)
    assert short.white == ("MAT52", "ARMA(2,1)")
    assert short.bias == ("DR", "SIN", "FGN", "FLK", "MAT32")
    assert short.without == ("QN",)
    assert "QN is in neither" in str(short)


def test_components_of_zero_are_in_no_list():
    short = white_and_bias(DEMO.replace("2.7878e-12", "0"), RATE, "rad/s")
    assert (short.white, short.bias, short.without) == (("GM_1",), ("GM_2",), ())


@pytest.mark.slow
def test_the_interval_of_the_sum_knows_how_its_parts_go_together():
    """Data divide white noise badly between WN and a GM of one sample, and know their sum. The delta method by hand."""
    truth = "WN(sigma2=1e-4) + GM(beta=1, variance=1e-4)"
    x = np.asarray(gj.simulate(truth, 2**14, key=jax.random.key(3)))
    wv = gj.wavelet_variance(gj.Recording(x[:, None], rate=RATE, channels=("gyro_x",), units=("rad/s",)))
    fit = gj.fit(wv, "WN + GM")
    assert not fit.at_boundary
    short = fit.white_and_bias(step=1.0)
    assert short.white == ("WN", "GM")

    def log_density(lines):
        sigma2, beta, variance = np.exp(lines)
        return np.log((sigma2 + variance / np.tanh(beta / 2)) / RATE) / 2

    at = np.log([float(v) for p in fit.model.processes for v in p.values])
    eye = 1e-5 * np.eye(3)
    gradient = np.array([(log_density(at + e) - log_density(at - e)) / 2e-5 for e in eye])
    assert short.error == pytest.approx(np.sqrt(gradient @ fit.covariance @ gradient), rel=1e-6)
    N = short.table(datasheet=False)["white", "N"]
    assert N.ci_high / N.value == pytest.approx(np.exp(1.959963985 * short.error), rel=1e-9)
    parts = fit.datasheet()
    spreads = [parts[key].ci_high / parts[key].value for key in (("WN", "N"), ("GM", "N_0"))]
    assert N.ci_high / N.value < min(spreads)


@pytest.mark.slow
def test_tables_of_fits_answer_it():
    x = np.asarray(gj.simulate("WN(sigma2=1e-4) + RW(gamma2=1e-9)", 4000, key=jax.random.key(1)))
    rec = gj.Recording(np.stack([x, x], 1), rate=RATE, channels=("gyro_x", "accel_x"), units=("rad/s", "m/s^2"))
    fits = gj.fit(rec, "WN + RW")
    assert "White noise and bias of a filter with a step of 0.01 s" in repr(fits["gyro_x"])
    text = repr(fits)
    assert "White noise and bias, at a step of one sample" in text
    assert "deg/sqrt(h)" in text
    assert "ug/sqrt(Hz)" in text
    gyro = fits["gyro_x"]
    white = gyro.to_dict()["white_and_bias"]["datasheet"][0]["value"]
    assert white == pytest.approx(gyro.datasheet()["WN", "N"].value, rel=1e-12)
    assert pytest.approx(np.sqrt(gyro.continuous()["RW", "q"].value), rel=1e-9) == gyro.white_and_bias().K
    with pytest.raises(ValueError, match="sampling rate is missing"):
        gj.fit(gj.wavelet_variance(x), "WN + RW").white_and_bias()


def test_errors_name_their_fault():
    with pytest.raises(ValueError, match="no value for sigma2"):
        white_and_bias("WN", RATE, "rad/s")
    with pytest.raises(ValueError, match="unit is one of rad/s"):
        white_and_bias("WN(sigma2=1)", RATE, "deg/s")
    with pytest.raises(ValueError, match=r"interval=\.\.\. must be a positive"):
        white_and_bias("WN(sigma2=1)", RATE, "rad/s", interval=-1.0)
