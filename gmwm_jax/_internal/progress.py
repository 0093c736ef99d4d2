"""A progress bar, if one is wanted."""

from typing import Any


class _Silent:
    """A bar that shows nothing."""

    def update(self, n: int) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""


def progress_bar(total: int | None, unit: str, wanted: bool) -> Any:
    """A bar with ``update(n)`` and ``close()``; without a total, a count.

    Raises
    ------
    ImportError
        It is wanted, and tqdm is not there.
    """
    if not wanted:
        return _Silent()
    try:
        from tqdm import tqdm
    except ImportError as error:
        raise ImportError('A progress bar needs the package tqdm: pip install "gmwm-jax[app]".') from error
    return tqdm(total=total, unit=unit, smoothing=0.1)
