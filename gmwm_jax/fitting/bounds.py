"""Bounds: what a user knows a parameter to lie between, by name, and what the search makes of it.

A shape is held between two coordinates, an amplitude between two numbers in the linear problem inside. A parameter that
the data push to a bound stays there, and the others are those of the problem in which it is held.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from jax import Array
from jaxtyping import Bool, Float

from gmwm_jax._internal.checks import concrete
from gmwm_jax._internal.host import known, namespace
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.parameter import Parameter

Bounds = Mapping[str, tuple[Any, Any]]
"""Name of a parameter -> the two values, per sample, that it lies between; 0 or infinity where there is none."""


class Box(NamedTuple):
    """Bounds as the search sees them, of components in the order of the problem."""

    coordinates: Float[np.ndarray, "C 2"]
    amplitudes: Float[np.ndarray, "P 2"]
    given_coordinates: Bool[np.ndarray, "C 2"]
    """Which of them are bounds of the user; the others are ends of what a record shows."""
    given_amplitudes: Bool[np.ndarray, "P 2"]
    ends: Float[np.ndarray, "C 2"]
    """Of the coordinates, as far as a record shows them."""
    of_component: tuple[bool, ...]
    """Has it bounds?"""

    def scaled(self, at: Float[np.ndarray, "S C"]) -> Float[Array | np.ndarray, "S C"]:
        """Places between all that a record shows as places in the box: as many starts for a short range as for all."""
        low, high = self.coordinates.T
        shares = (at - self.ends[:, 0]) / (self.ends[:, 1] - self.ends[:, 0])
        return low[None] + shares * (high - low)[None]


def by_component(bounds: Bounds, model: Composite) -> list[dict[str, tuple[Any, Any]]]:
    """The bounds of each component by the name of the parameter.

    Raises
    ------
    ValueError
        An unknown name, a parameter that is held, an empty range or one outside of the parameter's own.
    """
    names = [
        (f"{label} {q.name}", i, p, q)
        for i, (label, p) in enumerate(zip(model.labels, model.processes, strict=True))
        for q in p.parameters
    ]
    unknown = sorted(set(bounds) - {name for name, *_ in names})
    if unknown:
        raise ValueError(f"There is no parameter {unknown[0]!r}; there are {', '.join(name for name, *_ in names)}.")
    found: list[dict[str, tuple[Any, Any]]] = [{} for _ in model.processes]
    for name, i, p, q in names:
        if name in bounds:
            if q.name in p.fixed:
                raise ValueError(f"{name} is held, and has bounds: leave one of the two out.")
            found[i][q.name] = checked(name, bounds[name], q)
    return found


def checked(name: str, ends: tuple[Any, Any], parameter: Parameter) -> tuple[Any, Any]:
    """Both ends of a range, in order and inside of the parameter's own."""
    low, high = ends
    seen = [float(s) for s in (concrete(low), concrete(high)) if s is not None]
    if len(seen) == 2 and not parameter.lower <= seen[0] < seen[1] <= parameter.upper:
        raise ValueError(
            f"{name} lies between two values, the lower one first, within [{parameter.lower:g}, {parameter.upper:g}]; "
            f"given is {ends}."
        )
    return low, high


def box_of(
    processes: tuple[AbstractProcess, ...],
    own: list[dict[str, tuple[Any, Any]]],
    ends: Float[np.ndarray, "C 2"],
    starts: list[int | slice],
) -> Box:
    """The box of a problem.

    Parameters
    ----------
    processes, own
        The components in the order of the problem, and the bounds of each.
    ends
        Of the search coordinates without bounds.
    starts
        Where the coordinates of each component with a free shape stand.
    """
    given_coordinates, given_amplitudes = np.zeros(ends.shape, dtype=bool), np.zeros((len(processes), 2), dtype=bool)
    rows, amplitudes = [list(row) for row in ends], [[0.0, np.inf] for _ in processes]
    for i, (p, bounds) in enumerate(zip(processes, own, strict=True)):
        for q in p.parameters:
            if q.name not in bounds:
                continue
            low, high = bounds[q.name]
            given = [_is_given(low, q.lower), _is_given(high, q.upper)]
            if q is p.parameters[-1]:
                given_amplitudes[i] = given
                amplitudes[i] = [
                    p.amplitude_of(end) if is_given else amplitudes[i][k]
                    for k, (end, is_given) in enumerate(zip((low, high), given, strict=True))
                ]
                continue
            at = starts[i]
            if not isinstance(at, int):
                raise ValueError(
                    f"{p.kind}: its shape parameters are searched for together, and {q.name} has no bounds of its own; "
                    f"its {p.parameters[-1].name} may have."
                )
            line = [
                p.coordinate_from_shape(known(end)) if g else None for end, g in zip((low, high), given, strict=True)
            ]
            rows[at], given_coordinates[at] = _within(line, ends[at], f"{p.kind} {q.name}")
    return Box(
        _array(rows, ends.shape),
        _array(amplitudes, (len(processes), 2)),
        given_coordinates,
        given_amplitudes,
        ends,
        tuple(map(bool, own)),
    )


def _within(line: list[Any], ends: Float[np.ndarray, " 2"], name: str) -> tuple[list[Any], list[bool]]:
    """The ends of a coordinate, and which of them are bounds: not those beyond what a record shows."""
    found: list[Any] = [ends[k] if x is None else x for k, x in enumerate(line)]
    seen = [concrete(x) for x in found]
    if any(s is None for s in seen):
        return found, [x is not None for x in line]
    low, high = (float(s) for s in seen if s is not None)
    if not low < high:
        raise ValueError(f"The bound of {name} lies beyond all that a record of this length can show.")
    if low < ends[1] and high > ends[0]:  # the range of the record is enough, where it is the shorter one
        found = [max(low, float(ends[0])), min(high, float(ends[1]))]
    return found, [x is not None and f == float(s) for x, f, s in zip(line, found, (low, high), strict=True)]


def _is_given(end: Any, none: float) -> bool:
    seen = concrete(end)
    return seen is None or float(seen) != none


def _array(rows: list[list[Any]], shape: tuple[int, int]) -> Any:
    flat = known(*(x for row in rows for x in row))
    return namespace(*flat).stack(flat).reshape(shape) if flat else np.zeros(shape)
