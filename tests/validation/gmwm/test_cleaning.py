"""What cleaning does to fits, on simulated and on real records."""

import jax
import numpy as np
import pytest
from helpers import SIGMAS
from programs import WANDERING, masked, recording, white, with_bursts

import gmwm_jax as gj

WALK = "WN(sigma2=1.0) + RW(gamma2=1e-4)"


def test_a_clean_record_is_seldom_touched():
    """At a chance of 20 %, of 300 records of white noise at most that many, and 4.5 standard errors of 2.3 %."""
    seen = np.mean([np.any(masked(white(2000, seed), chance=0.2)) for seed in range(300)])
    assert 0.02 < seen < 0.2 + SIGMAS * np.sqrt(0.2 * 0.8 / 300)
    walks = np.mean([np.mean(masked(np.cumsum(white(5000, seed)))) for seed in range(100)])
    assert walks < 2e-4
    for noise in (0.15, 0.3, 0.5, 1.0):  # in steps of quantisation
        assert not any(np.any(masked(np.round(noise * white(5000, seed) + 0.3))) for seed in range(20))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("text", [WALK, WANDERING])
def test_parameters_of_a_cleaned_record_lie_within_the_clean_intervals(text, seed):
    """200,000 samples, 1 % of them 10 sigma off, one by one and in bursts of five: the classic ones leave them."""
    model = " + ".join(p.kind for p in gj.parse_model(text).processes)
    x = np.asarray(gj.simulate(text, 200_000, key=jax.random.key(seed)))
    clean = gj.fit(gj.wavelet_variance(x), model).parameters()
    for length in (1, 5):
        y, _ = with_bursts(x, length, seed)
        cleaned = gj.fit(gj.recordings.mask_outliers(recording(y)).recording, model).model
        classic = gj.fit(gj.wavelet_variance(y), model).model
        values = [[float(v) for p in m.processes for v in p.values] for m in (cleaned, classic)]
        inside, outside = ([e.ci_low < v < e.ci_high for e, v in zip(clean, vs, strict=True)] for vs in values)
        assert all(inside)
        assert not outside[0]  # the white noise doubles where outliers come one by one
        assert length == 1 or not any(outside)


def test_the_contaminated_record(shared):
    """456 samples stand out and hold an eighth of the variance of the white noise; what is left is not Gaussian.

    The robust variance is half at the finest scale and the whole beyond 3 s, since a sum of many samples is Gaussian:
    that is no spectrum of a sum of processes, so that no model fits it. The cleaned one is fitted as well as the
    classic one, with the same Gauss-Markov process.
    """
    rec = gj.read_recording(shared / "data" / "cont.imu1.rda")
    seen = gj.recordings.mask_outliers(rec)
    assert 400 < seen.counts["gyro_x"] < 500
    assert np.median([run.last - run.first for run in seen.runs["gyro_x"]]) == 0
    fits = {
        "classic": gj.fit(rec, "WN + GM"),
        "robust": gj.fit(gj.wavelet_variance(rec, efficiency=0.6), "WN + GM"),
        "cleaned": gj.fit(seen.recording, "WN + GM"),
    }
    assert fits["robust"].objective > 50 > 1 > fits["cleaned"].objective
    classic, cleaned = (fits[name].parameters() for name in ("classic", "cleaned"))
    assert cleaned["WN", "sigma2"].ci_high < 0.89 * classic["WN", "sigma2"].ci_low
    for symbol in ("beta", "variance"):
        assert classic["GM", symbol].ci_low < cleaned["GM", symbol].value < classic["GM", symbol].ci_high
