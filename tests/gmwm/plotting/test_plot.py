"""Figures: what is drawn is the data, with units on the axes, a legend and a band."""

import warnings

import numpy as np
import pytest
from drawn import assert_shows
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

import gmwm_jax
from gmwm_jax import plotting
from gmwm_jax.plotting import plot_allan_deviation, plot_fit, plot_fits, plot_recording, plot_wavelet_variance

pytestmark = pytest.mark.usefixtures("rendered_figures")

DATASHEET = gmwm_jax.from_datasheet({"N": "0.05 deg/s/sqrt(Hz)"}, 100.0)[0]


@pytest.fixture(scope="module")
def rec():
    return gmwm_jax.datasets.simulated("mti-g", 9001, channels=["gyro_x", "gyro_y", "accel_x"])


@pytest.fixture(scope="module")
def wv(rec):
    return gmwm_jax.wavelet_variance(rec, num_levels=10)


@pytest.fixture(scope="module")
def fits(wv):
    return gmwm_jax.fit(wv, "WN + GM + RW", throw=False)


def line(ax, label):
    """The one line of this label."""
    (found,) = [one for one in ax.lines if one.get_label() == label]
    return found


def assert_line(ax, label, x, y):
    np.testing.assert_allclose(line(ax, label).get_xdata(), x, rtol=1e-12)
    np.testing.assert_allclose(line(ax, label).get_ydata(), y, rtol=1e-12)


def assert_band(ax, x, low, high, position=0):
    band = [c for c in ax.collections if isinstance(c, PolyCollection)][position]
    corners = {tuple(v) for v in band.get_paths()[0].vertices}
    assert corners >= set(zip(x, low, strict=True)) | set(zip(x, high, strict=True))


def assert_log_log(ax):
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")


def legend(ax):
    return texts(ax.get_legend())


def below(figure):
    """The one legend of a figure, which covers none of its frames."""
    (shared,) = figure.legends
    assert all(ax.get_legend() is None for ax in figure.axes)
    return texts(shared)


def texts(legend):
    return [text.get_text() for text in legend.get_texts()]


def test_a_short_recording_is_drawn_sample_by_sample(rec):
    short = gmwm_jax.Recording.from_array(rec.data[:50], rate=20.0, units=rec.units, channels=rec.channels, name="a")
    figure = plot_recording(short)
    assert len(figure.axes) == 3
    for ax, (name, x), unit in zip(figure.axes, short.items(), ("rad/s", "rad/s", "m/s²"), strict=True):
        np.testing.assert_array_equal(ax.lines[0].get_xdata(), np.arange(50) / 20)
        np.testing.assert_array_equal(ax.lines[0].get_ydata(), x)
        assert ax.get_ylabel() == f"{name}\n[{unit}]"
    assert figure.axes[-1].get_xlabel() == "time [s]"
    assert figure.axes[0].get_title() == "a: 50 samples at 20 Hz"


def test_a_long_recording_is_drawn_as_ranges_that_leave_no_sample_out(rec):
    x = rec.data[:, 0].copy()
    x[-1], x[17] = 7.0, -5.0  # the last bin is not full
    spiked = gmwm_jax.Recording.from_array(x, rate=100.0, units="rad/s")
    figure = plot_recording(spiked)
    (ax,) = figure.axes
    size = 5  # of 9001 samples in at most 2000 bins
    bins = [x[i : i + size] for i in range(0, 9001, size)]
    t = [(i * size + (len(b) - 1) / 2) / 100 for i, b in enumerate(bins)]
    assert_line(ax, "mean of 5 samples", t, [b.mean() for b in bins])
    middle = [(i * size / 100 + (i * size + len(b) - 1) / 100) / 2 for i, b in enumerate(bins)]  # rounded as there
    assert_band(ax, middle, [b.min() for b in bins], [b.max() for b in bins])
    assert below(figure) == ["min .. max", "mean of 5 samples"]
    assert ax.get_ylim()[0] < -5
    assert ax.get_ylim()[1] > 7


def test_wavelet_variance_of_one_channel(wv):
    one = wv["gyro_x"]
    (ax,) = plot_wavelet_variance(one, datasheet=DATASHEET).axes
    assert_log_log(ax)
    assert_line(ax, "wavelet variance", one.times, one.variance)
    assert_line(ax, "datasheet", one.times, np.asarray(DATASHEET.wavelet_variance(one.scales)))
    assert_band(ax, one.times, one.bands().low, one.bands().high)
    assert ax.get_xlabel() == "scale τ [s]"
    assert ax.get_ylabel() == "wavelet variance [(rad/s)²]"
    assert ax.get_title() == "simulated mti-g, gyro_x"
    assert legend(ax) == ["wavelet variance", "datasheet"]
    assert ax.get_legend().get_title().get_text() == "band: 95 % interval, local power law"


