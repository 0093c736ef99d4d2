"""Figures of covariance analyses: what is drawn is the data, in the units on the axes, with legends and outages."""

from dataclasses import replace

import numpy as np
import pytest
from drawn import assert_shows
from matplotlib.figure import Figure
from nav.synthetic_analysis import (
    GROWTH,
    JUDGED,
    OUTAGE,
    TIME,
    make_analysis,
    make_budget,
    make_calibration,
    make_covariances,
    make_design,
    make_sensitivities,
    make_tuning,
)

from nav_jax import plotting
from nav_jax.plotting import plot_analysis, plot_budget, plot_calibration, plot_sensitivities

pytestmark = pytest.mark.usefixtures("rendered_figures")

DEGREES = 180 / np.pi


def texts(legend):
    return [text.get_text() for text in legend.get_texts()]


def labels(axes):
    return [ax.get_ylabel() for ax in axes]


def shaded(ax):
    return [patch.get_bbox().intervalx.tolist() for patch in ax.patches]


def lines(ax, style):
    """Lines over the epochs in a style."""
    return [one for one in ax.lines if one.get_linestyle() == style and len(one.get_xdata()) == len(TIME)]


def assert_line(one, y):
    np.testing.assert_array_equal(one.get_xdata(), TIME)
    np.testing.assert_allclose(one.get_ydata(), y, rtol=1e-9)


# filters


def test_true_and_claimed_errors_and_consistency():
    analysis = make_analysis()
    figure = analysis.plot()
    position, attitude, nees, coverage = figure.axes
    assert labels(figure.axes) == [
        "RMS position error [m]",
        "RMS orientation error [deg]",
        "expected NEES / dof [1]",
        "coverage of the 95 % region [1]",
    ]
    for ax, sd in ((position, 0.1), (attitude, 1e-3 * DEGREES)):
        root = np.sqrt(3) * sd * GROWTH
        for one, factor in zip(lines(ax, "-"), (1, 2), strict=True):
            assert_line(one, factor * root)
        for one in lines(ax, "--"):
            assert_line(one, root)
        assert ax.get_yscale() == "log"
    for one, value in zip(lines(nees, "-"), (1, 4), strict=True):
        assert_line(one, np.full(len(TIME), value))
    for one, c in zip(lines(coverage, "-"), analysis.values(), strict=True):
        assert_line(one, c.coverage("pose"))
    assert all(list(OUTAGE) in shaded(ax) for ax in figure.axes)
    (legend,) = figure.legends
    assert set(texts(legend)) == {"right", "optimist", "consistent", "outage", "true", "claimed"}
    colours = [[one.get_color() for one in lines(position, style)] for style in ("-", "--")]
    assert colours[0] == colours[1]
    assert len(set(colours[0])) == 2


def test_one_filter_of_another_group_and_level():
    c = make_covariances()
    nees, coverage = c.plot(group="velocity", level=0.5).axes[2:]
    assert nees.get_title() == "consistency of the velocity"
    np.testing.assert_allclose(lines(coverage, "-")[0].get_ydata(), 0.5, rtol=1e-6)


def test_a_start_that_is_known_exactly_is_left_out():
    c = make_covariances()
    P = c.claimed.copy()
    P[0] = 0.0
    position, _, nees, _ = plot_analysis({"exact": replace(c, true=P, claimed=P)}).axes
    assert np.isnan(lines(position, "-")[0].get_ydata()[0])
    assert np.isnan(lines(nees, "-")[0].get_ydata()[0])


# parameters and sources


def test_the_parameters_that_matter_most():
    s = make_sensitivities()
    figure = s.plot()
    assert labels(figure.axes) == ["d RMS / d log [m]", "d RMS / d log [deg]", "d RMS / d log [deg]"]
    for ax, q, factor in zip(figure.axes, ("position", "tilt", "heading"), (1, DEGREES, DEGREES), strict=True):
        assert ax.get_title() == q
        drawn = {one.get_label(): one for one in (*lines(ax, "-"), *lines(ax, "--"))}
        assert set(drawn) == {f"accel p{i} ({side})" for i in range(4) for side in ("truth", "filter")}
        assert_line(drawn["accel p1 (truth)"], factor * s.derivative[q][:, 1])
        assert_line(drawn["accel p1 (filter)"], factor * s.derivative[q][:, 7])
        assert drawn["accel p1 (truth)"].get_color() == drawn["accel p1 (filter)"].get_color()
        assert [one.get_linestyle() for one in drawn.values()] == ["-"] * 4 + ["--"] * 4
        assert list(OUTAGE) in shaded(ax)
    assert texts(figure.legends[0])[:2] == ["accel p0 (truth)", "accel p0 (filter)"]
    (only,) = plot_sensitivities(s, quantities=("vertical",), num=3).axes
    assert len(lines(only, "-")) + len(lines(only, "--")) == 3


