"""Scenarios of the README, the notebooks, the demonstration and the tests, with what they compare."""

import warnings
from collections.abc import Callable
from typing import Any

import nav_case
import numpy as np

import nav_jax as nj

ARCSEC, MGAL = np.deg2rad(1 / 3600), 1e-5
Case = tuple[nj.Scenario, Any, dict[str, nj.ImuErrors]]
ROUND = nj.Wgs84([0.81, 0.115, 500.0])
MANY = "WN(sigma2=6e-5) + GM(beta=1.8e-3, variance=5e-8) + GM(beta=9e-5, variance=1.4e-7)"
MANY_GYRO = "WN(sigma2=1.5e-6) + GM(beta=3e-3, variance=4e-9) + GM(beta=1e-4, variance=6e-9)"


def _white(accel: float, gyro: float, rate: float, **more: Any) -> nj.ImuErrors:
    return nj.ImuErrors(f"WN(sigma2={accel:g})", f"WN(sigma2={gyro:g})", rate, **more)


def _aiding(*outage: float) -> list:
    out = [outage]
    position = nj.GnssPosition(horizontal=0.025, vertical=0.05, outages=out)
    velocity = nj.GnssVelocity(horizontal=0.01, vertical=0.02, outages=out)
    return [position, velocity, nj.Barometer(height=0.5)]


def _start(heading: float, tilt: float = 1.0) -> nj.InitialUncertainty:
    return nj.InitialUncertainty(0.1, 0.05, np.deg2rad([tilt, tilt, heading]))


def readme() -> Case:
    truth, white = nj.ImuErrors(MANY, MANY_GYRO, 100.0), _white(6e-5, 1.5e-6, 100.0)
    out = [(80.0, 120.0)]
    aiding = [nj.GnssPosition(horizontal=0.025, vertical=0.05, outages=out), nj.Barometer(height=0.5)]
    scenario = nj.Scenario(nj.motions.lemniscate(120.0, 100.0), aiding, every=10)
    return scenario, truth, {"right": truth, "WN only": white}