def test_wavelet_variance_of_channels_in_a_frame_a_unit(wv):
    figure = plot_wavelet_variance(wv)
    gyro, accel = figure.axes
    assert legend(gyro) == ["gyro_x", "gyro_y"]
    assert_line(gyro, "gyro_x", wv.times, wv.variance[:, 0])
    assert_line(gyro, "gyro_y", wv.times, wv.variance[:, 1])
    assert_line(accel, "wavelet variance", wv.times, wv.variance[:, 2])
    assert_band(gyro, wv.times, wv.bands().low[:, 1], wv.bands().high[:, 1], position=1)
    assert accel.get_ylabel() == "wavelet variance [(m/s²)²]"
    assert accel.get_title() == "simulated mti-g, accel_x"
    assert line(gyro, "gyro_x").get_color() != line(gyro, "gyro_y").get_color()


def test_wavelet_variance_of_more_channels_than_colours():
    x = np.random.default_rng(8).normal(size=(64, 12))
    wv = gmwm_jax.wavelet_variance(x)
    (ax,) = plot_wavelet_variance(wv).axes
    assert legend(ax) == [f"channel_{i}" for i in range(12)]
    assert_line(ax, "channel_11", wv.scales, wv.variance[:, 11])
    assert ax.get_xlabel() == "scale τ [samples]"
    assert ax.get_ylabel() == "wavelet variance [1]"
    assert ax.get_title() == "12 channels"


def test_given_axes_are_used(wv):
    figure = Figure()
    ax = figure.subplots()
    assert plot_wavelet_variance(wv["gyro_x"], axes=ax) is figure
    assert plot_allan_deviation(gmwm_jax.allan_deviation(wv["gyro_y"]), axes=[ax]) is figure
    assert len(figure.axes) == 1
    with pytest.raises(ValueError, match="has 2 frames and draws into as many Axes; axes= has 1"):
        plot_wavelet_variance(wv, axes=ax)


@pytest.mark.slow
def test_a_datasheet_line_is_drawn_where_it_belongs(wv, fits):
    gyro, accel = plot_wavelet_variance(wv, datasheet={"rad/s": DATASHEET}).axes
    assert "datasheet" in legend(gyro)
    assert "datasheet" not in legend(accel)
    panels = plot_fits(fits, datasheet={"m/s^2": "WN(sigma2=1e-4)"}).axes[::2]
    assert ["datasheet" in ax.get_legend_handles_labels()[1] for ax in panels] == [False, False, True]
    for plot, data in ((plot_wavelet_variance, wv), (plot_fits, fits)):
        with pytest.raises(ValueError, match=r'units rad/s, m/s\^2, and a datasheet model belongs to one.*"rad/s"'):
            plot(data, datasheet=DATASHEET)
    with pytest.raises(ValueError, match=r"datasheet is about m/s\^2, and the data are in rad/s"):
        plot_fit(fits["gyro_x"], datasheet={"m/s^2": DATASHEET})


def test_allan_deviation(wv):
    adev = gmwm_jax.allan_deviation(wv)
    gyro, accel = plot_allan_deviation(adev).axes
    for ax in (gyro, accel):
        assert_log_log(ax)
        assert ax.get_xlabel() == "averaging time T [s]"
    assert (gyro.get_ylabel(), accel.get_ylabel()) == ("Allan deviation [rad/s]", "Allan deviation [m/s²]")
    marks = [f"{symbol} is read here" for symbol in "NBK"]
    assert [label for label in legend(gyro) if label not in marks] == ["gyro_x", "gyro_y"]
    read = gmwm_jax.fitting.read_off(adev["accel_x"], datasheet=True)
    known = [
        f"{e.symbol} {'≤' if 'upper' in e.note else '='} {e.value:.4g} {e.unit}" for e in read if e.value == e.value
    ]
    at = [f"{e.symbol} is read here" for e in read if e.value == e.value]
    assert legend(accel) == ["overlapping Allan deviation", *known, *at]
    assert_line(gyro, "gyro_y", adev.times, np.sqrt(2 * wv.variance[:, 1]))
    assert_line(accel, "overlapping Allan deviation", wv.scales / 200, np.sqrt(2 * wv.variance[:, 2]))
    one = adev["accel_x"]
    assert_band(accel, one.times, one.bands().low, one.bands().high)


