"""The fixes of a GNSS receiver as they were recorded: what they become for a filter."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from gmwm_jax._internal.text_table import format_table
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.gnss import AbstractNed, Gnss, GnssPosition, GnssVelocity
from nav_jax.recorded.gnss.raw import Matrices

_ARRAYS = ("time", "position", "covariance", "velocity", "velocity_covariance", "quality", "satellites", "age")


@dataclass(frozen=True, eq=False, repr=False)
class GnssRecord:
    """F fixes of a receiver, see `read_gnss`.

    Attributes
    ----------
    time
        s, on `clock`, shape (F,).
    position
        North, east, down in m in the tangent frame at `origin`, shape (F, 3).
    origin
        Latitude, longitude (rad) and height (m); None where the file has local coordinates about it knows not what.
    covariance
        Of each position, m^2, shape (F, 3, 3); None where the file says nothing of it.
    velocity
        North, east, down in m/s, shape (F, 3), NaN where there is none; None where no fix has one.
    velocity_covariance
        Shape (F, 3, 3), or None.
    quality
        As the file numbers it, shape (F,), or None.
    kinds
        Quality -> what it means in that format.
    satellites, age
        Number of satellites, and age of the corrections in s, shape (F,), or None.
    clock
        What `time` counts.
    height
        Above which heights are: ``ellipsoid`` or ``geoid``.
    utc
        UTC at time zero of the clock, to the microsecond, as of the first fix; None where the file knows no date.
    name
        Of the file.
    """

    time: Float64[np.ndarray, " F"]
    position: Float64[np.ndarray, "F 3"]
    origin: Float64[np.ndarray, "3"] | None = None
    covariance: Matrices | None = None
    velocity: Float64[np.ndarray, "F 3"] | None = None
    velocity_covariance: Matrices | None = None
    quality: Int64[np.ndarray, " F"] | None = None
    kinds: Mapping[int, str] = field(default_factory=dict)
    satellites: Float64[np.ndarray, " F"] | None = None
    age: Float64[np.ndarray, " F"] | None = None
    clock: str = ""
    height: str = "ellipsoid"
    utc: np.datetime64 | None = None
    name: str = ""

    def __len__(self) -> int:
        return len(self.time)

    def select(self, rows: Bool[np.ndarray, " F"] | Int64[np.ndarray, " n"] | slice) -> "GnssRecord":
        """Some of the fixes.

        Examples
        --------
        >>> drive = nj.recorded.GnssRecord(np.arange(4.0), np.zeros((4, 3)), quality=np.array([1, 5, 2, 1]))
        >>> drive.select(drive.time < 2.0).quality.tolist()
        [1, 5]
        """
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        return replace(self, **{name: None if a is None else a[rows] for name, a in arrays.items()})

    def without(self, *quality: int | str) -> "GnssRecord":
        """All fixes but those of some qualities, by their numbers or by what they mean.

        Raises
        ------
        ValueError
            The file has no quality, or the format knows no such one; no fix is left.

        Examples
        --------
        >>> drive = nj.recorded.GnssRecord(np.arange(4.0), np.zeros((4, 3)), quality=np.array([1, 5, 2, 1]))
        >>> drive.without(5, 2).time.tolist()
        [0.0, 3.0]
        """
        if self.quality is None:
            raise ValueError(
                f"The fixes{f' of {self.name}' * bool(self.name)} have no quality by which to leave some out."
            )
        numbers = {name: number for number, name in self.kinds.items()}
        if unknown := [q for q in quality if isinstance(q, str) and q not in numbers]:
            raise ValueError(f"There is no quality {unknown[0]!r}; there are {self._listed()}.")
        left = ~np.isin(self.quality, [numbers[q] if isinstance(q, str) else q for q in quality])
        if not left.any():
            raise ValueError(f"All {len(self)} fixes have one of the qualities {', '.join(map(str, quality))}.")
        return self.select(left)

    def shifted(self, seconds: Real) -> "GnssRecord":
        """The same fixes so many seconds later, as on the clock of an IMU that is ahead of theirs."""
        later = np.timedelta64(round(1e6 * float(seconds)), "us")
        return replace(self, time=self.time + float(seconds), utc=None if self.utc is None else self.utc - later)

    def position_fixes(
        self,
        *,
        horizontal: Any = None,
        vertical: Any = None,
        sd_factor: Real = 1.0,
        correlated: bool = True,
        **sensor: Any,
    ) -> Fixes:
        """What a filter takes of the positions.

        Parameters
        ----------
        horizontal, vertical
            Standard deviations in m, in place of those of the file; needed where it has none.
        sd_factor
            By which those of the file are multiplied: receivers are seldom right about themselves.
        correlated
            Whether the correlations of north, east and down of the file are believed too.
        **sensor
            Arguments of `GnssPosition`, such as lever_arm, lever_arm_sd, time_offset_sd, drift, outages and name; its
            rate is that of the fixes, the reciprocal of their median step.

        Raises
        ------
        ValueError
            Standard deviations that are missing, or that make no covariance; what `GnssPosition` and `Fixes` refuse.

        Examples
        --------
        >>> drive = nj.recorded.GnssRecord(np.arange(4.0), np.zeros((4, 3)), covariance=np.tile(np.eye(3), (4, 1, 1)))
        >>> drive.position_fixes(outages=[(1.0, 2.0)]).given.tolist()
        [True, False, False, True]
        """
        own = {"horizontal": horizontal, "vertical": vertical, "sd_factor": sd_factor, "correlated": correlated}
        return _fixes(GnssPosition, self.time, self.position, self.covariance, own, sensor)

    def fixes(
        self, position: Mapping[str, Any] | None = None, velocity: Mapping[str, Any] | None = None, **sensor: Any
    ) -> Fixes:
        """What a filter takes of positions and velocities together: of one receiver, with one antenna and one clock.

        Fixes without a velocity are left out.

        Parameters
        ----------
        position, velocity
            Arguments of `position_fixes` and `velocity_fixes` that say how good they are: horizontal, vertical,
            sd_factor, correlated.
        **sensor
            Arguments of `Gnss`, such as lever_arm, lever_arm_sd, time_offset_sd, averaged, drift, outages and name.

        Raises
        ------
        ValueError
            As of these two.

        Examples
        --------
        >>> drive = nj.recorded.GnssRecord(np.arange(4.0), np.zeros((4, 3)), velocity=np.zeros((4, 3)))
        >>> sd = {"horizontal": 0.1, "vertical": 0.2}
        >>> drive.fixes(sd, sd, time_offset_sd=0.1).value.shape
        (4, 6)
        """
        v = self.velocity_fixes(**(velocity or {}))
        p = self.select(np.isin(self.time, v.time)).position_fixes(**(position or {}))
        C = np.zeros((len(v.time), 6, 6))
        for part, fixes in ((slice(3), p), (slice(3, 6), v)):
            known = fixes.covariance
            C[:, part, part] = np.diag(np.asarray(fixes.sensor.believed) ** 2) if known is None else known
        sd = np.concatenate([np.asarray(f.sensor.believed) for f in (p, v)])
        names = ("horizontal", "vertical", "horizontal_velocity", "vertical_velocity")
        nominal = Gnss(_rate(v.time), **dict(zip(names, sd[[0, 2, 3, 5]].tolist(), strict=True)), **sensor)
        same = p.covariance is None and v.covariance is None
        return Fixes(nominal, v.time, np.concatenate([p.value, v.value], axis=1), None if same else C)

    def velocity_fixes(
        self,
        *,
        horizontal: Any = None,
        vertical: Any = None,
        sd_factor: Real = 1.0,
        correlated: bool = True,
        **sensor: Any,
    ) -> Fixes:
        """What a filter takes of the velocities; parameters and errors as of `position_fixes`, in m/s.

        Fixes without a velocity are left out. Where a file knows only the horizontal one (NMEA), the vertical one is
        taken for zero with the standard deviation `vertical`.

        Examples
        --------
        >>> drive = nj.recorded.GnssRecord(np.arange(4.0), np.zeros((4, 3)), velocity=np.zeros((4, 3)))
        >>> drive.velocity_fixes(horizontal=0.1, vertical=0.2).value.shape
        (4, 3)
        """
        if self.velocity is None:
            raise ValueError(f"The fixes{f' of {self.name}' * bool(self.name)} have no velocity.")
        there = np.isfinite(self.velocity[:, :2]).all(axis=1)
        v = self.velocity[there]
        if np.isnan(v[:, 2]).any():
            if vertical is None:
                raise ValueError(
                    "The file has no vertical velocity: give vertical=..., the standard deviation with which it is "
                    "taken for zero."
                )
            v = np.where(np.isnan(v), 0.0, v)
        C = None if self.velocity_covariance is None else self.velocity_covariance[there]
        own = {"horizontal": horizontal, "vertical": vertical, "sd_factor": sd_factor, "correlated": correlated}
        return _fixes(GnssVelocity, self.time[there], v, C, own, sensor)

    def _listed(self) -> str:
        return ", ".join(f"{number} ({name})" for number, name in self.kinds.items())

    def __repr__(self) -> str:
        if not len(self):
            return "GnssRecord: no fix"
        steps = np.diff(self.time)
        usual = np.median(steps) if len(steps) else np.nan
        of = f" of {self.name}" * bool(self.name)
        lines = [
            f"GnssRecord: {len(self)} fixes{of} from {self.time[0]:.10g} to {self.time[-1]:.10g} s "
            f"({self.clock or 'clock unknown'}), every {usual:g} s"
        ]
        if self.origin is not None:
            lat, lon, h = np.rad2deg(self.origin[0]), np.rad2deg(self.origin[1]), self.origin[2]
            lines.append(f"origin {lat:.8f}, {lon:.8f} deg, {h:.3f} m above the {self.height}")
        rows = []
        for label, values, C in (
            ("position", self.position, self.covariance),
            ("velocity", self.velocity, self.velocity_covariance),
        ):
            if values is None:
                continue
            unit = {"position": "m", "velocity": "m/s"}[label]
            rows += [[f"{label} least", unit, *_short(np.nanmin(values, axis=0))],
                     [f"{label} most", unit, *_short(np.nanmax(values, axis=0))]]  # fmt: skip
            if C is not None:
                sd = np.sqrt(np.median(np.diagonal(C, axis1=1, axis2=2), axis=0))
                rows.append([f"{label} sd, median", unit, *_short(sd)])
        lines.append(format_table(["", "unit", "N", "E", "D"], rows, left=2))
        if self.quality is not None:
            counts = zip(*np.unique(self.quality, return_counts=True), strict=True)
            lines.append("quality: " + ", ".join(f"{n} x {q} ({self.kinds.get(int(q), 'unknown')})" for q, n in counts))
        return "\n".join(lines)


def _short(values: np.ndarray) -> list[str]:
    return ["" if np.isnan(x) else f"{x:.4g}" for x in values]


def _rate(time: np.ndarray) -> float:
    """Of fixes, Hz."""
    return float(1 / np.median(np.diff(time))) if len(time) > 1 else 1.0


def _fixes(
    sensor: type[AbstractNed],
    time: np.ndarray,
    value: np.ndarray,
    covariance: np.ndarray | None,
    own: Mapping[str, Any],
    options: Mapping[str, Any],
) -> Fixes:
    """Fixes with the covariances of the file, where no standard deviations are given in their place."""
    sd = {name: own[name] for name in ("horizontal", "vertical")}
    label, options = options.get("name") or sensor.default_name, {"rate": _rate(time), **options}
    if None not in sd.values():
        return Fixes(sensor(**sd, **options), time, value)
    if covariance is None:
        missing = " and ".join(name for name, given in sd.items() if given is None)
        raise ValueError(f"{label}: the file has no standard deviations; give {missing}.")
    C = covariance if own["correlated"] else covariance * np.eye(3)
    # what is given takes the place of that of the file, and is independent of the rest
    for given, rows in ((sd["horizontal"], (0, 1)), (sd["vertical"], (2,))):
        if given is not None:
            C = C.copy()
            for i in rows:
                C[:, i, :] = C[:, :, i] = 0.0
                C[:, i, i] = (float(given) / float(own["sd_factor"])) ** 2
    C = C * float(own["sd_factor"]) ** 2
    usual = np.sqrt(np.median(np.diagonal(C, axis1=1, axis2=2), axis=0))
    if not (usual > 0).all():
        raise ValueError(f"{label}: the standard deviations of the file are zero: give horizontal and vertical.")
    nominal = sensor(horizontal=usual[:2].mean(), vertical=usual[2], **options)
    return Fixes(nominal, time, value, C)
