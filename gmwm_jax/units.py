"""Units: signals, noise densities, datasheet entries, and the way between per-sample and continuous time.

Everything inside the package is SI (rad/s for gyros, m/s^2 for accelerometers). This file is the edge.

A *signal unit* u is ``rad/s``, ``m/s^2`` or ``1`` for sensors of another kind. A noise quantity has a
unit derived from u: a white-noise density is u/sqrt(Hz), a random-walk density u/sqrt(s), quantisation u*s, a drift
u/s, a temperature coefficient u/K. Ratios such as scale factors are in ``ppm`` or ``%``. ``deg/sqrt(h)`` and
``rad/s/sqrt(Hz)`` are the same dimension (1/sqrt(Hz) = sqrt(s)).

Densities are two-sided: white noise of variance sigma2 per sample at rate f has q = sigma2/f over (-f/2, f/2), as IEEE
Std 952 and Kalman filters have it. A one-sided amplitude density sqrt(2 q) is larger by sqrt(2).

Sources: IEEE Std 952-1997, annex C; Farrell et al. (2022), "IMU error state modeling for state estimation and sensor
calibration"; Guerrier et al. (2013).
"""

import math
import re
from functools import cache
from typing import Any, NamedTuple

from gmwm_jax._internal.columns import plain_name
from gmwm_jax._internal.imu_names import role_of

STANDARD_GRAVITY = 9.80665
"""m/s^2, exact by definition (CGPM 1901)."""

SI_SIGNALS = ("rad/s", "m/s^2", "1")
"""Units of signals inside the package."""

_DEG = math.pi / 180.0
_HOUR = 3600.0
_G = STANDARD_GRAVITY


class Unit(NamedTuple):
    """A unit: the SI unit of what it measures, and its size in it."""

    si: str
    factor: float


_ANGLES = {
    "rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": _DEG, "mdeg": 1e-3 * _DEG, "arcmin": _DEG / 60,
    "arcsec": _DEG / 3600,
}  # fmt: skip
_SPEEDS = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1 / 3.6, "ft/s": 0.3048}
_ACCELERATIONS = {
    "m/s^2": 1.0, "mm/s^2": 1e-3, "g": _G, "mg": 1e-3 * _G, "ug": 1e-6 * _G, "mGal": 1e-5,
}  # fmt: skip
_FIELDS = {"T": 1.0, "mT": 1e-3, "uT": 1e-6, "nT": 1e-9, "gauss": 1e-4, "mgauss": 1e-7}
_TIMES = {"s": 1.0, "h": _HOUR}
_LENGTHS = {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3}


def _table() -> dict[str, Unit]:
    units: dict[str, Unit] = {}
    for name, size in _ANGLES.items():
        units[name] = Unit("rad", size)
        units[f"{name}/min"] = Unit("rad/s", size / 60)
        for t, seconds in _TIMES.items():
            units[f"{name}/{t}"] = Unit("rad/s", size / seconds)
            # angle random walk: an angle that grows with the root of time
            units[f"{name}/sqrt({t})"] = Unit("rad/s/sqrt(Hz)", size / math.sqrt(seconds))
            units[f"{name}/{t}/sqrt(Hz)"] = Unit("rad/s/sqrt(Hz)", size / seconds)
            for t2, seconds2 in _TIMES.items():
                units[f"{name}/{t}/sqrt({t2})"] = Unit("rad/s/sqrt(s)", size / seconds / math.sqrt(seconds2))
                units[f"{name}/{t}/{t2}"] = Unit("rad/s^2", size / seconds / seconds2)
        units[f"{name}/s^2"] = Unit("rad/s^2", size)
        units[f"{name}/h^2"] = Unit("rad/s^2", size / _HOUR**2)
        units[f"{name}/s^2/sqrt(Hz)"] = Unit("rad/s/sqrt(s)", size)
    for name, size in _SPEEDS.items():
        units[name] = Unit("m/s", size)
        for t, seconds in _TIMES.items():
            units[f"{name}/sqrt({t})"] = Unit("m/s^2/sqrt(Hz)", size / math.sqrt(seconds))
            units[f"{name}/{t}/sqrt({t})"] = Unit("m/s^2/sqrt(s)", size / seconds / math.sqrt(seconds))
    units["m/s/h"] = Unit("m/s^2", 1 / _HOUR)
    for name, size in _ACCELERATIONS.items():
        units[name] = Unit("m/s^2", size)
        units[f"{name}/sqrt(Hz)"] = Unit("m/s^2/sqrt(Hz)", size)
        for t, seconds in _TIMES.items():
            units[f"{name}/sqrt({t})"] = Unit("m/s^2/sqrt(s)", size / math.sqrt(seconds))
            units[f"{name}/{t}"] = Unit("m/s^3", size / seconds)
    units["m/s^3"] = Unit("m/s^3", 1.0)
    units["m/s^3/sqrt(Hz)"] = Unit("m/s^2/sqrt(s)", 1.0)
    for name, size in _LENGTHS.items():
        units[name] = Unit("m", size)
    for name, size in _FIELDS.items():
        units[name] = Unit("T", size)
    for name, size in {
        "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": _HOUR, "day": 86400.0,
    }.items():  # fmt: skip
        units[name] = Unit("s", size)
    for name, size in {"Hz": 1.0, "1/s": 1.0, "kHz": 1e3, "1/h": 1 / _HOUR}.items():
        units[name] = Unit("1/s", size)
    for name, size in {"1": 1.0, "%": 1e-2, "ppm": 1e-6}.items():
        units[name] = Unit("1", size)
    units["K"] = Unit("K", 1.0)
    # how a sensor depends on acceleration, and on temperature
    units["rad/s/(m/s^2)"] = Unit("rad/s/(m/s^2)", 1.0)
    units |= {f"{name}/g": Unit("rad/s/(m/s^2)", u.factor / _G) for name, u in units.items() if u.si == "rad/s"}
    for kelvin in ("K", "degC"):
        of_sensors = {name: u for name, u in units.items() if u.si in SI_SIGNALS}
        units |= {f"{name}/{kelvin}": Unit(f"{u.si}/K", u.factor) for name, u in of_sensors.items()}
    return units