def test_what_is_read_off_the_allan_deviation_is_drawn(wv):
    """Lines of slope -1/2 and 0 (and +1/2) through the points at which the coefficients are read."""
    adev = gmwm_jax.allan_deviation(wv["gyro_x"])
    table = gmwm_jax.fitting.read_off(adev)
    (ax,) = plot_allan_deviation(adev).axes
    lines = {label[0]: line(ax, label) for label in legend(ax)[1:] if "here" not in label}
    assert lines
    shapes = {"N": adev.times**-0.5, "B": 0.66428 * np.ones_like(adev.times), "K": np.sqrt(adev.times / 3)}
    for symbol, drawn in lines.items():
        np.testing.assert_allclose(drawn.get_ydata(), table["Allan", symbol].value * shapes[symbol], rtol=1e-4)
        touches = np.isclose(drawn.get_ydata(), adev.deviation, rtol=1e-9)
        assert touches.any()
        ((x, y),) = line(ax, f"{symbol} is read here").get_xydata()
        assert (x, y) in zip(adev.times[touches], drawn.get_ydata()[touches], strict=True)
    assert not ax.texts  # it would be over the curve
    (bare,) = plot_allan_deviation(adev, readings=False).axes
    assert legend(bare) == ["overlapping Allan deviation"]
    short = gmwm_jax.allan_deviation(gmwm_jax.wavelet_variance(np.random.default_rng(1).normal(size=10), rate=1.0))
    (ax,) = plot_allan_deviation(short).axes
    assert legend(ax) == ["overlapping Allan deviation"]


def test_allan_deviation_with_slopes(wv):
    adev = gmwm_jax.allan_deviation(wv["gyro_x"])
    regression = gmwm_jax.fitting.slope_regression(adev, {"WN": (0.1, 1.0), "RW": (2.0, 10.0)})
    (ax,) = plot_allan_deviation(adev, regression=regression).axes
    assert legend(ax) == ["overlapping Allan deviation", "WN", "RW", "sum"]
    N, K = (regression.table[kind, symbol].value for kind, symbol in (("WN", "N"), ("RW", "K")))
    np.testing.assert_allclose(line(ax, "WN").get_ydata(), N / np.sqrt(adev.times), rtol=1e-10)
    # of the random walk the samples are points, hence K sqrt(T/3) only where T is many samples
    np.testing.assert_allclose(line(ax, "RW").get_ydata()[-4:], (K * np.sqrt(adev.times / 3))[-4:], rtol=1e-3)
    assert_line(ax, "sum", adev.times, regression.implied_deviation)
    with pytest.raises(ValueError, match=r"one channel: choose it, as in adev\['gyro_x'\]"):
        plot_allan_deviation(gmwm_jax.allan_deviation(wv), regression=regression)


def test_fit(fits):
    fit = fits["gyro_x"]
    figure = plot_fit(fit, datasheet=DATASHEET)
    top, bottom = figure.axes
    assert_log_log(top)
    wv = fit.wv
    assert_line(top, "wavelet variance", wv.times, wv.variance)
    band = fit.wv.bands(fit.model)
    assert_band(top, wv.times, band.low, band.high)
    curve = line(top, "fit")
    at = np.searchsorted(curve.get_xdata(), wv.times * (1 - 1e-9))[[0, -1]]
    np.testing.assert_allclose(curve.get_xdata()[at], wv.times[[0, -1]], rtol=1e-12)
    np.testing.assert_allclose(curve.get_ydata()[at], fit.fitted[[0, -1]], rtol=1e-12)
    parts = [line(top, label).get_ydata() for label in fit.model.labels if label in below(figure)]
    np.testing.assert_allclose(np.sum(parts, axis=0), curve.get_ydata(), rtol=1e-10)
    np.testing.assert_allclose(
        line(top, "datasheet").get_ydata(), np.asarray(DATASHEET.wavelet_variance(wv.scales)), rtol=1e-12
    )
    labels = below(figure)
    assert labels[:2] == ["wavelet variance", "fit"]
    parts = [label.removesuffix(": zero") for label in labels[2:]]
    assert parts == ["WN", "GM", "RW", "datasheet", "95 % interval of one scale"]
    assert top.get_ylabel() == "wavelet variance [(rad/s)²]"
    assert top.get_title() == f"simulated mti-g, gyro_x: WN + GM + RW, objective {fit.objective:.5g}"
    assert bottom.get_xlabel() == "scale τ [s]"
    assert bottom.get_ylabel() == "residual\n[half CI]"
    # within +-1 exactly where the fitted curve runs inside the band
    inside = (band.low < fit.fitted) & (fit.fitted < band.high)
    np.testing.assert_array_equal(np.abs(bottom.lines[-1].get_ydata()) < 1, inside)
    np.testing.assert_array_equal(np.sign(bottom.lines[-1].get_ydata()), np.sign(wv.variance - fit.fitted))
    low, high = top.get_ylim()
    assert low < band.low.min()
    assert high > band.high.max()


def test_fit_says_which_components_are_zero():
    tau = 2.0 ** np.arange(1, 9)
    nu = tau**-1.1  # less than white noise at long scales: nothing is left for a drift
    fit = gmwm_jax.fit(gmwm_jax.variance.WaveletVariance.from_table(tau, nu, nu / 2, nu * 2), "WN + DR")
    assert fit.at_boundary == {"DR": "at boundary: zero"}
    assert "DR: zero" in below(plot_fit(fit))


