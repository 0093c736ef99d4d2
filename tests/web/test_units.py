"""Published wavelet variances, the rooms that take them, and the room Units & filters."""

import re

import numpy as np
from web.pages import drawn, enter

import gmwm_jax as gj
from gmwm_jax.app.web import library
from gmwm_jax.app.web.formula import converted
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
