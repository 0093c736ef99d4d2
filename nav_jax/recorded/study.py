"""How far off a navigation is after outages of so many seconds, all over a record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.labelled import Arrays, Labelled, Values
from gmwm_jax._internal.progress import Progress, progress_bar
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from nav_jax.aiding.fixes import Fixes
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.imu import Imu
from nav_jax.recorded.navigation import navigate
from nav_jax.recorded.outages import Outages
from nav_jax.statistics.distributions import chi2_quantile

_TIMES = {"schedule": "", "start": "s", "end": "s"}


@saved()
@dataclass(frozen=True, eq=False, repr=False)
class OutageStudy(Drawable, Saved, Labelled):
    """Errors at the ends of simulated outages of a sensor, against the fixes that were withheld.

    Attributes
    ----------
    sensor, unit
        Whose fixes they are, and their unit.
    schedule
        Which of the runs an outage was in, shape (O,).
    start, end
        Of the outages, s, shape (O,).
    error
        Predicted - measured at the last fix in each, north and east where there are such, shape (O, 2) or (O, K).
    covariance
        Of that, as the filter states it, noise of the fix included, shape (O, K, K).
    """

    sensor: str
    unit: str
    schedule: Int64[np.ndarray, " O"]
    start: Float64[np.ndarray, " O"]
    end: Float64[np.ndarray, " O"]
    error: Float64[np.ndarray, "O K"]
    covariance: Float64[np.ndarray, "O K K"]

    @property
    def size(self) -> Float64[np.ndarray, " O"]:
        """Norms of the errors."""
        return np.linalg.norm(self.error, axis=1)

    @property
    def claimed(self) -> Float64[np.ndarray, " O"]:
        """Root mean squares of these norms, as the filter states them."""
        return np.sqrt(np.trace(self.covariance, axis1=1, axis2=2))

    @property
    def nees(self) -> Float64[np.ndarray, " O"]:
        """Normalised squares of the errors; expectation K."""
        return np.einsum("ok,ok->o", self.error, np.linalg.solve(self.covariance, self.error[:, :, None])[:, :, 0])

    @property
    def rms(self) -> float:
        """Of the norms."""
        return float(np.sqrt(np.mean(self.size**2)))

    @property
    def median(self) -> float:
        """Of the norms."""
        return float(np.median(self.size))

    @property
    def mean_nees(self) -> float:
        """The mean normalised square over K: 1 where what is claimed is true."""
        return float(self.nees.mean() / self.error.shape[1])

    @property
    def nees_band(self) -> tuple[float, float]:
        """Where that is with 95 % probability, if errors of different outages are independent."""
        dof = self.error.size
        low, high = (float(chi2_quantile(p, dof)) / dof for p in (0.025, 0.975))
        return low, high

    def _arrays(self) -> Arrays:
        """A row an outage."""
        variables = {name: Values("outage", getattr(self, name), unit) for name, unit in _TIMES.items()}
        sizes = {"error": self.size, "claimed": self.claimed, "nees": self.nees / self.error.shape[1]}
        variables |= {name: Values("outage", x, "" if name == "nees" else self.unit) for name, x in sizes.items()}
        attributes: dict[str, Any] = {"sensor": self.sensor, "rms": self.rms, "median": self.median}
        attributes["mean_nees"] = self.mean_nees
        return Arrays(variables, {"outage": Values("outage", np.arange(len(self.start)))}, attributes, ("outage",))

    def __repr__(self) -> str:
        what = "horizontal error" if self.error.shape[1] == 2 else "error"
        head = ["run", "from", "to", f"{what} [{self.unit}]", "claimed", f"NEES/{self.error.shape[1]}"]
        columns = (self.schedule, self.start, self.end, self.size, self.claimed, self.nees / self.error.shape[1])
        rows = [
            [str(k), f"{a:g}", f"{b:g}", *(number(float(x), 4) for x in rest)]
            for k, a, b, *rest in zip(*columns, strict=True)
        ]
        low, high = self.nees_band
        lines = [
            f"{len(rows)} outages of {self.sensor}, at the last fix of each:",
            format_table(head, rows, left=0),
            f"median {self.median:.3g}, RMS {self.rms:.3g}, 90 % {np.quantile(self.size, 0.9):.3g}, most "
            f"{self.size.max():.3g} {self.unit}; claimed RMS {np.sqrt(np.mean(self.claimed**2)):.3g} {self.unit}",
            f"mean NEES/{self.error.shape[1]} {self.mean_nees:.3g}, 95 % band of independent outages "
            f"[{low:.3g}, {high:.3g}]",
        ]
        return "\n".join(lines)


def outage_study(
    imu: Imu,
    aiding: Sequence[Fixes],
    filter: ImuErrors,
    schedules: Sequence[Outages],
    *,
    sensor: str | None = None,
    progress: Progress = False,
    **options: Any,
) -> OutageStudy:
    """Navigate a record with outages of all receivers, one run a schedule, and judge the end of each outage.

    A schedule whose outages lie far apart gives the filter time to find its errors again; several of them, shifted
    against each other, cover the record.

    Parameters
    ----------
    imu, aiding, filter
        See `navigate`.
    schedules
        Of each run, intervals (start, end) in s, of all receivers; or sensor -> intervals.
    sensor
        Whose fixes judge; the first that has some withheld, unless given.
    progress
        Show a count of the runs (needs the extra ``app``); or a function of what is done and their number.
    options
        Of `navigate`: the start, its uncertainty, the Earth and the steps.

    Raises
    ------
    ValueError
        As of `navigate`; no schedule; no fix of that sensor was withheld.
    RuntimeError
        The filter failed.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=20.0, rate=20.0))  # in place of a recorded drive
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> fixes = nj.Fixes(nj.GnssPosition(horizontal=0.02, vertical=0.02), exact.time[20::20], exact.position[20::20])
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> start["initial"] = nj.InitialUncertainty(position_sd=0.1, velocity_sd=0.1, attitude_sd=0.01)
    >>> study = nj.recorded.outage_study(samples, [fixes], filter, [[(5.0, 8.0)], [(12.0, 15.0)]], **start)
    >>> study.size.shape
    (2,)
    """
    if not len(schedules):
        raise ValueError("Give at least one schedule: a list of intervals (start, end) in s.")
    if options.get("smooth"):
        raise ValueError("An outage study is of the filter: a smoother knows what comes after an outage.")
    rows: list[tuple[Any, ...]] = []
    name = unit = ""
    bar = progress_bar(len(schedules), "run", progress)
    try:
        for k, schedule in enumerate(schedules):
            found = navigate(imu, aiding, filter, outages=schedule, **options).withheld
            name = name or sensor or next(iter(found))
            if name not in found or (isinstance(schedule, Mapping) and name not in schedule):
                raise ValueError(f"No fix of {name} was withheld, only of {', '.join(found)}.")
            w = found[name]
            judged, unit = w.judged, w.unit.partition(",")[0]
            own = schedule[name] if isinstance(schedule, Mapping) else schedule
            for a, b in sorted((float(a), float(b)) for a, b in own):  # and not what the sensor lacks in all runs
                last = np.flatnonzero((w.time > a - 1e-6) & (w.time < b + 1e-6))[-1]
                rows.append((k, a, b, w.error[last, judged], w.covariance[last][np.ix_(judged, judged)]))
            bar.update(1)
    finally:
        bar.close()
    number, start, end, error, covariance = (np.array(column) for column in zip(*rows, strict=True))
    return OutageStudy(name, unit, number, start, end, error, covariance)
