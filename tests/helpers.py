"""What several test files share: statistical bands, a counter of traces, and when two results are the same."""

from collections.abc import Callable
from typing import Any

import numpy as np

from gmwm_jax._internal.states import to_state

SIGMAS = 4.5
"""Half width of every statistical band: one correct value in 150 000 lies outside."""


def assert_mean(draws: Any, expected: Any, *, sigmas: float = SIGMAS, atol: float = 0.0) -> float:
    """The mean over axis 0 of independent draws equals the expectation within `sigmas` of its standard error.

    The standard error is the empirical one, so that nothing about the distribution is assumed. `atol` is for
    quantities without any scatter (a mean of a drift), where only rounding is left. How far off the worst is, in
    standard errors, is returned.
    """
    draws = np.asarray(draws)
    error = np.std(draws, axis=0, ddof=1) / np.sqrt(draws.shape[0])
    off = np.abs(np.mean(draws, axis=0) - np.asarray(expected))
    with np.errstate(divide="ignore", invalid="ignore"):
        worst = np.max(np.where(off <= atol, 0.0, off / error))
    assert worst <= sigmas, f"the mean of {draws.shape[0]} draws is {worst:.2f} standard errors off ({sigmas} allowed)"
    return float(worst)


def assert_covariance(a: Any, b: Any, expected: Any, *, mean_a: Any = 0.0, mean_b: Any = 0.0) -> float:
    """The mean of (a - mean_a)(b - mean_b) over axis 0 equals the expected covariance within the band."""
    return assert_mean((np.asarray(a) - mean_a) * (np.asarray(b) - mean_b), expected)


class CountTraces:
    """A function that counts how often Python runs it: under jit, once a trace."""

    def __init__(self, function: Callable[..., Any]):
        self.function = function
        self.count = 0

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        self.count += 1
        return self.function(*args, **kwargs)


def assert_same_result(found, given):
    """Same class, same text, and every number of the state to the last bit."""
    assert type(found) is type(given)
    assert repr(found) == repr(given)
    a, b = to_state(found), to_state(given)
    assert a.tree == b.tree
    assert list(a.arrays) == list(b.arrays)
    for name, array in b.arrays.items():
        assert a.arrays[name].dtype == array.dtype
        assert a.arrays[name].shape == array.shape
        assert a.arrays[name].tobytes() == array.tobytes()


def arrays_of(data):
    """The arrays of figures, in their order."""
    if isinstance(data, np.ndarray):
        return [data]
    parts = data.values() if isinstance(data, dict) else data if isinstance(data, list | tuple) else []
    return [array for part in parts for array in arrays_of(part)]


class Told:
    """A function for ``progress=``, which keeps what it is told, and raises `error` when `most` is done."""

    def __init__(self, most: int | None = None, error: type[BaseException] = LookupError):
        self.heard: list[tuple[int, int | None]] = []
        self.most, self.error = most, error

    def __call__(self, done: int, total: int | None) -> None:
        """Hear it."""
        self.heard.append((done, total))
        if self.most is not None and done >= self.most:
            raise self.error("enough")

    def assert_whole(self, total: int | None, at_least: int = 2) -> None:
        """It was told from the start to the end, in order."""
        done = [heard for heard, _ in self.heard]
        assert done[0] == 0
        assert done == sorted(set(done))
        assert len(done) >= at_least
        assert {of for _, of in self.heard} == {total}
        assert total is None or done[-1] == total
