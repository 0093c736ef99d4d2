"""Classic against robust: scales that differ, samples that stand out, and what is printed and drawn."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import gmwm_jax as gj
from gmwm_jax.variance.robust import biweight

pytestmark = pytest.mark.usefixtures("rendered_figures")


def white(num, seed=0):
    return np.random.default_rng(seed).standard_normal(num)


@pytest.fixture(scope="module")
def spiked():
    """Spikes at 500 and 3000, a block of three samples at 7000, one at either end; every 97th sample of a burst."""
    x = white(10_000)
    x[500] += 30
    x[3000] -= 20
    x[7000:7003] += 40
    x[0] += 50
    return gj.Recording.from_array(x, rate=10.0, units="rad/s", channels="gyro_x", name="bench")


def test_the_samples_are_found(spiked):
    seen = gj.variance.compare_robust(spiked)
    runs = {(run.first, run.last) for run in seen.runs}
    # a block keeps a step on either side only: its inner samples look alike
    assert {(500, 500), (3000, 3000)} <= runs
    assert {run[0] for run in runs} >= {1, 7000}
    sizes = [run.size for run in seen.runs]
    assert sizes == sorted(sizes, reverse=True)
    x, nu = spiked.data[:, 0], seen.robust.variance[0]
    assert sizes[0] == pytest.approx(np.max(np.abs(np.diff(x))) / 2 / np.sqrt(nu))


def test_neighbouring_outliers_are_one_run():
    x = white(1000)
    x[400:404] = [50, -60, 70, -80]
    (run,) = gj.variance.compare_robust(x).runs
    assert (run.first, run.last) == (400, 403)
    assert gj.variance.compare_robust(x).num_outliers == 4


def test_the_numbers(spiked):
    seen = gj.variance.compare_robust(spiked, efficiency=0.9, num_levels=6, level=0.9)
    np.testing.assert_array_equal(seen.classic.variance, gj.wavelet_variance(spiked, num_levels=6).variance)
    expected = gj.wavelet_variance(spiked, num_levels=6, efficiency=0.9, level=0.9)
    np.testing.assert_array_equal(seen.robust.ci_high, expected.ci_high)
    x = spiked.data[:, 0]
    for j in range(6):
        n = 2**j
        S = np.convolve(x, np.ones(n), "valid")
        W = (S[n:] - S[:-n]) / (2 * n)
        c = biweight(0.9).c
        assert seen.weightless[j] == pytest.approx(np.mean(np.abs(W) > c * np.sqrt(expected.variance[j])))
    assert np.all(seen.significant == (np.abs(seen.z) > 2.638))  # 5 % over six scales and two sides


def test_it_prints_itself(spiked):
    text = repr(gj.variance.compare_robust(spiked))
    assert text.startswith("Classic against robust (efficiency 0.6) wavelet variance of bench\ntau [s]")
    assert text.splitlines()[3].endswith("differs")
    assert "outlying samples (" in text
    assert "300.00" in text  # seconds of sample 3000
    clean = repr(gj.variance.compare_robust(white(4096)))
    assert clean.endswith("0 outlying samples (0 %) in 0 runs")
    many = white(10_000)
    many[::500] += 20
    assert "in 20 runs, the 10 largest:" in repr(gj.variance.compare_robust(many))


def test_one_channel_only():
    with pytest.raises(ValueError, match="one channel"):
        gj.variance.compare_robust(np.column_stack([white(100), white(100)]))


def test_the_figure(spiked):
    comparison = gj.variance.compare_robust(spiked)
    figure = comparison.plot()
    top, bottom = figure.axes
    for label, wv in (("classic", comparison.classic), ("robust, efficiency 0.6", comparison.robust)):
        (line,) = [one for one in top.lines if one.get_label() == label]
        np.testing.assert_array_equal(line.get_xdata(), wv.times)
        np.testing.assert_array_equal(line.get_ydata(), wv.variance)
    drawn = np.concatenate([line.get_ydata() for line in bottom.lines[1:]])
    assert sorted(drawn) == sorted(comparison.z)
    assert "outlying samples" in top.get_title()
    assert bottom.get_xlabel() == "scale τ [s]"
    axes = Figure().subplots(2, 1)
    assert gj.plotting.plot_robust_comparison(comparison, axes=list(axes)) is axes[0].figure


def test_the_contaminated_record(shared):
    """Isolated outliers in real data: the fine scales differ, those beyond 5 s do not."""
    rec = gj.read_recording(shared / "data" / "cont.imu1.rda")
    seen = gj.variance.compare_robust(rec)
    np.testing.assert_array_equal(seen.significant, seen.classic.times < 3)
    assert 800 < seen.num_outliers < 1000
    assert seen.classic.variance[0] > 2 * seen.robust.variance[0]
