"""Studies drawn at random: any sensors with any of their states, any errors of the IMU, either Earth, either gains.

Each part works in its own tests; what is tested with these is that any of them work together. Motion and standard
deviations are small, so that a covariance of first order is what runs have.
"""

from typing import Any, NamedTuple

import numpy as np

import nav_jax as nj
from nav_jax.aiding.states import group_names

RATE = 40.0
DURATION = 4.0
NORTH = np.array([0.81, 0.115, 500.0])
ARCSEC, MGAL = np.deg2rad(1 / 3600), 1e-5


class Study(NamedTuple):
    """What is compared."""

    scenario: nj.Scenario
    truth: nj.ImuErrors
    filters: dict[str, nj.ImuErrors]
    """``right`` believes the truth, ``less`` knows only a part of it."""
    gains: str

    @property
    def matches(self) -> bool:
        """Whether ``right`` has a state for all that has a memory, and none for what is not there."""
        white = all(p.kind == "WN" for s in self.scenario.aiding for model in s.noise for p in model.processes)
        known = not self.scenario.neglected and not self.scenario.suspected
        return white and known and not self.truth.notes()


class _Choice:
    """Numbers of a seed."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)

    def often(self, p=0.5):
        return bool(self.rng.random() < p)

    def one(self, *of):
        return of[self.rng.integers(len(of))]

    def some(self, **options):
        """Each of the options or not."""
        return {name: value for name, value in options.items() if self.often()}


def _receiver(c, kind, name):
    options = c.some(
        outages=[(1.6, 3.4)],
        lever_arm=(0.6, 0.2, -1.1), lever_arm_sd=c.one(0.03, (0.03, 0.02, 0.0)), time_offset_sd=0.004,
        drift=c.one("GM(beta=0.05, variance=0.01)", ["RW(gamma2=1e-5)", "GM(beta=0.1, variance=0.01)"]),
    )  # fmt: skip
    speeds = {"horizontal_velocity": 0.03, "vertical_velocity": 0.05}
    noise = {"horizontal": c.one(0.05, "WN(sigma2=1e-3) + GM(beta=0.2, variance=1e-3)"), "vertical": 0.1}
    if kind is nj.GnssVelocity:
        noise = {"horizontal": 0.03, "vertical": 0.05}
    elif kind is nj.Gnss:
        noise |= speeds
        options |= c.some(drift_velocity="GM(beta=0.1, variance=1e-4)")
    if kind is not nj.GnssPosition:
        options |= c.some(averaged=c.one(0.25, 0.1))
    return kind(c.one(1.0, 2.0, 0.7), **noise, **options, name=name)


def _receivers(c):
    match c.rng.integers(5):
        case 0:
            return [_receiver(c, nj.Gnss, "gnss")]
        case 1:
            return [_receiver(c, nj.GnssPosition, "gnss_position"), _receiver(c, nj.GnssVelocity, "gnss_velocity")]
        case 2:
            return [_receiver(c, nj.GnssVelocity, "gnss_velocity")]
        case 3:
            return [nj.GnssPosition(1.0, covariance=[[0.01, 0.004, 0.0], [0.004, 0.01, 0.0], [0.0, 0.0, 0.04]])]
        case _:
            return [_receiver(c, nj.GnssPosition, "gnss_position")]


def _barometer(c):
    offset = c.some(offset_sd=0.3, offset_noise=c.one("GM(beta=0.02, variance=0.04)", "RW(gamma2=1e-3)"))
    return nj.Barometer(c.one(1.0, 3.0), height=0.3, **offset, **c.some(scale_sd=0.005))


def _odometer(c):
    options = c.some(
        sideways=c.one(0.04, (0.04, 0.06)), lever_arm=(-1.2, 0.3, 0.4), lever_arm_sd=c.one(0.02, (0.02, 0.02, 0.01)),
        mount_sd=0.01, mount_noise="RW(gamma2=1e-8)", scale_sd=0.005, scale_noise="RW(gamma2=1e-8)",
    )  # fmt: skip
    return nj.Odometer(c.one(2.0, 4.0), speed=0.03, **options)


def _axle(c):
    options = c.some(
        lever_arm=(-1.2, 0.0, 0.4), lever_arm_sd=0.02, mount_sd=0.01, mount_noise="RW(gamma2=1e-8)", faster=1.0
    )
    return nj.aiding.NonHolonomic(c.one(2.0, 4.0), right=0.04, down=0.06, **options)


def _compass(c):
    iron = c.some(hard_iron_sd=c.one(2e-7, (2e-7, 3e-7, 0.0)))
    return nj.aiding.Magnetometer(2.0, sd=2e-7, field=(22e-6, 1e-6, 43e-6), **iron)


def _pair(c):
    options = c.some(offset_sd=0.003)
    return nj.aiding.DualAntenna(1.0, horizontal=0.005, vertical=0.01, baseline=(1.0, 0.1, 0.0), **options)


def _stops(c):
    kinds = [nj.aiding.ZeroVelocity(2.0, sd=0.02), nj.aiding.ZeroRate(2.0, sd=2e-3)]
    return [kinds[c.rng.integers(2)]] if c.often() else kinds


def _errors(c, *, warm):
    noise = [
        "WN(sigma2=6e-6)", "WN(sigma2=6e-6) + GM(beta=0.01, variance=4e-6)", "WN(sigma2=6e-6) + RW(gamma2=1e-8)",
        "QN(q2=1e-7) + WN(sigma2=6e-6)", "WN(sigma2=6e-6) + MAT32(beta=0.05, variance=4e-6)",
    ]  # fmt: skip
    quiet = [text.replace("e-6", "e-9").replace("e-7", "e-10").replace("e-8", "e-11") for text in noise]
    kinds = [
        nj.imu.ScaleFactor(1e-3, c.one(1e-3, 0.0)), nj.imu.Misalignment(c.one(1e-3, 0.0), 1e-3),
        nj.imu.GSensitivity([1e-5, 2e-5, 0.0]), nj.imu.TemperatureBias(1e-3, 1e-5),
    ]  # fmt: skip
    which = [k for k in kinds if c.often() and (warm or not isinstance(k, nj.imu.TemperatureBias))]
    field = nj.imu.GravityDisturbance(
        deflection=c.one(20 * ARCSEC, (20 * ARCSEC, 0.0)), anomaly=c.one(100 * MGAL, 0.0), distance=[30.0, 50.0, 40.0]
    )
    options = c.some(
        accel_bias_sd=c.one(0.01, (0.01, 0.02, 0.0)), gyro_bias_sd=2e-4, deterministic=which, gravity=field,
        start="zero", output=nj.imu.Output(accel_step=1e-3, gyro_step=1e-5),
    )  # fmt: skip
    return nj.ImuErrors(c.one(*noise), c.one(*quiet), RATE, **options)


def study(seed) -> Study:
    """The study of a seed."""
    c = _Choice(seed)
    stands = c.often(0.2)
    reference = (
        nj.motions.static(DURATION, RATE)
        if stands
        else nj.motions.racetrack(DURATION, RATE, speed=6.0, straight=1.0, turn=2.0, ramp=0.5)
    )
    sensors: list[Any] = _receivers(c)
    for one in (_barometer, _odometer, _axle, _compass, _pair):
        if c.often(0.4) and not (stands and one in (_odometer, _axle)):
            sensors.append(one(c))
    sensors += _stops(c) if stands else []
    groups = list(group_names(sensors))
    neglected = [g for g in groups if c.often(0.15)]
    suspected = [g for g in groups if g not in neglected and c.often(0.15)]
    warm = c.often()
    options: dict[str, Any] = {"temperature": 20.0 + 2.0 * reference.time} if warm else {}
    scenario = nj.Scenario(
        reference, sensors, nj.InitialUncertainty(0.1, 0.05, 0.003), c.one(nj.FlatEarth(), nj.Wgs84(NORTH)),
        every=int(c.one(1, 4, 7)), output_interval=c.one(0.5, 1.0), neglected=neglected, suspected=suspected, **options,
    )  # fmt: skip
    truth = _errors(c, warm=warm)
    less = nj.ImuErrors("WN(sigma2=1e-5)", "WN(sigma2=1e-8)", RATE, accel_bias_sd=0.01)
    return Study(scenario, truth, {"right": truth, "less": less}, c.one("estimate", "reference"))
