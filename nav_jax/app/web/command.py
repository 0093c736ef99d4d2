"""The way to the page from the command line of this package: that of gmwm_jax, which serves it."""

from collections.abc import Sequence
from typing import Any

import typer

from gmwm_jax.app.cli import app
from nav_jax.app.web.controls import ROOM


def open_page(options: Sequence[str], load: Any) -> None:
    """Serve the page, opened at the room of this package, until an interrupt.

    Parameters
    ----------
    options
        Of ``gmwm-jax app``.
    load
        What has to be done first, see `gmwm_jax._internal.entry.run_command_line`.

    Raises
    ------
    SystemExit
        At its end, or where an option is wrong.
    """
    typer.main.get_command(app)(["app", "--room", ROOM, *options], prog_name="nav-jax", obj=load)
