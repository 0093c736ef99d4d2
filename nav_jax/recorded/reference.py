"""Errors of a navigation solution against a reference trajectory, and what the filter says of them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from nav_jax.filter.layout import GROUPS, NAVIGATION, QUANTITIES


@saved(not_finite=("nees",))
@dataclass(frozen=True, eq=False, repr=False)
class ReferenceErrors:
    """Estimate - reference at the outputs and fixes that the reference covers.

    Attributes
    ----------
    time
        s, shape (E,).
    error
        Position N, E, D (m), velocity (m/s), attitude (rad, rotation vector in n), shape (E, 9).
    sd
        What the filter says of them, shape (E, 9).
    nees
        Group of states -> normalised squared errors, shape (E,); NaN where the filter claims to know one exactly.
    """

    time: Float64[np.ndarray, " E"]
    error: Float64[np.ndarray, "E 9"]
    sd: Float64[np.ndarray, "E 9"]
    nees: Mapping[str, Float64[np.ndarray, " E"]]

    def rms(self) -> dict[str, tuple[float, float, str]]:
        """Quantity -> root mean square of the error, what is claimed of it, and their unit."""

        def size(x: np.ndarray, at: tuple[int, ...]) -> float:
            return float(np.sqrt(np.mean(np.sum(x[:, list(at)] ** 2, axis=1))))

        return {
            name: (factor * size(self.error, at), factor * size(self.sd, at), unit)
            for name, (at, unit, factor) in QUANTITIES.items()
        }

    def __repr__(self) -> str:
        rows = [[name, unit, number(rms, 4), number(claimed, 4)] for name, (rms, claimed, unit) in self.rms().items()]
        sizes = {g: sum(NAVIGATION.block(b).size for b in GROUPS[g]) for g in self.nees}
        lines = [
            f"Errors against the reference at {len(self.time)} epochs from {self.time[0]:g} to {self.time[-1]:g} s",
            format_table(["", "unit", "rms error", "claimed"], rows, left=2),
            "mean NEES / dof (epochs of one run are not independent): "
            + ", ".join(f"{g} {_mean_of_known(self.nees[g]) / n:.3g}" for g, n in sizes.items()),
        ]
        return "\n".join(lines)


def _mean_of_known(x: np.ndarray) -> float:
    known = x[np.isfinite(x)]
    return float(known.mean()) if len(known) else np.nan
