"""Named public recordings, fetched once and checked by their SHA-256, and simulated ones.

The files are those of the repository SMAC-Group/imudata; none of them is part of this package. A machine without a
network uses copies: put them into a folder and name it in the environment variable ``GMWM_JAX_DATA``.

Simulated recordings need neither: they are drawn on the spot. The parameter values are estimated with this package from
the wavelet variances published with SMAC-Group/imudata.
"""

import os
import zlib
from collections.abc import Sequence
from pathlib import Path

import jax
import numpy as np

from gmwm_jax._internal.checks import integer, typed_key
from gmwm_jax._internal.memory import FLOAT, require_memory
from gmwm_jax._internal.optional import import_optional
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.datasheet import from_datasheet
from gmwm_jax.processes.registry import parse_model
from gmwm_jax.processes.simulation import bytes_of_draw, simulate
from gmwm_jax.recordings._public_files import KNOWN_FILES, KnownFile, sha256
from gmwm_jax.recordings._sensors import SENSORS, Sensor
from gmwm_jax.recordings.files import read_recording
from gmwm_jax.recordings.recording import Recording

FOLDER_VARIABLE = "GMWM_JAX_DATA"
"""Environment variable that names a folder of files placed by hand."""


def names() -> tuple[str, ...]:
    """Return the names of all data sets.

    Examples
    --------
    >>> "mti-g" in gj.datasets.sensors(), len(gj.datasets.names()) > 0
    (True, True)
    """
    return tuple(known.name for known in KNOWN_FILES)


def info(name: str) -> KnownFile:
    """Return what is documented about a data set: file, rate, channels, units, description, source.

    Raises
    ------
    ValueError
        No data set has this name.

    Examples
    --------
    >>> gj.datasets.info(gj.datasets.names()[0]).rate
    100.0
    """
    for known in KNOWN_FILES:
        if known.name == name:
            return known
    raise ValueError(f"There is no data set {name!r}; there are: {', '.join(names())}.")


def load(name: str) -> Recording:
    """Return a data set as a recording in SI, fetching its file on first use.

    Raises
    ------
    ImportError, OSError, ValueError
        See `fetch` and `gmwm_jax.recordings.files.read_recording`.

    Examples
    --------
    >>> gj.datasets.load("adis_16405_imu1")  # doctest: +SKIP
    >>> gj.datasets.load("nothing")
    Traceback (most recent call last):
    ValueError: There is no data set 'nothing'; there are: ...
    """
    return read_recording(fetch(name), name=name)


def fetch(name: str) -> Path:
    """Return the path of a data set's file: placed by hand, else in the cache, else downloaded into the cache.

    Raises
    ------
    ImportError
        A download needs the extra ``io``.
    OSError
        The download failed; the message says where to put the file by hand.
    ValueError
        No data set has this name, or the file is not the one that is documented.

    Examples
    --------
    >>> path = gj.datasets.fetch("adis_16405_imu1")  # doctest: +SKIP
    >>> gj.datasets.fetch("nothing")
    Traceback (most recent call last):
    ValueError: There is no data set 'nothing'; there are: ...
    """
    known = info(name)
    return _placed(known) or _downloaded(known)


def _placed(known: KnownFile) -> Path | None:
    """Return the file that was placed by hand, if there is one."""
    folder = os.environ.get(FOLDER_VARIABLE)
    file = Path(folder) / known.file if folder else None
    if file is None or not file.is_file():
        return None
    seen = sha256(file)
    if seen != known.sha256:
        raise ValueError(
            f"{file} is not the public file: its SHA-256 is {seen}, and should be {known.sha256}. It was cut short or "
            f"changed on the way; fetch it again from {known.source}{known.file}, or remove it."
        )
    return file


def _downloaded(known: KnownFile) -> Path:
    pooch = import_optional("pooch")
    cache = pooch.create(
        path=pooch.os_cache("gmwm_jax"), base_url=known.source, registry={known.file: f"sha256:{known.sha256}"}
    )
    try:
        return Path(cache.fetch(known.file))
    except OSError as error:  # requests raises subclasses of it
        raise OSError(
            f"{known.file} could not be fetched from {known.source}{known.file} ({error}). Without a network, put the "
            f"file into a folder by hand and name the folder in the environment variable {FOLDER_VARIABLE}."
        ) from error