UNITS: dict[str, Unit] = _table()
"""Every unit name that is understood, with the SI unit of its quantity and the factor to it."""

# Negative powers, told before blanks go.
_POWERS = ((r"\s*[·*\s]\s*s(?:\^|\*\*)?[-−]1\b", "/s"), (r"\s*[·*\s]\s*s(?:\^|\*\*)?[-−]2\b", "/s^2"))

# How people write the same: lower case is not folded, since "mg" and "Mg" or "s" and "S" differ.
_SPELLINGS = (
    ("[µμ]", "u"), ("°", "deg"), ("√", "sqrt"), ("²", "^2"), ("³", "^3"), (r"\*\*", "^"), ("·", "*"), ("dps", "deg/s"),
    (r"(?:sq)?rt\(?(Hz|hr|h|sec|s)\b\)?", r"sqrt(\1)"),  # sqrtHz, rt(h)
    (r"\b(Hz|hr|h|sec|s)\^(?:0?\.5|\(1/2\)|1/2)", r"sqrt(\1)"),  # Hz^0.5
    (r"\bhr(?![a-z])", "h"),
    (r"\bsec(?![a-z])", "s"),
    (r"\b([sh])([23])\b", r"\1^\2"),  # m/s2
    (r"s/s\b", "s^2"),  # m/s/s, but not the start of deg/s/sqrt(Hz)
)  # fmt: skip
"""Regular expressions and what they become, in this order."""

_WORDS = {
    "radian": "rad", "radians": "rad", "degree": "deg", "degrees": "deg", "degrees_north": "deg", "degrees_east": "deg",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m", "sec": "s", "second": "s", "seconds": "s",
    "mps": "m/s", "m_s_1": "m/s", "m_s2": "m/s^2", "rad_s_1": "rad/s", "deg_s_1": "deg/s", "dps": "deg/s",
}  # fmt: skip
"""Words of tables and of the attribute ``units`` of netCDF files, as plain names, and what they mean."""


def unit(name: str) -> Unit:
    """Look up a unit by name.

    Parameters
    ----------
    name
        For example ``deg/h``, ``deg/sqrt(h)``, ``ug/sqrt(Hz)``, ``m/s^2``; ``µ``, ``°``, ``√``, ``hr``, ``m/s2`` and
        their like are read too.

    Raises
    ------
    ValueError
        Unknown unit; the message lists those that look like it.

    Examples
    --------
    >>> gj.units.unit("deg/sqrt(h)").si
    'rad/s/sqrt(Hz)'
    """
    plain = _plain_unit(name)
    if plain in UNITS:
        return UNITS[plain]
    head = plain.split("/")[0]
    near = [u for u in UNITS if u.split("/")[0] == head] or [
        "rad/s", "deg/s", "deg/h", "m/s^2", "g", "mg", "ug", "deg/sqrt(h)", "ug/sqrt(Hz)", "m/s/sqrt(h)",
    ]  # fmt: skip
    raise ValueError(f"Unknown unit {name!r}. Known ones near it: {', '.join(near)}.")