def test_fits_have_a_panel_a_channel_and_one_legend(fits):
    figure = plot_fits(fits)
    assert len(figure.axes) == 6
    for fit, top, bottom in zip(fits.values(), figure.axes[::2], figure.axes[1::2], strict=True):
        assert_line(top, "wavelet variance", fit.wv.times, fit.wv.variance)
        assert top.get_title().startswith(f"{fit.wv.channels[0]}: objective {fit.objective:.4g}")
        assert ("zero" in top.get_title()) == (gmwm_jax.fitting.Outcome.ZERO in fit.at_boundary.values())
        assert top.get_legend() is None
        assert bottom.get_xlabel() == "scale τ [s]"
    (shared,) = figure.legends
    assert [t.get_text() for t in shared.get_texts()] == [
        "wavelet variance", "fit", "WN", "GM", "RW", "95 % interval of one scale",
    ]  # fmt: skip


def test_an_interval_that_starts_at_zero_has_no_place_on_a_logarithmic_axis():
    tau = 2.0 ** np.arange(1, 9)
    nu = 1 / tau
    wv = gmwm_jax.variance.WaveletVariance.from_table(tau, nu, np.where(tau < 100, nu / 2, 0), 2 * nu, rate=10.0)
    fit = gmwm_jax.fit(wv, "WN")
    for figure in (plot_wavelet_variance(wv), plot_fit(fit)):
        assert figure.axes[0].get_ylim()[0] > 0


@pytest.mark.slow
def test_what_is_drawn_is_what_the_data_say(rec, wv, fits):
    short = gmwm_jax.Recording.from_array(rec.data[:50], rate=20.0, units=rec.units, channels=rec.channels)
    one, adev = wv["gyro_x"], gmwm_jax.allan_deviation(wv)
    slopes = {"regression": gmwm_jax.fitting.slope_regression(adev["gyro_x"], {"WN": (0.1, 1.0), "RW": (2.0, 10.0)})}
    promise = {"datasheet": {"rad/s": DATASHEET}}
    for result, data, options in (
        (rec, plotting.recording_data, {}),
        (short, plotting.recording_data, {}),
        (wv, plotting.wavelet_variance_data, promise),
        (one, plotting.wavelet_variance_data, {}),
        (gmwm_jax.variance.compare_robust(rec["gyro_x"]), plotting.robust_comparison_data, {"cleaned": one}),
        (adev, plotting.allan_deviation_data, {}),
        (adev["gyro_x"], plotting.allan_deviation_data, slopes),
        (fits["gyro_x"], plotting.fit_data, promise),
    ):
        assert_shows(result.plot(**options), data(result, **options))


def test_data_of_a_fit_are_those_of_the_result(fits):
    fit = fits["accel_x"]
    above, below = plotting.fit_data(fit)
    assert (above.x, above.y.unit, below.y.unit) == (("scale τ", "s", "log", ()), "(m/s^2)^2", "half CI")
    band, data, model, *parts = above.items
    np.testing.assert_array_equal(band.high, fit.wv.bands(fit.model).high)
    np.testing.assert_array_equal(data.y, fit.wv.variance)
    np.testing.assert_allclose(sum(part.y for part in parts if len(part.y)), model.y, rtol=1e-10)
    panels = plotting.fits_data(fits)
    assert [f.title for f in panels[::2]] == [ax.get_title() for ax in plot_fits(fits).axes[::2]]
    for frame, own in zip(panels[4].items, above.items, strict=True):
        np.testing.assert_array_equal(frame[1:], own[1:])


def test_every_figure_draws_into_given_axes(rec, wv, fits):
    """As many as it has frames; they are not the figure's own, so that it gets no title and no legend of its own."""
    adev, robust = gmwm_jax.allan_deviation(wv), gmwm_jax.variance.compare_robust(rec["gyro_x"])
    for result, shape in ((rec, (3, 1)), (wv, (1, 2)), (adev, (1, 2)), (robust, (2, 1)), (fits, (2, 3))):
        axes = Figure().subplots(*shape)
        figure = result.plot(axes=axes)
        assert figure is axes.flat[0].get_figure()
        assert len(figure.axes) == axes.size
        assert not figure.legends
        with pytest.raises(ValueError, match=f"has {axes.size} frames and draws into as many Axes; axes= has 1"):
            result.plot(axes=axes.flat[0])


@pytest.mark.slow
def test_results_plot_themselves(rec, wv, fits):
    adev = gmwm_jax.allan_deviation(wv)
    with warnings.catch_warnings(action="error"):
        for result in (rec, wv, adev, fits, fits["accel_x"]):
            assert len(result.plot().axes) >= 1
