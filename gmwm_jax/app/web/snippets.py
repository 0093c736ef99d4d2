"""The texts that other filters read, as the page offers them: what there is for these fits, and why another is not.

The texts are those of `gmwm_jax.fitting.exports`: their comments say rate, step, units, and what was left out.
"""

from collections.abc import Sequence
from typing import NamedTuple

from gmwm_jax.fitting.exports.registry import FORMATS, format_of
from gmwm_jax.fitting.result import Fit

_FILES = {
    "kalibr": "imu.yaml",
    "openvins": "kalibr_imu_chain.yaml",
    "vins": "vins_imu.yaml",
    "kf-gins": "kf-gins_imunoise.yaml",
    "pyins": "pyins_noise.py",
    "gtsam": "gtsam_noise.py",
    "px4": "ekf2.params",
    "ros": "imu_covariance.yaml",
    "nav-jax": "fit.json",
}


class Snippet(NamedTuple):
    """One format: its text, or why there is none."""

    format: str
    title: str
    file: str
    text: str
    reason: str
    """Why there is no text; "" where there is one."""


def formats() -> dict[str, str]:
    """Return format -> title, in the order of the page.

    Examples
    --------
    >>> from gmwm_jax.app.web import snippets
    >>> snippets.formats()["px4"]
    'PX4'
    """
    return {name: known.title for name, known in FORMATS.items()}


def snippet(fits: Sequence[Fit], format: str, *, rate: float | None = None, step: float | None = None) -> Snippet:
    """Write the noise of several channels for another filter.

    Parameters
    ----------
    fits
        Of gyros and accelerometers, told apart by their units.
    format
        One of `formats`.
    rate
        Sampling rate in Hz, if the data do not know theirs.
    step
        Of the filter in seconds, by default that of the filter as it comes, or else the sampling interval.

    Returns
    -------
    Snippet
        With a reason in place of the text where the format does not suit these fits.

    Raises
    ------
    ValueError
        There is no format of this name.

    Examples
    --------
    >>> from gmwm_jax.app.web import snippets
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["gyro_x"]))
    >>> snippets.snippet([gj.fit(wv, "WN + RW")], "kalibr").reason
    'Kalibr wants gyros and accelerometers, ...'
    """
    title, file = format_of(format).title, _FILES[format]
    if not fits:
        return Snippet(format, title, file, "", "There is no fit yet.")
    try:
        return Snippet(format, title, file, Fit.export_of(fits, format, rate=rate, step=step), "")
    except ValueError as error:
        return Snippet(format, title, file, "", str(error))


def snippets(fits: Sequence[Fit], *, rate: float | None = None, step: float | None = None) -> tuple[Snippet, ...]:
    """Write all formats, see `snippet`."""
    return tuple(snippet(fits, name, rate=rate, step=step) for name in FORMATS)