def _plain_unit(name: str) -> str:
    """Return a unit as `UNITS` writes it, if it is one of them."""
    plain = name.replace(" ", "")
    if plain in UNITS:
        return plain
    plain = name.strip()
    for written, meant in _POWERS:
        plain = re.sub(written, meant, plain)
    plain = plain.replace(" ", "")
    for written, meant in _SPELLINGS:
        plain = re.sub(written, meant, plain)
    return plain


def convert(value: Any, source: str, target: str) -> Any:
    """Convert a number or array between two units of the same quantity.

    Parameters
    ----------
    value
        Number or array in `source` units.
    source, target
        Unit names, see `unit`.

    Returns
    -------
    The value in `target` units.

    Raises
    ------
    ValueError
        Unknown unit, or two units that measure different things.

    Examples
    --------
    >>> gj.units.convert(180.0, "deg/s", "rad/s")
    3.14159...
    >>> f'{gj.units.convert(0.15, "deg/sqrt(h)", "rad/s/sqrt(Hz)"):.4e}'
    '4.3633e-05'
    """
    a, b = unit(source), unit(target)
    if a.si != b.si:
        raise ValueError(f"{source} measures {a.si} and {target} measures {b.si}: they cannot be converted.")
    return value * (a.factor / b.factor)


def names(si: str) -> tuple[str, ...]:
    """Return the names of all units that measure the same as an SI unit.

    Examples
    --------
    >>> gj.units.names("s")
    ('s', 'ms', ...)
    """
    return tuple(name for name, unit in UNITS.items() if unit.si == si)


@cache
def written(si: str) -> dict[str, float]:
    """Return how the units of a quantity are written behind the name of a column, and their sizes in SI.

    These are plain names, as ``deg_s`` in ``gyro_x_deg_s``.

    Examples
    --------
    >>> round(gj.units.written("rad/s")["deg_s"], 6)
    0.017453
    """
    words = {word: UNITS[name].factor for word, name in _WORDS.items() if UNITS[name].si == si}
    return {plain_name(name): UNITS[name].factor for name in names(si)} | words


def size(name: str, si: str) -> float:
    """Return the size of a unit in SI, where it may also be a word or stand behind the name of a column.

    Parameters
    ----------
    name
        ``deg/s``, ``deg_s``, ``degrees`` ...
    si
        The SI unit of the quantity.

    Raises
    ------
    ValueError
        Unknown unit, or one that measures something else.

    Examples
    --------
    >>> gj.units.size("deg_s", "rad/s") == gj.units.size("deg/s", "rad/s")
    True
    """
    factor = written(si).get(plain_name(name))
    return convert(1.0, name, si) if factor is None else factor


_BRACKETS = re.compile(r"\s*(?:\[\s*(?:in\s+)?([^\[\]]+?)\s*\]|\(\s*(?:in\s+)?([^()]+?)\s*\))\s*$")
_TIME_NAME = re.compile(r"t|(.*_)?(time|timestamps?|stamps?|tow|clock)(_.*)?")


def of_column(name: str) -> tuple[str, str | None]:
    """Divide the name of a column into the plain name of what it holds and its unit, if the name says one.

    Units stand in brackets, or behind an underscore: of rates always, and of increments and ``g`` where the name is
    that of an axis of a gyro or accelerometer.

    Parameters
    ----------
    name
        As the file writes it.

    Returns
    -------
    The plain name, and the unit as `UNITS` writes it, or None.

    Examples
    --------
    >>> gj.units.of_column("Gyro X [°/s]"), gj.units.of_column("accel_z_mg"), gj.units.of_column("Temp (C)")
    (('gyro_x', 'deg/s'), ('accel_z', 'mg'), ('temp_c', None))
    """
    if found := _BRACKETS.search(name):
        inner = (found[1] or found[2]).strip()
        written = _plain_unit(inner)
        known = written if written in UNITS else _words().get(plain_name(inner))
        if known is not None and UNITS[known].si != "1" and plain_name(name[: found.start()]):
            return plain_name(name[: found.start()]), known
    plain = plain_name(name)
    for word, unit_name in _words().items():
        base = plain.removesuffix(f"_{word}")
        if base and base != plain and _may_end(base, word, UNITS[unit_name].si):
            return base, unit_name
    return plain, None


