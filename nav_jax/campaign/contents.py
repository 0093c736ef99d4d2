"""What a store keeps of a chunk of runs: a row of `contents` for each array, as a function of the runs of one filter.

Sums over the runs of a chunk are kept for each chunk by itself, and added in the order of chunks by whoever reads them:
which worker came first changes no bit. Counts of histograms have edges that were fixed before the first run.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64, Integer

from nav_jax.filter.layout import GROUPS, NAVIGATION
from nav_jax.simulation.runs import Runs
from nav_jax.statistics.distributions import chi2_quantile

KEEPS = ("judged", "statistics", "runs")
"""From what needs least room on; each keeps what the ones before it keep, too."""

COVERAGE_LEVEL = 0.95
"""Of the regions that filters claim, whose coverage is counted."""

SIGMAS, BINS = 8.0, 512
EDGES = np.linspace(-SIGMAS, SIGMAS, BINS + 1)
"""Of the histograms of errors over the sigma that the filter claims; what lies beyond is in a bin more a side."""


class Content(NamedTuple):
    """An array of a store: for each run, or summed over the runs of a chunk, and for each filter.

    Attributes
    ----------
    name
        Of the array.
    dims
        Names of its axes after those of the run (or chunk) and the filter.
    per_run
        Whether it has a row for each run; else one for each chunk.
    of
        The rows, of the runs of one filter and the number of its judged epoch.
    """

    name: str
    dims: tuple[str, ...]
    per_run: bool
    of: Callable[[Runs, int], np.ndarray]


def contents(keep: str, runs: Runs) -> list[Content]:
    """List the arrays that are kept, see `KEEPS`; `runs` says which sensors there are."""
    kept = [*_JUDGED]
    if keep != "judged":
        kept += [*_STATISTICS, *(_nis_sum(sensor) for sensor in runs.nis)]
    if keep == "runs":
        kept += [*_RUNS, *(c for sensor in runs.nis for c in _fixes(sensor))]
    return kept


def all_nees(runs: Runs) -> Float64[np.ndarray, "R E G"]:
    """NEES of all groups, NaN for those of which the filter has no states."""
    none = np.full(runs.error.shape[:2], np.nan)
    return np.stack([runs.nees.get(group, none) for group in GROUPS], axis=-1)


def lengths(runs: Runs) -> Float64[np.ndarray, "R E 3"]:
    """Lengths of the errors of position, velocity and attitude of the good runs."""
    return np.stack([np.linalg.norm(runs.errors(b.name), axis=-1) for b in NAVIGATION.blocks], axis=-1)


def histogram(runs: Runs) -> Int64[np.ndarray, "9 bin"]:
    """Count errors over the sigma that the filter claims for them, over all good runs and epochs.

    Where it claims to know (a sigma of zero) nothing is counted.
    """
    error = runs.select(runs.error)[..., : NAVIGATION.size]
    sd = runs.select(runs.sd)[..., : NAVIGATION.size]
    counts = np.zeros((NAVIGATION.size, BINS + 2), np.int64)
    for i in range(NAVIGATION.size):
        known = sd[..., i] > 0
        place = np.searchsorted(EDGES, error[..., i][known] / sd[..., i][known], side="right")
        counts[i] = np.bincount(place, minlength=BINS + 2)
    return counts


def covered(runs: Runs) -> Int64[np.ndarray, "E G"]:
    """Count good runs whose truth lies in the region that the filter claims with the probability `COVERAGE_LEVEL`."""
    limits = [chi2_quantile(COVERAGE_LEVEL, runs.dof[g]) if g in runs.dof else -1.0 for g in GROUPS]
    return (runs.select(all_nees(runs)) <= np.array(limits, float)).sum(axis=0, dtype=np.int64)


def _of_good(values: Callable[[Runs], np.ndarray]) -> Callable[[Runs, int], np.ndarray]:
    """Sum over the good runs, with an axis for the chunk."""
    return lambda runs, _: runs.select(values(runs)).sum(axis=0)[None]


def _status(runs: Runs, _: int) -> Integer[np.ndarray, " R"]:
    return runs.status.astype(np.int64)


_JUDGED = (
    Content("status", (), True, _status),
    Content("error", ("component",), True, lambda r, k: r.error[:, k]),
    Content("sd", ("component",), True, lambda r, k: r.sd[:, k]),
    Content("position_covariance", ("axis", "axis2"), True, lambda r, k: r.position_covariance[:, k]),
    Content("nees", ("group",), True, lambda r, k: all_nees(r)[:, k]),
)
"""Of every run, at the judged epoch."""

_STATISTICS = (
    Content("num_good", (), False, lambda r, _: np.array([r.num_good], np.int64)),
    Content("sum_error", ("time", "component"), False, _of_good(lambda r: r.error)),
    Content("sum_squared_error", ("time", "component"), False, _of_good(lambda r: r.error**2)),
    Content("sum_variance", ("time", "component"), False, _of_good(lambda r: r.sd**2)),
    Content("sum_length", ("time", "block"), False, lambda r, _: lengths(r).sum(axis=0)[None]),
    Content("sum_nees", ("time", "group"), False, _of_good(all_nees)),
    Content("covered", ("time", "group"), False, lambda r, _: covered(r)[None]),
    Content("histogram", ("standardised", "bin"), False, lambda r, _: histogram(r)[None]),
)
"""Of every epoch, over the runs of a chunk."""

_RUNS = (
    Content("all_error", ("time", "component"), True, lambda r, _: r.error),
    Content("all_sd", ("time", "component"), True, lambda r, _: r.sd),
    Content("all_position_covariance", ("time", "axis", "axis2"), True, lambda r, _: r.position_covariance),
    Content("all_nees", ("time", "group"), True, lambda r, _: all_nees(r)),
)
"""Of every run at every epoch."""


def _nis_sum(sensor: str) -> Content:
    return Content(f"sum_nis.{sensor}", (f"{sensor}_time",), False, _of_good(lambda r: r.nis[sensor]))


def _fixes(sensor: str) -> tuple[Content, Content]:
    times = f"{sensor}_time"
    return (
        Content(f"nis.{sensor}", (times,), True, lambda r, _: r.nis[sensor]),
        Content(f"innovation.{sensor}", (times, f"{sensor}_axis"), True, lambda r, _: r.innovation[sensor]),
    )
