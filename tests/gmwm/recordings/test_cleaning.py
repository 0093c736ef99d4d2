"""Outlying samples: which are masked in which noise, what is reported, and what the estimates gain."""

import jax
import numpy as np
import pytest
from programs import WANDERING, masked, recording, white, with_bursts

import gmwm_jax as gj

NOISES = {
    "white": (lambda: white(50_000), 10.0),
    "walk": (lambda: np.cumsum(white(50_000)), 10.0),
    "slow": (lambda: np.asarray(gj.simulate("GM(beta=0.01, variance=50.0)", 50_000, key=jax.random.key(0))), 10.0),
    "quantised": (lambda: np.round(0.3 * white(50_000)), 5.0),  # 90 % zero, the others one step
    "quantised as finely as it is noisy": (lambda: np.round(white(50_000)), 10.0),
    "of small unit": (lambda: 1e-9 * np.round(0.4 * white(50_000)), 5e-9),
}


@pytest.mark.parametrize("name", NOISES)
def test_single_outliers_are_found_in_any_noise(name):
    """999 of 1000; of the others next to none, and those beside two outliers."""
    draw, size = NOISES[name]
    x = draw()
    assert np.sum(masked(x)) <= 3
    y, outlying = with_bursts(x, 1, size=size)
    seen = masked(y)
    assert np.mean(seen[outlying]) > 0.995
    assert np.sum(seen[~outlying]) < 20


@pytest.mark.parametrize("length", [2, 5, 10])
def test_bursts_are_found_as_a_whole(length):
    x = np.asarray(gj.simulate(WANDERING, 50_000, key=jax.random.key(length)))
    y, outlying = with_bursts(x, length)
    seen = masked(y)
    assert np.mean(seen[outlying]) > 0.995
    assert np.mean(seen[~outlying]) < 1e-4
    runs = gj.recordings.mask_outliers(recording(y)).runs["channel_0"]
    assert np.median([run.last - run.first + 1 for run in runs]) == length


def test_channels_are_judged_alone_and_gaps_stay():
    x = np.column_stack([white(3000), white(3000, 1), white(3000, 2)])
    x[500, 1] += 30
    x[1000:1003, 1] -= 20
    x[2000, 2] = np.nan
    before = x.copy()
    seen = gj.recordings.mask_outliers(recording(x, channels=["a", "b", "c"], gaps=True, name="bench"))
    assert seen.counts == {"a": 0, "b": 4, "c": 0}
    assert seen.shares["b"] == 4 / 3000
    assert [(run.first, run.last) for run in seen.runs["b"]] == [(500, 500), (1000, 1002)]
    assert 25 < seen.runs["b"][0].size < 40
    assert seen.recording.num_missing == {"a": 0, "b": 4, "c": 1}
    np.testing.assert_array_equal(x, before)
    np.testing.assert_array_equal(seen.recording.data[:, 0], x[:, 0])
    assert not seen.recording.data.flags.writeable
    assert 4.5 < seen.thresholds["a"] < 6.5
    lines = repr(seen).splitlines()
    assert lines[0].startswith("Outliers masked in bench: 3000 samples")
    assert lines[4].split()[:6] == ["b", "1", "4", "0.13", "%", "2"]
    assert any(line.split()[:4] == ["b", "1000", "1002", "100.00"] for line in lines)


def test_ends_and_short_records():
    x = white(3000)
    x[0] += 30
    x[-1] -= 30
    np.testing.assert_array_equal(np.flatnonzero(masked(x)), [0, 2999])
    y = white(12)
    y[5] = 40
    np.testing.assert_array_equal(np.flatnonzero(masked(y, max_share=0.2)), [5])


def test_bad_input():
    with pytest.raises(TypeError, match=r"takes a Recording, not ndarray: Recording\.from_array makes one"):
        gj.recordings.mask_outliers(white(100))
    with pytest.raises(ValueError, match=r"chance lies between 0 and 1, and is 1.5"):
        gj.recordings.mask_outliers(recording(white(100)), chance=1.5)
    with pytest.raises(ValueError, match=r"max_share lies between 0 and 1/4, and is 0.6"):
        gj.recordings.mask_outliers(recording(white(100)), max_share=0.6)
    loud = white(10_000)
    loud[:2000] *= 100
    with pytest.raises(ValueError, match=r"% of the samples of 'channel_0' stand out, and max_share allows 10 %"):
        gj.recordings.mask_outliers(recording(loud))


# -- the purpose -----------------------------------------------------------------------------------------------------


def test_the_figure_with_a_third_curve():
    y, _ = with_bursts(white(5000), 1)
    cleaned = gj.wavelet_variance(gj.recordings.mask_outliers(recording(y)).recording)
    figure = gj.variance.compare_robust(recording(y)).plot(cleaned=cleaned)
    (line,) = [one for one in figure.axes[0].lines if one.get_label() == f"cleaned: {cleaned.missing}"]
    np.testing.assert_array_equal(line.get_ydata(), cleaned.variance)
    figure.canvas.draw()


@pytest.mark.parametrize("length", [1, 5])
def test_a_cleaned_record_has_the_clean_white_noise(length):
    """1 % of the samples 10 sigma off, one by one or in bursts; fits of whole models are in tests/validation."""
    x = white(20_000)
    y, _ = with_bursts(x, length, 0)
    clean = gj.wavelet_variance(x)
    cleaned = gj.wavelet_variance(gj.recordings.mask_outliers(recording(y)).recording)
    assert clean.ci_low[0] < np.ravel(cleaned.variance)[0] < clean.ci_high[0]
    assert gj.wavelet_variance(y).variance[0] > clean.ci_high[0]
