"""The smallest drive that is navigated: four seconds at rest, with a fix each second."""

import numpy as np

import nav_jax as nj

COLUMNS = "time,north,east,down"
TEXT = """
[record]
imu = "imu.csv"
units = { gyro = "rad/s", accel = "m/s^2" }
position = [0, 0, 0]
velocity = [0, 0, 0]
attitude = [0, 0, 0]
[filters.white]
accel = "WN(sigma2=1e-4)"
gyro = "WN(sigma2=1e-6)"
rate = "20 Hz"
[[aiding]]
type = "gnss_position"
file = "fixes.csv"
horizontal = "1 m"
vertical = "2 m"
[initial]
position_sd = "1 m"
velocity_sd = "0.1 m/s"
attitude_sd = "1 deg"
"""


def write_drive(folder):
    """Write its files: the record, the fixes, and the configuration that names them."""
    samples, _ = nj.perfect_imu(nj.motions.static(duration=4.0, rate=20.0))
    table = np.column_stack([samples.time, samples.gyro, samples.accel])
    names = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    np.savetxt(folder / "imu.csv", table, "%.12f", delimiter=",", header=names, comments="")
    fixes = np.column_stack([np.arange(1.0, 5.0), np.zeros((4, 3))])
    np.savetxt(folder / "fixes.csv", fixes, "%.6f", delimiter=",", header=COLUMNS, comments="")
    (folder / "drive.toml").write_text(TEXT)
    return [folder / name for name in ("imu.csv", "fixes.csv", "drive.toml")]
