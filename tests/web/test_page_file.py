"""Values from the clipboard, and a page that is saved, loaded by somebody else, or refused, in a browser."""

import json
import re

import numpy as np
import pytest
from web.pages import drawn, go_to

import gmwm_jax as gj

PASTED = "\n".join(f"{v:.6e}" for v in np.random.default_rng(7).normal(scale=0.01, size=1200))


@pytest.fixture(scope="module")
def fit():
    """Of the pasted values."""
    x = np.array([float(line) for line in PASTED.splitlines()])
    return gj.fit(gj.wavelet_variance(gj.Recording.from_array(x, rate=100.0, units="rad/s")), "WN")


def objective(page):
    page.locator("#objective").wait_for()
    return float(re.search(r"objective (\S+),", page.locator("#objective").inner_text())[1])


def test_pasted_values_are_fitted_saved_and_loaded_by_a_colleague(open_page, fit, tmp_path):
    page = open_page("?source=file&rate=100&units=rad/s")
    page.locator("#data_status", has_text="a link holds no data").wait_for()
    page.locator("summary", has_text="clipboard").click()
    field, put = page.locator(".gmwm-pasted"), "(field, text) => { field.value = text; }"  # to type it takes seconds
    field.evaluate(put, "1\n" * 10_001)
    page.locator("[data-paste]").click()
    page.locator("#too_long", has_text="at most 20000").wait_for()
    field.evaluate(put, PASTED)
    page.locator("[data-paste]").click()
    page.locator("#facts", has_text="1200 samples").wait_for()
    page.locator("#first_samples td", has_text=f"{float(PASTED.splitlines()[1]):.5g}").wait_for()
    go_to(page, "model")
    drawn(page, "fitted")
    assert objective(page) == pytest.approx(fit.objective, rel=1e-6)
    page.locator("#history button", has_text="WN").wait_for()
    go_to(page, "takeaway")
    page.locator("#program pre").wait_for()
    with page.expect_download() as waited:
        page.locator("#save").click()
    path = tmp_path / "page.json"
    waited.value.save_as(path)

    colleague = open_page("?source=saved&samples=5000")
    colleague.locator("#page").set_input_files(path)
    colleague.locator("#facts", has_text="of a saved page").wait_for()
    go_to(colleague, "model")
    drawn(colleague, "fitted")
    assert objective(colleague) == pytest.approx(fit.objective, rel=1e-6)
    assert colleague.locator("#history button").count() == 1
    assert "rate=100" in colleague.url
    go_to(colleague, "takeaway")
    colleague.locator("#program pre", has_text="gj.load('variance.json')").wait_for()

    go_to(colleague, "data")
    for name, content in (("x.json", '{"name": "another"}'), ("y.json", path.read_text().replace("0.6", "9.6", 1))):
        colleague.locator("#page").set_input_files({"name": name, "mimeType": "x/y", "buffer": content.encode()})
        colleague.locator("#page_status .gmwm-error", has_text=name).wait_for()
    assert json.loads(path.read_text())["inputs"]["source"] == "saved"
