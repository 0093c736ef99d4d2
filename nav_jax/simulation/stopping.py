"""When a Monte Carlo may stop: after enough runs to tell filters apart, or to know means well enough.

Looks are taken at numbers of runs that are fixed beforehand, and each sees the first runs by their numbers, never those
that came first: a decision depends on the keys and on nothing else. Looked at are the lengths of the position error at
the judged epoch, in the runs in which no filter failed.
"""

import abc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float

from gmwm_jax._internal.checks import integer, number, probability
from gmwm_jax._internal.states import saved
from nav_jax.statistics.sequential import mixture_bound, mixture_p, normal_score, spending_bounds, spending_p

_LEAST_LOOK = 16
"""Runs that a first look takes: with fewer, z is hardly normal."""


class AbstractRule(abc.ABC):
    """A rule by which runs stop."""

    text: ClassVar[str] = ""
    """What the command line calls it."""

    @abc.abstractmethod
    def looks(self, most: int) -> tuple[int, ...]:
        """Numbers of runs at which it looks, of `most` at most."""

    @abc.abstractmethod
    def is_enough(self, lengths: Float[np.ndarray, "R L"], looks: Sequence[int], most: int) -> bool:
        """Whether the runs of the last of these looks are enough, of L filters."""

    @abc.abstractmethod
    def said(self, *, early: bool) -> str:
        """What it does to the numbers of a table."""


class AbstractTest(AbstractRule):
    """A rule by which runs stop when the best filter is told apart from all others.

    Each of the m pairs of filters is tested at alpha/m, so that one false claim or more is made with the probability
    alpha at most, whichever filter turns out the best.
    """

    alpha: float

    @abc.abstractmethod
    def bound(self, alpha: float, looks: Sequence[int], most: int) -> float:
        r"""Bound on \|z\| of one pair at the last of these looks."""

    @abc.abstractmethod
    def p(self, z: float, looks: Sequence[int], most: int) -> float:
        """Return the smallest alpha at which a pair crosses its bound at the last of these looks."""

    def is_enough(self, lengths: Float[np.ndarray, "R L"], looks: Sequence[int], most: int) -> bool:
        """Whether the filter with the lowest mean is told apart from every other."""
        L = lengths.shape[1]
        bound = self.bound(2 * self.alpha / (L * (L - 1)), looks, most)
        best = int(np.argmin(lengths.mean(axis=0)))
        return all(score(lengths[:, i] - lengths[:, best]) > bound for i in range(L) if i != best)

    def said(self, *, early: bool) -> str:
        """What it does to the numbers of a table."""
        biased = "after such a stop differences are biased away from zero; " if early else ""
        return f"{biased}intervals of differences and p hold for all looks together"


@saved()
@dataclass(frozen=True)
class Significant(AbstractTest):
    """Stop when the best filter is told apart from all others: a group sequential test with looks at doubling sizes.

    It has nearly the power of one test at the largest number of runs, and clear differences end it after a fraction of
    them. The bounds are `nav_jax.statistics.sequential.spending_bounds`.

    Parameters
    ----------
    alpha
        Probability of a false claim, of all pairs and looks together.
    first
        Number of runs of the first look.

    Raises
    ------
    ValueError
        An alpha that is no probability, fewer than 16 runs.

    Examples
    --------
    >>> nj.simulation.Significant().looks(500)
    (64, 128, 256, 500)
    """

    text: ClassVar[str] = "significant"

    alpha: float = 0.05
    first: int = 64

    def __post_init__(self) -> None:
        probability("alpha", self.alpha)
        integer("first", self.first, _LEAST_LOOK)

    def looks(self, most: int) -> tuple[int, ...]:
        """At doubling numbers of runs, and at the largest."""
        doubling = [self.first]
        while 2 * doubling[-1] < most:
            doubling.append(2 * doubling[-1])
        return (*(n for n in doubling if n < most), most)

    def bound(self, alpha: float, looks: Sequence[int], most: int) -> float:
        """By spending."""
        return float(spending_bounds([n / most for n in looks], alpha)[-1])

    def p(self, z: float, looks: Sequence[int], most: int) -> float:
        """By the same."""
        return spending_p(z, [n / most for n in looks])


