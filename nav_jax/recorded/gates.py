"""Gates of a record: the limits of its sensors, and what is said of the fixes that they refused."""

import itertools
import warnings
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float64

from gmwm_jax._internal.checks import number
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding
from nav_jax.statistics.distributions import chi2_quantile

Gate = Real | Mapping[str, Real]
"""Probability with which a good fix passes: of all sensors, or sensor -> its own."""

_IN_A_ROW = 5
"""Refused fixes that are no outliers any more, but a filter that is wrong, or a sensor."""


class RefusedFixesWarning(UserWarning):
    """A warning that a gate refuses one fix after the other."""


def limits_of(gate: Gate | None, sensors: Sequence[AbstractAiding]) -> Float64[np.ndarray, " S"] | None:
    """Of each sensor, the normalised innovation squared beyond which its fixes are refused; None without any gate.

    Raises
    ------
    ValueError
        No such sensor, or a probability that is none.
    """
    if gate is None:
        return None
    names = [s.name for s in sensors]
    given = dict(gate) if isinstance(gate, Mapping) else dict.fromkeys(names, gate)
    if unknown := sorted(set(given) - set(names)):
        raise ValueError(f"There is no sensor {unknown[0]!r} for a gate; there are {', '.join(names) or 'none'}.")
    for name, probability in given.items():
        if not 0.5 <= number(f"The gate of {name}", probability) < 1:
            raise ValueError(
                f"The gate of {name} is the probability with which a good fix passes, such as 0.999, from 0.5 to below "
                f"1, and this is {probability!r}."
            )
    return np.array([float(chi2_quantile(given[s.name], len(s.axes))) if s.name in given else np.inf for s in sensors])


def runs_of(refused: Bool[np.ndarray, " F"]) -> list[tuple[int, int]]:
    """First of each row of refused fixes, and their number."""
    rows = [(k, [i for i, _ in group]) for k, group in itertools.groupby(enumerate(refused), lambda x: bool(x[1]))]
    return [(members[0], len(members)) for is_refused, members in rows if is_refused]


def warn_of_rows(name: str, time: Float64[np.ndarray, " F"], refused: Bool[np.ndarray, " F"]) -> None:
    """Warn where so many are refused in a row that they are no outliers."""
    first, most = max(runs_of(refused), key=lambda row: row[1], default=(0, 0))
    if most >= _IN_A_ROW:
        warnings.warn(
            f"The gate refused {most} fixes of {name} in a row from {time[first]:g} s on, and {refused.sum()} of "
            f"{len(time)} in all: either they are wrong for so long, or the filter is wrong and now believes itself. "
            "Look at its innovations without a gate.",
            RefusedFixesWarning,
            stacklevel=3,
        )


def gate_line(name: str, time: Float64[np.ndarray, " F"], refused: Bool[np.ndarray, " F"]) -> str:
    """How many a gate refused, and when."""
    rows = runs_of(refused)
    shown = ", ".join(f"{time[k]:g}" + (f" ({n} in a row)" if n > 1 else "") for k, n in rows[:5])
    text = f"Gate of {name}: {refused.sum()} of {len(time)} fixes refused"
    return text + (f", at {shown}{' and more' if len(rows) > 5 else ''} s" if rows else "")
