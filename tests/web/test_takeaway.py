"""The room Take away in a browser: what it gives is what the page shows."""

import csv
import io
import json
import re
import subprocess
import sys
import zipfile
from xml.etree import ElementTree

import pytest

import gmwm_jax as gj

INPUTS = "?room=takeaway&samples=5000&boxes=WN%2CRW&sensor=mti-g"


@pytest.fixture
def page(open_page):
    page = open_page(INPUTS)
    page.locator("#program pre").wait_for()
    return page


def test_the_archive_has_everything_and_its_program_gives_the_same_numbers(page, tmp_path):
    with page.expect_download() as waited:
        page.locator("#archive").click()
    archive = zipfile.ZipFile(waited.value.path())
    names = archive.namelist()
    assert archive.testzip() is None
    fits = json.loads(archive.read("fit.json"))
    assert [fit["channel"] for fit in fits] == [f"{s}_{axis}" for s in ("gyro", "accel") for axis in "xyz"]
    wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 5000))
    assert fits[0]["objective"] == pytest.approx(gj.fit(wv["gyro_x"], "WN + RW").objective, rel=1e-9)
    for name in names:
        content = archive.read(name)
        match name.rsplit(".", 1)[1]:
            case "csv":
                rows = list(csv.reader(io.StringIO(content.decode())))
                assert len({len(row) for row in rows}) == 1, name
            case "svg":
                ElementTree.fromstring(content)
            case "pdf":
                assert content.startswith(b"%PDF")
            case "png":
                assert content.startswith(b"\x89PNG")
            case "html":
                assert b"gyro_x" in content
    program = archive.read("analysis.py").decode()
    assert page.locator("#program pre").inner_text().strip() == program.strip()
    (tmp_path / "analysis.py").write_text(program)
    subprocess.run([sys.executable, "analysis.py"], cwd=tmp_path, check=True, capture_output=True)
    again = json.loads((tmp_path / "fit.json").read_text())
    assert [fit["objective"] for fit in again] == pytest.approx([fit["objective"] for fit in fits], rel=1e-9)


def test_commands_stand_beside_it_where_there_are_some(page, open_page):
    assert re.search(r"gmwm-jax fit \S+ .*--model 'WN \+ RW'", page.locator("#commands pre").inner_text())
    other = open_page("?room=takeaway&source=published")
    other.locator("#commands", has_text="take the Python file").wait_for()
    assert "library.published('mti-g')" in other.locator("#program").inner_text()


def test_where_there_is_no_fit_there_is_nothing_to_take(open_page):
    page = open_page("?room=takeaway&samples=5000&model=nonsense")
    page.locator("#takeaway .gmwm-error", has_text="nonsense").wait_for()
    assert page.locator("#archive").count() == 0
    assert page.locator("#program pre").count() == 0


def luminance(colour):
    """Relative luminance of ``rgb(r, g, b)`` (WCAG 2.2)."""
    parts = [int(v) / 255 for v in re.findall(r"\d+", colour)[:3]]
    linear = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_buttons_links_and_texts_are_seen(open_page, scheme):
    """A contrast of 4.5 at least with the page behind them."""
    page = open_page(INPUTS, scheme=scheme)
    page.locator("#archive:not(.disabled)").wait_for()
    page.locator("#step_1 + p a").first.wait_for(state="attached")
    colour = "selector => getComputedStyle(document.querySelector(selector)).color"
    behind = luminance(page.evaluate("() => getComputedStyle(document.body).backgroundColor"))
    for selector in ("#archive", "#replicate", "#step_1 + p a", "h2", "#program pre"):
        seen = luminance(page.evaluate(colour, selector))
        ratio = (max(seen, behind) + 0.05) / (min(seen, behind) + 0.05)
        assert ratio >= 4.5, (selector, round(ratio, 2))