def test_parameters_without_effect_are_not_drawn():
    s = make_sensitivities()
    nothing = {q: 0 * d for q, d in s.derivative.items()}
    for q in nothing:
        nothing[q][:, 2] = 1.0
    (ax,) = plot_sensitivities(replace(s, derivative=nothing), quantities=("position",)).axes
    assert [one.get_label() for one in lines(ax, "-")] == ["accel p2 (truth)"]


def test_shares_of_the_sources():
    b = make_budget()
    figure = b.plot()
    frames, twins = figure.axes[:4], figure.axes[4:]
    assert labels(frames) == ["share of the mean square [%]"] * 4
    assert labels(twins) == [f"RMS error [{unit}]" for unit in ("m", "m", "deg", "deg")]
    assert texts(figure.legends[0]) == [
        *(f"source {i}" for i in (9, 8, 7, 6, 5, 4, 3)), "others", "RMS error (right axis)", "ends of outages",
    ]  # fmt: skip
    for ax, twin, q in zip(frames, twins, ("horizontal", "vertical", "tilt", "heading"), strict=True):
        assert len(ax.collections) == 8
        top = ax.collections[-1].get_paths()[0].vertices[:, 1].max()
        assert top == pytest.approx(100.0)
        largest = ax.collections[0].get_paths()[0].vertices[:, 1].max()
        assert largest == pytest.approx(100 * b.share(q)[9, 1])
        rms = (DEGREES if "deg" in twin.get_ylabel() else 1) * np.sqrt(b.mean_square(q).sum(axis=0))
        (one,) = twin.lines
        np.testing.assert_allclose(one.get_ydata()[1:], rms[1:])
        assert np.isnan(one.get_ydata()[0])


def test_few_sources_and_frames():
    figure = plot_budget(make_budget(num=3), quantities=("position", "tilt", "heading"))
    assert len(figure.axes) == 6
    assert "others" not in texts(figure.legends[0])


# calibration, design, tuning


def test_what_a_calibration_leaves_open():
    c = make_calibration()
    figure = c.plot()
    axes = np.array(figure.axes).reshape(3, 2)
    assert labels(axes[:, 0]) == ["RMS error [m]", "loss [%]", "number of draws [1]"]
    assert axes[0, 1].get_ylabel() == "RMS error [deg]"
    over_time, loss, draws = axes[:, 0]
    assert_line(lines(over_time, "-")[0], 0.1 * GROWTH)
    band = over_time.collections[0].get_paths()[0].vertices
    low, high = c.interval("position")
    for edge in (low, high):
        assert np.abs(band[None, :, 1] - edge[:, None]).min(axis=1).max() < 1e-12
    assert_line(lines(loss, "--")[0], np.ones(len(TIME)))
    assert draws.get_xlabel() == f"RMS error at {JUDGED:g} s [m]"
    assert sum(patch.get_height() for patch in draws.patches) == 50
    assert texts(figure.legends[0]) == [
        "95 % of the draws", "estimate", "outage", "mean over the draws", "draws", "95 % interval",
    ]  # fmt: skip
    half = plot_calibration(c, quantities=("tilt",), level=0.5)
    assert len(half.axes) == 3
    assert texts(half.legends[0])[0] == "50 % of the draws"


def test_states_against_errors():
    d = make_design()
    figure = d.plot()
    position, nees, loss = figure.axes
    assert labels(figure.axes) == ["true RMS position error [m]", "expected NEES / 9 [1]", "loss: score [1]"]
    k = int(np.flatnonzero(JUDGED == TIME)[0])
    drawn = {one.get_label(): one for one in position.lines}
    expected = [c.covariances[0].rms("position")[k] for c in d.candidates]
    np.testing.assert_allclose(drawn["designed"].get_ydata(), expected)
    np.testing.assert_allclose(drawn["truncated: a part of the truth"].get_ydata(), 2 * np.array(expected))
    assert drawn["right: believes the truth"].get_xdata() == [3]
    # those with three states beside each other
    at = drawn["designed"].get_xdata()
    np.testing.assert_allclose(at[[0, 3]], [0, 6])
    assert at[1] < 3 < at[2]
    drawn = {one.get_label(): one for one in nees.lines}
    np.testing.assert_allclose(drawn["truncated: a part of the truth"].get_ydata(), 4)
    front = next(one for one in loss.lines if one.get_label() == "Pareto front")
    np.testing.assert_array_equal(front.get_ydata(), [3, 1, 0.5])
    assert [t.get_text() for t in loss.texts] == ["0+0", "1+0", "0+1", "1+1?"]
    assert "Pareto front" in texts(figure.legends[0])


