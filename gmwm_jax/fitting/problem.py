"""A model as the estimator sees it: what is static, what is searched for, what is held; and the way back."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from gmwm_jax.fitting.search import Layout
from gmwm_jax.processes.base import AbstractProcess, Composite


class Problem(NamedTuple):
    """Components with a shape to search for come first, those of a kind together."""

    processes: tuple[AbstractProcess, ...]
    order: tuple[int, ...]
    """Position of each in the model."""
    layout: Layout
    bounds: Float[np.ndarray, "C 2"]
    shapes: tuple[Any, ...]
    """Of the components whose shape is given."""
    held: Float[np.ndarray, " P"]
    """Amplitudes that are held; 0 for those that are free."""

    @property
    def searched(self) -> tuple[AbstractProcess, ...]:
        """The components with a shape to search for."""
        return self.processes[: self.layout.num_shapes]


def pose(model: Composite, tau_max: float) -> Problem:
    """Pose the problem of estimating a model from spans up to tau_max.

    Raises
    ------
    ValueError
        Some of the shape parameters of a process are held, and others are not.
    """
    kinds = [type(p) for p in model.processes]
    order = sorted(range(len(kinds)), key=lambda i: (not _has_free_shape(model.processes[i]), kinds.index(kinds[i])))
    processes = tuple(model.processes[i] for i in order)
    layout = Layout(
        kinds=tuple(type(p) for p in processes),
        free_shape=tuple(_has_free_shape(p) for p in processes),
        free_amplitude=tuple(p.parameters[-1].name not in p.fixed for p in processes),
    )
    searched, given = processes[: layout.num_shapes], processes[layout.num_shapes :]
    held = [0.0 if free else float(p.amplitude) for p, free in zip(processes, layout.free_amplitude, strict=True)]
    return Problem(
        processes,
        tuple(order),
        layout,
        np.concatenate([np.zeros((0, 2)), *(np.reshape(p.coordinate_bounds(tau_max), (-1, 2)) for p in searched)]),
        tuple(p.shape for p in given),
        np.array(held),
    )


def _has_free_shape(p: AbstractProcess) -> bool:
    names = [q.name for q in p.parameters[:-1]]
    held = [n for n in names if n in p.fixed]
    if held and len(held) < len(names):
        raise ValueError(f"{p.kind}: the coefficients are estimated together. Hold all of {', '.join(names)} or none.")
    return len(held) < len(names)


def slots(problem: Problem, times: Float[np.ndarray, " P"], gone: Any) -> list[int]:
    """For each position in the model, the component (in the order of the problem) that belongs there.

    Components of a kind stand from fast to slow; what has no variance has no correlation time either, and comes last.

    Parameters
    ----------
    problem
        The problem.
    times
        Correlation time of each component.
    gone
        Which of them have no variance.
    """
    placed = [0] * len(problem.order)
    for kind in set(problem.layout.kinds):
        members = [i for i, k in enumerate(problem.layout.kinds) if k is kind]
        ranked = sorted(members, key=lambda i: (bool(gone[i]), float(times[i])))
        for position, member in zip(sorted(problem.order[i] for i in members), ranked, strict=True):
            placed[position] = member
    return placed
