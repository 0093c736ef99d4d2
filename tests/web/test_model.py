"""The room Model & fit in a browser: every change is fitted, and what stands there is the library's fit."""

import re

import numpy as np
import pytest
from web.pages import curves, drawn, enter, until

import gmwm_jax as gj


@pytest.fixture(scope="module")
def wv():
    """Of the record that the pages draw."""
    return gj.wavelet_variance(gj.datasets.simulated("mti-g", 5000))["gyro_x"]


def objective(page):
    page.locator("#objective").wait_for()
    return float(re.search(r"objective (\S+),", page.locator("#objective").inner_text())[1])


def test_boxes_are_fitted_and_nothing_stale_is_shown(open_page, wv):
    page = open_page("?room=model&samples=5000")
    before = drawn(page, "fitted")
    assert objective(page) == pytest.approx(gj.fit(wv, "WN").objective, rel=1e-6)
    page.locator("#boxes input[value=RW]").check()
    before = drawn(page, "fitted", after=before)
    fit = gj.fit(wv, "WN + RW")
    page.locator("#fit_status .gmwm-error", has_text=fit.misfit).wait_for()
    assert objective(page) == pytest.approx(fit.objective, rel=1e-6)
    shown = curves(page, "fitted")
    np.testing.assert_allclose(shown["wavelet variance"][1], wv.variance, rtol=1e-12)
    spans, fitted = map(np.array, shown["fit"])
    np.testing.assert_allclose(fitted, np.asarray(fit.model.wavelet_variance(np.round(spans * wv.rate))), rtol=1e-6)
    assert any("residual" in name for name in shown)
    page.locator("#estimates pre", has_text="Datasheet units").wait_for()
    assert "gamma2" in page.locator("#estimates").inner_text()
    for box in ("WN", "RW"):
        page.locator(f"#boxes input[value={box}]").uncheck()
    page.locator("#fit_status .gmwm-error", has_text="No process is ticked").wait_for()
    page.wait_for_timeout(200)
    assert page.locator("#fitted").get_attribute("data-drawn") is None
    assert page.locator("#estimates pre").count() == 0
    page.locator("#history button", has_text=re.compile(r"^WN \+ RW$")).click()  # one click back
    drawn(page, "fitted")
    assert objective(page) == pytest.approx(fit.objective, rel=1e-6)


def test_values_can_be_given_and_held(open_page, wv):
    page = open_page("?room=model&samples=5000&hold=1&model=WN(sigma2%3D5e-5)")
    drawn(page, "fitted")
    held = gj.fitting.objective(wv, gj.WN(sigma2=5e-5))
    assert objective(page) == pytest.approx(float(held), rel=1e-6)
    enter(page, "model", "WN + nonsense")
    page.locator("#fit_status .gmwm-error", has_text="nonsense").wait_for()
    enter(page, "model", " + ".join(["WN"] * 9))
    page.locator("#fit_status .gmwm-error").wait_for()
    enter(page, "model", "6*GM + WN")
    page.locator("#fit_status .gmwm-error", has_text="6 GM").wait_for()


def test_the_datasheet_is_drawn_and_adopted(open_page, wv):
    page = open_page("?room=model&samples=5000&datasheet=N%3D0.15%20deg%2Fsqrt(h)")
    before = drawn(page, "fitted")
    model, _ = gj.from_datasheet({"N": "0.15 deg/sqrt(h)"}, wv.rate)
    shown = curves(page, "fitted")["datasheet"][1]
    np.testing.assert_allclose(shown, np.asarray(model.wavelet_variance(wv.scales)), rtol=1e-12)
    page.locator("#adopt").click()
    drawn(page, "fitted", after=before)
    assert "sigma2" in page.locator("#model").input_value()


def test_more_processes_and_each_parameter_free_or_held(open_page, wv):
    page = open_page("?room=model&samples=5000&boxes=&more=AR1")
    assert page.locator("#more").is_visible()
    before = drawn(page, "fitted")
    assert objective(page) == pytest.approx(gj.fit(wv, "AR1").objective, rel=1e-5)
    page.locator("summary", has_text="each parameter").click()
    page.locator("#how_0").select_option("fixed")
    page.locator("#residuals").click()  # another input leaves what is filled in
    before = drawn(page, "fitted", after=before)
    enter(page, "at_0", 0.5)
    page.locator("#use").click()
    until(lambda: page.locator("#model").input_value() == "AR1(phi=0.5 fixed)")
    drawn(page, "fitted", after=before)
    assert objective(page) == pytest.approx(gj.fit(wv, "AR1(phi=0.5 fixed)").objective, rel=1e-5)
    assert "Model: AR1(phi=0.5 fixed)" in page.locator("#about").inner_text()


def test_weights_are_chosen(open_page, wv):
    page = open_page("?room=model&samples=5000&boxes=WN%2CRW&weights=covariance")
    drawn(page, "fitted")
    assert objective(page) == pytest.approx(gj.fit(wv, "WN + RW", weights="covariance").objective, rel=1e-5)


def test_theory_is_read_on_the_page(open_page):
    page = open_page("?room=model&samples=5000&boxes=WN")
    page.locator("#theory summary").click()
    drawn_formula = page.locator("#theory tr", has_text="Rate random walk").locator("math").last
    size = drawn_formula.bounding_box()
    assert size["height"] > 20  # a fraction
    assert page.locator("#theory math").count() == 24


def test_an_unknown_error_is_a_number(open_page, monkeypatch, caplog):
    def broken(*_, **__):
        raise KeyError("/secret/path")

    monkeypatch.setattr(gj, "fit", broken)
    page = open_page("?room=model&samples=5000&boxes=WN")
    page.locator("#fit_status .gmwm-error", has_text="Internal error").wait_for()
    assert "secret" not in page.locator("body").inner_text()
    number = page.locator("#fit_status .gmwm-error").inner_text().split()[2].rstrip(":")
    assert number in caplog.text
