"""Every public function has an example that runs, and shows what it says.

Examples stand in the docstrings and suppose 64-bit floats and the imports of `GLOBALS`. They run in an empty folder.
"""

import doctest
import importlib
import inspect
import pkgutil

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import gmwm_jax
import nav_jax
from gmwm_jax._internal.lazy import open_wide

pytestmark = pytest.mark.usefixtures("quick_compilation")

NAMESPACES = ("datasets", "motions", "weights")
"""Files whose functions are reached through the file."""

GLOBALS = {"gj": gmwm_jax, "nj": nav_jax, "np": np, "jax": jax, "jnp": jnp}


def doors():
    """The doors of the packages and of their rooms, the units, and the files that are namespaces."""
    for package in (gmwm_jax, nav_jax):
        open_wide(package.__name__)
        yield package
        for info in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            if not info.name.split(".")[-1].startswith("_"):
                room = importlib.import_module(info.name)
                yield room
                yield from (getattr(room, name) for name in NAMESPACES if hasattr(room, name))


def public():
    """Every public function and class by one of the names that it has, the shortest."""
    found = {}
    for door in doors():
        for name, thing in vars(door).items():
            ours = getattr(thing, "__module__", None) or ""
            if name.startswith("_") or not ours.startswith(("gmwm_jax", "nav_jax")) or not callable(thing):
                continue
            if door.__name__.split(".")[-1] in (*NAMESPACES, "units") and ours != door.__name__:
                continue  # what the file imports
            full = f"{door.__name__}.{name}"
            if id(thing) not in found or len(full) < len(found[id(thing)][0]):
                found[id(thing)] = (full, thing)
    return dict(found.values())


PUBLIC = public()
AT_DOOR = {name for name in PUBLIC if name.count(".") == 1}


def is_function(thing):
    """Is it a function, jitted or cached ones included? Not one that only chooses among others by a class."""
    return not inspect.isclass(thing) and not hasattr(thing, "registry")


RESULTS = {"gmwm_jax.Fit"}
"""Classes at a door whose instances only functions make."""

NEED_ONE = sorted(name for name, thing in PUBLIC.items() if is_function(thing) or name in AT_DOOR - RESULTS)
CHAPTERS = {door.__name__: door for door in doors() if ">>>" in (inspect.getdoc(door) or "")}
"""Doors that explain something with an example."""
RUN = PUBLIC | CHAPTERS
HAVE_ONE = sorted(name for name, thing in RUN.items() if ">>>" in (inspect.getdoc(thing) or ""))


def test_the_search_finds_what_is_public():
    assert {"gmwm_jax.fit", "gmwm_jax.WN", "gmwm_jax.units.convert", "nav_jax.compare"} <= set(NEED_ONE)
    assert "gmwm_jax.recordings.datasets.simulated" in NEED_ONE
    assert "nav_jax.filter.run_filter" in NEED_ONE
    assert "gmwm_jax.processes" in CHAPTERS
    assert len(NEED_ONE) > 100


@pytest.mark.parametrize("name", NEED_ONE)
def test_it_has_an_example(name):
    doc = inspect.getdoc(PUBLIC[name]) or ""
    assert "\nExamples\n--------\n" in doc, f"{name} has no section Examples"
    assert ">>>" in doc.split("\nExamples\n--------\n")[1]


@pytest.mark.parametrize("name", HAVE_ONE)
@pytest.mark.filterwarnings("default")
def test_its_example_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    example = doctest.DocTestParser().get_doctest(inspect.getdoc(RUN[name]), dict(GLOBALS), name, name, 0)
    said = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    runner.run(example, out=said.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(said)
