"""Every format is parsed back, and its numbers are computed by hand from the model and the definition of the format."""

import json
import math
import re

import jax
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.fitting.exports.registry import FORMATS
from gmwm_jax.fitting.result import Fit, Status
from gmwm_jax.fitting.weights import Default

RATE = 200.0
GYRO = {"x": (1e-6, 2e-12), "y": (4e-6, 1e-12), "z": (2e-6, 5e-13)}
ACCEL = {"x": (1e-4, 2e-11), "y": (9e-5, 3e-11), "z": (2e-4, 1e-11)}
"""Axis -> sigma2 and gamma2: white noise N^2 = sigma2/f, a random walk K^2 = gamma2 f, and nothing to approximate."""


def fit_of(name, unit, model, rate=RATE, levels=16):
    """The result of a fit that has found this model."""
    model = gj.parse_model(model)
    tau = 2.0 ** np.arange(1, levels + 1)
    nu = np.asarray(model.wavelet_variance(tau))
    wv = gj.variance.WaveletVariance.from_table(tau, nu, 0.9 * nu, 1.1 * nu, rate=rate, unit=unit, name=name)
    return Fit(model, wv, 0.0, np.eye(levels), Default(), Status.converged, rate=rate)


def imu(gyro=GYRO, accel=ACCEL, **options):
    sensors = (("gyro", "rad/s", gyro), ("accel", "m/s^2", accel))
    return gj.fitting.Channels(
        {
            f"{sensor}_{axis}": fit_of(f"{sensor}_{axis}", unit, f"WN(sigma2={s}) + RW(gamma2={g})", **options)
            for sensor, unit, axes in sensors
            for axis, (s, g) in axes.items()
        }
    )


def densities(axes, rate=RATE):
    return {axis: (math.sqrt(s / rate), math.sqrt(g * rate)) for axis, (s, g) in axes.items()}


N_GYRO, K_GYRO = zip(*densities(GYRO).values(), strict=True)
N_ACCEL, K_ACCEL = zip(*densities(ACCEL).values(), strict=True)

FLOAT = re.compile(r"[-+]?[0-9]+\.[0-9]*([eE][-+][0-9]+)?")
"""What YAML 1.1, and so PyYAML, takes for a float: 1e-5 is a text to it."""


def scalar(text):
    if text.startswith("["):
        items = [scalar(part.strip()) for part in text.strip("[]").split(",")]
        return items
    if FLOAT.fullmatch(text):
        return float(text)
    assert text.startswith(('"', "/")), text
    return text.strip('"')


def parse_yaml(text):
    """Mappings of scalars, lists of floats, mappings, and lists of lists; anything else is an error."""
    found, stack = {}, []
    for line in text.splitlines():
        body = line.split("#")[0].rstrip()
        if not body or line.startswith("%YAML:1.0"):
            continue
        indent = len(body) - len(body.lstrip())
        while stack and stack[-1][0] >= indent:
            stack.pop()
        above = stack[-1] if stack else None
        target = above[1] if above else found
        if body.lstrip().startswith("- "):
            above[2].setdefault(above[3], []).append(scalar(body.lstrip()[2:]))
            continue
        key, colon, value = body.strip().partition(":")
        assert colon, line
        if value.strip():
            target[key] = scalar(value.strip())
        else:
            stack.append((indent, {}, target, key))
            target[key] = stack[-1][1]
            if key in ("T_i_b", "Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC", "Tg"):
                del target[key]
    return found


def test_every_format_is_tested_here():
    assert set(FORMATS) == {"kalibr", "openvins", "vins", "kf-gins", "pyins", "gtsam", "px4", "ros", "nav-jax"}


def kalibr_numbers():
    return {
        "accelerometer_noise_density": max(N_ACCEL),
        "accelerometer_random_walk": max(K_ACCEL),
        "gyroscope_noise_density": max(N_GYRO),
        "gyroscope_random_walk": max(K_GYRO),
        "update_rate": RATE,
    }


