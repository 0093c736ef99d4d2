"""A progress bar, if it is wanted."""

from typing import Any


class _Silent:
    """A progress bar that shows nothing."""

    def update(self, n: int) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""


def progress_bar(total: int | None, unit: str, wanted: bool) -> Any:
    """A bar of tqdm, without a total a count, or one that shows nothing.

    Raises
    ------
    ImportError
        tqdm is not installed.
    """
    if not wanted:
        return _Silent()
    try:
        from tqdm import tqdm
    except ImportError as error:
        raise ImportError('A progress bar needs the package tqdm: pip install "gmwm-jax[app]".') from error
    return tqdm(total=total, unit=unit, smoothing=0.1)
