"""Records with a mistake in them, one a row: each is said by name, and a right record says nothing."""

import re
import warnings
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from nav.small_drive import write_drive
from refusals import assert_refused, invoke

import nav_jax as nj
from nav_jax import recorded
from nav_jax.app.cli import app

RATE, SECONDS = 20.0, 40
FOOT, G = 0.3048, 9.80665
ORIGIN = np.array([0.81, 0.115, 400.0])
FAR = ORIGIN - np.array([0.47, 0.0, 0.0])
"""3,000 km to the south."""
ERRORS = nj.ImuErrors("WN(sigma2=1e-3)", "WN(sigma2=1e-6)", rate=RATE, gyro_bias_sd=1e-3)
START = nj.InitialUncertainty(position_sd=1.0, velocity_sd=0.1, attitude_sd=0.02)


@pytest.fixture(scope="module")
def drive():
    """A level vehicle that heads where it goes, brakes, turns to both sides and climbs; SI, sensors of usual noise."""
    t = np.arange(RATE * SECONDS + 1) / RATE
    speed, course = 12.0 + 5.0 * np.sin(0.6 * t), 1.2 * np.sin(0.3 * t)
    v = np.stack([speed * np.cos(course), speed * np.sin(course), -1.0 - 0.8 * np.sin(0.4 * t)], axis=1)
    p = np.concatenate([np.zeros((1, 3)), np.cumsum((v[1:] + v[:-1]) / 2, axis=0)]) / RATE
    euler = np.stack([0 * t, 0 * t, course], axis=1)
    samples, truth = nj.perfect_imu(nj.Trajectory.from_euler(t, p, euler, velocity=v))
    rng = np.random.default_rng(4)
    accel, gyro = (sd * rng.standard_normal((len(samples), 3)) for sd in (0.03, 0.001))
    imu = replace(samples, accel=samples.accel + accel, gyro=samples.gyro + gyro)
    at = slice(int(RATE), None, int(RATE))
    position = truth.position[at] + 0.1 * rng.standard_normal((SECONDS, 3))
    velocity = truth.velocity[at] + 0.05 * rng.standard_normal((SECONDS, 3))
    height = -truth.position[at, 2:] + 0.3 * rng.standard_normal((SECONDS, 1))
    return {
        "imu": imu,
        "time": truth.time[at],
        "gnss": position,
        "gnss_velocity": velocity,
        "baro": height,
        **{name: getattr(truth, name)[0] for name in ("position", "velocity", "quaternion")},
        "initial": START,
    }


def navigated(drive, **changed):
    """The solution, with throw=False: what has been said before it fails is the point."""
    given = drive | changed
    time = given.pop("time")
    aiding = [
        nj.Fixes(nj.GnssPosition(horizontal=0.1, vertical=0.1), time, given.pop("gnss")),
        nj.Fixes(nj.GnssVelocity(horizontal=0.05, vertical=0.05), time, given.pop("gnss_velocity")),
        nj.Fixes(nj.Barometer(height=0.3), time, given.pop("baro")),
    ]
    return nj.navigate(given.pop("imu"), aiding, ERRORS, throw=False, **given)


