"""The command navigate: a simulated drive with a mounted IMU and clocks apart, its table and files, and bad input."""

import json

import numpy as np
import pymap3d
import pytest
from nav.app.test_analysis_cli import call
from nav.small_drive import write_drive
from scipy.spatial.transform import Rotation

import nav_jax as nj
from nav_jax.app.record_file import read_record

RATE = 20.0
ORIGIN = (46.5, 6.6, 400.0)
MOUNT = np.deg2rad([180.0, -5.0, 90.0])
OFFSET = 0.4
"""s by which the IMU's clock is ahead."""
TOW = 156840.0
DRIVE = """
[record]
imu = "imu.csv"
units = { gyro = "deg/s", accel = "g" }
mounting = ["180 deg", "-5 deg", "90 deg"]
time_offset = "0.4 s"
end = 156878.4
course_speed = "3 m/s"
origin = ["46.5 deg", "6.6 deg", "400 m"]

[filters.right]
accel = "WN(sigma2=4e-4)"
gyro = "WN(sigma2=1e-6)"
rate = "20 Hz"

[filters.other]
accel = "WN(sigma2=4e-2)"
gyro = "WN(sigma2=1e-4)"
rate = "20 Hz"

[[aiding]]
type = "gnss_position"
file = "gnss.pos"
lever_arm = [1.0, 0.5, -1.0]
exclude = ["single"]
outages = [[156860, 156865]]

[[aiding]]
type = "gnss_velocity"
file = "gnss.pos"
horizontal = "0.1 m/s"
vertical = "0.1 m/s"
lever_arm = [1.0, 0.5, -1.0]
outages = [[156860, 156865]]

[initial]
position_sd = "0.5 m"
velocity_sd = "0.2 m/s"
attitude_sd = "3 deg"

[reference]
file = "reference.csv"

[output]
export = "track.gpx"
"""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    """Somebody works where the files are, and folders below are made."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The files of a drive whose truth is known."""
    folder = tmp_path_factory.mktemp("drive")
    rng = np.random.default_rng(5)
    samples, exact = nj.perfect_imu(nj.motions.racetrack(duration=40.0, rate=RATE, straight=60.0, turn=20.0))
    R = Rotation.from_euler("ZYX", MOUNT[::-1]).as_matrix()
    gyro = (samples.gyro + rng.normal(0.0, 1e-3, (800, 3))) @ R
    accel = (samples.accel + rng.normal(0.0, 0.02, (800, 3))) @ R
    table = np.column_stack([TOW + OFFSET + samples.time, np.rad2deg(gyro), accel / 9.80665])
    names = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    np.savetxt(folder / "imu.csv", table, "%.12f", delimiter=",", header=names, comments="")
    nj.trajectory.save_trajectory(
        nj.Trajectory(TOW + OFFSET + exact.time, exact.position, exact.velocity, exact.quaternion),
        folder / "reference.csv",
    )
    q = np.roll(exact.quaternion, -1, axis=1)
    arm = np.array([1.0, 0.5, -1.0])
    rate = np.concatenate([samples.gyro, samples.gyro[-1:]])
    antenna = exact.position + Rotation.from_quat(q).apply(arm)
    speed = exact.velocity + Rotation.from_quat(q).apply(np.cross(rate, arm))
    lines = ["% GPST latitude(deg) longitude(deg) height(m) Q ns sdn sde sdu sdne sdeu sdun age ratio vn ve vu"]
    for k in range(0, 801, 10):
        sd, quality = ((0.05, 1), (0.3, 2), (5.0, 5))[int(k % 70 == 0) + int(k % 140 == 0)]
        p = pymap3d.ned2geodetic(*(antenna[k] + sd * rng.normal(size=3)), *ORIGIN)
        v = (speed[k] + 0.1 * rng.normal(size=3)) * [1, 1, -1]
        sds = " ".join(f"{x}" for x in (sd, sd, sd, 0, 0, 0, 0, 9))
        lines.append(
            f"2322 {TOW + exact.time[k]:.3f} {p[0]:.12f} {p[1]:.12f} {p[2]:.6f} {quality} 9 {sds} "
            + " ".join(f"{x:.6f}" for x in v)
        )
    (folder / "gnss.pos").write_text("\n".join(lines))
    return folder, exact


