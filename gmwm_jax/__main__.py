"""``python -m gmwm_jax`` and the command ``gmwm-jax``."""

import sys


def main() -> None:
    """Turn on 64-bit floats and run the command line."""
    import jax

    jax.config.update("jax_enable_x64", True)
    try:
        from gmwm_jax.app.cli import app
    except ModuleNotFoundError as error:
        if error.name != "typer":
            raise
        sys.exit(f'The command line needs the package {error.name}: pip install "gmwm-jax[app]".')
    app()


if __name__ == "__main__":
    main()