def docstrings() -> Case:
    truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", 20.0)
    scenario = nj.Scenario(nj.motions.lemniscate(10.0, 20.0), [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    return scenario, truth, {"right": truth, "white": _white(1e-4, 1e-8, 20.0)}


def of_r() -> Case:
    return nav_case.scenario(every=10), nav_case.errors(), nav_case.FILTERS


def gradients() -> Case:
    gyro = "WN(sigma2=1.5e-6) + GM(beta=1e-4, variance=6e-9)"
    truth = nj.ImuErrors("WN(sigma2=6e-5) + GM(beta=5e-4, variance=1e-6)", gyro, 100.0)
    start = nj.InitialUncertainty(0.05, 0.02, np.deg2rad(0.3))
    scenario = nj.Scenario(nj.motions.lemniscate(80.0, 100.0), _aiding(40.0, 80.0), start, every=10)
    return scenario, truth, {"right": truth, "fewer": nj.ImuErrors("WN(sigma2=6e-5)", gyro, 100.0)}


def other_programs() -> Case:
    truth = nj.ImuErrors("WN(sigma2=1e-4) + GM(beta=1e-4, variance=9e-6)", "WN(sigma2=1e-6) + RW(gamma2=1e-14)", 100.0)
    scenario = nj.Scenario(nj.motions.lemniscate(20.0, 100.0), _aiding(10.0, 20.0), every=10)
    return scenario, truth, {"right": truth, "white": _white(1e-4, 1e-6, 100.0)}


def studies() -> Case:
    rest = "WN(sigma2=1e-6)"
    truth = nj.ImuErrors("WN(sigma2=1e-4)", [f"{rest} + GM(beta=1e-3, variance=1e-6)", rest, rest], 100.0)
    aiding = [nj.GnssPosition(horizontal=0.5, vertical=1.0, outages=[(20.0, 40.0)])]
    return nj.Scenario(nj.motions.lemniscate(40.0, 100.0), aiding), truth, {
        "own process": truth, "white": _white(1e-4, 1e-6, 100.0)
    }  # fmt: skip


def thousand() -> Case:
    def errors(white: float, walk: float) -> nj.ImuErrors:
        accel, gyro = (f"WN(sigma2={a * white:g}) + RW(gamma2={b * walk:g})" for a, b in ((1e-4, 1e-8), (1e-7, 1e-11)))
        return nj.ImuErrors(accel, gyro, 10.0)

    aiding = [nj.GnssPosition(horizontal=1.0, vertical=2.0, outages=[(50.0, 70.0)])]
    start = nj.InitialUncertainty(1.0, 0.1, 0.02)
    scenario = nj.Scenario(nj.motions.racetrack(80.0, 10.0), aiding, start, every=5)
    return scenario, errors(1, 1), {"right": errors(1, 1), "walk / 1000": errors(1, 1e-3), "x 1000": errors(1e3, 1)}


def demonstration() -> Case:
    truth = nj.ImuErrors(MANY, MANY_GYRO, 100.0, accel_bias_sd=0.01, gyro_bias_sd=1e-4)
    scenario = nj.Scenario(nj.motions.lemniscate(120.0, 100.0), _aiding(80.0, 120.0), every=10, earth=ROUND)
    return scenario, truth, {"right": truth, "WN only": _white(6e-5, 1.5e-6, 100.0)}


def heading(degrees: float) -> Case:
    truth = nav_case.errors()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nj.filter.LinearisationWarning)
        reference = nj.motions.lemniscate(60.0, 100.0, attitude="navigation")
        scenario = nj.Scenario(reference, _aiding(30.0, 50.0), _start(degrees), every=10)
    return scenario, truth, {"right": truth}


def coarse() -> Case:
    truth = _white(1e-4, 1e-7, 20.0)
    aiding = [nj.GnssPosition(horizontal=0.1, vertical=0.2, outages=[(2.5, 5.0)])]
    scenario = nj.Scenario(nj.motions.lemniscate(6.0, 20.0), aiding, _start(5.0))
    return scenario, truth, {"right": truth, "calm": _white(1e-5, 1e-8, 20.0)}


def calibration() -> Case:
    reference = nj.motions.racetrack(40.0, 100.0, speed=60.0, straight=5.0, turn=8.0, ramp=2.0)
    known = [
        nj.imu.ScaleFactor(1e-3, 1e-3), nj.imu.Misalignment(1e-3, 1e-3), nj.imu.GSensitivity([1e-5, 2e-5, 3e-5]),
        nj.imu.TemperatureBias(2e-3, 2e-5),
    ]  # fmt: skip
    gravity = nj.imu.GravityDisturbance(deflection=60 * ARCSEC, anomaly=300 * MGAL, distance=[500.0, 800.0, 1e3])
    truth = _white(6e-6, 1.5e-8, 100.0, deterministic=known, gravity=gravity)
    warm = 25.0 - 15.0 * np.exp(-reference.time / 20.0)
    start = nj.InitialUncertainty(0.1, 0.05, 0.002)
    scenario = nj.Scenario(reference, _aiding(25.0, 40.0)[:2], start, ROUND, every=5, temperature=warm)
    return scenario, truth, {"right": truth, "bare": _white(6e-6, 1.5e-8, 100.0)}


def correlated() -> Case:
    noise = "WN(sigma2=4e-4) + GM(beta=0.05, variance=0.04)"
    gnss = nj.GnssPosition(horizontal=noise, vertical=noise, believed=(0.2, 0.2), outages=[(20.0, 30.0)])
    drift = nj.GnssPosition(
        horizontal=0.02, vertical=0.02, drift="GM(beta=0.05, variance=0.04)", outages=[(20.0, 30.0)], name="second"
    )
    truth = nj.ImuErrors("WN(sigma2=6e-5) + GM(beta=2e-3, variance=2e-5)", "WN(sigma2=1.5e-6)", 50.0)
    scenario = nj.Scenario(nj.motions.lemniscate(30.0, 50.0), [gnss, drift], _start(2.0, 0.5), every=5)
    return scenario, truth, {"right": truth}


def compass() -> Case:
    truth = _white(6e-5, 1.5e-6, 100.0, gyro_bias_sd=1e-3)
    field = nj.aiding.Magnetometer(5.0, sd=5e-7, field=(22e-6, 1e-6, 43e-6), hard_iron_sd=1e-6)
    gnss = nj.GnssPosition(horizontal=0.05, vertical=0.1)
    scenario = nj.Scenario(nj.motions.circle(20.0, 100.0), [gnss, field], _start(5.0, 0.5), every=5)
    return scenario, truth, {"right": truth}


def counting() -> Case:
    device = nj.devices["HG1700 AG58"]
    truth, believed = (make(50.0, effects=["range", "LSB"]) for make in (device.truth, device.filter))
    outage = [(18.0, 28.0)]
    aiding = [
        nj.GnssPosition(horizontal=0.5, vertical=1.0, outages=outage),
        nj.GnssVelocity(horizontal=0.05, vertical=0.1, outages=outage),
    ]
    start = nj.InitialUncertainty(0.5, 0.1, np.radians([0.2, 0.2, 1.0]))
    return nj.Scenario(nj.motions.lemniscate(30.0, 50.0), aiding, start, every=5), truth, {"right": believed}


def wheels() -> Case:
    truth = _white(6e-5, 1.5e-6, 100.0, accel_bias_sd=0.02, gyro_bias_sd=1e-3)
    wheel = nj.Odometer(
        5.0, speed=0.03, sideways=0.05, lever_arm=(-1.2, 0.7, 0.4), lever_arm_sd=0.1, scale_sd=0.01, mount_sd=0.03
    )
    gnss = nj.GnssPosition(horizontal=0.05, vertical=0.1, outages=[(22.0, 36.0)])
    track = nj.motions.racetrack(36.0, 100.0, straight=8.0, turn=10.0, speed=8.0)
    return nj.Scenario(track, [gnss, wheel], _start(2.0, 0.5), ROUND, every=5), truth, {"right": truth}


def receiver() -> Case:
    gnss = nj.Gnss(
        2.0, horizontal=0.02, vertical=0.03, horizontal_velocity=0.02, vertical_velocity=0.03,
        lever_arm=(1.0, 0.5, -1.5), lever_arm_sd=0.3, time_offset_sd=0.02, averaged=0.25,
        drift="GM(beta=0.05, variance=0.04)",
    )  # fmt: skip
    truth = nj.ImuErrors("WN(sigma2=6e-5) + GM(beta=2e-3, variance=2e-5)", "WN(sigma2=1.5e-6)", 50.0)
    reference = nj.motions.lemniscate(15.0, 50.0, attitude="navigation")
    return nj.Scenario(reference, [gnss], _start(2.0, 0.5), every=5), truth, {"right": truth}


def recording() -> Case:
    rng = np.random.default_rng(1)
    sd = {"accel": 6e-5**0.5, "gyro": 1.5e-6**0.5}
    truth = nj.RecordedErrors(**{sensor: s * rng.normal(size=(400_000, 3)) for sensor, s in sd.items()}, rate=100.0)
    scenario = nj.Scenario(nj.motions.lemniscate(20.0, 100.0), _aiding(10.0, 20.0), _start(2.0, 0.5), every=10)
    return scenario, truth, {"white": _white(6e-5, 1.5e-6, 100.0)}


CASES: dict[str, Callable[[], Case]] = {
    "README": readme,
    "docstrings": docstrings,
    "notebook 02, R's example": of_r,
    "notebook 05": gradients,
    "notebook 06": other_programs,
    "notebook 07": studies,
    "notebook 09": thousand,
    "demonstration, WGS-84, biases": demonstration,
    "heading 5 deg": lambda: heading(5.0),
    "heading 15 deg": lambda: heading(15.0),
    "heading 40 deg": lambda: heading(40.0),
    "5 deg, a coarse IMU": coarse,
    "calibration states, WGS-84": calibration,
    "GNSS correlated, with a drift": correlated,
    "a compass": compass,
    "an IMU that counts": counting,
    "wheel on an arm, WGS-84": wheels,
    "all errors of a receiver": receiver,
    "a recording": recording,
}