@pytest.fixture
def drive(written):
    path = written[0] / "drive.toml"
    path.write_text(DRIVE)
    return path


def test_the_record_is_put_together(drive, written):
    known = read_record(drive)
    exact = written[1]
    start = known.imu.time[0] - TOW - OFFSET
    row = round(start * RATE)
    np.testing.assert_allclose(known.position, exact.position[row], rtol=0, atol=0.3)
    np.testing.assert_allclose(known.velocity, exact.velocity[row], rtol=0, atol=0.5)
    assert abs(known.quaternion @ exact.quaternion[row]) > np.cos(np.deg2rad(2.0))
    position, velocity = known.aiding
    assert known.imu.epochs[-1] == pytest.approx(156878.4)
    assert position.time[-1] <= known.imu.epochs[-1]
    assert set(np.round(np.sqrt(position.covariance[:, 0, 0]), 3)) == {0.05, 0.3}
    assert velocity.covariance is None
    assert len(velocity.time) > len(position.time)
    assert known.notes[0].startswith("gnss_position: ")
    # 2322 weeks and some seconds, less 18 leap seconds and the offset
    assert known.utc == np.datetime64("2024-07-06T23:59:41.600000")


@pytest.mark.slow
def test_navigate(drive, written, tmp_path):
    saved = written[0] / "a.npz"
    drive.write_text(drive.read_text().replace("[output]", "[run]\ngate = { gnss_position = 0.99999 }\n\n[output]"))
    report = ("--out", tmp_path, "--json", tmp_path / "a.json", "--save", saved)
    stdout = call("navigate", drive, "--filter", "right", *report).stdout
    assert "horizontal error at the end [m]" in stdout
    assert "Errors against the reference" in stdout
    assert "fixes lie in the record." in stdout
    content = json.loads((tmp_path / "a.json").read_text())
    assert content["filter"] == "right"
    assert content["refused"] == {"gnss_position": []}
    # three components; the antenna's velocity shares the noise of the gyros, little of it
    assert 2.0 < content["nis"]["gnss_position"]["mean"] < 4.2
    (outage,) = content["outages"]["gnss_position"]
    assert outage["num_fixes"] in (9, 10)
    assert outage["error"] < 4 * outage["claimed"]
    reference = content["reference"]
    assert reference["position"]["rms"] < 0.4
    assert 0.3 < reference["position"]["rms"] / reference["position"]["claimed"] < 2.5
    figures = {"track.png", "innovations.png", "sensors.png", "outages.png"}
    assert {p.name for p in tmp_path.iterdir()} == figures | {"navigation.txt", "navigation.json", "a.json"}
    assert all((tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in figures)
    assert repr(nj.load(saved)) in stdout
    # times in UTC, on a map
    track = nj.read_gnss(written[0] / "track.gpx", origin=(*np.deg2rad(ORIGIN[:2]), ORIGIN[2]))
    exact = written[1]
    at = exact.at(np.clip(track.time - TOW, 0.0, 40.0))
    assert np.abs(track.position - at.position).max() < 1.5


@pytest.mark.slow
def test_outages(drive, tmp_path):
    """The record has some 36 s with fixes: of two runs, outages of 4 s each 12 s, shifted by 6."""
    drive.write_text(drive.read_text().replace("[output]", "[run]\nvibration = { accel = 0.01 }\n\n[output]"))
    options = ("--filter", "right", "--last", "4", "--every", "12", "--out", tmp_path, "--json", tmp_path / "a.json")
    stdout = call("outages", drive, *options, "--save", tmp_path / "a.npz").stdout
    assert repr(nj.load(tmp_path / "a.npz")) in stdout
    content = json.loads((tmp_path / "a.json").read_text())
    assert content["sensor"] == "gnss_position"
    assert {row["run"] for row in content["outages"]} == {0, 1}
    starts = sorted(row["start"] for row in content["outages"])
    np.testing.assert_allclose(np.diff(starts), 6.0)
    assert all(row["end"] - row["start"] == pytest.approx(4.0) for row in content["outages"])
    assert f"median {content['median']:.3g}, RMS {content['rms']:.3g}" in stdout
    assert (tmp_path / "outages.png").read_bytes().startswith(b"\x89PNG")


BAD = [
    ({"[output]": "[run]\ngate = 99.9\n\n[output]"}, [], "[run], gate"),
    ({"[output]": "[run]\ngate = { gps = 0.99 }\n\n[output]"}, [], "There is no sensor 'gps' for a gate"),
    ({"[output]": "[run]\nvibration = -1\n\n[output]"}, [], "[run], vibration"),
    ({"imu.csv": "none.csv"}, [], "There is no file"),
    ({'time_offset = "0.4 s"': 'time_offset = "1 h"'}, [], "[record]: No fix between 156841 and 156878 s has a speed"),
    ({'course_speed = "3 m/s"': 'course_speed = "300 m/s"'}, [], "has a speed of 300 m/s"),
    ({'course_speed = "3 m/s"': "attitude = [0, 0, 1]"}, [], "With an attitude there must be a velocity"),
    ({'course_speed = "3 m/s"': "attitude = [0, 0, 1]\ncourse_speed = 1"}, [], "course_speed is for"),
    ({"end = 156878.4": "end = 10"}, [], "[record]: The record is of 156840 to 156880 s"),
    ({"end = 156878.4": "end = 1\nend2 = 2"}, [], "there is no key 'end2'"),
    ({'exclude = ["single"]': 'exclude = ["bad"]'}, [], "[[aiding]] 1: There is no quality 'bad'"),
    ({'exclude = ["single"]': 'clock = "sun"'}, [], "The clock is one of week"),
    ({'exclude = ["single"]': "believed = [1, 2]"}, [], "believed: what the filter believes of recorded fixes"),
    ({'file = "reference.csv"': 'file = "imu.csv"'}, [], "[reference]: "),
    ({"imu": "imu"}, ["--export", "a.txt"], "tracks are exported as .csv, .npz, .kml, .gpx"),
    ({"imu": "imu"}, ["--save", "a.gpx"], "solutions are saved as .npz, .json, .nc, .zarr"),
    ({"horizontal = \"0.1 m/s\"\n": ""}, [], "[[aiding]] 2: gnss_velocity: the file has no standard deviations"),
]  # fmt: skip


@pytest.mark.parametrize(("by", "arguments", "message"), BAD)
def test_bad_input_is_one_line(drive, by, arguments, message):
    text = drive.read_text()
    for old, new in by.items():
        assert old in text
        text = text.replace(old, new)
    drive.write_text(text)
    code = 2
    stderr = call("navigate", drive, *arguments, code=code).stderr
    assert message in " ".join(stderr.replace("│", " ").split()), stderr


def test_an_output_is_not_written_over_an_input(drive):
    text = drive.read_text().replace('export = "track.gpx"', 'export = "reference.csv"')
    drive.write_text(text)
    assert "reference.csv" in call("navigate", drive, code=2).stderr


def test_inspect(drive, tmp_path):
    """Nothing but the record is needed; what is found is beyond what is stated."""
    text = drive.read_text().replace('time_offset = "0.4 s"', 'time_offset = "0.3 s"').replace("end = 156878.4", "")
    drive.write_text(text[: text.index("[filters.right]")] + text[text.index("[[aiding]]") : text.index("[initial]")])
    result = call("inspect", drive, "--out", tmp_path, "--json", tmp_path / "a.json")
    assert "IMU: 800 samples at 20 Hz" in result.stdout
    content = json.loads((tmp_path / "a.json").read_text())
    assert {(o["fixes"], o["signal"]) for o in content["time_offsets"]} == {
        (fixes, signal) for fixes in ("positions", "velocities") for signal in ("turns", "speed")
    }
    assert content["fixes"]["start"] == pytest.approx(TOW + 0.3, abs=1.0)
    assert (tmp_path / "inspection.png").read_bytes().startswith(b"\x89PNG")
    assert "give --out" in call("inspect", drive, "--plot", code=2).stderr


def test_a_record_has_an_origin_that_not_all_of_its_sensors_need(tmp_path):
    """Speeds and velocities have none, and local positions are about it already."""
    *_, config = write_drive(tmp_path)
    at = np.arange(1.0, 5.0)
    for name, columns in (("odo", "time,speed"), ("speed", "time,vn,ve,vd"), ("baro", "time,height")):
        table = np.column_stack([at, np.zeros((4, columns.count(",")))])
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header=columns, comments="")
    more = """
[[aiding]]
type = "odometer"
file = "odo.csv"
speed = 0.1
[[aiding]]
type = "gnss_velocity"
file = "speed.csv"
horizontal = 0.1
vertical = 0.1
[[aiding]]
type = "barometer"
file = "baro.csv"
height = 0.5
[run]
earth = "wgs84"
"""
    config.write_text(config.read_text().replace("[record]", "[record]\norigin = [0.81, 0.115, 400.0]", 1) + more)
    known = read_record(config)
    assert [f.sensor.name for f in known.aiding] == ["gnss_position", "odometer", "gnss_velocity", "barometer"]
    np.testing.assert_array_equal(known.aiding[0].value, np.zeros((4, 3)))
    np.testing.assert_array_equal(known.aiding[3].value, np.full((4, 1), -400.0))


