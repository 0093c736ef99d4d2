"""Figures of the page show the numbers of the results, escape names, and have axes with powers of ten."""

from dataclasses import replace

import numpy as np
import pytest
from programs import fitted, simulated

import gmwm_jax as gj

pytest.importorskip("plotly", reason="needs the extra web")

from gmwm_jax.app.web import figures
from gmwm_jax.app.web.frames import escaped, themed

HOSTILE = "<img src=x onerror=alert(1)>"


def curve(figure, name):
    """The points of the trace of a name."""
    (trace,) = [t for t in figure.data if (t.name == name and t.mode != "lines") or (t.name == name and t.fill is None)]
    return np.asarray(trace.x, dtype=float), np.asarray(trace.y, dtype=float)


def test_variances_are_those_of_the_result():
    wv = simulated()
    x, y = curve(figures.variance(wv), "wavelet variance")
    np.testing.assert_array_equal(x, wv.times)
    np.testing.assert_array_equal(y, wv.variance)
    adev = gj.allan_deviation(wv)
    x, y = curve(figures.variance(wv, allan=True, deviation=True), "Allan deviation")
    np.testing.assert_allclose(x, adev.times, rtol=1e-14)
    np.testing.assert_allclose(y, adev.deviation, rtol=1e-14)
    x, _ = curve(figures.variance(wv, samples=True), "wavelet variance")
    np.testing.assert_array_equal(x, wv.scales)


def test_units_of_the_page_are_converted():
    wv = replace(simulated(), units=("rad/s",))
    figure = figures.variance(wv, unit={"rad/s": "deg/h"})
    np.testing.assert_allclose(curve(figure, "wavelet variance")[1], wv.variance * (np.degrees(1) * 3600) ** 2)
    assert figure.layout.yaxis.title.text == "wavelet variance [(deg/h)²]"


def test_the_datasheet_is_its_wavelet_variance():
    """Half the Allan variance at half the span: an overlay at the span itself is the error of both former apps."""
    rate, B = 100.0, 1e-3
    model, _ = gj.from_datasheet({"B": f"{B} rad/s"}, rate)
    wv = replace(simulated(), units=("rad/s",))
    figure = figures.variance(wv, datasheet=model)
    _, y = curve(figure, "datasheet")
    np.testing.assert_allclose(y[5:], np.log(2) / np.pi * B**2, rtol=1e-3)  # half of (0.664 B)^2


def test_the_fit_has_its_components_and_residuals():
    fit = fitted()
    figure = figures.fit(fit)
    tau = fit.wv.times
    for label, value in (("fit", fit.fitted), *fit.decomposition().items()):
        x, y = curve(figure, label)
        at = np.isin(np.round(x, 9), np.round(tau, 9))
        np.testing.assert_allclose(y[at], value[np.isin(np.round(tau, 9), np.round(x, 9))], rtol=1e-9)
    assert "residual" in {t.name for t in figure.data}
    assert "residual" not in {t.name for t in figures.fit(fit, residuals=False).data}


def test_slopes_are_those_of_what_is_drawn():
    for deviation, power in ((False, 1.0), (True, 0.5)):
        figure = figures.variance(simulated(), slopes=True, deviation=deviation)
        x, y = curve(figure, f"white noise, slope {-power:+g}")
        np.testing.assert_allclose(np.diff(np.log(y)) / np.diff(np.log(x)), -power, rtol=1e-9)


def test_a_component_at_zero_is_named():
    fit = fitted()
    none = fit.model.processes[0].__class__(0.0)
    figure = figures.fit(replace(fit, model=gj.Composite([none, *fit.model.processes[1:]])))
    (zero,) = [t for t in figure.data if t.name == "WN: zero"]
    assert zero.showlegend
    assert len(zero.x) == 1  # one without points has no entry


def test_intervals_mark_the_truth():
    fit = fitted()
    truth = gj.parse_model("WN(sigma2=1.0) + GM(beta=0.03, variance=0.2)")
    figure = figures.intervals(fit, None, truth=truth)
    x, _ = curve(figure, "truth")
    np.testing.assert_allclose(x * [e.value for e in fit.parameters()], [1.0, 0.03, 0.2], rtol=1e-12)
    with pytest.raises(ValueError, match="The truth is"):
        figures.intervals(fit, None, truth="RW(gamma2=1.0)")


def test_names_are_no_tags():
    assert "<" not in escaped(HOSTILE)
    rec = gj.Recording.from_array(
        np.random.default_rng(0).normal(size=(500, 1)), rate=10.0, units="1", channels=[HOSTILE], name=HOSTILE
    )
    for figure in (
        figures.recording(rec, 0),
        figures.steps(rec, 0),
        figures.variance(replace(simulated(), channels=(HOSTILE,))),
        figures.fit(replace(fitted(), wv=replace(simulated(), channels=(HOSTILE,), name=HOSTILE))),
    ):
        shown = figure.to_dict()
        shown["layout"].pop("meta")  # a text alternative, which is no text of the figure
        assert "<img" not in str(shown)


def test_the_grid_of_a_coarse_sensor_is_seen():
    x = np.round(np.random.default_rng(0).normal(size=5000) * 3) * 0.01
    rec = gj.Recording.from_array(x, rate=10.0, units="rad/s")
    assert "multiples of 0.01 rad/s" in figures.steps(rec, 0).layout.annotations[0].text


def test_logarithmic_axes_have_powers_of_ten():
    figure = figures.variance(simulated())
    axis = figure.layout.xaxis
    assert (axis.type, axis.exponentformat, axis.dtick) == ("log", "power", 1)


def test_a_dark_page_has_light_text_and_the_same_data():
    figure = figures.fit(fitted())
    dark = themed(figure, dark=True)
    assert dark.layout.font.color == "#ececec"
    assert len(dark.data) == len(figure.data)
    assert "#1f4e79" not in str(dark.to_json())