def test_kalibr():
    text = imu().export("kalibr")
    found = parse_yaml(text)
    assert found.pop("rostopic") == "/imu0"
    assert found == pytest.approx(kalibr_numbers(), rel=1e-8)
    yaml = pytest.importorskip("yaml")
    again = yaml.safe_load(text)
    assert again.pop("rostopic") == "/imu0"
    assert again == found


def test_openvins():
    text = imu().export("openvins")
    assert text.startswith("%YAML:1.0\n")
    found = parse_yaml(text)["imu0"]
    matrices = {key: np.array(found.pop(key)) for key in ("T_i_b", "Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC", "Tg")}
    for key, matrix in matrices.items():
        size = 4 if key == "T_i_b" else 3
        np.testing.assert_array_equal(matrix, np.zeros((3, 3)) if key == "Tg" else np.eye(size))
    assert (found.pop("rostopic"), found.pop("model"), found.pop("time_offset")) == ("/imu0", "kalibr", 0.0)
    assert found == pytest.approx(kalibr_numbers(), rel=1e-8)


def test_vins_grows_by_what_the_noise_grows():
    found = parse_yaml(imu().export("vins"))
    dt = 1 / RATE
    for key, N, K in (("acc", max(N_ACCEL), max(K_ACCEL)), ("gyr", max(N_GYRO), max(K_GYRO))):
        # the preintegration: the mean of two samples times dt, each of variance n^2; a bias plus w dt
        assert 2 * (dt / 2 * found[f"{key}_n"]) ** 2 == pytest.approx(N**2 * dt, rel=1e-8)
        assert (dt * found[f"{key}_w"]) ** 2 == pytest.approx(K**2 * dt, rel=1e-8)
    assert set(found) == {"acc_n", "acc_w", "gyr_n", "gyr_w"}


def test_kf_gins_in_its_units():
    """arw deg/sqrt(h), vrw m/s/sqrt(h); biases are tested where they are no random walks."""
    found = parse_yaml(imu().export("kf-gins"))["imunoise"]
    assert set(found) == {"arw", "vrw", "gbstd", "abstd", "corrtime"}
    np.testing.assert_allclose(found["arw"], [math.degrees(N) * math.sqrt(3600) for N in N_GYRO], rtol=1e-8)
    np.testing.assert_allclose(found["vrw"], [N * math.sqrt(3600) for N in N_ACCEL], rtol=1e-8)
    # random walks are processes that never return: q = 2 sigma^2/time is theirs
    time = found["corrtime"] * 3600
    for sd, K in zip(found["gbstd"], K_GYRO, strict=True):
        assert math.sqrt(2 / time) * math.radians(sd) / 3600 == pytest.approx(K, rel=1e-2)
    for sd, K in zip(found["abstd"], K_ACCEL, strict=True):
        assert math.sqrt(2 / time) * sd * 1e-5 == pytest.approx(K, rel=1e-2)


def test_kf_gins_has_the_gauss_markov_processes_that_there_are():
    """All of one correlation time, which it can hold as they are."""
    time, sds = 20.0, {"x": 1e-4, "y": 3e-4, "z": 2e-4}
    fits = [
        fit_of(f"{sensor}_{axis}", unit, f"WN(sigma2=1e-5) + GM(beta={1 / (time * RATE)}, variance={sd**2})")
        for sensor, unit in (("gyro", "rad/s"), ("accel", "m/s^2"))
        for axis, sd in sds.items()
    ]
    found = parse_yaml(Fit.export_of(fits, "kf-gins"))["imunoise"]
    assert found["corrtime"] * 3600 == pytest.approx(time, rel=0.05)  # of the times that are tried the nearest
    np.testing.assert_allclose(found["gbstd"], [math.degrees(sd) * 3600 for sd in sds.values()], rtol=0.03)
    np.testing.assert_allclose(found["abstd"], [sd * 1e5 for sd in sds.values()], rtol=0.03)


