"""The room Inference & selection in a browser: what buttons start is the library's, shows its progress and ends."""

import re
import time

import jax
import pytest
from web.pages import drawn, enter

import gmwm_jax as gj

PAGE = "?room=inference&samples=5000&boxes=WN%2CRW"


@pytest.fixture(scope="module")
def wv():
    """Of the record that the pages draw."""
    return gj.wavelet_variance(gj.datasets.simulated("mti-g", 5000))["gyro_x"]


def test_replicates_are_those_of_the_library_and_never_stale(open_page, wv):
    page = open_page(PAGE + "&replicates=250&draw_seed=3")
    page.locator("#replicated_fit p").wait_for()
    page.locator("#replicate").click()
    drawn(page, "intervals")
    table = page.locator("#replicates_table").inner_text()
    assert "250 of 250 replicates by variances" in table
    expected = gj.bootstrap(gj.fit(wv, "WN + RW"), 250, key=jax.random.key(3)).parameters()
    for e in expected:
        assert f"{e.ci_low:.4g}"[:5] in table
    assert page.locator("#job").is_hidden()
    enter(page, "draw_seed", 4)  # what is shown belongs to other inputs now
    page.locator("#replicates_table table").wait_for(state="detached")
    assert page.locator("#intervals").get_attribute("data-drawn") is None
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
    enter(page, "superset", "nonsense")
    page.locator("#rank").click()
    page.locator("#ranked_status .gmwm-error", has_text="nonsense").wait_for()
