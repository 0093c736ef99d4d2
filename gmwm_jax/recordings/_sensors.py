"""Noise models of four inertial measurement units, for demonstrations and tests: facts, no files.

The parameter values (per sample, SI) are estimated with this package from the wavelet variances published with
SMAC-Group/imudata for static recordings of these units; components that came out as zero, or as too small to change the
objective, are left out. No model of this kind describes the accelerometers of the LN-200, whose output is coarsely
quantised: take theirs as a rough likeness. The datasheet entries are the manufacturers'.
"""

from typing import NamedTuple


class Sensor(NamedTuple):
    """One unit: sampling rate, a model text a channel, datasheet white-noise density a sensor."""

    title: str
    rate: float
    models: dict[str, str]
    datasheet: dict[str, dict[str, str]]


SENSORS: dict[str, Sensor] = {
    "mti-g": Sensor(
        "Xsens MTi-G (MEMS)",
        100.0,
        {
            "gyro_x": "RW(gamma2=2.954e-12) + GM(beta=2.074, variance=5.109e-5) + GM(beta=1.062e-3, variance=1.499e-7)",
            "gyro_y": "RW(gamma2=4.766e-12) + GM(beta=2.126, variance=4.882e-5) + GM(beta=1.705e-3, variance=1.195e-7)",
            "gyro_z": "RW(gamma2=7.12e-12) + GM(beta=2.143, variance=5.628e-5) + GM(beta=2.222e-3, variance=9.488e-8)",
            "accel_x": "WN(sigma2=3.021e-5) + RW(gamma2=1.915e-11) + GM(beta=1.606, variance=5.263e-5)"
            " + GM(beta=1.53e-3, variance=7.351e-8)",
            "accel_y": "WN(sigma2=5.522e-5) + RW(gamma2=1.075e-10) + GM(beta=1.662, variance=5.856e-5)"
            " + GM(beta=2.761e-3, variance=1.555e-7)",
            "accel_z": "WN(sigma2=9.207e-5) + RW(gamma2=5.016e-11) + GM(beta=1.344, variance=3.413e-5)"
            " + GM(beta=1.192e-3, variance=3.416e-7)",
        },
        {"gyro": {"N": "0.05 deg/s/sqrt(Hz)"}, "accel": {"N": "0.002 m/s^2/sqrt(Hz)"}},
    ),
    "navchip": Sensor(
        "Thales Visionix NavChip (MEMS)",
        250.0,
        {
            "gyro_x": "WN(sigma2=5.294e-7) + QN(q2=1.682e-6) + RW(gamma2=1.875e-12)"
            " + GM(beta=1.777e-3, variance=6.326e-9)",
            "gyro_y": "WN(sigma2=7.142e-7) + QN(q2=2.279e-6) + RW(gamma2=2.612e-13)"
            " + GM(beta=1.235e-2, variance=5.48e-9) + GM(beta=6.194e-4, variance=7.257e-9)",
            "gyro_z": "WN(sigma2=5.005e-7) + QN(q2=1.847e-6) + RW(gamma2=2.728e-13)"
            " + GM(beta=3.777e-3, variance=6.042e-9) + GM(beta=1.809e-4, variance=6.854e-9)",
            "accel_x": "WN(sigma2=4.936e-5) + QN(q2=2.319e-5) + RW(gamma2=3.728e-11)"
            " + GM(beta=0.1124, variance=1.947e-6) + GM(beta=3.278e-3, variance=7.369e-7)",
            "accel_y": "WN(sigma2=5.564e-5) + QN(q2=1.654e-5) + RW(gamma2=1.812e-11)"
            " + GM(beta=4.775e-2, variance=1.202e-6) + GM(beta=1.092e-3, variance=5.404e-7)",
            "accel_z": "WN(sigma2=5.625e-5) + QN(q2=1.327e-5) + RW(gamma2=1.308e-12)"
            " + GM(beta=1.133e-3, variance=1.15e-7) + GM(beta=4.118e-5, variance=1.451e-7)",
        },
        {"gyro": {"N": "0.003 deg/s/sqrt(Hz)"}, "accel": {"N": "50 ug/sqrt(Hz)"}},
    ),
    "imar-fsas": Sensor(
        "iMAR iIMU-FSAS (fibre-optic gyros)",
        400.0,
        {
            "gyro_x": "GM(beta=3.388, variance=2.404e-7) + GM(beta=0.1085, variance=1.154e-9)",
            "gyro_y": "GM(beta=2.688, variance=3.785e-7) + GM(beta=0.1182, variance=6.318e-10)",
            "gyro_z": "GM(beta=3.063, variance=3.527e-7) + GM(beta=3.271e-2, variance=1.113e-9)",
        },
        {"gyro": {"N": "0.15 deg/sqrt(h)"}},
    ),
    "ln200": Sensor(
        "Northrop Grumman LN-200 (fibre-optic gyros)",
        400.0,
        {
            "gyro_x": "GM(beta=1.842, variance=4.561e-8)",
            "gyro_y": "GM(beta=1.987, variance=4.042e-8) + GM(beta=0.5138, variance=2.359e-9)",
            "gyro_z": "GM(beta=2.063, variance=3.945e-8) + GM(beta=0.1115, variance=2.181e-12)",
            "accel_x": "WN(sigma2=4.49e-5) + QN(q2=1.885e-2)",
            "accel_y": "QN(q2=5.758e-2) + RW(gamma2=1.045e-15) + GM(beta=6.644e-4, variance=1.871e-9)",
            "accel_z": "QN(q2=4.521e-2) + GM(beta=0.1843, variance=1.456e-6)",
        },
        {"gyro": {"N": "0.05 deg/sqrt(h)"}},
    ),
}
