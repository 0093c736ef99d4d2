"""Runs without a filter: Gaussian errors that have, epoch by epoch, exactly the covariance that is stated for them."""

from dataclasses import replace

import numpy as np

from nav_jax.filter.history import Estimates
from nav_jax.simulation.runs import Runs, Track

OUTAGE = (60.0, 80.0)
DIRECTION = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
"""Axes of the position covariance, which is not diagonal in NED."""


def make_runs(name="right", num_runs=40, *, seed=1, scale=1.0, inflation=1.0, axes=range(6), noise=None, **fields):
    """Runs with 1 Hz epochs over 100 s and an outage.

    Errors are `inflation` times what the filter says, and their size is `scale`. `axes` are those of the six sensors
    with states. With one seed the draws are common to models; `noise` mixes own ones in.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(101.0)
    away = np.clip(time - OUTAGE[0], 0.0, OUTAGE[1] - OUTAGE[0]) * (time <= OUTAGE[1])
    position = scale * (1.5 + 0.02 * away**2)[:, None] * np.array([1.0, 0.6, 0.8])
    velocity = scale * (0.05 + 0.04 * away)[:, None] * np.array([1.0, 1.0, 0.5])
    attitude = np.deg2rad(scale * (0.3 + 0.02 * away))[:, None] * np.array([1.0, 1.0, 3.0])
    sensor = np.concatenate([np.full((101, 3), 2e-3), np.full((101, 3), 1e-4)], 1) * (0.5 + np.exp(-time / 30))[:, None]
    sd = np.concatenate([position, velocity, attitude, sensor], 1)
    z = correlated(rng, num_runs, 101, 15)
    if noise is not None:
        own = correlated(np.random.default_rng(noise), num_runs, 101, 15)
        z = 0.95 * z + np.sqrt(1 - 0.95**2) * own
    error = inflation * sd * z
    nees = {
        "position": np.sum((inflation * z[..., :3]) ** 2, -1),
        "velocity": np.sum((inflation * z[..., 3:6]) ** 2, -1),
        "attitude": np.sum((inflation * z[..., 6:9]) ** 2, -1),
    }
    nees["pose"] = nees["position"] + nees["attitude"]
    nees["navigation"] = nees["pose"] + nees["velocity"]
    dof = {"position": 3, "velocity": 3, "attitude": 3, "pose": 6, "navigation": 9}
    axes = list(axes)
    if axes:
        nees["sensors"] = np.sum((inflation * z[..., [9 + i for i in axes]]) ** 2, -1)
        dof["sensors"] = len(axes)
    error[..., :3] = error[..., :3] @ DIRECTION.T
    covariance = DIRECTION @ (position[:, :, None] ** 2 * np.eye(3)) @ DIRECTION.T
    sd[:, :3] = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    sd[:, [9 + i for i in range(6) if i not in axes]] = 0.0
    fixes = {"gnss": time[1:][(time[1:] < OUTAGE[0]) | (time[1:] > OUTAGE[1])], "baro": time[1:]}
    m = {"gnss": 3, "baro": 1}
    innovation = {s: inflation * rng.standard_normal((num_runs, len(t), m[s])) for s, t in fixes.items()}
    return Runs(
        **{
            "name": name,
            "time": time,
            "error": error,
            "sd": np.broadcast_to(sd, error.shape).copy(),
            "position_covariance": np.broadcast_to(covariance, (num_runs, *covariance.shape)).copy(),
            "nees": nees,
            "dof": dof,
            "status": np.zeros(num_runs, np.int64),
            "nis": {s: np.sum(v**2, -1) for s, v in innovation.items()},
            "nis_time": fixes,
            "nis_dof": m,
            "innovation": innovation,
            "outages": {"gnss": (OUTAGE,), "baro": ()},
            "tracks": {i: make_track(error[i]) for i in range(min(2, num_runs))},
            **fields,
        }
    )


def with_failures(name, failed, **options):
    """The same with some runs that failed: their rows are NaN."""
    runs = make_runs(name, **options)
    rows = list(failed)
    status = runs.status.copy()
    status[rows] = 1
    for array in (runs.error, runs.sd, runs.position_covariance, *runs.nees.values(), *runs.nis.values()):
        array[rows] = np.nan
    for array in runs.innovation.values():
        array[rows] = np.nan
    return replace(runs, status=status)


def correlated(rng, num_runs, num_epochs, size, phi=0.9):
    """Standard normal at each epoch, with correlation from one to the next."""
    z = np.empty((num_runs, num_epochs, size))
    z[:, 0] = rng.standard_normal((num_runs, size))
    for k in range(1, num_epochs):
        z[:, k] = phi * z[:, k - 1] + np.sqrt(1 - phi**2) * rng.standard_normal((num_runs, size))
    return z


def path(time):
    """A figure of eight with a climb: position and velocity."""
    w = 2 * np.pi / 60
    s, c = np.sin(w * time), np.cos(w * time)
    position = np.stack([50 * s, 50 * s * c, -2.0 + 0.0 * time - 5 * (1 - np.cos(w * time / 2))], -1)
    velocity = np.stack([50 * w * c, 50 * w * (c**2 - s**2), -2.5 * w * np.sin(w * time / 2)], -1)
    return position, velocity


def make_track(error):
    """A run at 10 Hz whose errors are those of the epochs, straight lines between them."""
    time = np.arange(1001) / 10
    position, velocity = path(time)
    between = np.stack([np.interp(time, np.arange(101.0), error[:, i]) for i in range(6)], -1)
    heading = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0])) / 2
    zero = np.zeros_like(heading)
    quaternion = np.stack([np.cos(heading), zero, zero, np.sin(heading)], -1)
    sensors, sd = np.zeros((1001, 6)), np.ones((1001, 15))
    arrays = (position + between[:, :3], velocity + between[:, 3:], quaternion, sensors, sd)
    fixes = slice(10, None, 10)
    return Track(time, *arrays, Estimates(time[fixes], *(a[fixes] for a in arrays)))