@saved()
@dataclass(frozen=True)
class Anytime(AbstractTest):
    """Stop when the best filter is told apart from all others, by a confidence sequence, whatever the largest number.

    It may be looked at as often as one likes, and continued: for what nobody has planned. Where the largest number of
    runs is known, `Significant` finds small differences with fewer of them. The bounds are
    `nav_jax.statistics.sequential.mixture_bound`.

    Parameters
    ----------
    alpha
        Probability of a false claim, of all pairs and looks together.
    every
        Runs between looks.

    Raises
    ------
    ValueError
        An alpha that is no probability, fewer than 16 runs.

    Examples
    --------
    >>> nj.simulation.Anytime().looks(200)
    (64, 128, 192, 200)
    """

    text: ClassVar[str] = "anytime"

    alpha: float = 0.05
    every: int = 64

    def __post_init__(self) -> None:
        probability("alpha", self.alpha)
        integer("every", self.every, _LEAST_LOOK)

    def looks(self, most: int) -> tuple[int, ...]:
        """At every so many runs, and at the largest number."""
        return (*range(self.every, most, self.every), most)

    def bound(self, alpha: float, looks: Sequence[int], most: int) -> float:
        """Of the sequence."""
        return mixture_bound(looks[-1], alpha, made_for=self.alpha)

    def p(self, z: float, looks: Sequence[int], most: int) -> float:
        """Of the same."""
        return mixture_p(z, looks[-1], self.alpha)


@saved()
@dataclass(frozen=True)
class Precision(AbstractRule):
    """Stop when means are known well enough: by their standard errors (Chow & Robbins 1965, Glynn & Whitt 1992).

    The ordinary interval holds after such a stop, since how well a mean is known says nothing of where it lies.

    Parameters
    ----------
    position
        m, the largest standard error of the mean position error of any filter.
    difference
        m, the largest standard error of the mean difference of any two filters in the same runs.
    least
        Number of runs before which it does not stop.
    every
        Runs between looks.

    Raises
    ------
    ValueError
        Neither of the two, one that is not positive, fewer than 16 runs.

    Examples
    --------
    >>> nj.Precision(position=0.01).looks(300)
    (128, 192, 256, 300)
    """

    text: ClassVar[str] = "precise"

    position: float | None = None
    difference: float | None = None
    least: int = 128
    every: int = 64

    def __post_init__(self) -> None:
        if self.position is None and self.difference is None:
            raise ValueError("Precision takes position= or difference=, standard errors in m, or both.")
        for name in ("position", "difference"):
            if getattr(self, name) is not None:
                number(name, getattr(self, name))
        integer("least", self.least, _LEAST_LOOK)
        integer("every", self.every, _LEAST_LOOK)

    def looks(self, most: int) -> tuple[int, ...]:
        """At every so many runs from the least number on, and at the largest."""
        return (*range(self.least, most, self.every), most)

    def is_enough(self, lengths: Float[np.ndarray, "R L"], looks: Sequence[int], most: int) -> bool:
        """Whether all standard errors are as small as that."""
        pairs = combinations(range(lengths.shape[1]), 2)
        of_means = self.position is None or bool(np.all(_se(lengths) <= self.position))
        return of_means and (
            self.difference is None or all(_se(lengths[:, i] - lengths[:, j]) <= self.difference for i, j in pairs)
        )

    def said(self, *, early: bool) -> str:
        """Nothing."""
        return "intervals and p are the ordinary ones"


Rule = Significant | Anytime | Precision
RULES: Mapping[str, type[AbstractTest]] = {rule.text: rule for rule in (Significant, Anytime)}
"""What a text stands for."""


