"""Which column of a source is which quantity of a trajectory or a record, and in which unit."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gmwm_jax._internal.checks import real_array
from gmwm_jax._internal.columns import Columns, plain_name
from gmwm_jax._internal.imu_names import role_of
from gmwm_jax._internal.stamps import from_text, over_weeks, unwrapped
from gmwm_jax.units import names as units_of
from gmwm_jax.units import size, time_size, written

POSITION = {"ned": ("north", "east", "down"), "geodetic": ("latitude", "longitude", "height")}
ATTITUDE = ("roll", "pitch", "yaw")
VELOCITY = ("velocity_north", "velocity_east", "velocity_down")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
ACCEL = ("accel_x", "accel_y", "accel_z")
LOCAL_UP = ("east", "north", "up")
ECEF = ("ecef_x", "ecef_y", "ecef_z")
VELOCITY_UP = ("velocity_north", "velocity_east", "velocity_up")
POSITION_SD = ("sd_north", "sd_east", "sd_down")
MAGNETIC = ("magnetic_x", "magnetic_y", "magnetic_z")
BASELINE = ("baseline_north", "baseline_east", "baseline_down")
VELOCITY_SD = ("sd_velocity_north", "sd_velocity_east", "sd_velocity_down")
_TRAJECTORY = ("time", *POSITION["ned"], *POSITION["geodetic"], *ATTITUDE, *VELOCITY)

_ALIASES = {
    "time": "t time timestamp",
    "north": "north n x_n pos_n p_n position_north",
    "east": "east e x_e pos_e p_e position_east",
    "down": "down d x_d pos_d p_d position_down",
    "latitude": "latitude lat",
    "longitude": "longitude lon long lng",
    "height": "height alt altitude h ellipsoidal_height",
    "roll": "roll",
    "pitch": "pitch",
    "yaw": "yaw heading",
    "velocity_north": "velocity_north vel_n v_n vn vel_north v_north",
    "velocity_east": "velocity_east vel_e v_e ve vel_east v_east",
    "velocity_down": "velocity_down vel_d v_d vd vel_down v_down",
    "up": "up u pos_u position_up",
    "velocity_up": "velocity_up vel_u v_u vu vel_up v_up",
    **{f"ecef_{axis}": f"ecef_{axis} {axis}_ecef" for axis in "xyz"},
    "sd_north": "sd_north sd_n sdn std_n std_north sigma_n sigma_north",
    "sd_east": "sd_east sd_e sde std_e std_east sigma_e sigma_east",
    "sd_down": "sd_down sd_d sdd std_d std_down sigma_d sigma_down sd_up sd_u sdu std_u std_up sigma_u sd_height",
    "sd_velocity_north": "sd_velocity_north sd_v_n sdvn sd_vn std_vn sigma_vn",
    "sd_velocity_east": "sd_velocity_east sd_v_e sdve sd_ve std_ve sigma_ve",
    "sd_velocity_down": "sd_velocity_down sd_v_d sdvd sd_vd std_vd sigma_vd sd_velocity_up sdvu sd_vu",
    "quality": "quality q fix fix_type fix_quality",
    "satellites": "satellites num_satellites num_sats nsat ns",
    "speed": "speed wheel_speed odometer odometer_speed v_x",
    **{f"magnetic_{axis}": f"magnetic_{axis} mag_{axis} magnetometer_{axis} magnetic_field_{axis}" for axis in "xyz"},
    **{
        f"baseline_{axis}": f"baseline_{axis} baseline_{axis[0]} relpos{axis[0]} rel_pos_{axis[0]} relative_{axis}"
        for axis in ("north", "east", "down")
    },
    **{f"gyro_{axis}": f"gyro_{axis} gyr_{axis} gyroscope_{axis} omega_{axis} w_{axis}" for axis in "xyz"},
    **{f"accel_{axis}": f"accel_{axis} acc_{axis} accelerometer_{axis} f_{axis}" for axis in "xyz"},
}
"""Quantity -> plain names by which it is known, without the unit."""

_SI = {
    "time": "s",
    **dict.fromkeys(("latitude", "longitude", *ATTITUDE), "rad"),
    **dict.fromkeys((*POSITION["ned"], "height", "up", *ECEF, *POSITION_SD, *BASELINE), "m"),
    **dict.fromkeys((*VELOCITY, "velocity_up", "speed", *VELOCITY_SD), "m/s"),
    **dict.fromkeys(("quality", "satellites"), "1"),
    **dict.fromkeys(GYRO, "rad/s"),
    **dict.fromkeys(ACCEL, "m/s^2"),
    **dict.fromkeys(MAGNETIC, "T"),
}
"""Quantity -> the SI unit that measures it."""

_DAY = 86_400
"""s, after which times of the day begin anew."""

_INCREMENTS = {"rad/s": "rad", "m/s^2": "m/s"}
"""SI unit of an inertial sensor -> that of its increments per sample."""


class Reader:
    """The columns of a trajectory in SI.

    Parameters
    ----------
    table
        The source.
    numbers
        Quantity -> number of its column.
    angles, time_unit
        What the caller states, see `nav_jax.trajectory.files.read_trajectory`.

    Raises
    ------
    ValueError
        A unit that is unknown, not stated, or stated twice differently; values that are no finite numbers.
    """

    def __init__(self, table: Columns, numbers: Mapping[str, int], angles: Any, time_unit: str | None):
        self.table, self.numbers, self.time_unit = table, numbers, time_unit
        written = numbers.get("time") if numbers.get("time") in table.text else None
        told = {quantity: i for quantity, i in numbers.items() if i != written}
        self.values = dict(zip(told, table.load(list(told.values())), strict=True))
        if written is not None:
            self.values["time"] = table.load_text(written, from_text)
        by_kind = angles if isinstance(angles, Mapping) else {"position": angles, "attitude": angles}
        if not set(by_kind) <= {"position", "attitude"}:
            raise ValueError(f'angles has the keys "position" and "attitude", and these are {list(by_kind)}.')
        kinds = {"position": ("latitude", "longitude"), "attitude": ATTITUDE}
        self.angles: dict[str, str | None] = {q: by_kind.get(kind) for kind, qs in kinds.items() for q in qs}
        for unit in filter(None, self.angles.values()):
            if unit not in ("rad", "deg"):
                raise ValueError(f'angles is "rad" or "deg", and is {unit!r}.')

    def time(self) -> np.ndarray:
        """Seconds."""
        values = self.values["time"]
        if values.dtype.kind == "M":
            return (values - values[:1]) / np.timedelta64(1, "s")
        if values.dtype.kind == "m":
            return unwrapped(values / np.timedelta64(1, "s"), _DAY)
        stated = self._stated("time")
        if self.time_unit is not None:
            time_size(self.time_unit)  # known
        unit = self._agreed("time", stated, self.time_unit, "time_unit") or "s"
        return over_weeks(real_array("The column of time", values, (None,)) * size(unit, "s"))

    def three(self, names: Sequence[str], *, missing: bool = False) -> np.ndarray:
        """Columns side by side, (N, number of names), in which values may be missing (NaN) where that is said."""
        return np.stack([self._si(name, missing) for name in names], axis=1)

    def sensor(
        self, names: Sequence[str], unit: str | None, argument: str, rate: float = 1.0, count: float = 1.0
    ) -> np.ndarray:
        """The three axes of an inertial sensor side by side, (N, 3), in a unit that is stated here or by the source.

        Increments are multiplied by the rate, counts by their size in the unit.
        """
        si = _SI[names[0]]
        if unit is not None and not any(_measures(unit, known) for known in (si, _INCREMENTS[si])):
            known = (*units_of(si), *units_of(_INCREMENTS[si]))
            raise ValueError(f"{argument} is one of {', '.join(known)}, and is {unit!r}.")
        columns = []
        for name in names:
            agreed = self._agreed(name, self._stated(name), unit, argument)
            if agreed is None:
                raise ValueError(
                    self.table.hint or f"The unit of {name} is not stated: give {argument}. It is never guessed."
                )
            factor = count * (size(agreed, si) if _measures(agreed, si) else size(agreed, _INCREMENTS[si]) * rate)
            columns.append(factor * real_array(f"The column of {name}", self.values[name], (None,)))
        return np.stack(columns, axis=1)

    def _si(self, name: str, missing: bool) -> np.ndarray:
        values = self.values[name]
        gone = np.isnan(values) & missing if values.dtype.kind == "f" else np.zeros(values.shape, dtype=bool)
        values = real_array(f"The column of {name}", np.where(gone, 0.0, values) if gone.any() else values, (None,))
        values = np.where(gone, np.nan, values)
        unit = self._stated(name)
        if _SI[name] != "rad":
            return values * (size(unit, _SI[name]) if unit else 1.0)
        unit = self._agreed(name, unit, self.angles[name] or self.table.angles, "angles")
        if unit is None:
            raise ValueError(
                f'The unit of {name} is not stated: give angles="rad" or angles="deg", or for both kinds of angles as '
                'in {"position": "deg", "attitude": "rad"}. It is never guessed.'
            )
        if size(unit, "rad") == 1.0 and np.abs(values).max(initial=0.0) > 4 * np.pi and name in ("roll", "pitch"):
            raise ValueError(f"The {name} reaches {np.abs(values).max():.4g}, which is no angle in rad but one in deg.")
        return values * size(unit, "rad")

    def _stated(self, quantity: str) -> str | None:
        """The unit that the source states for a quantity, by an attribute or behind its name."""
        if self.table.names is None:
            return None
        name = self.table.names[self.numbers[quantity]]
        if name in self.table.units:
            unit = self.table.units[name]
            if not any(_measures(unit, si) for si in _measured(quantity)):
                known = ", ".join(units_of(_SI[quantity]))
                raise ValueError(f"The unit of {name} is {unit!r}; known are: {known}.")
            return unit
        return _split(quantity, plain_name(name))[1]

    @staticmethod
    def _agreed(name: str, stated: str | None, given: str | None, argument: str) -> str | None:
        if stated and given and _sizes(stated, name) != _sizes(given, name):
            raise ValueError(f"{argument} says that {name} is in {given}, and the source says {stated}.")
        return stated or given


def _measured(quantity: str) -> tuple[str, ...]:
    """SI units of what may stand in a column: of axes of an IMU, also increments."""
    si = _SI[quantity]
    return (si, _INCREMENTS[si]) if quantity in (*GYRO, *ACCEL) else (si,)


def _sizes(unit: str, quantity: str) -> list[float | None]:
    """Size of a unit in each of the SI units that it may measure."""
    return [size(unit, si) if _measures(unit, si) else None for si in _measured(quantity)]


def _measures(unit: str, si: str) -> bool:
    try:
        size(unit, si)
    except ValueError:
        return False
    return True


def _split(quantity: str, name: str) -> tuple[str, str | None]:
    """Divide a plain name into that of a quantity and its unit."""
    words = [word for si in _measured(quantity) for word in written(si)]
    for unit in sorted(words, key=len, reverse=True):
        if name.endswith(f"_{unit}"):
            return name.removesuffix(f"_{unit}"), unit
    return name, None


def choose(table: Columns, position: str | None, columns: Any) -> tuple[str, dict[str, int]]:
    """Return the kind of position, and the number of the column of each quantity.

    Raises
    ------
    ValueError
        The kind is not stated, or twice differently; a column is missing, or two may be the same quantity.
    """
    if position is not None and position not in POSITION:
        raise ValueError(f'position is "ned" or "geodetic", and is {position!r}.')
    if position and table.position and position != table.position:
        raise ValueError(f"position={position!r} was given, and the file says {table.position!r}.")
    system = position or table.position
    found = present(table, columns if isinstance(columns, Mapping) else {}, _TRAJECTORY)
    if system is None:
        fits = [kind for kind, names in POSITION.items() if set(names) <= set(found)]
        if len(fits) != 1:
            raise ValueError(
                'The kind of position is not stated: give position="ned" (north, east, down in m) or "geodetic" '
                f"(latitude, longitude, height). {_seen(table)}"
            )
        system = fits[0]
    order = ("time", *POSITION[system], *ATTITUDE, *VELOCITY)
    if columns is None and table.names is None:
        columns = range(table.count)
    if columns is not None and not isinstance(columns, Mapping):
        picked = [table.number(column) for column in columns]
        if len(picked) not in (7, 10):
            raise ValueError(
                "The columns are time, three of position, roll, pitch, yaw, and perhaps three of velocity: 7 or 10, "
                f"and there are {len(picked)}. Pick them by columns=..."
            )
        return system, dict(zip(order, picked, strict=False))
    missing = [q for q in order[:7] if q not in found]
    if missing:
        raise ValueError(
            f"No column is found for {', '.join(missing)}: name them as in columns={{{missing[0]!r}: ...}}. "
            f"{_seen(table)}"
        )
    velocity = [q for q in VELOCITY if q in found]
    return system, {q: found[q] for q in (*order[:7], *(velocity if len(velocity) == 3 else ()))}


def pick(table: Columns, wanted: Sequence[str], columns: Mapping[str, int | str] | None = None) -> dict[str, int]:
    """Return the number of the column of each quantity: as told, by name, or in this order where there are no names.

    Raises
    ------
    ValueError
        A column is missing, or two may be the same quantity.
    """
    if table.names is None and columns is None:
        if table.count != len(wanted):
            raise ValueError(f"The columns are {', '.join(wanted)}, and there are {table.count}, without names.")
        return {quantity: i for i, quantity in enumerate(wanted)}
    found = present(table, columns or {}, wanted)
    if missing := [q for q in wanted if q not in found]:
        raise ValueError(
            f"No column is found for {', '.join(missing)}: name them as in columns={{{missing[0]!r}: ...}}. "
            f"{_seen(table)}"
        )
    return found


def present(table: Columns, columns: Mapping[str, int | str], wanted: Sequence[str]) -> dict[str, int]:
    """Columns of the quantities that are there."""
    if unknown := [key for key in columns if key not in wanted]:
        raise ValueError(f"columns names {', '.join(unknown)}; the quantities are: {', '.join(wanted)}.")
    told = {key: table.number(column) for key, column in columns.items()}
    if not table.names:
        return told
    # a column that the caller names for one quantity is no other, whatever it is called
    free = ["" if i in told.values() else name for i, name in enumerate(table.names)]
    return _by_name(free, [q for q in wanted if q not in told]) | told


def _by_name(names: Sequence[str], wanted: Sequence[str]) -> dict[str, int]:
    found: dict[str, int] = {}
    for i, name in enumerate(names):
        for quantity in wanted:
            short, unit = _split(quantity, plain_name(name))
            aliases = _ALIASES[quantity].split()
            if short in aliases or (unit and plain_name(name) in aliases) or role_of(short) == quantity:
                if quantity in found:
                    raise ValueError(
                        f"Both {names[found[quantity]]!r} and {name!r} may be the {quantity}: pick one as in "
                        f"columns={{{quantity!r}: {name!r}}}."
                    )
                found[quantity] = i
    return found


def _seen(table: Columns) -> str:
    names = "without names" if table.names is None else ", ".join(table.names)
    return f"The source has {table.count} columns: {names}."
