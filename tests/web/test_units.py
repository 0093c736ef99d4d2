"""Published wavelet variances, the rooms that take them, and the room Units & filters."""

import re
from urllib.parse import quote

import numpy as np
from web.pages import drawn, enter

import gmwm_jax as gj
from gmwm_jax.app.web import datasheet, library, tables
from gmwm_jax.app.web.datasheet import verdicts
from gmwm_jax.app.web.formula import converted, to_filter, to_samples
from gmwm_jax.app.web.snippets import snippet


def test_the_published_example_from_its_variance_to_a_filter(open_page):
    page = open_page("?room=model&source=published&published=mti-g&channel=gyro_x")
    drawn(page, "fitted")
    assert "873684" in page.locator("#about").inner_text()
    assert "540.4236" in page.locator("#objective").inner_text()
    fit = gj.fit(library.published("mti-g")["gyro_x"], "WN")
    page.locator('.navbar a[data-value="units"]').click()
    page.locator("#for_filters table").wait_for()
    cells = page.locator("#for_filters tbody tr").first.inner_text().split("\t")
    shown = [float(c) for c in cells if re.fullmatch(r"[-+.\de]+", c.strip())]
    q = next(e.value for e in fit.continuous() if e.symbol == "q")
    assert min(abs(value / q - 1) for value in shown if np.isfinite(value)) < 1e-4
    fits = list(gj.fit(library.published("mti-g"), "WN").values())
    for target in ("kalibr", "gtsam"):  # a reason, or a file
        page.locator("#target").select_option(target)
        wanted = snippet(fits, target)
        page.locator("#filter_file pre", has_text=(wanted.text or wanted.reason).splitlines()[0]).wait_for()


def test_numbers_are_converted_with_the_formula(open_page):
    page = open_page("?room=units&samples=5000")
    page.locator("#converted p").wait_for()
    assert page.locator("#converted").inner_text() == converted(0.15, "deg/sqrt(h)", "rad/s/sqrt(Hz)").text
    enter(page, "unit_to", "kg")
    page.locator("#converted .gmwm-error").wait_for()
    for step in to_filter("WN", [4.926494e-05], 100.0, "rad/s"):
        assert step.text in page.locator("#by_formula").inner_text()
    page.locator("#process").select_option("GM")
    page.locator("#by_formula .gmwm-error", has_text="GM takes beta and the stationary variance").wait_for()
    page.locator("#way").select_option("samples")
    enter(page, "numbers", "2.0, 0.02")
    page.locator("#by_formula", has_text=to_samples("GM", [2.0, 0.02], 100.0, "rad/s")[1].text).wait_for()


def test_the_fit_is_compared_with_the_datasheet(open_page):
    entries = "N=0.05 deg/s/sqrt(Hz), B=20 deg/h"
    page = open_page(f"?room=units&samples=5000&boxes=WN%2CRW&datasheet={quote(entries + ' | N=50 ug/sqrt(Hz)')}")
    fit = gj.fit(gj.wavelet_variance(gj.datasets.simulated("mti-g", 5000))["gyro_x"], "WN + RW")
    page.locator("#verdict table").first.wait_for()
    shown = page.locator("#verdict table").first.inner_text()
    for v in verdicts(fit, entries):
        assert re.search(rf"{v.entry}\s+{v.stated:.5g}\s+{v.measured:.5g}.*{v.answer}", shown)
    model, _ = datasheet.model(entries, 100.0)
    assert str(model) in page.locator("#verdict").inner_text()
    assert tables.formulas(fit.model, 100.0, "rad/s").rows[0][4] in page.locator("#formulas").inner_text()
    enter(page, "datasheet", "N=50 ug/sqrt(Hz)")
    page.locator("#verdict", has_text="says nothing of a channel in rad/s").wait_for()
