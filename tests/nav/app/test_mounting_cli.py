"""``mounting = "find"`` in the files of a simulated drive: as the same mounting stated, for each command; bad input."""

import json

import numpy as np
import pytest
from nav import cars
from nav.app.test_analysis_cli import call

import nav_jax as nj
from nav_jax.app.record_file import read_record

AGE = 0.4
"""s, of which the receiver's velocities are means."""
CLOCK = 0.25
"""s, by which the clock of the IMU is ahead."""
TOML = f"""
[record]
imu = "imu.csv"
units = {{ gyro = "rad/s", accel = "m/s^2" }}
mounting = "find"
time_offset = "{CLOCK} s"

[filters.car]
accel = "WN(sigma2=0.09)"
gyro = "WN(sigma2=1e-4)"
rate = "50 Hz"
accel_bias_sd = "0.1 m/s^2"
gyro_bias_sd = "0.2 deg/s"

[[aiding]]
type = "gnss"
file = "fixes.csv"
format = "table"
horizontal = "5 cm"
vertical = "5 cm"
horizontal_velocity = "0.1 m/s"
vertical_velocity = "0.1 m/s"
averaged = "{AGE} s"

[initial]
position_sd = "1 m"
velocity_sd = "0.3 m/s"
attitude_sd = "5 deg"

[align]
motion = "moving"
velocity_sd = "0.1 m/s"
position_sd = "5 cm"
accel_bias_sd = "0.1 m/s^2"
gyro_bias_sd = "0.2 deg/s"
accel_noise = 0.04
gyro_noise = 1.5e-3

[run]
output_interval = 1.0
"""
KNOWN = cars.car(np.random.default_rng(31), duration=60.0, hz=2.0, averaged=AGE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("mounting")
    samples = np.column_stack([KNOWN.time + CLOCK, KNOWN.gyro, KNOWN.accel])
    names = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    np.savetxt(where / "imu.csv", samples, "%.9f", delimiter=",", header=names, comments="")
    fixes = np.column_stack([KNOWN.fixes_time, KNOWN.position, KNOWN.velocity])
    names = "time,north,east,down,velocity_north,velocity_east,velocity_down"
    np.savetxt(where / "fixes.csv", fixes, "%.9f", delimiter=",", header=names, comments="")
    return where


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(folder, monkeypatch):
    monkeypatch.chdir(folder)


@pytest.fixture(scope="module")
def found():
    """By the library; files have their numbers to nine digits."""
    imu = nj.Imu(KNOWN.time, KNOWN.gyro, KNOWN.accel, KNOWN.rate)
    fixes = nj.recorded.GnssRecord(KNOWN.fixes_time, KNOWN.position, velocity=KNOWN.velocity)
    return nj.recorded.find_mounting(imu, fixes, averaged=AGE)


def written(folder, name, **changes):
    """The configuration with other words in it."""
    text = TOML
    for old, new in changes.values():
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / name).write_text(text)
    return folder / name


def stated(folder, found):
    """The same with the mounting that the library finds."""
    return written(folder, "stated.toml", mounting=('"find"', str(found.euler.tolist())))


def test_a_record_is_along_the_axes_of_the_vehicle(folder, found):
    assert (np.abs(KNOWN.error(found.euler)) < 3.5 * found.sd).all()
    record = read_record(written(folder, "drive.toml"))
    expected = read_record(stated(folder, found))
    np.testing.assert_allclose(record.imu.accel, expected.imu.accel, rtol=0, atol=1e-6)
    np.testing.assert_allclose(record.imu.gyro, expected.imu.gyro, rtol=0, atol=1e-7)
    np.testing.assert_allclose(record.quaternion, expected.quaternion, rtol=0, atol=1e-7)
    angles = ", ".join(f"{x:.2f}" for x in np.rad2deg(found.euler))
    assert record.notes[0].startswith(f"Mounting found by the drive: roll, pitch, yaw {angles} deg; sd about front")
    assert not any("Mounting" in note for note in expected.notes)


def navigated(config, tmp_path):
    stdout = call("navigate", config, "--json", tmp_path / "a.json", "--save", tmp_path / "a.npz").stdout
    return json.loads((tmp_path / "a.json").read_text()), nj.load(tmp_path / "a.npz").trajectory, stdout


@pytest.mark.slow
def test_navigate(folder, found, tmp_path):
    content, track, stdout = navigated(written(folder, "drive.toml"), tmp_path)
    _, expected, _ = navigated(stated(folder, found), tmp_path)
    np.testing.assert_allclose(track.position, expected.position, rtol=0, atol=1e-4)
    np.testing.assert_allclose(track.quaternion, expected.quaternion, rtol=0, atol=1e-5)
    assert content["notes"][0].startswith("Mounting found by the drive")
    assert content["notes"][0] in stdout


