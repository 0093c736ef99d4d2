"""The way into both command lines."""

import importlib
import sys
from collections.abc import Collection

from gmwm_jax._internal.interrupts import leave_when_deaf


def run_command_line(module: str, needs: Collection[str]) -> None:
    """Turn on 64-bit floats and run the command line ``app`` of a module.

    Parameters
    ----------
    module
        Its name.
    needs
        Packages of the extra ``app``, of which one that is missing is named; any other error is not hidden.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
    try:
        cli = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name not in needs:
            raise
        sys.exit(f'The command line needs the package {error.name}: pip install "gmwm-jax[app]".')
    leave_when_deaf()
    cli.app()