@saved()
@dataclass(frozen=True)
class Stopped:
    """How a rule ended runs.

    Attributes
    ----------
    rule
        It.
    looks
        Numbers of runs at which it has looked, of all filters.
    most
        Largest number of runs.
    early
        Whether it has stopped before that.
    time
        Of the judged epoch, s.
    """

    rule: Rule
    looks: tuple[int, ...]
    most: int
    early: bool
    time: float

    def __str__(self) -> str:
        verb = "stopped" if self.early else "not stopped before the end"
        return f"{verb} by {self.rule}: {self.looks[-1]} of at most {self.most} runs, look {len(self.looks)}"

    def said(self, time: float) -> str:
        """What a table of that time says of it."""
        if time != self.time and isinstance(self.rule, AbstractTest):
            return f"{self}; it looked at {self.time:g} s, and of this time intervals and p are those of one look"
        return f"{self}; {self.rule.said(early=self.early)}"


def rule_of(stop: "Rule | str | None", num_filters: int) -> Rule | None:
    """Return the rule that is meant.

    Raises
    ------
    ValueError
        There is no such rule, or it tells apart filters of which there is one.
    """
    if stop is None:
        return None
    if isinstance(stop, str):
        if stop not in RULES:
            raise ValueError(f"stop is {', '.join(map(repr, RULES))} or Precision(...), and is {stop!r}.")
        stop = RULES[stop]()  # type: ignore[assignment]
    if not isinstance(stop, AbstractRule):
        raise ValueError(f"stop is {', '.join(map(repr, RULES))} or Precision(...), and is {stop!r}.")
    if num_filters < 2 and (isinstance(stop, AbstractTest) or stop.position is None):
        raise ValueError(f"stop={stop!r} compares filters, and there is one: state Precision(position=...).")
    return stop


class Watch:
    """Looks at runs as they come in.

    Parameters
    ----------
    rule
        By which they stop.
    most
        Number of runs beyond which there are none.
    time
        Of the judged epoch, s.
    whole
        Looks are taken at multiples of this number of runs.
    """

    def __init__(self, rule: Rule, most: int, time: float, whole: int = 1):
        self.rule, self.most, self.time = rule, most, time
        rounded = (min(-(-n // whole) * whole, most) for n in rule.looks(most))
        self.looks = tuple(dict.fromkeys(rounded))
        self.held: tuple[int, ...] = ()
        self.ended: Stopped | None = None

    @property
    def next(self) -> int:
        """Number of runs of the next look; of the last one if there is no more."""
        return self.looks[min(len(self.held), len(self.looks) - 1)]

    def look(
        self, num_runs: int, error: Mapping[str, Float[np.ndarray, "_ 3"]], good: Mapping[str, Bool[np.ndarray, " _"]]
    ) -> Stopped | None:
        """Take the looks for which there are runs, until one is enough.

        Parameters
        ----------
        num_runs
            That are there, from the first on.
        error, good
            Position errors at the judged epoch, and which runs have not failed, by filter.
        """
        while self.ended is None and self.next <= num_runs:
            n = self.next
            self.held += (n,)
            lengths = _lengths(n, error, good)
            if len(lengths) > 1 and self.rule.is_enough(lengths, self.held, self.most):
                self.ended = Stopped(self.rule, self.held, self.most, n < self.most, self.time)
            elif n == self.looks[-1]:
                self.ended = Stopped(self.rule, self.held, self.most, False, self.time)
        return self.ended


def score(difference: Float[np.ndarray, " R"]) -> float:
    """The mean over its standard error, as the normal variable that is as improbable as Student's t."""
    mean, se = float(difference.mean()), float(_se(difference))
    t = mean / se if se > 0 else np.copysign(np.inf, mean) if mean else 0.0
    return normal_score(t, len(difference) - 1)


def _lengths(n: int, error: Mapping[str, np.ndarray], good: Mapping[str, np.ndarray]) -> np.ndarray:
    """Lengths of the errors in the first n runs in which no filter failed; filters with less than two do not count."""
    counted = [name for name in error if good[name][:n].sum() >= 2]
    if not counted:
        return np.zeros((0, 0))
    common = np.logical_and.reduce([good[name][:n] for name in counted])
    return np.stack([np.linalg.norm(error[name][:n][common], axis=1) for name in counted], axis=1)


def _se(x: Float[np.ndarray, "R *L"]) -> Float[np.ndarray, "*L"]:
    return np.asarray(x.std(axis=0, ddof=1) / np.sqrt(len(x)))
