"""The command align: a record at rest and one on the move, whose attitudes are known, and bad input."""

import json
from dataclasses import replace

import numpy as np
import pymap3d
import pytest
from nav import moving
from nav.app.test_analysis_cli import call
from scipy.spatial.transform import Rotation

import nav_jax as nj
from nav_jax.app.record_file import read_record

ORIGIN = (46.5, 6.6, 400.0)
TOW = 156840.0
TOML = """
[record]
imu = "imu.csv"
units = { gyro = "rad/s", accel = "m/s^2" }

[align]
"""
MOVING = """motion = "moving"
velocity_sd = "0.05 m/s"
position_sd = 0.05
accel_bias_sd = "2 mg"
gyro_bias_sd = "0.1 deg/s"
gyro_noise = "0.1 deg/sqrt(h)"

[[aiding]]
type = "gnss_position"
file = "gnss.pos"
"""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    """Somebody works where the files are, and folders below are made."""
    monkeypatch.chdir(tmp_path)


def written(folder, drive, text):
    """The files of a drive, and its configuration."""
    table = np.column_stack([TOW + drive.imu.time, drive.imu.gyro, drive.imu.accel])
    names = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    np.savetxt(folder / "imu.csv", table, "%.12f", delimiter=",", header=names, comments="")
    lines = ["% GPST latitude(deg) longitude(deg) height(m) Q ns sdn sde sdu sdne sdeu sdun age ratio vn ve vu"]
    for k in range(0, len(drive.time), 25):
        p = pymap3d.ned2geodetic(*(drive.position[k]), *ORIGIN)
        v = " ".join(f"{x:.9f}" for x in drive.velocity[k] * [1, 1, -1])
        lines.append(f"2322 {TOW + drive.time[k]:.3f} {p[0]:.12f} {p[1]:.12f} {p[2]:.6f} 1 9 .1 .1 .1 0 0 0 0 9 {v}")
    (folder / "gnss.pos").write_text("\n".join(lines))
    (folder / "drive.toml").write_text(TOML + text)
    return folder / "drive.toml"


def aligned(config, tmp_path):
    stdout = call("align", config, "--out", tmp_path / "out", "--json", tmp_path / "a.json").stdout
    content = json.loads((tmp_path / "a.json").read_text())
    assert json.loads((tmp_path / "out" / "alignment.json").read_text()) == content
    assert (tmp_path / "out" / "alignment.txt").read_text().strip() in stdout
    return content, stdout


def test_on_the_move(tmp_path):
    drive = moving.car()
    content, stdout = aligned(written(tmp_path, drive, MOVING), tmp_path)
    assert content["time"] == TOW + 30.0
    yaw, pitch, roll = Rotation.from_matrix(drive.C[round(30.0 * moving.RATE)]).as_euler("ZYX", degrees=True)
    found = content["euler_deg"]
    np.testing.assert_allclose([found["roll"], found["pitch"], found["yaw"]], [roll, pitch, yaw], atol=0.01)
    assert "yaw" in stdout
    # an arm of the receiver is used: its antenna is taken for being a metre behind where it is
    shifted = written(tmp_path, drive, MOVING + "lever_arm = [1.0, 0.0, 0.0]\n")
    other, _ = aligned(shifted, tmp_path)
    apart = np.linalg.norm(np.subtract(other["position"], content["position"]))
    assert apart == pytest.approx(1.0, abs=0.01)
    # the sd of roll, pitch and yaw are those of small turns of the attitude in n, here by finite differences
    C, base = np.array(content["covariance"])[6:, 6:], drive.C[round(30.0 * moving.RATE)]
    slope = np.array([
        Rotation.from_matrix(Rotation.from_rotvec(1e-6 * e).as_matrix() @ base).as_euler("ZYX") for e in np.eye(3)
    ]).T - Rotation.from_matrix(base).as_euler("ZYX")[:, None]  # fmt: skip
    sd = np.rad2deg(np.sqrt(np.diag(slope @ C @ slope.T)) / 1e-6)
    np.testing.assert_allclose([content["euler_sd_deg"][k] for k in ("yaw", "pitch", "roll")], sd, rtol=1e-3)


def test_at_rest(tmp_path):
    still = nj.motions.static(duration=8.0, rate=moving.RATE, euler=(0.0, 0.0, 0.7))
    drive = moving.turned(*nj.perfect_imu(still), (0.1, -0.05, 0.0))
    text = 'motion = "at rest"\nyaw = "40 deg"\nyaw_sd = "2 deg"\naccel_bias_sd = "1 mg"\n'
    content, _ = aligned(written(tmp_path, drive, text), tmp_path)
    assert content["euler_deg"] == pytest.approx(
        {"roll": np.rad2deg(0.1), "pitch": np.rad2deg(-0.05), "yaw": 40.0}, abs=1e-6
    )
    assert content["euler_sd_deg"]["yaw"] == pytest.approx(2.0, rel=0.01)
    assert content["euler_sd_deg"]["pitch"] == pytest.approx(np.rad2deg(1e-3), rel=0.01)


def test_what_is_wrong_is_said(tmp_path):
    drive = moving.car()
    for text, said in (
        ('motion = "moving"\n', "needs the file of a GNSS receiver"),
        ('motion = "at rest"\naveraged = 20.0\n', "averaged is no argument of motion"),
        ('motion = "flying"\n', "[align]"),
        ("window = 20.0\n", "motion"),
    ):
        assert said in call("align", written(tmp_path, drive, text), code=2).stderr