def test_what_nothing_measures_is_told_by_the_samples(tmp_path):
    *_, config = write_drive(tmp_path)
    more = """
[[aiding]]
type = "zero_velocity"
rate = "5 Hz"
sd = "2 cm/s"
accel_sd = 0.1
gyro_sd = "0.5 deg/s"
window = "0.4 s"
[[aiding]]
type = "non_holonomic"
rate = "10 Hz"
right = "3 cm/s"
down = "5 cm/s"
slip = 0.0
bumps = 0.0
"""
    before, fixes = config.read_text().split("[[aiding]]")
    config.write_text(before + more + "[[aiding]]" + fixes)
    still, wheels, gnss = read_record(config).aiding
    np.testing.assert_allclose(still.time, 0.2 * np.arange(1, 21), rtol=0, atol=1e-9)
    assert wheels.sensor.axes == ("right", "down")
    np.testing.assert_allclose(np.sqrt(wheels.covariance[:, [0, 1], [0, 1]]), [[0.03, 0.05]] * 40)
    assert gnss.sensor.name == "gnss_position"
    call("inspect", config)
    for old, new, said in (
        ('gyro_sd = "0.5 deg/s"', "", "Give fixes with velocities, or the standard deviations at rest"),
        ("slip = 0.0", "slip = -1.0", "slip must be"),
        ("slip = 0.0", 'file = "odo.csv"', "there is no key 'file'"),
    ):
        config.write_text((before + more + "[[aiding]]" + fixes).replace(old, new, 1))
        assert said in call("navigate", config, code=2).stderr


def test_an_outage_that_holds_no_fix_is_noted(tmp_path):
    *_, config = write_drive(tmp_path)
    config.write_text(
        config.read_text().replace('vertical = "2 m"', 'vertical = "2 m"\noutages = [[1.5, 2.5], [60, 75]]')
    )
    assert read_record(config).notes == ("gnss_position: no fix lies in the outage 60 to 75 s, of 1 to 4 s.",)