def test_parameters_before_and_after_a_tuning():
    figure = make_tuning().plot()
    (ax,) = figure.axes
    assert ax.get_xlabel() == "factor on the start [1]"
    assert ax.get_xscale() == "log"
    assert [t.get_text() for t in ax.get_yticklabels()] == list(make_tuning().names)
    (bars,) = ax.containers
    np.testing.assert_allclose(bars.lines[0].get_xydata(), [[2, 0], [0.5, 2]])
    segments = bars.lines[2][0].get_segments()
    np.testing.assert_allclose([s[:, 0] for s in segments], [[1.6, 2.5], [0.3, 0.8]])
    marked = {one.get_label(): one.get_xydata().tolist() for one in ax.lines}
    assert (marked["not observable"], marked["held"]) == ([[1, 1]], [[1, 3]])
    assert set(texts(figure.legends[0])) == {"start", "tuned, 95 % interval", "not observable", "held"}
    assert ax.get_title() == "300 innovations: log likelihood +12"


def test_what_a_tuning_lost_is_at_the_edge():
    t = make_tuning()
    value = t.value * [1, 1e-9, 1, 1]
    (ax,) = replace(t, value=value, lost=np.array([False, True, False, False])).plot().axes
    marked = {one.get_label(): one.get_xydata() for one in ax.lines}
    assert "not observable" not in marked
    ((x, row),) = marked["lost in the search"]
    assert row == 1
    assert ax.get_xlim()[0] < x < 0.3


def test_a_tuning_with_a_prior_and_a_negative_partial_autocorrelation():
    """An interval through zero goes on to the edge of the logarithmic axis; what the prior knows is marked."""
    t, nan = make_tuning(), np.nan
    t = replace(
        t,
        names=("gyro AR(2) phi partial 1", *t.names[1:]),
        start=np.array([-0.2, *t.start[1:]]),
        value=np.array([-0.1, *t.value[1:]]),
        ci_low=np.array([-0.3, 0.5 * t.start[1], *t.ci_low[2:]]),
        ci_high=np.array([0.1, 2 * t.start[1], *t.ci_high[2:]]),
        se=np.array([0.1, 0.7, 0.2, nan]),
        sought=np.array([True, True, True, False]),
    )
    figure = t.plot()
    figure.canvas.draw()
    assert set(texts(figure.legends[0])) == {"start", "tuned, 95 % interval", "from the prior", "held"}
    shown, prior = figure.axes[0].containers
    first = shown.lines[2][0].get_segments()[0][:, 0]
    assert first[0] < figure.axes[0].get_xlim()[0]
    assert first[1] == pytest.approx(1.5)
    np.testing.assert_allclose(prior.lines[0].get_xydata(), [[1, 1]])
    assert "from the prior" in repr(t)


def test_a_tuning_that_did_not_converge_says_so():
    t = replace(make_tuning(), converged=False, sought=np.full(4, True), observable=np.full(4, True), held=())
    t = replace(t, ci_low=0.9 * t.value, ci_high=1.1 * t.value)
    figure = t.plot()
    assert figure.axes[0].get_title().endswith("NOT converged")
    assert "not observable" not in texts(figure.legends[0])


@pytest.mark.slow
def test_what_is_drawn_is_what_the_data_say():
    right = make_analysis()["right"]
    for result, data, options in (
        (make_analysis(), plotting.analysis_data, {"group": "navigation", "level": 0.9}),
        (make_sensitivities(), plotting.sensitivities_data, {"quantities": ("vertical", "heading"), "num": 3}),
        (make_budget(), plotting.budget_data, {"num": 4}),
        (make_budget(3), plotting.budget_data, {"quantities": ("tilt",)}),
        (make_calibration(), plotting.calibration_data, {"level": 0.5}),
        (make_design(), plotting.design_data, {}),
        (make_tuning(), plotting.tuning_data, {}),
    ):
        assert_shows(result.plot(**options), data(result, **options))
    assert_shows(right.plot(), plotting.analysis_data({"right": right}))


def test_the_shares_of_a_budget_add_up():
    b = make_budget()
    shares = plotting.budget_data(b)[0]
    bands = [item for item in shares.items if isinstance(item, plotting.Band)]
    assert [band.label for band in bands][-2:] == ["source 3", "others"]
    np.testing.assert_array_equal(bands[0].low, 0.0)
    np.testing.assert_allclose(bands[-1].high[1:], 100.0)
    np.testing.assert_allclose((bands[0].high - bands[0].low)[1:], 100 * b.share("horizontal")[-1, 1:])


def test_given_axes_are_used():
    for result, shape in (
        (make_analysis(), (2, 2)),
        (make_sensitivities(), (3, 1)),
        (make_budget(), (2, 2)),
        (make_calibration(), (3, 2)),
        (make_design(), (1, 3)),
        (make_tuning(), (1, 1)),
    ):
        axes = Figure().subplots(*shape, squeeze=False)
        figure = result.plot(axes=axes)
        assert figure is axes[0, 0].get_figure()
        assert all(ax.has_data() for ax in axes.flat)
        assert not figure.legends
        with pytest.raises(ValueError, match=f"has {axes.size} frames and draws into as many Axes; axes= has 7"):
            result.plot(axes=Figure().subplots(1, 7))
