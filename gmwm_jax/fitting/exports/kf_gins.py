"""The section ``imunoise`` of KF-GINS, whose biases are Gauss-Markov processes of one correlation time.

Each channel has its standard deviation, such that the process has the Allan deviation of the channel's bias at the time
T at which the random walk of `gmwm_jax.fitting.bias` has it; the correlation time, which all share, is the one at which
white noise and bias together come closest to the Allan deviations of the models, in the mean square of their logs over
all channels and averaging times from the step on.
"""

import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.compiling import compiled_quickly
from gmwm_jax.fitting.bias import WhiteAndBias
from gmwm_jax.fitting.exports.noise import ImuNoise, comments, reals, three_axes
from gmwm_jax.processes.gauss_markov import GM
from gmwm_jax.units import convert

_LONGEST = 100.0
"""Times the longest averaging time: beyond it a Gauss-Markov process is a random walk."""
_TRIED = 400


def kf_gins(imu: ImuNoise) -> str:
    """Write the section."""
    time, at_end = _common_time([c.filter for c in imu.channels])
    gyro, accel = three_axes(imu.gyro), three_axes(imu.accel)
    keys = (
        ("arw", "deg/sqrt(h)", [convert(c.filter.N, "rad/s/sqrt(Hz)", "deg/sqrt(h)") for c in gyro]),
        ("vrw", "m/s/sqrt(h)", [convert(c.filter.N, "m/s^2/sqrt(Hz)", "m/s/sqrt(h)") for c in accel]),
        ("gbstd", "deg/h", [convert(_sigma(c.filter, time), "rad/s", "deg/h") for c in gyro]),
        ("abstd", "mGal", [convert(_sigma(c.filter, time), "m/s^2", "mGal") for c in accel]),
    )
    bias = (
        "Bias: all other components as one Gauss-Markov process of each channel, gbstd and abstd, which has their "
        "Allan deviation at the time T that is given for it (K is its random walk). The correlation time, one for all, "
        "is that of the least squares of log Allan deviations."
    )
    remarks = [
        "gsstd and asstd (ppm) are scale factors: keep yours in this section.",
        "Without initbgstd and initbastd the biases start with gbstd and abstd, and not with what a turn-on bias has.",
    ]
    if not any(c.filter.bias for c in imu.channels):
        remarks.append("No channel has a bias: any corrtime will do.")
    elif at_end:
        remarks.append("corrtime is the longest that was tried: the biases are random walks.")
    return "\n".join(
        [
            *comments(imu, "KF-GINS, section of kf-gins.yaml", *remarks, bias=bias),
            "imunoise:",
            *(f"  {key}: {reals(values)}  # {unit}" for key, unit, values in keys),
            f"  corrtime: {time / 3600:.9e}  # h, {time:.4g} s",
            "",
        ]
    )


def _sigma(one: WhiteAndBias, time: float) -> float:
    """Standard deviation of the process of a correlation time with the Allan deviation of the bias at its T."""
    k = int(np.argmin(np.abs(one.times - one.interval)))
    unit = np.asarray(_unit_wavelet_variance(np.array([1 / (time * one.rate)]), 2 * one.rate * one.times))[0, k]
    return float(one.bias_deviation[k] / np.sqrt(2 * unit))


def _common_time(filters: list[WhiteAndBias]) -> tuple[float, bool]:
    """Correlation time of all biases, and whether it is the longest of those tried; the shortest if there are none."""
    longest = max(one.times[-1] for one in filters) * _LONGEST
    tried = np.geomspace(max(one.step for one in filters), longest, _TRIED)
    distance = np.zeros(_TRIED)
    for one in filters:
        if not one.bias:
            continue
        unit = np.asarray(_unit_wavelet_variance(1 / (tried * one.rate), 2 * one.rate * one.times))
        k, on = int(np.argmin(np.abs(one.times - one.interval))), one.times >= one.step * (1 - 1e-6)
        white, bias = one.N**2 / one.times[on], one.bias_deviation**2
        reached = white + bias[k] * unit[:, on] / unit[:, k : k + 1]
        distance += np.sum(np.log(reached / (white + bias[on])) ** 2, axis=1)
    best = int(np.argmin(distance))
    return float(tried[best]), best == _TRIED - 1


@compiled_quickly()
def _unit_wavelet_variance(beta: Float[Array, " T"], tau: Float[Array, " J"]) -> Float[Array, "T J"]:
    return GM.unit_wavelet_variance((beta[:, None],), tau[None, :])
