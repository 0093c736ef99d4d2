"""The tutorial in a browser: every printed number stands on the page, and each step can be done."""

import re

import pytest
from web.pages import drawn

from gmwm_jax.app.web.tutorial import CHAPTERS

MINIMA = {2: "540.424", 3: "537.854", 4: "28.477", 6: "17.23"}


def test_printed_numbers_stand_beside_the_minima(open_page):
    page = open_page("?room=tutorial")
    for chapter in CHAPTERS:
        if not chapter.printed:
            continue
        step = page.locator(f"#step_{chapter.number}")
        step.locator("table").wait_for()
        said = step.inner_text()
        printed = f"{chapter.printed_objective:.7g}"
        assert f"Printed: {printed}; at the printed estimates: {printed}" in said
        assert ("not the minimum" in said) == (chapter.number > 2)
        assert chapter.number == 2 or f"The minimum is {MINIMA[chapter.number]}" in said
    six = page.locator("#step_6").inner_text()
    assert re.search(r"GM_1: with the stationary variance .* 296\.\d+ times too large", six)
    assert "0.0002004939" in six


@pytest.mark.parametrize("number", [1, 4, 7])
def test_a_step_is_done_where_its_link_leads(open_page, number):
    page = open_page("?room=tutorial")
    page.get_by_role("link", name="Do this step").nth(number - 1).click()
    if CHAPTERS[number - 1].room == "units":
        page.locator("#per_sample table").wait_for()
        return
    drawn(page, "fitted" if number == 4 else "variances")
    if number == 4:
        assert "objective 28.47" in page.locator("#objective").inner_text()
        assert page.locator("#channel").input_value() == "gyro_x"