def sensors() -> tuple[str, ...]:
    """Return the names of the sensors that `simulated` can draw.

    Examples
    --------
    >>> gj.datasets.sensors()
    ('mti-g', ...)
    """
    return tuple(SENSORS)


def sensor_models(sensor: str) -> dict[str, Composite]:
    """Return the noise model of each channel of a sensor (parameters per sample at its own rate, SI).

    Raises
    ------
    ValueError
        No sensor has this name.

    Examples
    --------
    >>> gj.datasets.sensor_models("mti-g")["gyro_x"].labels
    ('RW', 'GM_1', 'GM_2')
    """
    return {channel: parse_model(text) for channel, text in _sensor(sensor).models.items()}


def sensor_rate(sensor: str) -> float:
    """Return the sampling rate of a sensor in Hz, to which its models belong.

    Examples
    --------
    >>> gj.datasets.sensor_rate("mti-g")
    100.0
    """
    return _sensor(sensor).rate


def sensor_datasheet(sensor: str, group: str) -> Composite | None:
    """Return the white noise that a sensor's datasheet promises for ``gyro`` or ``accel``; None if it is silent.

    Examples
    --------
    >>> gj.datasets.sensor_datasheet("mti-g", "gyro").labels
    ('WN',)
    """
    known = _sensor(sensor)
    entries = known.datasheet.get(group)
    return None if entries is None else from_datasheet(entries, known.rate)[0]


def simulated(
    sensor: str,
    num_samples: int = 360_000,
    *,
    key: PRNGKey | None = None,
    channels: Sequence[str] | None = None,
) -> Recording:
    """Draw a static recording of a sensor.

    The parameter values are estimated with this package from the wavelet variances published with SMAC-Group/imudata,
    see `gmwm_jax.recordings._sensors`.

    Parameters
    ----------
    sensor
        ``mti-g``, ``navchip``, ``imar-fsas`` or ``ln200``.
    num_samples
        Length at the sensor's own rate (100, 250, 400, 400 Hz).
    key
        A typed key; ``jax.random.key(0)`` unless told otherwise. Every channel has a stream of its own.
    channels
        Which to draw; all by default.

    Returns
    -------
    Recording
        SI units, named ``simulated mti-g``.

    Raises
    ------
    ValueError
        Unknown sensor or channel.
    TypeError
        The key is an integer or of the old kind.

    Examples
    --------
    >>> gj.datasets.simulated("mti-g", 2000, channels=["gyro_x", "accel_x"]).data.shape
    (2000, 2)
    """
    models = sensor_models(sensor)
    chosen = tuple(models) if channels is None else tuple(channels)
    if not chosen:
        raise ValueError(f"No channel is asked for; {sensor} has {', '.join(models)}.")
    for channel in chosen:
        if channel not in models:
            raise ValueError(f"{sensor} has no channel {channel!r}; it has {', '.join(models)}.")
    key = jax.random.key(0) if key is None else key
    typed_key(key)
    num = integer("num_samples", num_samples, 1)
    kept = 2 * FLOAT * num * len(chosen)  # the columns, and side by side
    most = kept + max(bytes_of_draw(models[c], num) for c in chosen)
    require_memory(most, f"{num} samples of {len(chosen)} channels", "draw fewer samples (num_samples) or channels")
    columns = [
        np.asarray(simulate(models[c], num_samples, key=jax.random.fold_in(key, zlib.crc32(c.encode()))))
        for c in chosen
    ]
    units = tuple("rad/s" if c.startswith("gyro") else "m/s^2" for c in chosen)
    return Recording.from_array(
        np.column_stack(columns), rate=_sensor(sensor).rate, units=units, channels=chosen, name=f"simulated {sensor}"
    )


def _sensor(name: str) -> Sensor:
    if name not in SENSORS:
        raise ValueError(f"There is no sensor {name!r}; there are: {', '.join(SENSORS)}.")
    return SENSORS[name]
