"""``python -m nav_jax`` and the command ``nav-jax``."""

import sys


def main() -> None:
    """Turn on 64-bit floats and run the command line."""
    import jax

    from gmwm_jax._internal.interrupts import leave_when_deaf

    jax.config.update("jax_enable_x64", True)
    try:
        from nav_jax.app.cli import app
    except ModuleNotFoundError as error:
        if error.name not in ("typer", "pydantic"):
            raise
        sys.exit(f'The command line needs the package {error.name}: pip install "gmwm-jax[app]".')
    leave_when_deaf()
    app()


if __name__ == "__main__":
    main()