MODELS = """
[filters.car]
rate = 50.0
accel = "WN(sigma2=0.0001) + RW(gamma2=1e-8)"
gyro = "WN(sigma2=1e-6) + RW(gamma2=1e-12)"
accel_bias_sd = "2 mg"
gyro_bias_sd = "0.1 deg/s"

[run]
output_interval = 1.0
"""
ALIGNED = "[initial]\nalign = true\n" + MODELS


def navigated(config, tmp_path):
    call("navigate", config, "--json", tmp_path / "n.json", "--save", tmp_path / "n.npz")
    return json.loads((tmp_path / "n.json").read_text()), nj.load(tmp_path / "n.npz")


def error_of(solution, drive):
    """Angle between the attitude of a solution and the true one at each of its epochs, rad."""
    e = solution.trajectory
    true = Rotation.from_matrix(drive.C[np.rint((e.time - TOW) * moving.RATE).astype(int)])
    return (true.inv() * Rotation.from_quat(np.roll(e.quaternion, -1, axis=1))).magnitude()


def test_navigation_starts_where_an_alignment_on_the_move_ends(tmp_path):
    """Of a record with the biases of a car's gyros, along whose course nothing tells how the IMU is mounted."""
    drive = moving.car(duration=45.0)
    bias = np.array([0.002, -0.001, 0.0015])
    drive = replace(drive, imu=replace(drive.imu, gyro=drive.imu.gyro + bias))
    content, solution = navigated(written(tmp_path, drive, MOVING + ALIGNED), tmp_path)
    assert solution.trajectory.time[0] == TOW + 30.0
    assert error_of(solution, drive).max() < np.deg2rad(0.5)
    said = " ".join(content["notes"])
    assert "the alignment on the move ends" in said
    found = [float(x) for x in said.split("off the gyro: ")[1].split(" deg/h")[0].split(",")]
    np.testing.assert_allclose(found, np.rad2deg(bias) * 3600, rtol=0, atol=np.rad2deg(1e-4) * 3600)
    # the fixes up to the start were used by the alignment, and are not used again
    assert solution.fixes[0].time[0] == TOW + 30.5


def test_what_is_unknown_of_a_receiver_is_unknown_of_the_start(tmp_path):
    """Its clock by the way of that time, its antenna by where that is, errors that last as they are."""
    config = written(tmp_path, moving.car(), MOVING + ALIGNED)
    known = read_record(config)
    exact = np.asarray(known.initial.covariance)
    C = Rotation.from_quat(np.roll(known.quaternion, -1)).as_matrix()

    def more(option):
        config.write_text((TOML + MOVING + ALIGNED).replace('"gnss.pos"', f'"gnss.pos"\n{option}'))
        return np.asarray(read_record(config).initial.covariance) - exact

    late = more("time_offset_sd = 0.1")
    np.testing.assert_allclose(late[:3, :3], 0.01 * np.outer(known.velocity, known.velocity), rtol=0, atol=1e-9)
    a = late[:3, 3:6].T @ known.velocity / (0.01 * known.velocity @ known.velocity)
    np.testing.assert_allclose(late[3:6, 3:6], 0.01 * np.outer(a, a), rtol=0, atol=1e-9)
    turning = (known.imu.gyro[:50] @ C.T)[:, 2]  # it turns at about this rate a third of the time
    assert 0.01 * late[8, 8] < (0.1 * np.abs(turning).max()) ** 2
    arm = more("lever_arm_sd = [0.3, 0.2, 0.1]")
    np.testing.assert_allclose(arm[:3, :3], C @ np.diag([0.09, 0.04, 0.01]) @ C.T, rtol=0, atol=1e-9)
    lasting = more('drift = "GM(beta=0.05, variance=0.25)"')
    np.testing.assert_allclose(lasting, np.diag([0.25] * 3 + [0.0] * 6), rtol=0, atol=1e-9)


def test_navigation_starts_where_the_vehicle_stood(tmp_path):
    drive = moving.turned(*nj.perfect_imu(nj.motions.static(duration=12.0, rate=moving.RATE)), (0.1, -0.05, 0.4))
    drive = replace(drive, imu=replace(drive.imu, gyro=drive.imu.gyro + 0.001))
    rest = 'motion = "at rest"\nwindow = 8.0\nyaw = 0.4\nyaw_sd = "1 deg"\naccel_bias_sd = "1 mg"\n'
    receiver = '[[aiding]]\ntype = "gnss_position"\nfile = "gnss.pos"\n'
    content, solution = navigated(written(tmp_path, drive, rest + receiver + ALIGNED), tmp_path)
    assert solution.trajectory.time[0] == TOW + 8.0
    assert error_of(solution, drive).max() < 1e-3
    assert "off the gyro: 206.3, 206.3, 206.3 deg/h" in " ".join(content["notes"])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (MOVING + "[initial]\nalign = true\nposition_sd = 1.0\n" + MODELS, "leave out position_sd"),
        ('motion = "at rest"\nyaw = 0.0\nyaw_sd = 0.1\n' + ALIGNED, "needs window"),
    ],
)
def test_starts_that_contradict_themselves(tmp_path, text, said):
    assert said in call("navigate", written(tmp_path, moving.car(), text), code=2).stderr


def test_an_alignment_that_is_not_there(tmp_path):
    config = written(tmp_path, moving.car(), "")
    text = config.read_text().replace("[align]\n", "") + ALIGNED
    config.write_text(text)
    assert "no section [align]" in call("navigate", config, code=2).stderr
    config.write_text(
        text.replace("[initial]", "[align]\nmotion = 'moving'\n[initial]").replace(
            "[record]\n", "[record]\nvelocity = [1.0, 0.0, 0.0]\n"
        )
    )
    assert "leave one out" in call("navigate", config, code=2).stderr
