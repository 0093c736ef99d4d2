"""How far long work has come: a bar on a terminal, now and then a line elsewhere, or a call of the user's own."""

import sys
import time
from collections.abc import Callable
from typing import Any, Protocol, TypeAlias, runtime_checkable

Progress: TypeAlias = bool | Callable[[int, int | None], object]
"""Whether to show a bar, or a function that is called with what is done and the total (None: nobody knows).

It is called by the thread that called, and cancels by raising: `KeyboardInterrupt` keeps what is done, as the keyboard
does, and any other exception comes out at the caller.
"""

SECONDS = 30.0
"""Between two lines where there is no terminal."""


@runtime_checkable
class Bar(Protocol):
    """What shows how far the work has come."""

    def update(self, n: int) -> Any:
        """So many more are done."""

    def close(self) -> Any:
        """Nothing more comes."""


class _Silent:
    """A bar that shows nothing."""

    def update(self, n: int) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""


class _Told(_Silent):
    """A bar that somebody else draws."""

    def __init__(self, total: int | None, tell: Callable[[int, int | None], object]):
        self.done, self.total, self.tell = 0, total, tell
        tell(0, total)  # who does not want it any more need not wait for the first part

    def update(self, n: int) -> None:
        """Tell that so many more are done."""
        self.done += n
        self.tell(self.done, self.total)


class _Lines(_Silent):
    """A line from time to time, for a file that is looked at later."""

    def __init__(self, total: int | None, unit: str):
        self.done, self.total, self.unit = 0, total, unit
        self.began = self.last = time.monotonic()

    def update(self, n: int) -> None:
        """Print a line, unless one was printed a short while ago."""
        self.done += n
        now = time.monotonic()
        if now - self.last < SECONDS:
            return
        self.last = now
        of = "" if self.total is None else f" of {self.total}"
        unit = f"{self.unit}s" if len(self.unit) > 1 else self.unit  # a symbol, such as B, has no plural
        print(f"{self.done}{of} {unit} after {now - self.began:.0f} s", file=sys.stderr, flush=True)  # noqa: T201


def progress_bar(total: int | None, unit: str, wanted: Progress) -> Bar:
    """A bar with ``update(n)`` and ``close()``; without a total, a count.

    Raises
    ------
    ImportError
        It is wanted on a terminal or in a notebook, and tqdm is not there.
    """
    if callable(wanted):
        return _Told(total, wanted)
    if not wanted:
        return _Silent()
    # a notebook is no terminal, and shows a bar all the same
    if not sys.stderr.isatty() and "ipykernel" not in sys.modules:
        return _Lines(total, unit)
    try:
        from tqdm import tqdm
    except ImportError as error:
        raise ImportError('A progress bar needs the package tqdm: pip install "gmwm-jax[app]".') from error
    return tqdm(total=total, unit=unit, smoothing=0.1)
