"""Sub-models of a model, and the smallest model that contains others: positions of components, nothing numeric."""

import itertools
from collections import Counter
from collections.abc import Hashable, Sequence

from gmwm_jax.processes.base import AbstractProcess, Composite

Subset = tuple[int, ...]
"""Positions of the components of a sub-model in its superset."""


def submodels(superset: Composite) -> list[Subset]:
    """All sub-models of a model, from small to large; components that can be swapped count once.

    A component whose amplitude is held is in all of them.
    """
    groups: dict[Hashable, list[int]] = {}
    for i, p in enumerate(superset.processes):
        groups.setdefault(_identity(p), []).append(i)
    choices = [
        [members] if _is_held(superset.processes[members[0]]) else [members[:k] for k in range(len(members) + 1)]
        for members in groups.values()
    ]
    found = [tuple(sorted(itertools.chain(*parts))) for parts in itertools.product(*choices)]
    return sorted((s for s in found if s), key=lambda s: (len(s), s))


def common_superset(models: Sequence[Composite]) -> tuple[Composite, list[Subset]]:
    """The smallest model that contains all of the given ones, and where in it each of them is."""
    processes: list[AbstractProcess] = []
    subsets: list[Subset] = []
    for model in models:
        free = list(range(len(processes)))
        places = []
        for p in model.processes:
            place = next((i for i in free if _identity(processes[i]) == _identity(p)), None)
            if place is None:
                place = len(processes)
                processes.append(p)
            else:
                free.remove(place)
            places.append(place)
        subsets.append(tuple(sorted(places)))
    return Composite(processes), subsets


def components(model: Composite) -> Counter[Hashable]:
    """What a model is made of, whatever the order and the starting values: how often each component."""
    return Counter(_identity(p) for p in model.processes)


def text_of(model: Composite) -> str:
    """A model without starting values, as ``WN + 2*GM``."""
    counts: Counter[str] = Counter()
    for p in model.processes:
        held = ", ".join(f"{name}={float(getattr(p, name)):.6g} fixed" for name in p.fixed)
        counts[f"{p.kind}({held})" if held else p.kind] += 1
    return " + ".join(f"{count}*{name}" if count > 1 else name for name, count in counts.items())


def _identity(p: AbstractProcess) -> Hashable:
    """What tells a component from others: its kind, and the values that are held."""
    return type(p), tuple((name, float(getattr(p, name))) for name in p.fixed)


def _is_held(p: AbstractProcess) -> bool:
    return p.parameters[-1].name in p.fixed
