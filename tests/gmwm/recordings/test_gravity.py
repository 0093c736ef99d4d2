"""Units that gravity contradicts are doubted; others, real recordings among them, are not."""

import warnings

import numpy as np
import pytest

from gmwm_jax._internal.gravity import ImplausibleUnitsWarning, doubt
from gmwm_jax.recordings.files import read_recording

G = 9.80665
NAMES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
NOISE = np.random.default_rng(4).normal(size=(500, 3))
GYRO = np.deg2rad(0.3) + 1e-3 * NOISE
ACCEL = G * np.array([0.02, -0.6, 0.79]) / np.hypot(0.6, 0.79) + 0.02 * NOISE[:, ::-1]


@pytest.mark.parametrize(
    ("size", "text"),
    [
        (1 / G, "read as m/s^2, average 1 m/s^2, .* look like g"),
        (G, "read as g, average .* look like m/s^2"),
        (1e3, "read as g, .* look like mg"),
        (1e-3, "read as mg, .* look like g"),
        (1e3 / G, "read as m/s^2, .* look like mg"),
    ],
)
def test_wrong_units_of_accelerometers(size, text):
    found = doubt(GYRO, size * ACCEL)
    assert found is not None
    assert all(part in found for part in text.split(" .* ")), found


@pytest.mark.parametrize(("size", "unit"), [(1.0, "rad/s"), (np.pi / 180, "deg/s")])
def test_swapped_columns(size, unit):
    found = doubt(size * ACCEL, GYRO / size)
    assert found is not None
    assert f"read as {unit}, average 9.8" in found
    assert "swapped" in found


@pytest.mark.parametrize(
    ("gyro", "accel"),
    [
        (GYRO, ACCEL),
        (GYRO, 1.8 * ACCEL),
        (GYRO, ACCEL - ACCEL.mean(axis=0)),
        (ACCEL, GYRO - GYRO.mean(axis=0)),
        (GYRO, 0.3 * ACCEL),
        (None, ACCEL / 50),
        (GYRO, 50 * NOISE + ACCEL / G),
        (GYRO, np.full_like(ACCEL, np.nan)),
        (GYRO[:0], ACCEL[:0]),
    ],
)
def test_what_is_not_doubted(gyro, accel):
    assert doubt(gyro, accel) is None


def write(path, columns, names=NAMES):
    np.savetxt(path, columns, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return path


def test_a_file_whose_unit_was_forgotten(tmp_path):
    path = write(tmp_path / "a.csv", np.hstack([GYRO, ACCEL / G]))
    with pytest.warns(ImplausibleUnitsWarning, match=r'look like g. If they are, say so: units=\{"accel": "g"\}'):
        rec = read_recording(path, rate=100.0, units={"gyro": "rad/s", "accel": "m/s^2"})
    assert "look like g" in repr(rec.understood)
    with warnings.catch_warnings(action="error"):
        read_recording(path, rate=100.0, units={"gyro": "rad/s", "accel": "g"})
        read_recording(path, rate=100.0, units={"gyro": "rad/s", "accel": "m/s^2"}, channels=["gyro", "accel_x"])


def test_a_file_with_missing_samples_and_other_names(tmp_path):
    """Roles are told by names with units, in any order."""
    values = np.hstack([ACCEL, GYRO])
    values[3] = np.nan
    names = ["w_x [rad/s]", "w_y [rad/s]", "w_z [rad/s]", "acc_x [m/s^2]", "acc_y [m/s^2]", "acc_z [m/s^2]"]
    with pytest.warns(ImplausibleUnitsWarning, match="columns seem to be swapped"):
        read_recording(write(tmp_path / "a.csv", values, names), rate=100.0, gaps="nan")


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 4])
def test_real_recordings_are_not_doubted(shared, number):
    with warnings.catch_warnings(action="error"):
        rec = read_recording(shared / "data" / f"adis_16405_imu{number}.rda")
    data = {name: samples for name, samples in rec.items()}
    gyro, accel = (np.stack([data[f"{s}_{a}"] for a in "xyz"], axis=1) for s in ("gyro", "accel"))
    assert doubt(gyro, accel) is None
    assert doubt(gyro, accel - accel.mean(axis=0)) is None


@pytest.mark.parametrize("name", ["real_loop1", "real_loop2", "real_drive", "real_walk"])
def test_real_drives_are_not_doubted_unless_their_unit_is_wrong(shared, name):
    with np.load(shared / "data" / f"{name}.npz") as file:
        is_si = "imu_accel" in file
        accel = file["imu_accel"] if is_si else file["imu_accel_mg"] * (G / 1e3)
        gyro = file["imu_gyro"] if is_si else np.deg2rad(file["imu_gyro_mdps"] * 1e-3)
    assert doubt(gyro, accel) is None
    assert "look like g" in str(doubt(gyro, accel / G))
    assert "look like m/s^2" in str(doubt(gyro, accel * G))
    assert "swapped" in str(doubt(accel, gyro))


def test_nothing_is_said_of_samples_without_unit(tmp_path):
    """Whoever wants the numbers as they stand, as for R's, says that they have no unit."""
    x = np.random.default_rng(0).normal(size=(500, 3)) * 1e-3 + [0.0, 0.0, 1.0]
    np.savetxt(tmp_path / "x.csv", x, delimiter=",", header="accel_x,accel_y,accel_z", comments="")
    with warnings.catch_warnings(action="error"):
        read_recording(tmp_path / "x.csv", rate=100.0, units="1")
    with pytest.warns(ImplausibleUnitsWarning, match="look like g"):
        read_recording(tmp_path / "x.csv", rate=100.0, units="m/s^2")