def test_pyins():
    names = {}
    exec(imu().export("pyins"), names)
    np.testing.assert_allclose(names["GYRO"]["noise"], N_GYRO, rtol=1e-8)
    np.testing.assert_allclose(names["GYRO"]["bias_walk"], K_GYRO, rtol=1e-8)
    np.testing.assert_allclose(names["ACCEL"]["noise"], N_ACCEL, rtol=1e-8)
    np.testing.assert_allclose(names["ACCEL"]["bias_walk"], K_ACCEL, rtol=1e-8)


def test_gtsam():
    class Params:
        def __getattr__(self, name):
            assert name.startswith("set")
            return lambda matrix: self.__dict__.__setitem__(name.removeprefix("set"), matrix)

    names, params = {}, Params()
    exec(imu().export("gtsam"), names)
    names["set_noise"](params)
    for key, values in (
        ("GyroscopeCovariance", N_GYRO),
        ("BiasOmegaCovariance", K_GYRO),
        ("AccelerometerCovariance", N_ACCEL),
        ("BiasAccCovariance", K_ACCEL),
    ):
        np.testing.assert_allclose(getattr(params, key), np.diag(np.square(values)), rtol=1e-8)


def test_px4_grows_by_what_the_noise_grows():
    text = imu().export("px4")
    rows = [line.split("\t") for line in text.splitlines() if not line.startswith("#")]
    assert all(row[:2] == ["1", "1"] and row[4] == "9" for row in rows)
    found = {row[2]: float(row[3]) for row in rows}
    dt = 0.01  # the prediction step of EKF2 as it comes
    for sensor, N, K in (("GYR", max(N_GYRO), max(K_GYRO)), ("ACC", max(N_ACCEL), max(K_ACCEL))):
        assert (dt * found[f"EKF2_{sensor}_NOISE"]) ** 2 == pytest.approx(N**2 * dt, rel=1e-7)
        assert (dt * found[f"EKF2_{sensor}_B_NOISE"]) ** 2 == pytest.approx(K**2 * dt, rel=1e-7)
    assert "EKF2_PREDICT_US = 10000" in text
    assert not any("e" in row[3] for row in rows)
    other = imu().export("px4", step=0.02)
    assert "EKF2_PREDICT_US = 20000" in other
    halved = {row[2]: float(row[3]) for row in (li.split("\t") for li in other.splitlines() if li[0] != "#")}
    assert halved["EKF2_GYR_NOISE"] == pytest.approx(found["EKF2_GYR_NOISE"] / math.sqrt(2), rel=1e-7)
    assert "the range that PX4 documents" not in text
    assert "outside of 0.01 to 1, the range that PX4 documents" in other  # 1e-3 m/s^2/sqrt(Hz) over sqrt(0.02 s)


def test_ros():
    found = parse_yaml(imu().export("ros"))
    for key, values in (("angular_velocity_covariance", N_GYRO), ("linear_acceleration_covariance", N_ACCEL)):
        np.testing.assert_allclose(np.reshape(found[key], (3, 3)), np.diag(np.square(values)) * RATE, rtol=1e-8)


def test_nav_jax():
    found = json.loads(imu().export("nav-jax"))
    assert [one["channel"] for one in found] == [f"{s}_{a}" for s in ("accel", "gyro") for a in "xyz"]
    assert {one["rate"] for one in found} == {RATE}
    assert found[3]["processes"] == [{"kind": "WN", "sigma2": 1e-6}, {"kind": "RW", "gamma2": 2e-12}]


DEMO = (
    "WN(sigma2=0) + RW(gamma2=2.7878e-12) + GM(beta=2.0573, variance=5.119e-5) + GM(beta=9.0303e-4, variance=1.3274e-7)"
)


