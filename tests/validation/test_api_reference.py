"""The API reference has every public name on the page of its room, and says nothing that is private."""

import html
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

from gmwm_jax._internal.lazy import open_wide

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Text of each page by its name; warnings are errors."""
    folder = tmp_path_factory.mktemp("docs")
    command = [sys.executable, "-W", "error::UserWarning", "notebooks/api_reference.py", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return {
        ".".join(path.relative_to(folder).with_suffix("").parts): path.read_text() for path in folder.rglob("*.html")
    }


def anchors(page):
    return set(re.findall(r'<section id="([\w.]+)">', page))


@pytest.mark.parametrize("package", ["gmwm_jax", "nav_jax"])
def test_a_room_is_a_chapter(pages, package):
    door = importlib.import_module(package)
    chapters = [page for page in pages if re.fullmatch(rf"{package}\.\w+", page)]
    assert len(chapters) >= 8
    for chapter in chapters:
        room = importlib.import_module(chapter)
        first = room.__doc__.split("\n")[0].split("`")[0]
        assert first in html.unescape(pages[chapter]), "the paragraph of the room opens its chapter"
        public = {n for n, thing in vars(room).items() if not n.startswith("_") and isinstance(thing, type)}
        ours = {n for n in public if getattr(room, n).__module__.startswith(package)}
        assert ours <= anchors(pages[chapter])
    open_wide(package)
    named = {n: getattr(thing, "__module__", None) or thing.__name__ for n, thing in vars(door).items() if n[0] != "_"}
    public = {n for n, module in named.items() if module.startswith(("gmwm_jax", "nav_jax"))}
    assert len(public) > 20
    links = set(re.findall(rf'href="{package}/([\w./]+)\.html#?(\w*)', pages[package]))
    reached = {name or chapter.split("/")[-1] for chapter, name in links}
    assert public <= reached, "the page of the package leads to everything at its door"


def test_nothing_private_is_shown(pages):
    assert not [page for page in pages if "._" in page]
    assert not [a for page in pages.values() for a in anchors(page) if a.split(".")[0].startswith("_")]


def test_sections_of_docstrings_are_headings(pages):
    """Sections as NumPy's style has them, and formulas without emphasis in the middle."""
    page = pages["gmwm_jax.variance"]
    assert re.search(r'<h6 id="parameters[^>]*>Parameters</h6>', page)
    assert "-------" not in page
    assert "2^j" in page


def test_the_citation_is_of_this_version():
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {importlib.import_module('gmwm_jax').__version__}\n" in citation
    assert "Guerrier" in citation