def said(function, *args, **options):
    """All warnings and the error, each with its class before it."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        try:
            function(*args, **options)
        except ValueError as error:
            return [f"ValueError: {error}"]
    return [f"{w.category.__name__}: {w.message}" for w in found]


def of_imu(**change):
    """The record with its samples changed."""
    return lambda d: {"imu": replace(d["imu"], **{name: f(getattr(d["imu"], name)) for name, f in change.items()})}


def moved(change):
    return lambda d: {"gnss": change(d["gnss"])}


def mounted(*degrees):
    return lambda d: {"imu": recorded.mounted(d["imu"], np.deg2rad(degrees))}


DOUBT = "ImplausibleRecordWarning: "
MISTAKES = {
    "fixes before the IMU": (
        lambda d: {"time": d["time"] - 100},
        "ValueError: 40 of 40 fixes of gnss_position, .* before it. .*clocks",
    ),
    "fixes after the IMU": (
        lambda d: {"time": d["time"] + 315964800},
        "ValueError: 40 of 40 fixes of gnss_position, .* after it. .*clocks",
    ),
    "some fixes before the IMU": (
        lambda d: {"time": d["time"] - 10},
        "ValueError: 9 of 40 fixes of gnss_position, .* 9 before it. Leave",
    ),
    "a position outside the Earth": (
        lambda d: {"earth": nj.Wgs84(ORIGIN), "gnss": d["gnss"] + [0, 0, 3e6]},
        "ValueError: The fixes of gnss_position: At index 0 a position is -.* m above the ellipsoid",
    ),
    "a start outside the Earth": (
        lambda d: {"earth": nj.Wgs84(ORIGIN), "position": [0, 0, 6.4e6]},
        "ValueError: .* above the ellipsoid",
    ),
    "a start 3000 km away": (
        lambda d: {"position": [3e6, 0, 0]},
        DOUBT + "The record starts 3e\\+06 m from the fix of gnss_position at",
    ),
    "fixes 3000 km away": (
        moved(lambda p: p + np.array([0, 3e6, 0])),
        DOUBT + "The record starts 3e\\+06 m from the fix of gnss_position",
    ),
    "positions in mm": (moved(lambda p: 1e3 * p), DOUBT + "Half of the fixes of gnss_position .* Earth is flat"),
    "positions in feet": (
        moved(lambda p: p / FOOT),
        DOUBT + "The positions of gnss_position speed up 3.* as of feet taken for metres",
    ),
    "velocities in km/h": (
        lambda d: {"gnss_velocity": 3.6 * d["gnss_velocity"]},
        DOUBT + "The velocities of gnss_velocity .* as of km/h",
    ),
    "velocities in knots": (
        lambda d: {"gnss_velocity": 1.944 * d["gnss_velocity"]},
        DOUBT + "The velocities .* as of knots",
    ),
    "heights in feet": (
        lambda d: {"baro": d["baro"] / FOOT},
        DOUBT + "The heights of barometer and of gnss_position .* feet beside metres",
    ),
    "depths for heights": (lambda d: {"baro": -d["baro"]}, DOUBT + "The heights .* opposite ways"),
    "east before north": (
        moved(lambda p: p[:, [1, 0, 2]]),
        DOUBT + "The positions of gnss_position turn right where the gyros turn left",
    ),
    "gyros in deg/s": (of_imu(gyro=np.rad2deg), DOUBT + "The positions .* as of gyros in deg/s taken for rad/s"),
    "gyros converted twice": (
        of_imu(gyro=np.deg2rad),
        DOUBT + "The velocities .* as of gyros in rad/s converted once more",
    ),
    "gyros that spin": (
        of_imu(gyro=lambda w: w + np.array([0, 0, 100.0])),
        DOUBT + "The gyros turn by .* rad/s in the median",
    ),
    "accelerometers in g": (
        of_imu(accel=lambda f: f / G),
        DOUBT + "The accelerometers, read as m/s\\^2, .* look like g",
    ),
    "gravity taken out": (
        of_imu(accel=lambda f: f + np.array([0, 0, G])),
        DOUBT + "The specific force is .* gravity was taken out",
    ),
    "gravity up": (of_imu(accel=lambda f: -f), "ValueError: Gravity points up at the start"),
    "upside down": (mounted(180, 0, 0), "ValueError: Gravity points up at the start: .*recorded.mounted"),
    "mounted on its side": (
        mounted(90, 0, 0),
        DOUBT + "The specific force at the start, .* deg off the vertical: the mounting",
    ),
    "mounted backwards": (
        mounted(0, 0, 180),
        DOUBT + "The velocities .* speed up where the accelerometers feel that it",
    ),
    "mounted across": (
        mounted(0, 0, 90),
        DOUBT
        + "The velocities of gnss_velocity speed up as the accelerometers feel to the right, and not ahead: the m",
    ),
    "mounted across to the other side": (mounted(0, 0, -90), DOUBT + "The velocities .* feel to the left, and not"),
    "an attitude upside down": (
        lambda d: {"quaternion": [0, 1, 0, 0]},
        "ValueError: Gravity points up at the start: .* mend the attitude",
    ),
    "a start in deg": (lambda d: {"initial": nj.InitialUncertainty(1.0, 0.1, 2.0)}, "LinearisationWarning: .* 115 deg"),
    "half a turn of yaw": (
        lambda d: {"quaternion": [0, 0, 0, 1]},
        DOUBT + "The innovations of gnss_velocity are .* times as large",
    ),
    "an outage from the start": (
        lambda d: {"outages": [(0.0, 9.0)]},
        "ValueError: No fix comes before the outage 0 to 9 s",
    ),
    "an outage that holds no fix": (
        lambda d: {"outages": [(9.2, 9.7)]},
        "ValueError: No fix lies in the outage 9.2 to 9.7 s",
    ),
}
"""What is wrong -> how the record is changed, and what is said."""


@pytest.mark.slow
def test_a_right_record_says_nothing(drive):
    assert said(navigated, drive) == []


@pytest.mark.slow
def test_a_smoother_has_no_fix_behind_an_outage(drive):
    assert said(navigated, drive, outages=[(20.0, 30.0)], smooth=True) == []
    found = said(navigated, drive, outages=[(30.0, 41.0)], smooth=True)
    assert re.match(DOUBT + "No fix of gnss_position comes after the outage 30 to 41 s, .* at 29 s", found[0])
    assert re.match(DOUBT + "No fix of gnss_velocity comes after the outage", found[1])
    assert len(found) == 2, found


def rows(table):
    """Errors come before a filter is compiled."""
    return [
        pytest.param(name, marks=() if text.startswith("ValueError") else pytest.mark.slow)
        for name, (_, text) in table.items()
    ]


@pytest.mark.parametrize("mistake", rows(MISTAKES))
def test_a_mistake_is_named(drive, mistake):
    change, expected = MISTAKES[mistake]
    found = said(navigated, drive, **change(drive))
    assert any(re.match(expected, text) for text in found), found


AT_REST = {
    "in g": (of_imu(accel=lambda f: f / G), {}, "ValueError: The mean specific force is 1 m/s\\^2 and gravity"),
    "gravity up": (of_imu(accel=lambda f: -f), {}, "ValueError: Gravity points up in this body"),
    "turning": (
        of_imu(gyro=lambda w: w + np.array([0, 0, 3.0])),
        {},
        "ValueError: The mean of the gyros is 3 rad/s at rest: the body turns",
    ),
    "a bias in deg/s": (
        of_imu(gyro=lambda w: w + 0.5),
        {},
        DOUBT + "The mean of the gyros is 0.866 rad/s at rest, 49.6 deg/s",
    ),
    "the Earth in deg/s": (
        of_imu(gyro=np.rad2deg),
        {"yaw": None, "yaw_sd": None, "earth": nj.Wgs84(ORIGIN)},
        "ValueError: The mean of the gyros .* 57.3 times the rate of the Earth",
    ),
    "a yaw in deg": (of_imu(), {"yaw": 90.0}, "ValueError: yaw and yaw_sd are in rad, and are 90 and"),
    "an sd in deg": (of_imu(), {"yaw_sd": 5.0}, "ValueError: yaw and yaw_sd are in rad, and are .* and 5"),
}


@pytest.mark.parametrize("mistake", AT_REST)
def test_a_mistake_at_rest_is_named(mistake):
    change, options, expected = AT_REST[mistake]
    still = nj.motions.static(duration=2.0, rate=RATE)
    given = {"imu": nj.perfect_imu(still, earth=nj.Wgs84(ORIGIN))[0]}
    found = said(recorded.align_at_rest, **{**given, **change(given), "yaw": 0.5, "yaw_sd": 0.1, **options})
    assert len(found) == 1, found
    assert re.match(expected, found[0]), found


def table(path, geodetic):
    names = "time,latitude,longitude,height,roll,pitch,yaw"
    rows = np.column_stack(
        [np.arange(40) / 20.0, np.broadcast_to(geodetic, (40, 3)) + 1e-7 * np.arange(40)[:, None], np.zeros((40, 3))]
    )
    np.savetxt(path, rows, "%.12f", delimiter=",", header=names, comments="")
    return path


READERS = {
    "trajectory": lambda path, **how: nj.read_trajectory(path, angles="rad", **how),
    "fixes": lambda path, **how: nj.read_fixes(
        path, nj.GnssPosition(horizontal=1.0, vertical=1.0), angles="rad", **{"origin": ORIGIN, **how}
    ),
    "gnss": lambda path, **how: nj.read_gnss(path, angles="rad", **how),
}
PLACES = {
    "latitude in deg": ((46.5, 0.1, 400.0), {}, "ValueError: .*Latitudes reach 46.5"),
    "latitude in 1e-7 deg": ((46.5e7, 6.6e7, 400.0), {}, "ValueError: .*whole numbers of 1e-7 deg"),
    "longitude in deg near the equator": ((1.3, 103.8, 40.0), {}, "ValueError: .*Longitudes reach 103.8"),
    "no height of the Earth": ((0.81, 0.115, -6e6), {}, "ValueError: .*a height is -6e\\+06 m above the ellipsoid"),
    "an origin in deg": (ORIGIN, {"origin": (46.5, 6.6, 400.0)}, "ValueError: .*The origin is .* in deg"),
    "an origin 3000 km away": (
        ORIGIN,
        {"origin": FAR},
        "FarOriginWarning: The nearest position is 29.. km from the origin",
    ),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("mistake", PLACES)
def test_a_place_that_is_none_is_named(tmp_path, reader, mistake):
    place, options, expected = PLACES[mistake]
    found = said(READERS[reader], table(tmp_path / "a.csv", place), **options)
    assert len(found) == 1, found
    assert re.match(expected, found[0]), found


@pytest.mark.slow
def test_the_origin_of_another_record(drive):
    """Its fixes lie on the Earth, and its axes are tilted by 27 deg there."""
    far = nj.Wgs84(FAR)
    geodetic = np.tile(ORIGIN, (SECONDS, 1))
    local = nj.kinematics.geodetic.ned_from_geodetic(geodetic, np.asarray(far.origin))
    turn = far.local(local[:1])[0].T
    q = nj.kinematics.rotation.quat_from_dcm(jnp.asarray(turn)[:, :, None])[:, 0]
    found = said(navigated, drive, gnss=local, position=local[0], quaternion=np.asarray(q), earth=far)
    assert any(re.match("FarOriginWarning: The nearest position is 29.. km from the origin", text) for text in found)


def test_an_imu_that_is_upside_down_has_no_course(drive):
    fixes = recorded.GnssRecord(drive["time"], drive["gnss"])
    assert recorded.align_by_course(drive["imu"], fixes).time == 1.0
    turned = recorded.mounted(drive["imu"], (np.pi, 0.0, 0.0))
    with pytest.raises(ValueError, match=r"Gravity points up in this body at 1 s .*recorded\.mounted"):
        recorded.align_by_course(turned, fixes)
    with pytest.raises(ValueError, match=r"Gravity does not point down in this body .*find_mounting"):
        recorded.align_by_course(recorded.mounted(drive["imu"], (0.0, np.pi / 2, 0.0)), fixes)


def test_a_mounting_in_deg(drive):
    with pytest.raises(ValueError, match=r"roll, pitch, yaw in rad, and is \[180.0, 0.0, 0.0\]: np.deg2rad"):
        recorded.mounted(drive["imu"], (180.0, 0.0, 0.0))


@pytest.mark.slow
def test_what_no_sensor_tells_is_named():
    """At rest positions tell the tilts, and so the gyros that tilt, but no heading: gyro z stays as it was."""
    samples, exact = nj.perfect_imu(nj.motions.static(duration=20.0, rate=RATE))
    fixes = nj.Fixes(nj.GnssPosition(horizontal=0.01, vertical=0.01), exact.time[20::20], exact.position[20::20])
    start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    solution = nj.navigate(samples, [fixes], ERRORS, **start, initial=START)
    assert list(solution.unobserved) == ["gyro z"]
    assert solution.unobserved["gyro z"] == pytest.approx(1.0, abs=1e-9)
    assert "hardly observed, with sd at the end over that at the start: gyro z 1" in repr(solution)
    assert nj.navigate(samples, [fixes], ERRORS, **start, initial=START, smooth=True).unobserved == {}


FILES = {
    "upside down": ("attitude = [0, 0, 0]", 'attitude = ["180 deg", 0, 0]', "Gravity points up at the start"),
    "another clock": ("[record]", '[record]\ntime_offset = "1 h"', "none of the 4 fixes"),
    "an origin in deg": ("[record]", "[record]\norigin = [46.5, 6.6, 400]", "in deg"),
}


@pytest.mark.parametrize("mistake", FILES)
def test_a_mistake_in_a_file_is_named(tmp_path, mistake):
    old, new, expected = FILES[mistake]
    *_, config = write_drive(tmp_path)
    config.write_text(config.read_text().replace(old, new, 1))
    assert re.search(expected, assert_refused(app, ["navigate", config]))


@pytest.mark.slow
def test_a_unit_in_a_file_is_doubted(tmp_path):
    *_, config = write_drive(tmp_path)
    config.write_text(config.read_text().replace('accel = "m/s^2"', 'accel = "mg"', 1))
    with warnings.catch_warnings():
        warnings.simplefilter("always")  # as outside of tests
        written = invoke(app, ["navigate", config]).stderr
    assert "Warning: The accelerometers, read as mg, average 0.09617" in written