@pytest.mark.parametrize("format", [name for name in FORMATS if name != "nav-jax"])
def test_whoever_copies_a_number_gets_the_angle_random_walk(format):
    """The fit of the demonstration, whose white noise is zero: 2.797 deg/sqrt(h) in the comments of every format."""
    fits = [fit_of("gyro_x", "rad/s", DEMO, rate=100.0), fit_of("accel_x", "m/s^2", DEMO, rate=100.0)]
    text = Fit.export_of(fits, format)
    assert re.search(r"gyro_x: N = 0.00081357\d* rad/s/sqrt\(Hz\) = 2.797 deg/sqrt\(h\) \(GM_1\)", text)
    N = math.sqrt(5.119e-5 * (1 + math.exp(-2.0573)) / (1 - math.exp(-2.0573)) / 100)
    if format == "kalibr":
        assert parse_yaml(text)["gyroscope_noise_density"] == pytest.approx(N, rel=1e-8)
    if format == "kf-gins":
        assert parse_yaml(text)["imunoise"]["arw"] == pytest.approx([2.797] * 3, abs=5e-4)
    assert "RW + GM_2" in text
    assert "Rate of the samples 100 Hz" in text


def test_the_comments_say_what_was_left_out_and_how_it_was_approximated():
    model = "WN(sigma2=1e-6) + QN(q2=4e-6) + GM(beta=1e-3, variance=1e-7)"
    text = fit_of("gyro_x", "rad/s", model).export("gtsam", interval=5.0)
    flat = re.sub(r"\n# +", " ", text)
    # the integral of quantisation noise is the difference of two rounding errors
    assert (
        f"left out: QN, whose integral is bounded, with a standard deviation of {math.sqrt(8e-6) / RATE:.3g} rad"
        in flat
    )
    assert "(GM, T = 5.12 s, the time of the scales that is nearest to the one asked for)" in flat
    assert "one random walk K, which has their Allan deviation at the time T" in flat
    assert "turn-on biases" in flat
    assert all(len(line) <= 112 for line in text.splitlines() if line.startswith("#"))


def test_one_sensor_alone_where_the_format_can():
    gyro = fit_of("gyro_x", "rad/s", "WN(sigma2=1e-6) + RW(gamma2=2e-12)")
    names = {}
    exec(gyro.export("pyins"), names)
    assert "ACCEL" not in names
    np.testing.assert_allclose(names["GYRO"]["noise"], [N_GYRO[0]] * 3, rtol=1e-8)
    assert "linear" not in gyro.export("ros").split("covariances of sensor_msgs")[1]
    assert "ACC" not in gyro.export("px4")
    for format in ("kalibr", "openvins", "vins", "kf-gins", "nav-jax"):
        with pytest.raises(ValueError, match=r"wants gyros and accelerometers, and of accelerometers there are none"):
            gyro.export(format)


def test_records_in_g_and_in_si_give_the_same():
    x = np.asarray(gj.simulate("WN(sigma2=1e-4)", 1000, key=jax.random.key(0)))
    texts = []
    for samples, unit in ((x, "m/s^2"), (x / 9.80665, "g")):
        rec = gj.Recording.from_array(samples, rate=100.0, units=unit, channels=["accel_x"])
        texts.append(gj.fit(rec, "WN").export("ros"))
    found = [parse_yaml(text)["linear_acceleration_covariance"][0] for text in texts]
    assert found[0] == pytest.approx(np.var(x), rel=0.15)
    assert found[1] == pytest.approx(found[0], rel=1e-8)


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    target = tmp_path / "new" / "imu.yaml"
    text = imu().export("kalibr", path=target)
    assert target.read_text() == text
    with pytest.raises(ValueError, match="gyros"):
        imu().__class__({"accel_x": imu()["accel_x"]}).export("kalibr", path=tmp_path / "none.yaml")
    assert not (tmp_path / "none.yaml").exists()


