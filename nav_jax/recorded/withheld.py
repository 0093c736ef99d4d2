"""What a filter says of fixes that were kept from it: its errors in outages of aiding, simulated on a record."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number

_WITH_PLAN = ("n", "e", "d")
"""Axes, the first of all, of which two are horizontal."""


@saved()
@dataclass(frozen=True, eq=False, repr=False)
class Withheld:
    """Fixes of a sensor in its outages, which were kept from the filter, beside its predictions of them.

    Attributes
    ----------
    time
        s, shape (F,).
    error
        Predicted - measured, shape (F, K).
    covariance
        Of that, as the filter states it, noise of the fixes included, shape (F, K, K).
    axes, unit
        Of the K components.
    outages
        Intervals in which these fixes lie.
    """

    time: Float64[np.ndarray, " F"]
    error: Float64[np.ndarray, "F K"]
    covariance: Float64[np.ndarray, "F K K"]
    axes: tuple[str, ...]
    unit: str
    outages: tuple[tuple[float, float], ...]

    @property
    def nis(self) -> Float64[np.ndarray, " F"]:
        """Normalised squares of the errors; expectation K."""
        return np.einsum("fk,fk->f", self.error, np.linalg.solve(self.covariance, self.error[:, :, None])[:, :, 0])

    @property
    def judged(self) -> list[int]:
        """Components whose norm is the error: the horizontal ones, if there are such, else all."""
        return [0, 1] if self.axes[:3] == _WITH_PLAN else list(range(len(self.axes)))

    @property
    def size(self) -> Float64[np.ndarray, " F"]:
        """Norm of the error, of positions and velocities the horizontal one."""
        return np.linalg.norm(self.error[:, self.judged], axis=1)

    @property
    def claimed(self) -> Float64[np.ndarray, " F"]:
        """Root mean square that the filter states of that error, noise of the fixes included."""
        variances = np.diagonal(self.covariance, axis1=1, axis2=2)
        return np.sqrt(variances[:, self.judged].sum(axis=1))

    def rows(self) -> list[dict[str, float]]:
        """What came of each outage.

        Its ends, the number of fixes in it, the error at the last of them, what the filter states of that, the largest
        error, and the mean normalised square divided by K.
        """
        found = []
        for start, end in self.outages:
            inside = np.flatnonzero((self.time >= start - 1e-6) & (self.time <= end + 1e-6))
            if len(inside):
                last = inside[-1]
                found.append(
                    {
                        "start": start,
                        "end": end,
                        "num_fixes": len(inside),
                        "error": float(self.size[last]),
                        "claimed": float(self.claimed[last]),
                        "most": float(self.size[inside].max()),
                        "nis": float(self.nis[inside].mean() / len(self.axes)),
                    }
                )
        return found

    def __repr__(self) -> str:
        what, unit = "horizontal error" if self.axes[:3] == _WITH_PLAN else "error", self.unit.split(",")[0]
        head = ["from", "to", "fixes", f"{what} at the end [{unit}]", "claimed", "most", f"NIS/{len(self.axes)}"]
        rows = self.rows()
        keys = ("error", "claimed", "most", "nis")
        table = [
            [f"{r['start']:g}", f"{r['end']:g}", str(r["num_fixes"]), *(number(r[k], 4) for k in keys)] for r in rows
        ]
        if len(rows) > 1:
            errors, claims = (np.array([r[k] for r in rows]) for k in ("error", "claimed"))
            table.append(["RMS", "", "", *(number(float(np.sqrt(np.mean(x**2))), 4) for x in (errors, claims)), "", ""])
            table.append(["median", "", "", *(number(float(np.median(x)), 4) for x in (errors, claims)), "", ""])
        return format_table(head, table, left=1)
