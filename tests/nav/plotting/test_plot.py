"""Figures: what is drawn is the data, in the units on the axes, with bands, legends and shaded outages."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from drawn import assert_shows
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from nav.simulation.test_comparison import make_reference
from nav.synthetic import OUTAGE, make_runs, with_failures

from nav_jax import plotting
from nav_jax.plotting import (
    plot_comparison,
    plot_consistency,
    plot_errors,
    plot_mean_errors,
    plot_nis,
    plot_realisations,
    plot_sensor_states,
    plot_trajectory,
)
from nav_jax.plotting._style import logarithmic
from nav_jax.simulation.comparison import Comparison
from nav_jax.statistics.energy import energy_score

pytestmark = pytest.mark.usefixtures("rendered_figures")

N = 30
DEGREES = 180 / np.pi


@pytest.fixture(scope="module")
def reference():
    return make_reference()


@pytest.fixture(scope="module")
def comparison(reference):
    models = {
        "right": make_runs("right", N),
        "near": make_runs("near", N, scale=1.02, noise=6),
        "poor": with_failures("poor", [3], num_runs=N, scale=1.5, inflation=3.0, axes=(), noise=7),
    }
    return Comparison(reference, models, "MTi-G")


def good(r):
    return [i for i in range(N) if i != 3]


def line(ax, label):
    """The one line whose label starts so."""
    (found,) = [one for one in ax.lines if str(one.get_label()).startswith(label)]
    return found


def assert_line(ax, label, x, y):
    np.testing.assert_allclose(line(ax, label).get_xdata(), x, rtol=1e-12)
    np.testing.assert_allclose(line(ax, label).get_ydata(), y, rtol=1e-12)


def below(figure):
    """Texts and title of the one legend of a figure, which covers none of its frames."""
    (shared,) = figure.legends
    assert all(ax.get_legend() is None for ax in figure.axes)
    return [text.get_text() for text in shared.get_texts()], shared.get_title().get_text()


def spans(ax):
    """Left end, lower end, width and height of each shaded rectangle, in its own mixed coordinates."""
    return [patch.get_bbox().bounds for patch in ax.patches]


def assert_outage_is_shaded(ax):
    assert any((x, x + width) == OUTAGE for x, _, width, _ in spans(ax))


def test_a_trajectory(reference):
    figure = plot_trajectory(reference)
    plan, height, attitude = figure.axes
    np.testing.assert_array_equal(plan.lines[0].get_xydata(), reference.position[:, [1, 0]])
    np.testing.assert_array_equal(height.lines[0].get_ydata(), -reference.position[:, 2])
    assert_line(attitude, "yaw", reference.time, DEGREES * reference.euler[:, 2])
    assert [ax.get_ylabel() for ax in figure.axes] == ["north [m]", "height [m]", "angle [deg]"]
    assert plan.get_aspect() == 1.0
    assert len(plot_trajectory(reference, attitude=False).axes) == 2


@pytest.mark.parametrize("with_tracks", [True, False])
def test_realisations_over_the_truth(reference, with_tracks):
    r = make_runs(num_runs=6)
    if not with_tracks:
        r = replace(r, tracks={})
    plan, height = plot_realisations(r, reference, max_runs=4).axes
    assert_line(plan, "truth", reference.position[:, 1], reference.position[:, 0])
    assert_line(height, "truth", reference.time, -reference.position[:, 2])
    shown = 2 if with_tracks else 4
    first = height.lines[0]
    assert first.get_label() == f"{shown} runs of right"
    at_epochs = np.interp(r.time, first.get_xdata(), first.get_ydata())
    truth = np.interp(r.time, reference.time, -reference.position[:, 2])
    np.testing.assert_allclose(at_epochs, truth - r.error[0, :, 2], atol=1e-9)
    assert_outage_is_shaded(height)
    in_outage = line(plan, "in an outage")
    epochs = (first.get_xdata() >= OUTAGE[0]) & (first.get_xdata() <= OUTAGE[1])
    assert len(in_outage.get_xdata()) == np.count_nonzero(epochs)


def test_failed_runs_are_not_drawn(reference):
    r = with_failures("some", [0, 2], num_runs=5)
    assert plot_realisations(r, reference).axes[1].lines[0].get_label() == "1 run of some"
    axes = plot_errors(r).axes
    assert sum(str(one.get_label()).startswith("_") or one.get_label() == "runs" for one in axes[0].lines) == 3 + 2


def test_errors_with_bounds():
    r = make_runs(num_runs=12)
    figure = plot_errors(r, blocks=("position", "velocity", "attitude"), max_runs=5)
    axes = np.array(figure.axes).reshape(3, 3)
    labels = [[ax.get_ylabel() for ax in row] for row in axes]
    assert labels == [
        ["east [m]", "east [m/s]", "about north [deg]"],
        ["north [m]", "north [m/s]", "about east [deg]"],
        ["up [m]", "up [m/s]", "about down [deg]"],
    ]
    shown = {(0, 0): (1, 1.0), (1, 0): (0, 1.0), (2, 0): (2, -1.0), (2, 1): (5, -1.0), (1, 2): (7, DEGREES)}
    for (row, column), (component, factor) in shown.items():
        ax = axes[row, column]
        assert_line(ax, "5 runs", r.time, factor * r.error[0, :, component])
        bound = 3 * abs(factor) * np.sqrt(np.mean(r.sd[..., component] ** 2, axis=0))
        assert_line(ax, "±3 sd", r.time, bound)
        assert_outage_is_shaded(ax)
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["outage", "5 runs", "±3 sd of the filter"]


def test_a_run_plots_itself():
    assert len(make_runs(num_runs=3).plot(blocks=("velocity",)).axes) == 3


def test_unknown_blocks_are_named():
    with pytest.raises(ValueError, match="'height' is none of the blocks"):
        plot_errors(make_runs(num_runs=3), blocks=("height",))


def test_sensor_states_say_where_there_is_none():
    r = make_runs(num_runs=12, axes=(0, 1, 2, 5))
    axes = np.array(plot_sensor_states(r).axes).reshape(3, 2)
    silent = [[ax.get_title(loc="right") == "no state" for ax in row] for row in axes]
    assert silent == [[False, True], [False, True], [False, False]]
    assert_line(axes[2, 1], "±3 sd", r.time, 3 * DEGREES * 3600 * r.sd[0, :, 14])
    (raw,) = (ax for ax in plot_sensor_states(r, average=0).axes if ax.get_ylabel() == "y [mm/s²]")
    assert_line(raw, "runs", r.time, 1e3 * r.error[0, :, 10])
    assert (axes[0, 0].get_ylabel(), axes[0, 1].get_ylabel()) == ("x [mm/s²]", "x [deg/h]")


def test_a_slow_bias_is_seen_through_white_noise():
    """Running means and their quantiles are those of the bias; without them noise hides it."""
    r = make_runs(num_runs=40)
    rng = np.random.default_rng(3)
    bias = np.linspace(-1.0, 1.0, 40)[:, None] * np.ones(101)
    error = r.error.copy()
    error[:, :, 12] = (bias + 20 * rng.standard_normal((40, 101))) / (DEGREES * 3600)  # gyroscope x
    r = replace(r, error=error, sd=np.where(np.arange(15) == 12, 20 / (DEGREES * 3600), r.sd))
    shown = plotting.sensor_states_data(r, average=25.0, share=0.5)[1]
    band = next(item for item in shown.items if isinstance(item, plotting.Band))
    raw = next(i for i in plotting.sensor_states_data(r, average=0, share=0.5)[1].items if isinstance(i, plotting.Band))
    assert band.label == "50 % of the runs"
    assert np.mean(band.high - band.low) < 0.35 * np.mean(raw.high - raw.low)
    one = next(item for item in shown.items if item.label == "30 runs")
    x = DEGREES * 3600 * error[0, :, 12]
    np.testing.assert_allclose(one.y[50], x[38:63].mean())  # 12 epochs to each side
    np.testing.assert_allclose(one.y[0], x[:13].mean())
    # bounds of what is fast would press it flat: they are said instead
    r = replace(r, sd=np.where(np.arange(15) == 12, 9000 / (DEGREES * 3600), r.sd))
    ax = plot_sensor_states(r, average=25.0).axes[1]
    assert ax.get_ylim()[1] < 100
    assert ax.get_title(loc="right") == "±3 sd is ±2.7e+04 deg/h, beyond the frame"
    with pytest.raises(ValueError, match="share is 1"):
        plot_sensor_states(r, share=1.0)
    with pytest.raises(ValueError, match="average is -1"):
        plot_sensor_states(r, average=-1.0)


def test_errors_before_an_outage_are_not_pressed_flat():
    r = make_runs(num_runs=12)
    away = 1 + 99.0 * ((r.time > OUTAGE[0]) & (r.time <= OUTAGE[1]))
    r = replace(r, sd=r.sd * away[:, None], error=r.error * away[:, None])
    figure = plot_errors(r)
    assert_shows(figure, plotting.errors_data(r))
    for ax, column in zip(figure.axes, (1, 0, 2), strict=True):
        assert ax.get_yscale() == "symlog"
        bound = 3 * r.sd[0, 0, column]
        height = np.ptp(ax.transData.transform([(0, -bound), (0, bound)])[:, 1])
        assert height > 0.2 * ax.get_window_extent().height  # linear it would be a hundredth


def test_no_curve_hides_another(reference):
    """Of models that are the same to the last digit, each is seen in its colour along its part of the way."""
    models = {name: make_runs(name, 6) for name in ("a", "b", "c", "d")}
    for figure in (plot_mean_errors(models), plot_consistency(models, groups=("pose",))):
        figure.canvas.draw()
        pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)
        for ax in figure.axes:
            colours = {line(ax, name).get_color() for name in models}
            assert len(colours) == 4
            box = ax.get_window_extent()
            inside = pixels[::-1][round(box.y0) : round(box.y1), round(box.x0) : round(box.x1)]
            for colour in colours:
                rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
                assert np.count_nonzero(np.abs(inside - rgb).max(axis=-1) < 12) > 50, (ax.get_title(), colour)


@pytest.mark.parametrize("log", [False, True])
def test_mean_errors_with_bands(comparison, log):
    figure = plot_mean_errors(comparison, log=log)
    left, right = figure.axes
    assert below(figure) == (["right", "near", "poor", "outage"], f"{N - 1} runs; 95 % interval of the mean")
    for ax, columns, factor in ((left, slice(0, 3), 1.0), (right, slice(6, 9), DEGREES)):
        for position, (name, r) in enumerate(comparison.runs.items()):
            length = factor * np.linalg.norm(r.error[good(r), :, columns], axis=-1)
            assert_line(ax, name, r.time, length.mean(axis=0))
            low, high = scipy.stats.t.interval(0.95, N - 2, length.mean(axis=0), scipy.stats.sem(length))
            band = [c for c in ax.collections if isinstance(c, PolyCollection)][position]
            corners = band.get_paths()[0].vertices
            for edge in (low, high):
                distances = np.abs(corners[None, :, :] - np.stack([r.time, edge], -1)[:, None, :]).max(axis=-1)
                assert distances.min(axis=1).max() < 1e-9
        assert ax.get_yscale() == ("log" if log else "linear")
        assert_outage_is_shaded(ax)
    assert (left.get_ylabel(), right.get_ylabel()) == ("mean position error [m]", "mean orientation error [deg]")


def test_consistency_with_the_bands_of_a_consistent_filter(comparison):
    figure = plot_consistency(comparison, groups=("pose", "sensors"))
    axes = np.array(figure.axes).reshape(2, 2)
    assert below(figure)[0] == ["consistent", "right", "near", "poor", "outage"]
    n = N - 1
    for column, (group, dof) in enumerate((("pose", 6), ("sensors", 6))):
        top, bottom = axes[:, column]
        r = comparison["right"]
        squares = r.nees[group][good(r)]
        assert_line(top, "right", r.time, squares.mean(axis=0) / dof)
        assert_line(bottom, "right", r.time, np.mean(squares <= scipy.stats.chi2(dof).ppf(0.95), axis=0))
        low, high = scipy.stats.chi2(dof * n).ppf([0.025, 0.975]) / (dof * n)
        assert any(np.allclose((y, y + height), (low, high), rtol=1e-9) for _, y, _, height in spans(top))
        low, high = scipy.stats.binom(n, 0.95).ppf([0.025, 0.975]) / n
        assert any(np.allclose((y, y + height), (low, high), rtol=1e-9) for _, y, _, height in spans(bottom))
        for ax in (top, bottom):
            assert_outage_is_shaded(ax)
        inside = np.mean(
            np.abs(scipy.stats.chi2(dof * n).cdf(n * squares.mean(axis=0)) - 0.5) < 0.475  # of each epoch
        )
        assert f"inside: right {100 * inside:.0f} %, near" in top.get_title()
        assert bottom.get_ylim() == (0, 1)
    # far off: in a logarithmic frame; without states: not there
    assert axes[0, 0].get_yscale() == "log"
    assert axes[0, 1].get_yscale() == "linear"
    assert "poor" not in axes[0, 1].get_title()


def test_a_group_that_no_model_has(reference):
    (top, _) = plot_consistency(make_runs(num_runs=4, axes=()), groups=("sensors",)).axes
    assert top.get_title() == "sensors: no states"


def test_consistency_from_an_exact_start():
    r = make_runs(num_runs=4)
    r.nees["pose"][:, 0] = np.nan
    (top, _) = plot_consistency(r, groups=("pose",)).axes
    assert line(top, "right").get_xdata()[0] == 1.0


def test_innovations(comparison):
    figure = plot_nis(comparison)
    for ax, (sensor, dof) in zip(figure.axes, {"gnss": 3, "baro": 1}.items(), strict=True):
        r = comparison["near"]
        assert_line(ax, "near", r.nis_time[sensor], r.nis[sensor][good(r)].mean(axis=0) / dof)
        assert ax.get_title().startswith(f"{sensor}\ninside: right ")
        assert_outage_is_shaded(ax)
    assert len(plot_nis(comparison["right"], sensors=["baro"]).axes) == 1
    with pytest.raises(ValueError, match="no innovations of sonar, only of gnss, baro"):
        plot_nis(comparison, sensors=["sonar"])
    bare = make_runs(num_runs=3, nis={}, nis_time={}, nis_dof={}, innovation={})
    with pytest.raises(ValueError, match="these runs have no fixes"):
        plot_nis(bare)


def test_too_few_runs_for_a_mean():
    with pytest.raises(ValueError, match="takes 2 or more in which no model failed, and there are 0"):
        plot_mean_errors(make_runs(num_runs=1))


def test_the_overview(comparison):
    figure = comparison.plot()
    position, orientation, score, nees, covered, pairs = figure.axes
    r = comparison["poor"]
    each = energy_score(r.error[good(r), :, :3], r.position_covariance[good(r)])
    assert_line(score, "poor", r.time, each.mean(axis=0))
    table = comparison.table()
    drawn = {tuple(c.lines[0].get_xydata()[0]) for c in pairs.containers}
    assert drawn == {(one.paired.difference, row) for row, one in enumerate(table[1:])}
    for text, one in zip(pairs.get_yticklabels(), table[1:], strict=True):
        assert one.model in text.get_text()
        assert one.verdict in text.get_text().replace("\n", " ")
    assert not any(ax.texts for ax in figure.axes)  # they would be over curves
    assert below(figure)[0] == ["right", "near", "poor", "outage", "consistent"]
    assert covered.get_ylim() == (0, 1)
    assert {ax.get_yscale() for ax in (position, orientation, score)} == {"log"}
    assert {ax.get_yscale() for ax in comparison.plot(log=False).axes[:3]} == {"linear"}
    for ax in (position, orientation, score, nees, covered):
        assert_outage_is_shaded(ax)
        assert any(np.all(np.asarray(one.get_xdata()) == table.time) for one in ax.lines)
    assert figure.get_suptitle() == f"{N - 1} common runs along figure of eight"


def test_the_overview_of_one_model(reference):
    figure = plot_comparison(Comparison(reference, {"only": make_runs("only", 5)}), at=30.0)
    assert figure.axes[-1].get_title() == "difference in the same runs at 30 s"


@pytest.mark.slow
def test_what_is_drawn_is_what_the_data_say(reference, comparison):
    r = make_runs(num_runs=6)
    for plot, data, first, options in (
        (plot_trajectory, plotting.trajectory_data, (reference,), {}),
        (plot_trajectory, plotting.trajectory_data, (reference,), {"attitude": False}),
        (plot_realisations, plotting.realisations_data, (r, reference), {"max_runs": 4}),
        (plot_errors, plotting.errors_data, (r,), {"blocks": ("position", "attitude"), "max_runs": 3, "sigmas": 2.0}),
        (plot_sensor_states, plotting.sensor_states_data, (r,), {}),
        (plot_mean_errors, plotting.mean_errors_data, (comparison,), {}),
        (plot_mean_errors, plotting.mean_errors_data, (r,), {"log": True, "level": 0.9}),
        (plot_consistency, plotting.consistency_data, (r,), {"groups": ("position", "pose")}),
        (plot_nis, plotting.nis_data, (r,), {}),
    ):
        assert_shows(plot(*first, **options), data(*first, **options))


def test_the_overview_shows_its_data(reference):
    models = {name: make_runs(name, N, scale=scale, noise=6) for name, scale in (("a", 1.0), ("b", 1.1), ("c", 1.3))}
    c = Comparison(reference, models, "MTi-G")
    shown = plotting.comparison_data(c, at=20.0)
    assert_shows(plot_comparison(c, at=20.0), shown)
    assert [frame.y.unit for frame in shown[:5]] == ["m", "deg", "m", "1", "1"]
    best, *bars = shown[5].items
    table = c.table(20.0)
    assert best.at == 0
    assert shown[5].x.label.startswith(f"position error minus that of {table[0].model}, ")
    for bar, one, name in zip(bars, table[1:], shown[5].y.names, strict=True):
        assert [bar.low[0], bar.x[0], bar.high[0]] == [one.paired.low, one.paired.difference, one.paired.high]
        assert name.startswith(one.model)


@pytest.mark.slow
def test_given_axes_are_used(reference, comparison):
    r = make_runs(num_runs=6)
    for plot, result, shape in (
        (plot_trajectory, reference, (1, 3)),
        (plot_errors, r, (3, 1)),
        (plot_sensor_states, r, (3, 2)),
        (plot_mean_errors, comparison, (1, 2)),
        (plot_consistency, comparison, (2, 3)),
        (plot_nis, r, (len(r.nis), 1)),
        (plot_comparison, comparison, (2, 3)),
    ):
        axes = Figure().subplots(*shape, squeeze=False)
        figure = plot(result, axes=axes)
        assert figure is axes[0, 0].get_figure()
        assert len(figure.axes) == axes.size
        assert not figure.legends
        assert figure.get_suptitle() == ""
        with pytest.raises(ValueError, match=f"has {axes.size} frames and draws into as many Axes; axes= has 7"):
            plot(result, axes=Figure().subplots(1, 7))


def test_a_logarithmic_axis_of_one_value_to_rounding():
    """Matplotlib warns of an axis without a width: designs that converge to what they began with have one."""
    ax = Figure().subplots()
    ax.plot([1, 2], [1.75, np.nextafter(1.75, 2.0)])
    logarithmic(ax)
    low, high = ax.get_ylim()
    assert low < 1.75 / 1.05
    assert high > 1.75 * 1.05
