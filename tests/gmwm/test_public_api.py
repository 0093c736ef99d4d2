"""What the package offers: every name is explained where it stands, and known to the README."""

import ast
import inspect
from pathlib import Path

import gmwm_jax

ROOT = Path(__file__).resolve().parents[2]


def exported():
    """The names that `__init__` exports: each import written `name as name`."""
    tree = ast.parse((ROOT / "gmwm_jax" / "__init__.py").read_text())
    aliases = [alias for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    return [alias.asname for alias in aliases if alias.name == alias.asname]


def test_every_import_of_the_package_is_an_export():
    tree = ast.parse((ROOT / "gmwm_jax" / "__init__.py").read_text())
    imports = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    names = [alias.asname or alias.name for node in imports for alias in node.names]
    assert sum(not name.startswith("_") for name in names) == len(exported())
    assert len(set(exported())) == len(exported())


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