@pytest.mark.slow
def test_align(folder, found, tmp_path):
    contents = []
    for config in (written(folder, "drive.toml"), stated(folder, found)):
        stdout = call("align", config, "--json", tmp_path / "a.json").stdout
        contents.append(json.loads((tmp_path / "a.json").read_text()))
        assert ("Mounting found by the drive" in stdout) == bool(contents[-1]["notes"])
    a, b = (list(c["euler_deg"].values()) for c in contents)
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-5)
    assert [len(c["notes"]) for c in contents] == [1, 0]
    # the age of the velocities may stand in [align] as well
    age = f'averaged = "{AGE} s"\n'
    elsewhere = written(
        folder, "align.toml", receiver=(age, ""), align=('motion = "moving"\n', f'motion = "moving"\n{age}')
    )
    call("align", elsewhere, "--json", tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text()) == contents[0]


def test_inspect(folder, found, tmp_path):
    """The age of velocities is part of what the clocks are apart, there."""
    stdout = call("inspect", written(folder, "drive.toml"), "--json", tmp_path / "a.json").stdout
    mounting = json.loads((tmp_path / "a.json").read_text())["mounting"]
    assert (np.abs(KNOWN.error(mounting["euler"])) < 3.5 * np.deg2rad(list(mounting["sd_deg"].values()))).all()
    assert "of a vehicle on wheels" in stdout
    # that of a record whose mounting is stated is what is left
    call("inspect", stated(folder, found), "--json", tmp_path / "b.json")
    rest = json.loads((tmp_path / "b.json").read_text())["mounting"]
    assert (np.abs(rest["euler"]) < 3.5 * np.deg2rad(list(rest["sd_deg"].values()))).all()


NO_RECEIVER = ('file = "fixes.csv"\nformat = "table"', 'file = "none.csv"')
BAD = {
    "a word": ({"mounting": ('"find"', '"fnd"')}, '[record], mounting: expected "find", or roll, pitch, yaw'),
    "two angles": ({"mounting": ('"find"', '["1 deg", 0]')}, '[record], mounting: expected "find", or roll'),
    "a length": ({"mounting": ('"find"', '["1 m", 0, 0]')}, "[record], mounting: '1 m' has a unit that is no rad"),
    "deg as rad": ({"mounting": ('"find"', "[0, 0, 90]")}, "[record]: The mounting is roll, pitch, yaw in rad"),
    "nan": ({"mounting": ('"find"', "[0, nan, 0]")}, "[record]: The mounting (roll, pitch, yaw)"),
    "clocks": ({"clock": (f'"{CLOCK} s"', '"20 s"')}, "[record]: However the IMU is mounted, it does not feel what"),
    "a short record": (
        {"time": ("[filters", "end = 25.0\n[filters")},
        "[record]: Only 23 windows of 1 s between fixes, in the record of 0.25 to 24.99 s",
    ),
}  # fmt: skip


@pytest.mark.parametrize("command", ["navigate", "align"])
@pytest.mark.parametrize("case", BAD)
def test_what_is_refused_and_where(folder, case, command):
    changes, said = BAD[case]
    assert said in call(command, written(folder, "bad.toml", **changes), code=2).stderr


def test_a_table_of_a_receiver_is_as_good_as_its_file(folder, found, tmp_path):
    """It was passed over by inspect and by whoever looks for a mounting, where its noise is stated."""
    table = written(folder, "table.toml", as_table=('format = "table"\n', ""))
    content = {}
    for name in ("drive.toml", "table.toml"):
        written(folder, "drive.toml")
        call("inspect", folder / name, "--json", tmp_path / "found.json")
        content[name] = json.loads((tmp_path / "found.json").read_text())
    assert content["table.toml"] == content["drive.toml"]
    assert content["table.toml"]["fixes"]["num"] == len(KNOWN.fixes_time)
    assert read_record(table).notes == read_record(folder / "drive.toml").notes
    # whose positions are latitude, longitude, height is told how to say so
    (folder / "places.csv").write_text("time,latitude,longitude,height\n1.0,46.0,6.0,400\n2.0,46.0,6.0,400\n")
    where = {"as_table": ('format = "table"\n', ""), "file": ('"fixes.csv"', '"places.csv"')}
    said = call("inspect", written(folder, "bad.toml", **where), code=2).stderr
    assert "if positions are latitude, longitude and height, say so by angles" in said


def test_there_has_to_be_a_receiver(folder):
    """Be there no aiding at all, or a table of a sensor."""
    start, end = TOML.index("[[aiding]]"), TOML.index("[initial]")
    (folder / "bad.toml").write_text(TOML[:start] + TOML[end:])
    for command in ("navigate", "align"):
        message = call(command, folder / "bad.toml", code=2).stderr
        assert (
            '[record]: mounting = "find" needs the file of a GNSS receiver in [[aiding]], and there is none' in message
        )
    np.savetxt(folder / "height.csv", [[1.0, 0.0], [2.0, 0.0]], delimiter=",", header="time,height", comments="")
    baro = '[[aiding]]\ntype = "barometer"\nheight = 0.5\nfile = "height.csv"\n'
    (folder / "bad.toml").write_text(TOML[:start] + baro + TOML[end:])
    assert "needs the file of a GNSS receiver" in call("navigate", folder / "bad.toml", code=2).stderr
