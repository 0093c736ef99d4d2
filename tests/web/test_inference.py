"""The room Inference & selection in a browser: what buttons start is the library's, shows its progress and ends."""

import re
import time
from urllib.parse import quote

import jax
import numpy as np
import pytest
from web.pages import curves, drawn, enter, go_to, until

import gmwm_jax as gj
from gmwm_jax.app.web import tables

PAGE = "?room=inference&samples=5000&boxes=WN%2CRW"


@pytest.fixture(scope="module")
def wv():
    """Of the record that the pages draw."""
    return gj.wavelet_variance(gj.datasets.simulated("mti-g", 5000))["gyro_x"]


def test_replicates_are_those_of_the_library_and_never_stale(open_page, wv):
    page = open_page(PAGE + "&replicates=250&draw_seed=3")
    page.locator("#replicated_fit p").wait_for()
    page.locator("#replicate").click()
    page.locator("#replicates_table", has_text="250 of 250").wait_for()
    until(lambda: any("250 replicates" in name for name in curves(page, "intervals")))
    table = page.locator("#replicates_table").inner_text()
    assert "250 of 250 replicates by variances" in table
    expected = gj.bootstrap(gj.fit(wv, "WN + RW"), 250, key=jax.random.key(3)).parameters()
    for e in expected:
        assert f"{e.ci_low:.4g}"[:5] in table
    assert page.locator("#job").is_hidden()
    enter(page, "draw_seed", 4)  # what is shown belongs to other inputs now
    page.locator("#replicates_table table").wait_for(state="detached")
    until(lambda: not any("replicates" in name for name in curves(page, "intervals")))
    assert any("theory" in name for name in curves(page, "intervals"))
    enter(page, "replicates", 7)
    page.locator("#replicates_status .gmwm-error", has_text="Replicates").wait_for()


def test_what_is_cancelled_keeps_what_is_done(open_page):
    page = open_page(PAGE + "&replicates=5000&route=records")
    page.locator("#replicated_fit p").wait_for()
    page.locator("#replicate").click()
    page.locator("#job_text", has_text=re.compile(r"\d+ of 5000, about \d+ s left")).wait_for()
    page.locator("#replicate").click()
    page.locator(".shiny-notification", has_text="This page computes already").wait_for()
    began = time.monotonic()
    page.locator("#cancel").click()
    page.locator("#replicates_table", has_text=re.compile(r"\d+ of 5000 replicates by records")).wait_for()
    assert time.monotonic() - began < 30
    assert int(re.search(r"(\d+) of 5000", page.locator("#replicates_table").inner_text())[1]) < 5000
    assert page.locator("#job").is_hidden()


def test_another_page_is_answered_meanwhile(open_page):
    busy = open_page(PAGE + "&replicates=5000&route=records&draw_seed=5")
    busy.locator("#replicated_fit p").wait_for()
    busy.locator("#replicate").click()
    busy.locator("#job_text", has_text="of 5000").wait_for()
    other = open_page("?room=model&samples=5000&boxes=WN")
    before = drawn(other, "fitted")
    other.locator("#boxes input[value=RW]").check()
    drawn(other, "fitted", after=before)
    assert other.locator("#job").is_hidden()
    assert busy.locator("#job").is_visible()
    busy.locator("#cancel").click()
    busy.locator("#job").wait_for(state="hidden")


def test_the_recommended_model_is_adopted(open_page, wv):
    page = open_page(PAGE + "&superset=WN+%2B+QN+%2B+RW")
    page.locator("#about", has_text="5000 samples").wait_for()
    page.locator("#rank").click()
    drawn(page, "ranked")
    expected = gj.select(wv, "WN + QN + RW")
    table = page.locator("#ranked_table").inner_text()
    assert all(c.name in table for c in expected.candidates if c.sound)
    assert expected.recommended.fit.misfit in page.locator("#adoption .gmwm-error").inner_text()
    page.locator("#adoption button", has_text=expected.recommended.name).click()
    end = time.monotonic() + 20
    while page.locator("#model").input_value() != expected.recommended.name and time.monotonic() < end:
        time.sleep(0.1)
    assert page.locator("#model").input_value() == expected.recommended.name
    page.locator("#nested").click()
    enter(page, "superset", "WN + RW; WN + QN")
    page.locator("#rank").click()
    page.locator("#ranked_table", has_text="2 models within").wait_for()
    page.locator("#nested").click()
    page.locator("#rank").click()
    page.locator("#ranked_status .gmwm-error", has_text="one model with all its parts").wait_for()
    enter(page, "superset", "nonsense")
    page.locator("#rank").click()
    page.locator("#ranked_status .gmwm-error", has_text="nonsense").wait_for()


def test_the_truth_stands_beside_the_estimate_and_the_level_is_chosen(open_page):
    """Simulated: WN + GM + DR at values of one's own."""
    truth = "WN(sigma2=1) + GM(beta=0.1, variance=0.6) + DR(omega=5e-5)"
    page = open_page(f"?room=inference&samples=6000&own={quote(truth)}&boxes=WN%2CGM&level=0.9")
    drawn(page, "intervals")
    table = page.locator("#true_values").inner_text()
    assert "90 % low" in table
    assert re.search(r"GM\s+beta\s+0.1\s", table)
    x = np.asarray(gj.simulate(gj.parse_model(truth), 6000, key=jax.random.key(0)))
    fit = gj.fit(gj.wavelet_variance(gj.Recording.from_array(x, rate=100.0, units="rad/s")), "WN + GM", level=0.9)
    shown = curves(page, "intervals")["truth"][0]
    np.testing.assert_allclose(shown, np.array([1.0, 0.1, 0.6]) / [e.value for e in fit.parameters()], rtol=1e-6)
    p_value = f"p = {gj.goodness_of_fit(fit).p_value:.3g}"
    page.locator("#goodness", has_text=p_value).wait_for()
    enter(page, "level", 0.99)
    page.locator("#true_values", has_text="99 % low").wait_for()


def test_several_records_are_fitted_together_and_tested(open_page):
    page = open_page("?room=inference&samples=5000&boxes=WN")
    records = []
    for number, seed in enumerate((0, 1), start=1):
        page.locator("#about", has_text="5000 samples").wait_for()
        if number > 1:
            go_to(page, "data")
            enter(page, "seed", seed)
            page.locator("#facts", has_text=facts(seed)).wait_for()
            go_to(page, "inference")
        page.locator("#keep").click()
        page.locator("#kept", has_text=f"{number} kept").wait_for()
        records.append(gj.wavelet_variance(gj.datasets.simulated("mti-g", 5000, key=jax.random.key(seed)))["gyro_x"])
    drawn(page, "joint_variances")
    joint = gj.fit_records(records, "WN")
    assert f"objective {joint.objective:.8g}" in page.locator("#joint_text").inner_text()
    enter(page, "tests", 20)
    page.locator("#same").click()
    test = gj.multisignal.near_stationarity(joint, 20, key=jax.random.key(0))
    page.locator("#stationarity", has_text=f"p = {test.p_value:.3g}").wait_for()
    page.locator("#forget").click()
    page.locator("#joint_text pre").wait_for(state="detached")


def facts(seed):
    """A number that tells a record from that of another seed."""
    rec = gj.datasets.simulated("mti-g", 5000, key=jax.random.key(seed))
    return f"{tables.recording(rec).rows[0][4]:.5g}"
