"""What the package offers: every name is explained where it stands, and known to the README."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import gmwm_jax

ROOT = Path(__file__).resolve().parents[2]


def exported():
    """What its door offers."""
    return gmwm_jax.__all__


def test_type_checkers_see_what_the_door_offers():
    tree = ast.parse((ROOT / "gmwm_jax" / "__init__.py").read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    aliases = [alias for node in block.body for alias in node.names]
    assert all(alias.name == alias.asname for alias in aliases)  # elsewhere it is no export
    assert sorted(alias.name for alias in aliases) == exported()


def test_the_door_opens_when_somebody_goes_through():
    program = "import sys, gmwm_jax; print('jax' in sys.modules, gmwm_jax.fit.__name__, 'jax' in sys.modules)"
    seen = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert seen.stdout.split() == ["False", "fit", "True"]
    with pytest.raises(AttributeError, match="module 'gmwm_jax' has no attribute 'fitt'"):
        gmwm_jax.fitt  # noqa: B018
    assert set(exported()) <= set(dir(gmwm_jax))


def test_every_name_is_documented():
    undocumented = [name for name in exported() if not (getattr(gmwm_jax, name).__doc__ or "").strip()]
    assert not undocumented


def test_every_public_method_is_documented():
    undocumented = [
        f"{name}.{attribute}"
        for name in exported()
        if inspect.isclass(cls := getattr(gmwm_jax, name))
        for attribute, value in vars(cls).items()
        if not attribute.startswith("_") and (inspect.isfunction(value) or isinstance(value, property))
        if not inspect.getdoc(getattr(cls, attribute))
    ]
    assert not undocumented


def test_functions_of_several_parameters_explain_them():
    short = [
        name
        for name in exported()
        if inspect.isfunction(f := getattr(gmwm_jax, name))
        if len(inspect.signature(f).parameters) > 1 and "Parameters\n" not in (inspect.getdoc(f) or "")
    ]
    assert not short


def test_every_name_is_in_the_readme():
    readme = (ROOT / "README.md").read_text()
    missing = [name for name in exported() if f"`{name}`" not in readme and f"`gj.{name}" not in readme]
    assert not missing


def test_the_version_is_that_of_the_project():
    assert f'version = "{gmwm_jax.__version__}"' in (ROOT / "pyproject.toml").read_text()
