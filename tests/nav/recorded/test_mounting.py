"""The mounting of an IMU in a vehicle on wheels: as stated, and as found from simulated drives, where it is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from nav import cars
from scipy.spatial.transform import Rotation

import nav_jax as nj
from nav_jax.recorded import GnssRecord, find_mounting

MOST = 3.5
"""Claimed standard deviations: one of these 60 errors is larger in three of a hundred choices of seeds."""
EXACT = np.deg2rad([1e-5, 1e-5, 0.1])
"""rad. Two axes are told by gravity, the third by velocities over a second, in which a vehicle turns."""


def taken(drive, *, velocities=True, rows=slice(None), later=0.0):
    """What the package takes of a drive."""
    v = drive.velocity[rows] if velocities else None
    fixes = GnssRecord(drive.fixes_time[rows] + later, drive.position[rows], velocity=v)
    return nj.Imu(drive.time, drive.gyro, drive.accel, drive.rate), fixes


def drive(seed, **options):
    return cars.car(np.random.default_rng(seed), **options)


def exact(**options):
    return drive(0, road=cars.FLAT, errors=cars.EXACT, **options)


def misses(found, drive):
    """Errors in claimed standard deviations."""
    return np.abs(drive.error(found.euler)) / found.sd


def test_mounted_turns_to_the_axes_of_the_body():
    imu, _ = nj.perfect_imu(nj.motions.racetrack(duration=40.0, rate=50.0, straight=60.0, turn=20.0))
    euler = np.array([0.3, -0.2, 2.0])
    R = Rotation.from_euler("ZYX", euler[::-1]).as_matrix()
    found = nj.recorded.mounted(replace(imu, gyro=imu.gyro @ R, accel=imu.accel @ R), euler)  # R' in columns
    np.testing.assert_allclose(found.gyro, imu.gyro, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.accel, imu.accel, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("velocities", [True, False])
def test_any_mounting_is_found(seed, velocities):
    known = drive(seed, hz=(1.0, 5.0)[seed % 2])
    found = find_mounting(*taken(known, velocities=velocities))
    assert misses(found, known).max() < MOST
    # not by claiming little: the roll as well as the roads are level across, the others by two minutes of driving
    assert (found.sd < np.deg2rad([1.3, 0.7, 1.6])).all()


@pytest.mark.parametrize(("hz", "velocities"), [(5.0, True), (1.0, True), (5.0, False), (1.0, False)])
def test_without_errors_it_is_found_exactly(hz, velocities):
    known = exact(hz=hz)
    found = find_mounting(*taken(known, velocities=velocities))
    assert (np.abs(known.error(found.euler)) < EXACT).all()


def test_velocities_of_a_moment_ago():
    """The clock is known and the age of velocities is stated, or it is not; of positions it is not asked."""
    known = exact(hz=5.0, averaged=0.8)
    imu, fixes = taken(known)
    stated = find_mounting(imu, fixes, averaged=0.8, clock_sd=0.0)
    assert (np.abs(known.error(stated.euler)) < EXACT).all()
    unstated = find_mounting(imu, fixes, clock_sd=0.0)
    assert np.abs(known.error(unstated.euler)).max() > 3 * np.abs(known.error(stated.euler)).max()
    assert unstated.sd[2] > 3 * stated.sd[2]
    positions = replace(fixes, velocity=None)
    by_positions = [find_mounting(imu, positions, averaged=a, clock_sd=0.0).euler for a in (0.0, 0.8)]
    np.testing.assert_array_equal(*by_positions)


def test_a_further_rotation_of_the_imu_is_found_as_such():
    known = drive(3)
    imu, fixes = taken(known)
    more = cars.any_rotation(np.random.default_rng(8))
    a = find_mounting(imu, fixes)
    b = find_mounting(
        replace(imu, gyro=more.inv().apply(imu.gyro.copy()), accel=more.inv().apply(imu.accel.copy())), fixes
    )
    A, B = (Rotation.from_euler("ZYX", m.euler[::-1]) for m in (a, b))
    assert (A * more * B.inv()).magnitude() < 1e-6
    np.testing.assert_allclose(b.covariance, a.covariance, rtol=1e-6, atol=1e-12)


def test_a_drive_to_another_direction_tells_the_same():
    known = drive(4)
    imu, fixes = taken(known)
    north_to = Rotation.from_euler("Z", 2.0)
    elsewhere = replace(fixes, position=north_to.apply(fixes.position), velocity=north_to.apply(fixes.velocity))
    a, b = (find_mounting(imu, f) for f in (fixes, elsewhere))
    np.testing.assert_allclose(a.euler, b.euler, rtol=0, atol=1e-6)


def test_a_receiver_without_vertical_velocities():
    known = drive(5)
    imu, fixes = taken(known)
    v = fixes.velocity.copy()
    v[:, 2] = np.nan
    assert misses(find_mounting(imu, replace(fixes, velocity=v)), known).max() < MOST


def test_fixes_that_are_missing():
    known = drive(6)
    there = (known.fixes_time < 40.0) | (known.fixes_time > 60.0)
    found = find_mounting(*taken(known, rows=there))
    assert misses(found, known).max() < MOST
    # none over the gap, nor one that ends in it; a fix without a velocity is as one that is missing
    whole, fixes = taken(known)
    assert 20 <= find_mounting(whole, fixes).num_windows - found.num_windows <= 22
    v = np.where(there[:, None], fixes.velocity, np.nan)
    np.testing.assert_allclose(find_mounting(whole, replace(fixes, velocity=v)).euler, found.euler, rtol=0, atol=1e-9)


def test_a_vehicle_that_backs_out_of_a_yard():
    known = drive(7, duration=180.0, backs=(20.0, 40.0))
    assert misses(find_mounting(*taken(known)), known).max() < MOST


def test_fixes_that_are_wrong_now_and_then():
    known = drive(8)
    imu, fixes = taken(known)
    v = fixes.velocity.copy()
    v[50::120] += [30.0, -20.0, 5.0]
    assert misses(find_mounting(imu, replace(fixes, velocity=v)), known).max() < MOST


@pytest.mark.parametrize("options", [{"turning": 0.0}, {"hurry": 0.0}, {"turning": 0.4, "hurry": 6.0}])
def test_a_road_without_turns_and_one_without_braking_and_a_race(options):
    """What does not happen says nothing, and is no contradiction; nor are accelerations above that of gravity."""
    known = drive(9, **options)
    assert misses(find_mounting(*taken(known)), known).max() < MOST


@pytest.mark.parametrize("errors", [cars.EXACT, cars.Errors(), cars.Errors(vibration=0.03)])
@pytest.mark.parametrize("seed", [10, 20, 21])
def test_a_straight_at_constant_speed_tells_no_yaw(errors, seed):
    """Nor does noise, of which least squares make as much of a yaw as of anything."""
    known = drive(seed, turning=0.0, hurry=0.0, road=cars.FLAT, errors=errors)
    with pytest.raises(
        ValueError, match=r"does not tell the mounting of the IMU to 10 deg \(1 sigma; it tells .* down"
    ):
        find_mounting(*taken(known))


def test_what_is_believed_is_used():
    known = drive(11)
    imu, fixes = taken(known)
    usual = find_mounting(imu, fixes)
    level = find_mounting(imu, fixes, cross_slope_sd=0.0)
    np.testing.assert_array_equal(level.euler, usual.euler)
    slope = usual.covariance[0, 0] - level.covariance[0, 0]
    assert np.sqrt(slope) == pytest.approx(np.deg2rad(1.0))
    # a bias of the accelerometers is a tilt, which two minutes tell in part
    calibrated = find_mounting(imu, fixes, cross_slope_sd=0.0, accel_bias_sd=1e-3)
    assert calibrated.sd[0] < level.sd[0]


def signs(gyro, accel):
    return lambda d: replace(d, gyro=d.gyro * np.array(gyro), accel=d.accel * np.array(accel))


RIGHT = [1.0, 1.0, 1.0]
BAD = {
    "a left-handed system": (signs([1, -1, 1], [1, -1, 1]), {}, "specific forces across it -0.9.*right-handed system"),
    "accelerometers of the other sign": (signs(RIGHT, [-1, -1, -1]), {}, "sign of the accelerometers"),
    "gyros of the other sign": (signs([-1, -1, -1], RIGHT), {}, "correlations: turn rates -0.9.*are the same ones"),
    "clocks 30 s apart": (lambda d: d, {"later": 30.0}, "does not feel what the fixes show.*clocks of both"),
    "other days": (lambda d: d, {"later": 1e6}, "Only 0 windows of 1 s between fixes.*clocks of both"),
    "deg/s": (signs([180 / np.pi] * 3, RIGHT), {}, r"factors: turn rates 5\d\).*units of both"),
    "deg/s taken twice": (signs([np.pi / 180] * 3, RIGHT), {}, r"factors: turn rates 0\.017\).*units of both"),
    "g": (signs(RIGHT, [1 / 9.80665] * 3), {}, r"feel 1\.\d+ m/s\^2 \(median .* gravity is 9.807 .*units"),
    "dead accelerometers": (signs(RIGHT, [0.0] * 3), {}, r"feel 0 m/s\^2 .* gravity is 9.807 .*units"),
    "dead gyros": (signs([0.0] * 3, RIGHT), {}, r"correlations: turn rates 0\.00"),
    "km/h": (lambda d: replace(d, velocity=3.6 * d.velocity), {}, "specific forces along the way 0.* units of both"),
    "feet": (
        lambda d: replace(d, position=d.position / 0.3048),
        {"velocities": False},
        "specific forces along the way 0.* units of both",
    ),
    "no speed": (lambda d: replace(d, velocity=0 * d.velocity), {}, "Only 0 windows .* faster than 2 m/s"),
    "no velocity": (lambda d: replace(d, velocity=np.nan * d.velocity), {}, "Only 0 windows"),
    "few fixes": (lambda d: d, {"rows": slice(100)}, "Only 18 windows .* told by 30 or more"),
    "one fix": (lambda d: d, {"rows": slice(1)}, "Only 0 windows"),
    "no fix": (lambda d: d, {"rows": slice(0)}, "Only 0 windows"),
    "two positions": (
        lambda d: d,
        {"rows": slice(2), "velocities": False},
        "There are 2 fixes: velocities are derived",
    ),
    "a clock that was reset": (
        lambda d: replace(d, fixes_time=np.where(d.fixes_time < 60.0, d.fixes_time, d.fixes_time - 30.0)),
        {},
        "The time of the fixes does not increase at index 300",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_refused_and_how(case):
    change, options, said = BAD[case]
    imu, fixes = taken(change(drive(12)), **options)
    with pytest.raises(ValueError, match=said):
        find_mounting(imu, fixes)


@pytest.mark.parametrize(
    ("name", "value"), [("accel_bias_sd", -1.0), ("averaged", np.nan), ("gravity", 0.0), ("ahead_sd", np.inf)]
)
def test_arguments_that_are_no_numbers_of_their_kind(name, value):
    with pytest.raises(ValueError, match=f"{name} must be a .* number, and is"):
        find_mounting(*taken(drive(13, duration=40.0)), **{name: value})


def test_a_mounting_prints_itself_and_is_numbers():
    known = drive(14)
    found = find_mounting(*taken(known))
    text = repr(found)
    for part in (f"by {found.num_windows} windows", "roll", "yaw", "down", f"{np.rad2deg(found.euler[1]):.2f}"):
        assert part in text
    content = json.loads(json.dumps(found.to_dict()))
    assert list(content["euler_deg"].values()) == pytest.approx(np.rad2deg(found.euler))
    assert list(content["sd_deg"]) == ["front", "right", "down"]
    assert np.sqrt(np.diag(content["covariance"])) == pytest.approx(found.sd)
    assert np.deg2rad(list(content["sd_deg"].values())) == pytest.approx(found.sd)


def inspected(drive, fixes):
    return nj.recorded.inspect_record(drive.time, drive.gyro, drive.accel, fixes)


def test_an_inspection_has_it_whatever_the_clocks():
    known = drive(15)
    _, fixes = taken(known, later=-0.8)
    found = inspected(known, fixes)
    assert misses(found.mounting, known).max() < MOST
    assert repr(found.mounting) in repr(found)
    assert "if it is that of a vehicle on wheels" in repr(found)
    assert found.to_dict()["mounting"] == found.mounting.to_dict()
    # that of what is mounted already is what is left
    rest = nj.recorded.inspect_record(known.time, *(known.mounting.apply(x) for x in (known.gyro, known.accel)), fixes)
    assert np.abs(rest.mounting.euler / rest.mounting.sd).max() < MOST


def test_an_inspection_says_why_there_is_none():
    known = drive(16)
    _, fixes = taken(known)
    alone = inspected(known, None)
    assert alone.mounting == "there are no fixes"
    assert alone.to_dict()["mounting"] is None
    # somebody walks at a tenth of the speed
    walk = inspected(known, replace(fixes, position=0.1 * fixes.position, velocity=0.1 * fixes.velocity))
    assert "faster than 2 m/s, and the mounting of the IMU is told by 30 or more" in walk.mounting
    assert walk.mounting in repr(walk)
    assert walk.to_dict()["mounting"] is None
