"""What there is to look at without a file of one's own: published wavelet variances, simulated and public recordings.

Of published wavelet variances there are no samples: no series, no robust estimate, no outliers.
"""

import json
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from gmwm_jax.recordings import datasets
from gmwm_jax.variance.wavelet import WaveletVariance, WaveletVariances

_FILE = "wavelet_variances.json"
_UNITS = {"gyro": "rad/s", "accel": "m/s^2"}

PUBLISHED, SIMULATED, PUBLIC = "published", "simulated", "public"
"""Kinds of entries: a wavelet variance, a recording that is drawn, and one that is fetched."""


class Entry(NamedTuple):
    """One thing of the library."""

    kind: str
    name: str
    title: str
    source: str
    has_samples: bool


def entries() -> tuple[Entry, ...]:
    """List all that there is.

    Examples
    --------
    >>> from gmwm_jax.app.web import library
    >>> [e.name for e in library.entries() if e.kind == library.PUBLISHED]
    ['mti-g', 'navchip', 'imar', 'ln200']
    """
    table = _table()
    of_sensor = "Simulated from models estimated from the published wavelet variances"
    return (
        *(Entry(PUBLISHED, name, _title(row), table["source"], False) for name, row in table["sensors"].items()),
        *(Entry(SIMULATED, name, f"{name}, simulated", of_sensor, True) for name in datasets.sensors()),
        *(Entry(PUBLIC, n, datasets.info(n).description, datasets.info(n).source, True) for n in datasets.names()),
    )


def source() -> str:
    """Say where the published wavelet variances are from, and what of it is here.

    Examples
    --------
    >>> from gmwm_jax.app.web import library
    >>> "imudata" in library.source()
    True
    """
    return f"{_table()['source']} Only these numbers are here; the recordings are there, under its terms."


def published(sensor: str) -> WaveletVariances:
    """Return the published wavelet variances of a sensor, in SI.

    Parameters
    ----------
    sensor
        ``mti-g``, ``navchip``, ``imar`` or ``ln200``.

    Raises
    ------
    ValueError
        There is no such sensor.

    Examples
    --------
    >>> from gmwm_jax.app.web import library
    >>> wv = library.published("mti-g")["gyro_x"]
    >>> wv.num_samples, wv.num_scales, f"{wv.variance[0]:.4e}"
    (873684, 18, '2.2128e-05')
    """
    sensors = _table()["sensors"]
    if sensor not in sensors:
        raise ValueError(f"There is no published wavelet variance of {sensor!r}; there are {', '.join(sensors)}.")
    row = sensors[sensor]
    channels = tuple(row["channels"])
    variance, low, high = (
        np.column_stack([row["channels"][c][key] for c in channels]) for key in ("variance", "ci_low", "ci_high")
    )
    return WaveletVariance.from_table(
        2.0 ** np.arange(1, len(variance) + 1),
        variance,
        low,
        high,
        num_samples=row["num_samples"],
        rate=row["rate"],
        unit=[_UNITS[c.split("_")[0]] for c in channels],
        name=f"{row['title']}, published",
        channels=channels,
    )


def _title(row: dict[str, Any]) -> str:
    return f"{row['title']}: {len(row['channels'])} channels at {row['rate']:g} Hz"


@cache
def _table() -> dict[str, Any]:
    return json.loads(files("gmwm_jax.app.web").joinpath(_FILE).read_text())
