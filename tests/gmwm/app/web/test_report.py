"""What is taken away is all there, is read back, and runs nothing."""

import csv
import io
import json
import zipfile
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from programs import RATE, fitted, simulated

from gmwm_jax.app.web import report
from gmwm_jax.app.web.script import Analysis, Simulated

HOSTILE = "../<img src=x onerror=alert(1)>"


class Tags(HTMLParser):
    """All tags of a page with their attributes."""

    def __init__(self, text):
        super().__init__()
        self.tags = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))


@pytest.fixture(scope="module")
def files():
    wv = replace(simulated(), units=("rad/s",), channels=(HOSTILE,))
    analysis = Analysis(Simulated("mti-g", 20_000, 0), ("gyro_x",), "WN + GM")
    return report.downloads([replace(fitted(), wv=wv, rate=RATE)], analysis=analysis)


def test_every_file_is_what_it_says(files):
    assert {name.rpartition(".")[2] for name in files} >= {"csv", "json", "svg", "pdf", "png", "html", "py", "params"}
    assert all(not name.startswith((".", "/")) and ".." not in name and "<" not in name for name in files)
    for name, content in files.items():
        if name.endswith(".csv"):
            rows = list(csv.reader(io.StringIO(content.decode(), newline="")))
            assert len({len(row) for row in rows}) == 1
            assert len(rows) > 2
    (found,) = json.loads(files["fit.json"])
    assert found["objective"] == fitted().objective
    starts = {"svg": b"<?xml", "pdf": b"%PDF", "png": b"\x89PNG"}
    assert all(files[f"{stem}.{kind}"].startswith(start) for kind, start in starts.items() for stem in _figures(files))
    compile(files["analysis.py"], "analysis.py", "exec")


def _figures(files):
    return {name.removesuffix(".svg") for name in files if name.endswith(".svg")}


def test_the_report_is_one_file_that_runs_nothing(files):
    text = files["report.html"].decode()
    tags = Tags(text).tags
    assert not {"script", "link", "iframe"} & {tag for tag, _ in tags}
    sources = [attrs["src"] for tag, attrs in tags if tag == "img"]
    assert sources
    assert all(source.startswith("data:image/svg+xml;base64,") for source in sources)
    assert not [attrs for _, attrs in tags if "onerror" in attrs]
    assert f"{fitted().objective:.8g}" in text


def test_the_archive_holds_all_and_is_the_same_again(files):
    packed = report.archive(files)
    assert packed == report.archive(files)
    with zipfile.ZipFile(io.BytesIO(packed)) as read:
        assert read.testzip() is None
        assert {name: read.read(name) for name in read.namelist()} == files
