"""Steps of the tutorial that are done in this room: a filter that believes another model, and what is left out.

Nothing here is a stored result but what is printed: a share of 0.7 of 500 runs, in a band that is normal there and
exact here.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gmwm_jax.app.web.rooms.room import Step
from gmwm_jax.app.web.tables import Table
from nav_jax.app.web import tables
from nav_jax.app.web.controls import ROOM
from nav_jax.app.web.state import NavigationState
from nav_jax.app.web.study import RIGHT, config_of_text, tables_of, toml_of
from nav_jax.imu.errors import ImuErrors
from nav_jax.lincov.analysis import Analysis, analyse
from nav_jax.statistics.distributions import binomial_band, normal_quantile

SHARE, NUM_RUNS = 0.70, 500
"""The coverage that is printed, in as many runs as its printed band, 66 to 74 %, is of."""

_ACCEL, _GYRO = "WN(sigma2=6e-5)", "WN(sigma2=4.926494e-05)"
EMULATED: Mapping[str, Any] = {
    "nav_truth": "text",
    "nav_page": False,
    "nav_structures": "",
    "nav_accel": f"{_ACCEL} + GM(beta=1.8e-3, variance=5e-8)",
    "nav_gyro": f"{_GYRO} + GM(beta=1.688923e-03, variance=1.190042e-07)",
    "nav_own_accel": _ACCEL,
    "nav_own_gyro": _GYRO,
    "nav_run_num_runs": str(NUM_RUNS),
}
"""White noise and one Gauss-Markov process on each axis, those of the gyros as they are printed, and a filter that
believes in white noise alone."""

NAMED: Mapping[str, Mapping[str, Any]] = {
    "as above": {},
    "initial errors": {
        "nav_start_position_sd": "1", "nav_start_velocity_sd": "0.1", "nav_start_attitude_sd": "[0.02, 0.02, 0.05]",
    },
    "a constant bias": {"nav_accel_bias": "0.02", "nav_gyro_bias": "1e-4"},
    "scale factors": {"nav_scale_factor_accel_sd": "2000 ppm", "nav_scale_factor_gyro_sd": "2000 ppm"},
    "axes not orthogonal": {"nav_misalignment_accel_sd": "2 mrad", "nav_misalignment_gyro_sd": "2 mrad"},
    "gravity anomalies": {
        "nav_gravity_deflection": "8 arcsec", "nav_gravity_anomaly": "40 mGal", "nav_gravity_distance": "20 km",
    },
}  # fmt: skip
"""What the example names as left out, and the inputs that switch it on."""


def band() -> str:
    """Say in which band the coverage of a right filter lies.

    Examples
    --------
    >>> from nav_jax.app.web.steps import band
    >>> print(band())
    Printed: [66 %, 74 %] about 70 %, by 0.7 +- 1.96 sqrt(0.7 0.3 / 500); the exact binomial band is [66.0 %, 74.0 %].
    """
    half = normal_quantile(0.95) * np.sqrt(SHARE * (1 - SHARE) / NUM_RUNS)
    low, high = binomial_band(NUM_RUNS, SHARE, 0.95)
    return (
        f"Printed: [{SHARE - half:.0%}, {SHARE + half:.0%}] about {SHARE:.0%}, by {SHARE:g} +- 1.96 sqrt({SHARE:g} "
        f"{1 - SHARE:g} / {NUM_RUNS}); the exact binomial band is [{low:.1%}, {high:.1%}]."
    ).replace("%", " %")


def compared() -> Sequence[str | Table]:
    """Analyse the right filter and the one of white noise alone along the lemniscate.

    Examples
    --------
    >>> from nav_jax.app.web.steps import compared
    >>> compared()[1].rows[0][0]
    'right'
    """
    return (band(), tables.analysis(_analysed(EMULATED)))


def left_out() -> Sequence[str | Table]:
    """Analyse the right filter with what the example leaves out.

    Examples
    --------
    >>> from nav_jax.app.web.steps import left_out
    >>> [row[0] for row in left_out()[0].rows]
    ['as above', 'initial errors', 'a constant bias', 'scale factors', 'axes not orthogonal', 'gravity anomalies']
    """
    rows = []
    for name, inputs in NAMED.items():
        found = _analysed({**EMULATED, "nav_own_accel": "", "nav_own_gyro": "", **inputs})[RIGHT]
        k = found.epoch()
        degrees = float(np.rad2deg(found.rms("attitude")[k]))
        rows.append((name, float(found.rms("position")[k]), degrees, float(found.nees("pose")[k] / found.dof("pose"))))
    text = "A filter that knows of it, at the end of the outage: RMS errors, expected NEES of the pose"
    return (Table(("with", "position", "attitude", "NEES / dof"), ("", "m", "deg", "1"), tuple(rows), text),)


def _analysed(inputs: Mapping[str, Any]) -> Analysis:
    config = config_of_text(toml_of(tables_of(NavigationState(**inputs), {})))
    assert isinstance(config.truth, ImuErrors)  # a model is given
    return analyse(config.scenario, config.truth, config.filters)


STEPS = (
    Step(
        "What a wrong model does to navigation",
        "A white noise and a Gauss-Markov process are emulated on each axis along a lemniscate, 40 s of it without "
        "GNSS. A filter that believes them is consistent; one that believes in white noise alone claims more than it "
        "can, in NEES and coverage too. The link computes this at once; there the button runs 500 times and shows mean "
        "errors in m and deg.",
        {"room": ROOM, **EMULATED},
        compared,
    ),
    Step(
        "What the example leaves out",
        "Initial errors, a constant bias, scale factors, axes that are not orthogonal and gravity that is not the "
        "Earth's alone are inputs here, each with a sentence on what it does. The table has the filter that knows of "
        "it; in the room, one that does not stands beside it.",
        {"room": ROOM, **EMULATED, **{name: value for inputs in NAMED.values() for name, value in inputs.items()}},
        left_out,
    ),
)
