"""What the package offers: every name is explained where it stands."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import nav_jax

ROOT = Path(__file__).resolve().parents[2]


def exported():
    """What its door offers."""
    return nav_jax.__all__


def test_type_checkers_see_what_the_door_offers():
    tree = ast.parse((ROOT / "nav_jax" / "__init__.py").read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    aliases = [alias for node in block.body for alias in node.names]
    assert all(alias.name == alias.asname for alias in aliases)  # elsewhere it is no export
    assert sorted(alias.name for alias in aliases) == exported()


def test_the_door_opens_when_somebody_goes_through():
    program = "import sys, nav_jax; print('jax' in sys.modules, nav_jax.Imu.__name__, 'jax' in sys.modules)"
    seen = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert seen.stdout.split() == ["False", "Imu", "True"]
    with pytest.raises(AttributeError, match="module 'nav_jax' has no attribute 'fitt'"):
        nav_jax.fitt  # noqa: B018
    assert set(exported()) <= set(dir(nav_jax))


def test_every_name_is_documented():
    undocumented = [name for name in exported() if not (getattr(nav_jax, name).__doc__ or "").strip()]
    assert not undocumented


def test_every_public_method_is_documented():
    undocumented = [
        f"{name}.{attribute}"
        for name in exported()
        if inspect.isclass(cls := getattr(nav_jax, name))
        for attribute, value in vars(cls).items()
        if not attribute.startswith("_") and (inspect.isfunction(value) or isinstance(value, property))
        if not inspect.getdoc(getattr(cls, attribute))
    ]
    assert not undocumented


def test_functions_of_many_parameters_explain_them():
    """Or say where they are explained; those of all motions are explained at the head of their file."""
    short = [
        name
        for name in exported()
        if inspect.isfunction(f := inspect.unwrap(getattr(nav_jax, name)))
        if f.__module__ != "nav_jax.trajectory.motions"
        if len(inspect.signature(f).parameters) > 3
        if not ("Parameters\n" in (doc := inspect.getdoc(f) or "") or "Parameters as in" in doc)
    ]
    assert not short


def test_the_version_is_that_of_the_project():
    assert f'version = "{nav_jax.__version__}"' in (ROOT / "pyproject.toml").read_text()
