"""What the package offers: every name is explained where it stands."""

import ast
import inspect
from pathlib import Path

import nav_jax

ROOT = Path(__file__).resolve().parents[2]


def exported():
    """The names that `__init__` exports: each import written `name as name`."""
    tree = ast.parse((ROOT / "nav_jax" / "__init__.py").read_text())
    aliases = [alias for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    return [alias.asname for alias in aliases if alias.name == alias.asname]


def test_every_import_of_the_package_is_an_export():
    tree = ast.parse((ROOT / "nav_jax" / "__init__.py").read_text())
    imports = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    names = [alias.asname or alias.name for node in imports for alias in node.names]
    assert sum(not name.startswith("_") for name in names) == len(exported())
    assert len(set(exported())) == len(exported())


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
