"""What a model selection gives: the candidates in order, which of them are as good as the best, and the simplest."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.fitting.result import Fit, Status
from gmwm_jax.inference._submodels import components
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_REJECTED = 0.01
_SHOWN = 12
"""Candidates in a table, at least."""


@dataclass(frozen=True, repr=False)
class Candidate:
    """One model of a selection.

    Attributes
    ----------
    name
        Its components, as a model text.
    fit
        With the weights that all candidates share.
    num_parameters
        Those that the data determine.
    optimism
        What the objective lacks of its average on other data.
    difference, standard_error
        Of the criterion, to that of the best candidate; see `gmwm_jax.inference._criterion`.
    p_value
        Of the chi-square test of fit: with the covariance under the model itself for those that none is better than,
        under the superset for the others.
    contained_in
        Name of a smaller candidate that is the same, since a component here came out as zero or at a limit; or "".
    worse_than
        Name of the lowest candidate that is significantly better; or "".
    """

    name: str
    fit: Fit
    num_parameters: int
    optimism: float
    difference: float
    standard_error: float
    p_value: float
    contained_in: str = ""
    worse_than: str = ""

    @property
    def objective(self) -> float:
        """Q of the fit."""
        return self.fit.objective

    @property
    def criterion(self) -> float:
        """WVIC = Q + optimism: the average objective on other data of the same sensor. Lower is better."""
        return self.objective + self.optimism

    @property
    def sound(self) -> bool:
        """Is it a model of its own, and is its minimum found?"""
        return not self.contained_in and self.fit.status is Status.converged

    def to_dict(self) -> dict[str, Any]:
        """Numbers and texts for JSON."""
        names = ("name", "num_parameters", "objective", "optimism", "criterion", "difference", "standard_error")
        p_value = float(self.p_value) if np.isfinite(self.p_value) else None
        rest = {
            "p_value": p_value,
            "contained_in": self.contained_in,
            "worse_than": self.worse_than,
            "status": self.fit.status.value,
        }
        return {name: getattr(self, name) for name in names} | rest


@dataclass(frozen=True, repr=False)
class Selection(Mapping[str, Candidate]):
    """Candidates for one channel, the best first; those contained in smaller ones, and failed fits, come last.

    Attributes
    ----------
    superset
        What all candidates are part of.
    candidates
        In order of the criterion.
    level
        A candidate is significantly better than another if an interval of this confidence for their difference does
        not hold zero.
    num_replicates
        From which the optimism is; 0 for theory.
    """

    superset: Fit
    candidates: tuple[Candidate, ...]
    level: float
    num_replicates: int = 0

    def __getitem__(self, model: str | AbstractProcess | Composite) -> Candidate:
        wanted = components(as_model(model))
        for c in self.candidates:
            if components(as_model(c.name)) == wanted:
                return c
        raise KeyError(f"{model} is no candidate; there are {', '.join(self)}.")

    def __iter__(self) -> Iterator[str]:
        return (c.name for c in self.candidates)

    def __len__(self) -> int:
        return len(self.candidates)

    @property
    def best(self) -> Candidate:
        """The lowest criterion."""
        return self.candidates[0]

    @cached_property
    def equivalent(self) -> tuple[Candidate, ...]:
        """The best, and the others than which none is significantly better, from the fewest parameters on."""
        near = [c for c in self.candidates if c.sound and not c.worse_than]
        return tuple(sorted(near, key=lambda c: (c.num_parameters, c.criterion)))

    @property
    def recommended(self) -> Candidate:
        """The simplest of the equivalent models, if possible of those that their own test does not reject at 1 %.

        Of equally simple ones, that with the lower criterion.
        """
        return next((c for c in self.equivalent if not c.p_value < _REJECTED), self.equivalent[0])

    def __repr__(self) -> str:
        """A row a candidate: those equivalent to the best, and the next after them."""
        wv = self.superset.wv
        equivalent = {c.name for c in self.equivalent}
        own = [c for c in self.candidates if c.sound]
        last = max([_SHOWN, *(i + 1 for i, c in enumerate(own) if c.name in equivalent)])
        rows = []
        for c in own[:last]:
            mark = "recommended" if c is self.recommended else "equivalent" if c.name in equivalent else ""
            numbers = (number(c.objective, 6), number(c.optimism, 3), number(c.criterion, 6))
            spread = ("", "") if c is self.best else (number(c.difference, 4), number(c.standard_error, 2))
            rows.append([c.name, str(c.num_parameters), *numbers, *spread, number(c.p_value, 2), mark])
        head = ["model", "parameters", "objective", "optimism", "WVIC", "difference", "its SE", "p of fit", ""]
        how = f"{self.num_replicates} replicates" if self.num_replicates else "theory"
        lines = [
            f"Model selection for {wv.channels[0]} [{self.superset.unit}]: {len(self)} models within "
            f"{' + '.join(self.superset.model.labels)}, {self.superset.weights} weights, optimism by {how}",
            format_table(head, rows),
        ]
        contained = sum(bool(c.contained_in) for c in self.candidates)
        failed = sum(c.fit.status is not Status.converged for c in self.candidates)
        lines += [f"{len(own) - last} more with a higher criterion."] if len(own) > last else []
        lines += [f"{contained} more have a component at zero or at a limit: they are smaller models."] * (
            contained > 0
        )
        lines += [f"{failed} more did not converge."] * (failed > 0)
        if self.recommended.p_value < _REJECTED:
            lines += [f"No model describes every scale: the recommended one has p = {self.recommended.p_value:.2g}."]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain numbers and texts, for JSON."""
        return {
            "channel": self.superset.wv.channels[0],
            "unit": self.superset.unit,
            "weights": self.superset.weights,
            "level": self.level,
            "num_replicates": self.num_replicates,
            "recommended": self.recommended.name,
            "equivalent": [c.name for c in self.equivalent],
            "candidates": [c.to_dict() for c in self.candidates],
            "fit": self.recommended.fit.to_dict(),
        }

    def plot(self) -> "Figure":
        """Differences of the criterion with their intervals, see `gmwm_jax.plotting.selection`."""
        from gmwm_jax.plotting.selection import plot_selection

        return plot_selection(self)


@dataclass(frozen=True, repr=False)
class Selections(Mapping[str, Selection]):
    """Selections for several channels, by name of the channel."""

    selections: tuple[Selection, ...]

    def __getitem__(self, channel: str | int) -> Selection:
        if isinstance(channel, int):
            return self.selections[channel]
        for s in self.selections:
            if s.superset.wv.channels[0] == channel:
                return s
        raise KeyError(f"No channel {channel!r}; there are {', '.join(self)}.")

    def __iter__(self) -> Iterator[str]:
        return (s.superset.wv.channels[0] for s in self.selections)

    def __len__(self) -> int:
        return len(self.selections)

    def __repr__(self) -> str:
        """One row a channel: what is recommended, and how it compares."""
        rows = []
        for channel, s in self.items():
            r = s.recommended
            numbers = [number(r.objective, 6), number(r.criterion, 6), number(r.p_value, 2), str(len(s.equivalent))]
            rows.append([channel, s.superset.unit, r.name, str(r.num_parameters), *numbers, s.best.name])
        head = ["channel", "unit", "recommended", "parameters", "objective", "WVIC", "p of fit", "equivalent", "lowest"]
        return f"Model selections, of {len(self.selections[0])} models each\n{format_table(head, rows, left=3)}"

    def plot(self) -> "Figure":
        """A panel a channel, see `gmwm_jax.plotting.selection`."""
        from gmwm_jax.plotting.selection import plot_selections

        return plot_selections(self)
