"""What several test files share: statistical bands and a counter of traces."""

from collections.abc import Callable
from typing import Any

import numpy as np

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