def test_what_does_not_suit_is_refused():
    fits = imu()
    with pytest.raises(ValueError, match=r"no format 'matlab' to export to; there are kalibr, openvins"):
        fits.export("matlab")
    timeless = fit_of("gyro_x", "rad/s", "WN(sigma2=1)", rate=None)
    with pytest.raises(ValueError, match="sampling rate is missing"):
        timeless.export("ros")
    assert "step of the filter 0.01 s" in timeless.export("ros", rate=100.0)
    with pytest.raises(ValueError, match=r"gyro_x was given|rate=100.0 was given"):
        fits.export("kalibr", rate=100.0)
    with pytest.raises(ValueError, match=r"x has the unit 1, and a filter takes gyros in rad/s"):
        fit_of("x", "1", "WN(sigma2=1)").export("ros")
    with pytest.raises(ValueError, match=r"Kalibr refuses a random walk of zero, and gyro_x has none: its model"):
        Fit.export_of([fit_of("gyro_x", "rad/s", "WN(sigma2=1)"), fits["accel_x"]], "kalibr")
    with pytest.raises(ValueError, match=r"Kalibr refuses a noise density of zero, and gyro_x has none: no comp"):
        Fit.export_of([fit_of("gyro_x", "rad/s", "RW(gamma2=1)"), fits["accel_x"]], "kalibr")
    for format in ("vins", "gtsam"):
        with pytest.raises(ValueError, match=r"refuses a random walk of zero"):
            Fit.export_of([fit_of("gyro_x", "rad/s", "WN(sigma2=1)"), fits["accel_x"]], format)
    with pytest.raises(ValueError, match=r"ROS refuses a noise density of zero, and gyro_y has none"):
        Fit.export_of([fits["gyro_x"], fit_of("gyro_y", "rad/s", "RW(gamma2=1)"), fits["gyro_z"]], "ros")
    with pytest.raises(ValueError, match=r"one channel for all of them is wanted, or three .* are gyro_x, gyro_y"):
        Fit.export_of([fits["gyro_x"], fits["gyro_y"]], "gtsam")
    other = fit_of("accel_x", "m/s^2", "WN(sigma2=1)", rate=100.0)
    with pytest.raises(ValueError, match=r"one rate, and these are gyro_x 200 Hz, accel_x 100 Hz"):
        Fit.export_of([fits["gyro_x"], other], "ros")
    with pytest.raises(TypeError, match="Fits are exported, and these are of the class Odd"):
        gj.fitting.Channels({"a": Odd()}).export("kalibr")


class Odd:
    @classmethod
    def table_of(cls, results):
        return ""


def test_one_noisy_axis_is_enough_where_there_is_one_number():
    quiet = [fit_of(f"{s}_y", u, "WN(sigma2=1e-9)") for s, u in (("gyro", "rad/s"), ("accel", "m/s^2"))]
    fits = imu()
    found = parse_yaml(Fit.export_of([*quiet, fits["gyro_x"], fits["accel_x"]], "kalibr"))
    assert found["gyroscope_random_walk"] == pytest.approx(K_GYRO[0], rel=1e-8)


def test_biases_that_are_not_there():
    fits = [fit_of("gyro_x", "rad/s", "WN(sigma2=1e-6)"), fit_of("accel_x", "m/s^2", "WN(sigma2=1e-4)")]
    text = Fit.export_of(fits, "kf-gins")
    found = parse_yaml(text)["imunoise"]
    assert (found["gbstd"], found["abstd"]) == ([0.0] * 3, [0.0] * 3)
    assert found["corrtime"] > 0
    assert "No channel has a bias: any corrtime will do." in text
    names = {}
    exec(Fit.export_of(fits, "pyins"), names)
    assert names["GYRO"]["bias_walk"] == [0.0] * 3


def test_a_name_does_not_end_a_comment():
    fits = [
        fit_of("gyro_x\nupdate_rate: 1.0", "rad/s", "WN(sigma2=1e-6) + RW(gamma2=1e-12)"),
        fit_of("accel_x", "m/s^2", "WN(sigma2=1e-6) + RW(gamma2=1e-12)"),
    ]
    text = Fit.export_of(fits, "kalibr")
    assert text.count("\nupdate_rate") == 1
    assert parse_yaml(text)["update_rate"] == RATE


def test_axes_are_told_by_the_ends_of_their_names():
    fits = [
        fit_of(name, "rad/s", f"WN(sigma2={s})") for name, s in (("Gyro.Z", 3e-6), ("Gyro.X", 1e-6), ("Gyro.Y", 2e-6))
    ]
    names = {}
    exec(Fit.export_of(fits, "pyins"), names)
    np.testing.assert_allclose(names["GYRO"]["noise"], np.sqrt(np.array([1e-6, 2e-6, 3e-6]) / RATE), rtol=1e-8)
