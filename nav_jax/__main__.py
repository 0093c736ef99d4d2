"""``python -m nav_jax`` and the command ``nav-jax``."""

from gmwm_jax._internal.entry import run_command_line


def main() -> None:
    """Run the command line; most of its time is spent in loops over the steps of filters."""
    run_command_line("nav_jax.app.cli", ("gmwm_jax", "nav_jax"), ("typer", "pydantic"), loops=True)


if __name__ == "__main__":
    main()