def _may_end(base: str, word: str, si: str) -> bool:
    """May this word behind the name of a column be its unit?"""
    match role_of(base), si:
        case None, "s":
            return bool(_TIME_NAME.fullmatch(base))
        case None, _:
            return si in ("rad/s", "m/s^2") and ("_" in word or word == "dps")
        case role, _:
            return si in (("rad/s", "rad") if str(role).startswith("gyro") else ("m/s^2", "m/s"))


@cache
def _words() -> dict[str, str]:
    """How units of signals and of time are written behind a name, longest first, and as `UNITS` writes them."""
    words = {
        plain_name(name): name for si in ("s", "rad", "m/s", "rad/s", "m/s^2") for name in names(si) if name != "day"
    }
    words |= {word: name for word, name in _WORDS.items() if UNITS[name].si != "m" and not word.startswith("degrees_")}
    return dict(sorted(words.items(), key=lambda item: -len(item[0])))


def time_size(name: str) -> float:
    """Return the seconds in a unit of a clock; days are none.

    Raises
    ------
    ValueError
        Unknown unit; the message lists those that there are.

    Examples
    --------
    >>> gj.units.time_size("ms")
    0.001
    """
    clocks = [unit for unit in names("s") if unit != "day"]
    if name not in clocks:
        raise ValueError(f"Unknown unit of time {name!r}; it is one of: {', '.join(clocks)}.")
    return UNITS[name].factor


class SignalUnit(NamedTuple):
    """How samples in a unit become the SI signal: times `factor`, and times the rate if they are increments."""

    si: str
    factor: float
    increments: bool


def signal_unit(name: str) -> SignalUnit:
    """Read the unit of a record's samples; the unit itself tells rates from increments.

    ``rad/s``, ``deg/s``, ``deg/h``, ``m/s^2``, ``g``, ``mg``, ``ug`` are rates; ``rad``, ``deg``, ``arcsec``, ``m/s``
    are increments per sample (delta angle, delta velocity) and are multiplied by the sampling rate; ``1`` is a
    dimensionless signal, left as it is.

    Raises
    ------
    ValueError
        Unknown unit, or one that no sensor signal has.

    Examples
    --------
    >>> gj.units.signal_unit("mg").si
    'm/s^2'
    >>> gj.units.signal_unit("deg").increments  # angles are increments of a gyro
    True
    """
    u = unit(name)
    match u.si:
        case "rad/s" | "m/s^2" | "1":
            return SignalUnit(u.si, u.factor, increments=False)
        case "rad" | "m/s":
            return SignalUnit(u.si + "/s" if u.si == "rad" else "m/s^2", u.factor, increments=True)
    raise ValueError(
        f"{name!r} measures {u.si}, which is no sensor signal. Rates: rad/s, deg/s, deg/h, m/s^2, g, mg, ug. "
        "Increments per sample: rad, deg, arcsec, m/s."
    )


_COUNTS = re.compile(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)(?:\s*/\s*(\d[\d.]*(?:[eE][-+]?\d+)?)(?:\^(-?\d+))?)?\s*(.*)")


def counts(text: str) -> tuple[float, str]:
    """Read the size of a count, as ``0.1 deg/s``, ``1/16.4 deg/s`` or ``200/2^31 m/s``.

    Returns
    -------
    The number, and the unit of a signal.

    Raises
    ------
    ValueError
        No number with a unit; a unit that is unknown or no sensor signal.

    Examples
    --------
    >>> gj.units.counts("1/16 deg/s")
    (0.0625, 'deg/s')
    """
    found = _COUNTS.fullmatch(text)
    if found is None or not found[4]:
        raise ValueError(f'The size of a count is a number with a unit, as in "0.1 deg/s", and not {text!r}.')
    signal_unit(found[4])
    return float(found[1]) / float(found[2] or 1) ** int(found[3] or 1), found[4]


def require_si(unit: str) -> None:
    """Raise unless this is the unit of a signal inside the package.

    Examples
    --------
    >>> gj.units.require_si("rad/s")
    >>> gj.units.require_si("deg/s")
    Traceback (most recent call last):
    ValueError: unit is one of rad/s, m/s^2, 1, and is 'deg/s': ...
    """
    if unit not in SI_SIGNALS:
        raise ValueError(
            f"unit is one of {', '.join(SI_SIGNALS)}, and is {unit!r}: Recording.from_array converts samples in others."
        )
