"""Doors of packages that open when somebody goes through: until then nothing behind them is loaded.

The help of a command line is there at once, and whoever takes one function does not wait for figures.
"""

import ast
import importlib
import sys
from collections.abc import Callable
from typing import Any


def lazily(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Make the attributes of a package from the imports that its ``__init__`` has under ``if TYPE_CHECKING``.

    Type checkers read these imports, and here they are read too, so that there is one list (as the stubs of the package
    lazy_loader are).

    Parameters
    ----------
    package
        Its name, of which the ``__init__`` is being imported.

    Returns
    -------
    Its ``__getattr__``, ``__dir__`` and ``__all__``.
    """
    door = sys.modules[package]
    origin = _origins(door.__spec__.loader.get_source(package))  # type: ignore[union-attr]
    names = sorted(origin)

    def attribute(name: str) -> Any:
        if name not in origin:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = origin[name]
        found = (
            importlib.import_module(f"{package}.{name}")
            if module == package
            else getattr(importlib.import_module(module), name)
        )
        setattr(door, name, found)  # the next time nobody asks here
        return found

    return attribute, lambda: sorted({*vars(door), *names}), names


def open_wide(package: str) -> None:
    """Load all that is behind the door of a package, if the package itself is imported."""
    door = sys.modules.get(package)
    for name in () if door is None else door.__all__:
        getattr(door, name)


def _origins(source: str) -> dict[str, str]:
    """Name -> module that it is from, of the imports under ``if TYPE_CHECKING``."""
    blocks = (node for node in ast.parse(source).body if isinstance(node, ast.If))
    imports = (i for block in blocks for i in block.body if isinstance(i, ast.ImportFrom))
    return {alias.name: str(i.module) for i in imports for alias in i.names}
