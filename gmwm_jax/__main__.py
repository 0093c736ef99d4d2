"""``python -m gmwm_jax`` and the command ``gmwm-jax``."""

from gmwm_jax._internal.entry import run_command_line


def main() -> None:
    """Run the command line."""
    run_command_line("gmwm_jax.app.cli", ("gmwm_jax",), ("typer",))


if __name__ == "__main__":
    main()
