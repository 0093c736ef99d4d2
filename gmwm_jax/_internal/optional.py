"""Packages of an extra, imported at the moment of use."""

import importlib
from typing import Any


def import_optional(module: str, extra: str = "io") -> Any:
    """Import a module that comes with an extra.

    Raises
    ------
    ImportError
        It is not installed; the message says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.split(".")[0]
        raise ImportError(f'This needs the package {package}: pip install "gmwm-jax[{extra}]"') from error
