"""Configurations: every section becomes what it says, units are converted, and errors say their place."""

import json
import re
import tomllib
from pathlib import Path

import equinox as eqx
import jax
import numpy as np
import pytest
from nav.synthetic import make_runs

import gmwm_jax
from nav_jax.aiding.barometer import Barometer
from nav_jax.aiding.gnss import GnssPosition, GnssVelocity
from nav_jax.app.comparison_file import read_config
from nav_jax.app.reports import keys_of
from nav_jax.app.sections import MOTIONS, ModelErrors, quantity
from nav_jax.imu.datasheets import devices
from nav_jax.imu.errors import ImuErrors, RecordedErrors
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.stopping import Precision
from nav_jax.trajectory import motions
from nav_jax.trajectory.files import save_trajectory

ACCEL = "WN(sigma2=6e-5) + GM(beta=0.01, variance=1e-6)"
GYRO = "WN(sigma2=1.5e-6) + RW(gamma2=1e-13)"
TEXT = f"""
[trajectory]
motion = "lemniscate"
duration = "0.1 min"
size = "20 m"

[truth]
accel = "{ACCEL}"
gyro = {{ x = "{GYRO}", y = "WN(sigma2=2e-6)", z = "WN(sigma2=3e-6)" }}
rate = "50 Hz"
gyro_bias_sd = ["1 deg/h", 0, "2 deg/h"]
start = "zero"

[filters]
right = "truth"

[filters."WN only"]
accel = "WN(sigma2=6e-5)"
gyro = "WN(sigma2=1.5e-6)"
rate = 50

[[aiding]]
type = "gnss_position"
horizontal = "2.5 cm"
vertical = 0.05
outages = [["4 s", 5]]

[[aiding]]
type = "gnss_velocity"
rate = 2
horizontal = "36 mm/s"
vertical = "0.02 m/s"
believed = [0.01, 0.02]
first = 1

[[aiding]]
type = "barometer"
name = "second barometer"
height = "WN(sigma2=0.25)"

[initial]
position_sd = ["1 m", 2, "3 m"]
attitude_sd = "1 deg"

[run]
num_runs = 3
seed = 7
gravity = 9.8056
every = 5
"""


@pytest.fixture
def write(tmp_path):
    """Write a configuration, with texts replaced."""

    def written(text=TEXT, **replaced):
        for old, new in replaced.get("by", {}).items():
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        path = tmp_path / "a.toml"
        path.write_text(text)
        return path

    return written


# what it becomes


def test_every_section_becomes_what_it_says(write):
    """Against the same comparison, written in Python with SI numbers."""
    config = read_config(write())
    reference = motions.lemniscate(6.0, 50.0, size=20.0, gravity=9.8056)
    assert config.scenario.reference.name == "lemniscate"
    for field in ("time", "position", "velocity", "quaternion"):
        np.testing.assert_array_equal(getattr(config.scenario.reference, field), getattr(reference, field))
    deg = np.pi / 180
    gyro = [GYRO, "WN(sigma2=2e-6)", "WN(sigma2=3e-6)"]
    bias = np.array([1, 0, 2]) * deg / 3600
    truth = ImuErrors(ACCEL, gyro, 50.0, gyro_bias_sd=bias, start="zero")
    white = ImuErrors("WN(sigma2=6e-5)", "WN(sigma2=1.5e-6)", 50.0)
    for seen, expected in ((config.truth, truth), (config.filters["WN only"], white)):
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-14), seen, expected)
    assert config.filters["right"] is config.truth
    aiding = [
        GnssPosition(horizontal=0.025, vertical=0.05, outages=[(4.0, 5.0)]),
        GnssVelocity(2.0, horizontal=0.036, vertical=0.02, believed=(0.01, 0.02), first=1.0),
        Barometer(height=0.5, name="second barometer"),
    ]
    for seen, expected in zip(config.scenario.aiding, aiding, strict=True):
        assert (seen.name, seen.rate, seen.first, seen.outages) == (
            expected.name, expected.rate, expected.first, expected.outages,
        )  # fmt: skip
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-14), seen, expected)
    assert float(config.scenario.earth.gravity) == 9.8056
    assert (config.scenario.every, config.scenario.output_interval) == (5, 1.0)
    sd = np.sqrt(np.diag(config.scenario.initial.covariance))
    np.testing.assert_allclose(sd, [1, 2, 3, 0, 0, 0, deg, deg, deg], rtol=1e-14)
    assert config.run.model_dump() == {
        "num_runs": 3, "seed": 7, "gains": "estimate", "every": 5, "output_interval": 1.0, "earth": "flat",
        "gravity": 9.8056, "origin": None, "chunk_size": None, "workers": None, "neglected": [], "suspected": [],
        "stop": None, "temperature_rise": None, "temperature_time": 300.0,
    }  # fmt: skip
    assert config.output.model_dump() == {"folder": None, "plot": True, "save": None}


def test_the_earth_may_be_round(write):
    """About an origin that the file states."""
    text = 'earth = "wgs84"\norigin = ["46.5 deg", "6.6 deg", "500 m"]'
    scenario = read_config(write(by={"gravity = 9.8056": text})).scenario
    np.testing.assert_allclose(scenario.earth.origin, [*np.deg2rad([46.5, 6.6]), 500.0], rtol=1e-14)
    np.testing.assert_array_equal(scenario.reference.origin, scenario.earth.origin)


def test_it_runs_what_it_says(write, monkeypatch):
    """What `compare` is given, with other numbers of runs and seeds, and some of the filters."""
    calls = []
    config = read_config(write())

    def recorded(*positional, **named):
        calls.append((positional, named))
        return Comparison(config.scenario.reference, {"right": make_runs()})

    monkeypatch.setattr("nav_jax.app.comparison_file.compare", recorded)
    config.compare()
    config.compare(num_runs=2, seed=1, only=["WN only"], progress=True)
    for (positional, named), names, num_runs, seed, progress in zip(
        calls, (["right", "WN only"], ["WN only"]), (3, 2), (7, 1), (False, True), strict=True
    ):
        scenario, truth, filters = positional
        assert (scenario, truth) == (config.scenario, config.truth)
        assert list(filters) == names
        assert all(f is config.filters[name] for name, f in filters.items())
        assert named.pop("key") == jax.random.key(seed)
        assert named == {
            "num_runs": num_runs, "progress": progress, "gains": "estimate", "chunk_size": None, "workers": None,
            "stop": None,
        }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ('"significant"', "significant"),
        ('"anytime"', "anytime"),
        ('{position = "1 cm"}', Precision(position=0.01)),
        ('{difference = "2 mm", least = 256}', Precision(difference=0.002, least=256)),
    ],
)
def test_rules_of_stopping(write, text, rule):
    assert read_config(write(by={"gravity = 9.8056": f"gravity = 9.8056\nstop = {text}"})).run.rule == rule


@pytest.mark.parametrize(
    ("text", "complaint"),
    [('"soon"', "significant"), ("{}", "position= or difference="), ('{position = "1 deg"}', "position")],
)
def test_rules_that_are_none(write, text, complaint):
    with pytest.raises(ValueError, match=complaint):
        read_config(write(by={"gravity = 9.8056": f"gravity = 9.8056\nstop = {text}"}))


@pytest.mark.parametrize("name", MOTIONS)
def test_every_motion(write, name):
    """All parameters but rate and gravity are keys, and what is needed is enough."""
    needed = {"waypoints": 'speed = "36 km/h"\npoints = [[0, 0, 0], [100, 0, "-1 km"], [100, 100, 0], [0, 100, 0]]'}
    default = needed.get(name, 'duration = "1 min"')
    attitude = {"static": 'euler = ["10 deg", 0, "1 rad"]', "lemniscate": 'attitude = "navigation"'}
    text = f'motion = "{name}"\n{default}\n{attitude.get(name, "attitude = [0, 0, 0.5]")}'
    old = 'motion = "lemniscate"\nduration = "0.1 min"\nsize = "20 m"'
    reference = read_config(write(by={old: text, 'outages = [["4 s", 5]]': ""})).scenario.reference
    assert reference.rate == 50.0
    if name == "static":
        np.testing.assert_allclose(reference.euler[0], [np.pi / 18, 0, 1], atol=1e-12)
    elif name == "waypoints":
        assert np.linalg.norm(reference.position - [100, 0, -1000], axis=1).min() < 0.1  # at 10 m/s and 50 Hz
    else:
        assert reference.duration == 60.0


def test_a_trajectory_from_a_file(write, tmp_path):
    """Beside the configuration; its columns and units as read_trajectory wants them; smoothed if asked."""
    reference = motions.circle(6.0, 20.0, radius=30.0)
    save_trajectory(reference, tmp_path / "flight.csv")
    old = 'motion = "lemniscate"\nduration = "0.1 min"\nsize = "20 m"'
    read = read_config(write(by={old: 'file = "flight.csv"'})).scenario.reference
    np.testing.assert_allclose(read.position, reference.position, atol=1e-12)
    (tmp_path / "logger.csv").write_text("Logger 7\nof 2026\n" + (tmp_path / "flight.csv").read_text())
    below = read_config(write(by={old: 'file = "logger.csv"\nheader = 3'})).scenario.reference
    np.testing.assert_array_equal(below.position, read.position)
    smooth = read_config(write(by={old: 'file = "flight.csv"\nsmooth = "500 ms"'})).scenario.reference
    np.testing.assert_array_equal(smooth.position, read.smoothed(0.5).position)
    assert np.abs(smooth.position - read.position).max() > 0


SOURCE = f"""accel = "{ACCEL}"
gyro = {{ x = "{GYRO}", y = "WN(sigma2=2e-6)", z = "WN(sigma2=3e-6)" }}
rate = "50 Hz"
gyro_bias_sd = ["1 deg/h", 0, "2 deg/h"]
start = "zero"
"""


def test_a_sensor_by_name(write):
    config = read_config(write(by={SOURCE: 'sensor = "mti-g"', "rate = 50\n": "rate = 100\n"}))
    models = gmwm_jax.datasets.sensor_models("mti-g")
    channels = [f"{s}_{axis}" for s in ("accel", "gyro") for axis in "xyz"]
    assert config.truth.rate == 100.0
    assert [repr(m) for m in config.truth.models] == [repr(models[c]) for c in channels]
    slow = read_config(write(by={SOURCE: 'sensor = "mti-g"\nrate = "50 Hz"'})).truth
    assert slow.rate == 50.0
    # the density of white noise stays
    assert float(slow.models[0].processes[0].sigma2) == pytest.approx(3.021e-5 / 2, rel=1e-12, abs=0)


def test_a_device_by_its_datasheet(write):
    """What is emulated in the truth, what a filter believes in a filter; the rate is the datasheet's or another."""
    white = 'accel = "WN(sigma2=6e-5)"\ngyro = "WN(sigma2=1.5e-6)"'
    true = 'device = "ADIS16405"\nrate = "50 Hz"\neffects = ["range", "LSB"]\nlongest = "10 min"'
    config = read_config(write(by={SOURCE: true, white: 'device = "ADIS16405"\ncorrelation_time = "100 s"'}))
    sheet = devices["ADIS16405"]
    expected = sheet.truth(50.0, effects=["range", "LSB"], longest=600.0)
    assert eqx.tree_equal(config.truth, expected)
    assert eqx.tree_equal(config.filters["WN only"], sheet.filter(50.0, correlation_time=100.0))
    # what the datasheet leaves open is added to it, and what it says is not said twice
    more = 'device = "LSM6DSO"\ncalibration = { misalignment = { accel_sd = 5e-3 } }\n'
    more += "gravity = { anomaly = 3e-4, distance = 1e3 }"
    config = read_config(write(by={SOURCE: f"{more}\nrate = 50", white: more}))
    kinds = [[type(d).__name__ for d in e.deterministic] for e in (config.truth, config.filters["WN only"])]
    assert kinds == [["ScaleFactor", "Misalignment"]] * 2
    assert config.truth.gravity is not None
    with pytest.raises(ValueError, match="Two errors have the same constants"):
        read_config(write(by={white: more.replace("misalignment", "scale_factor")}))
    own = {SOURCE: 'device = "HG1700 AG58"', "rate = 50\n": "rate = 100\n"}
    assert read_config(write(by=own)).truth.rate == 100.0


@pytest.fixture
def fits(tmp_path):
    """Fits of two channels, as the command line of gmwm_jax writes them."""
    rec = gmwm_jax.datasets.simulated("mti-g", 3000, channels=["gyro_x", "accel_x"])
    found = gmwm_jax.fit(gmwm_jax.wavelet_variance(rec), "WN")
    content = [f.to_dict() for f in found.values()]
    assert [p["kind"] for p in content[0]["processes"]] == ["WN"]
    content[0]["processes"].append({"kind": "RW", "gamma2": 0.0})
    (tmp_path / "fit.json").write_text(json.dumps(content))
    return found, content


def test_fits_with_all_their_digits(write, fits, tmp_path):
    """One channel serves three axes; components at zero are no states."""
    found, content = fits
    config = read_config(write(by={SOURCE: 'fit = "fit.json"', "rate = 50\n": "rate = 100\n"}))
    expected = ImuErrors(found["accel_x"], found["gyro_x"])
    assert config.truth.rate == 100.0
    jax.tree.map(np.testing.assert_array_equal, config.truth, expected)
    six = [{**f, "channel": f["channel"][:-1] + axis} for f in content for axis in "xyz"]
    (tmp_path / "fit.json").write_text(json.dumps(six))
    again = read_config(write(by={SOURCE: 'fit = "fit.json"', "rate = 50\n": "rate = 100\n"}))
    jax.tree.map(np.testing.assert_array_equal, again.truth, expected)


def test_a_recording_is_a_truth(write, tmp_path):
    rec = gmwm_jax.datasets.simulated("mti-g", 2000)
    gmwm_jax.save_recording(rec, tmp_path / "static.npz")
    by = {SOURCE: 'recording = "static.npz"', "rate = 50\n": "rate = 100\n", 'right = "truth"': ""}
    truth = read_config(write(by=by)).truth
    assert isinstance(truth, RecordedErrors)
    assert truth.rate == 100.0
    for column, channel in enumerate(("accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z")):
        np.testing.assert_allclose(
            truth.record[:, column], rec.column(channel) - rec.column(channel).mean(), rtol=1e-12
        )
    with pytest.raises(ValueError, match="truth is a recording, of which no filter has a model"):
        read_config(write(by={k: v for k, v in by.items() if "right" not in k}))


def test_no_filters_means_the_truth(write):
    old = TEXT[TEXT.index("[filters]") : TEXT.index("[[aiding]]")]
    config = read_config(write(by={old: ""}))
    assert config.filters == {"truth": config.truth}


# units


@pytest.mark.parametrize(
    ("value", "si", "expected"),
    [
        (2, "m", 2.0), ("2 m", "m", 2.0), ("-2.5e-1cm", "m", -0.0025), (".5 km", "m", 500.0), ("3 mm", "m", 0.003),
        ("1 min", "s", 60.0), ("500 ms", "s", 0.5), ("2 kHz", "1/s", 2000.0), ("36 km/h", "m/s", 10.0),
        ("180 deg", "rad", np.pi), ("1 g", "m/s^2", 9.80665), ("3600 deg/h", "rad/s", np.pi / 180),
        ("9.81 m/s2", "m/s^2", 9.81),
    ],
)  # fmt: skip
def test_quantities(value, si, expected):
    assert quantity(value, si) == pytest.approx(expected, rel=1e-14, abs=0)


@pytest.mark.parametrize(
    ("value", "si", "message"),
    [
        ("2", "m", "expected a number in m, or a text with its unit such as \"1 m\", and this is '2'"),
        ("two m", "m", "expected a number"),
        (True, "m", "expected a number"),
        ([1], "s", "expected a number"),
        ("2 furlong", "m", "no m; lengths are in m, km, cm, mm"),
        ("2 m/s", "m", "no m"),
        ("2 m", "m/s", "'2 m' has a unit that is no m/s"),
        ("2 deg/fortnight", "rad/s", "Unknown unit 'deg/fortnight'"),
        ("2 deg", "rad/s", "deg measures rad and rad/s measures rad/s"),
    ],
)
def test_what_is_no_quantity(value, si, message):
    with pytest.raises(ValueError, match=message.replace("(", r"\(")):
        quantity(value, si)


# bad input: all of it before anything is computed

WRONG = [
    ({"[run]": "[runs]"}, "there is no section [runs]; the sections are trajectory, truth, filters, aiding"),
    ({"[truth]": "[filters.truth]"}, "the section [truth] is missing"),
    ({'size = "20 m"': "sise = 20"}, "[trajectory]: there is no key 'sise'; the keys are motion, duration, size"),
    ({'size = "20 m"': 'size = "20 s"'}, "[trajectory], size: '20 s' has a unit that is no m"),
    ({'size = "20 m"': "size = -1"}, "[trajectory]: size (m) must be a positive and finite number, and is -1.0"),
    ({'"lemniscate"': '"spiral"'}, "motion is one of static, straight, circle"),
    ({'motion = "lemniscate"': ""}, '[trajectory]: give either file = "..." or motion = "..."'),
    ({'"lemniscate"': '"static"\neuler = ["1 m", 0, 0]'}, "[trajectory], euler.0: '1 m' has a unit that is no rad"),
    ({'"lemniscate"': '"waypoints"'}, "[trajectory]: the key 'points' is missing"),
    ({'rate = "50 Hz"': ""}, "[truth]: the key 'rate' is missing"),
    ({'rate = "50 Hz"': 'rate = "50 Hz"\nsensor = "mti-g"'}, "[truth]: the errors are given by accel and gyro, or by"),
    ({SOURCE: ""}, "[truth]: the errors are given by accel and gyro, or by sensor, by fit, by device or by"),
    ({SOURCE: 'sensor = "mti-h"'}, "[truth]: There is no sensor 'mti-h'; there are: mti-g"),
    ({SOURCE: 'sensor = "imar-fsas"'}, "[truth]: imar-fsas: channels accel_x, accel_y and accel_z are wanted"),
    ({SOURCE: 'fit = "a.toml"'}, "[truth]: "),
    ({SOURCE: 'device = "STIM301"\nrate = 50'}, "[truth]: device is one of MPU-6000, "),
    ({SOURCE: 'device = "STIM300"\nrate = 50\neffects = ["LSB"]'}, "[truth]: effects: STIM300 leaves the gyro's LSB"),
    ({SOURCE: 'device = "STIM300"\ncorrelation_time = 100'}, "[truth]: there is no key 'correlation_time'; the keys"),
    ({'start = "zero"': 'start = "nowhere"'}, "[truth], start: Input should be 'stationary' or 'zero', and it"),
    ({'x = "WN': 'w = "WN'}, "[truth], gyro"),
    ({"sigma2=2e-6": "sigma2=-2e-6"}, "[truth]: WN: sigma2 must be one number in [0, inf), and is -2e-06"),
    ({"GM(beta=0.01": "GN(beta=0.01"}, "[truth]: Unknown process 'GN'"),
    ({'right = "truth"': 'right = "true"'}, '[filters.right] is a section, or the text "truth", and is \'true\''),
    ({"rate = 50\n": ""}, "[filters.WN only]: the key 'rate' is missing"),
    ({'accel = "WN(sigma2=6e-5)"': 'recording = "x.npz"'}, "[filters.WN only]: the errors are given by"),
    (
        {'"barometer"\n': '"sextant"\n'},
        "[[aiding]] 3: type is one of gnss, gnss_position, gnss_velocity, barometer, odometer, non_holonomic, ",
    ),
    ({'"2.5 cm"': '"-2.5 cm"'}, "[[aiding]] 1: gnss_position: a standard deviation must be positive"),
    ({'[["4 s", 5]]': "[[5, 4]]"}, "[[aiding]] 1: gnss_position: the outage (5, 4) ends before it starts"),
    ({'[["4 s", 5]]': "[4, 5]"}, "[[aiding]] 1, outages.0"),
    ({'"36 mm/s"': '"36 mm"'}, "[[aiding]] 2, horizontal: '36 mm' has a unit that is no m/s"),
    ({"vertical = 0.05": "vertikal = 0.05"}, "[[aiding]] 1: there is no key 'vertikal'"),
    ({"[[aiding]]\ntype = \"barometer\"": "[aiding2]\ntype = \"barometer\""}, "there is no section [aiding2]"),
    ({'attitude_sd = "1 deg"': 'attitude_sd = "-1 deg"'}, "[initial]: attitude_sd must be non-negative"),
    ({"num_runs = 3": "num_runs = 0"}, "[run], num_runs: Input should be greater than or equal to 1, and it is 0"),
    ({"num_runs = 3": 'num_runs = "3"'}, "[run], num_runs: Input should be a valid integer, and it is '3'"),
    ({"seed = 7": 'gains = "kalman"'}, "[run], gains: Input should be 'estimate', 'reference' or 'two-level', and it"),
    ({"seed = 7": "seed = 7\nworker = 2"}, "[run]: there is no key 'worker'; the keys are earth, gravity, num_runs"),
    ({"[run]": "[run"}, "is no TOML file"),
    ({"seed = 7": 'temperature_time = "2 min"'}, "[run]: temperature_time is that of a temperature_rise"),
    ({"seed = 7": 'earth = "round"'}, "[run], earth: Input should be 'flat' or 'wgs84', and it is 'round'"),
    ({"seed = 7": 'earth = "wgs84"'}, "[run]: gravity is that of a flat Earth; wgs84 has its own"),
    ({"gravity = 9.8056": 'earth = "wgs84"'}, "[run]: wgs84 needs to know where positions are zero: state"),
    ({"seed = 7": "origin = [0.8, 0.1, 500]"}, '[run]: origin is that of earth = "wgs84"'),
    ({"gravity = 9.8056": 'earth = "wgs84"\norigin = [46.5, 6.6, 500]'}, "are the angles in deg?"),
]  # fmt: skip


@pytest.mark.parametrize(("by", "message"), WRONG, ids=[message[:40] for _, message in WRONG])
def test_what_is_wrong_is_said_by_its_place(write, by, message):
    path = write(by=by)
    with pytest.raises(ValueError) as seen:  # noqa: PT011
        read_config(path)
    assert str(seen.value).startswith(str(path))
    assert message in str(seen.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [("", "is no file of fits"), ("{}", "the fits belong to one rate"), ('[{"channel": 1}]', "is no file of fits"),
     ('[{"channel": "gyro_x", "rate": null, "processes": []}]', "the fits belong to one rate")],
)  # fmt: skip
def test_a_corrupt_file_of_fits(write, tmp_path, content, message):
    (tmp_path / "fit.json").write_text(content)
    with pytest.raises(ValueError, match=message):
        read_config(write(by={SOURCE: 'fit = "fit.json"'}))


def test_files_that_are_not_there(write, tmp_path):
    with pytest.raises(FileNotFoundError):
        read_config(tmp_path / "none.toml")
    for by in ({SOURCE: 'fit = "none.json"'}, {SOURCE: 'recording = "none.npz"', 'right = "truth"': ""}):
        with pytest.raises(FileNotFoundError):
            read_config(write(by=by))


def test_the_text_here_is_complete():
    """Every section is in it."""
    assert set(tomllib.loads(TEXT)) == {"trajectory", "truth", "filters", "aiding", "initial", "run"}


CALIBRATED = """
[truth.calibration]
scale_factor = { accel_sd = "300 ppm", gyro_sd = ["0.1 %", 0, 1e-3] }
misalignment = { gyro_sd = "1 mrad" }
g_sensitivity = { gyro_sd = "10 deg/h/g" }
temperature_bias = { accel_sd = "0.1 mg/K" }

[filters.all]
accel = "WN(sigma2=6e-5)"
gyro = "WN(sigma2=1.5e-6)"
rate = 50
calibration = { scale_factor = { accel_sd = 3e-4 } }
"""


def test_what_a_calibration_leaves(write):
    """Each kind in its customary units, beside models; and the sensor warms up where the run says so."""
    rise = 'gravity = 9.8056\ntemperature_rise = "20 K"\ntemperature_time = "2 min"'
    config = read_config(write(TEXT + CALIBRATED, by={"gravity = 9.8056": rise}))
    scale, bent, g, warm = config.truth.deterministic
    np.testing.assert_allclose(scale.sd, [3e-4] * 3 + [1e-3, 0, 1e-3], rtol=1e-14)
    np.testing.assert_allclose(bent.sd, [0, 0, 0, 1e-3, 1e-3, 1e-3], rtol=1e-14)
    np.testing.assert_allclose(g.sd, [0, 0, 0] + [np.deg2rad(10 / 3600) / 9.80665] * 3, rtol=1e-14)
    np.testing.assert_allclose(warm.sd, [9.80665e-4] * 3 + [0, 0, 0], rtol=1e-14)
    assert [type(d).__name__ for d in config.filters["all"].deterministic] == ["ScaleFactor"]
    assert config.filters["WN only"].deterministic == ()
    time = config.scenario.reference.time
    np.testing.assert_allclose(config.scenario.temperature, 20 * (1 - np.exp(-time / 120)), rtol=1e-12, atol=1e-12)


def test_errors_are_read_as_they_are_written(write):
    """`keys_of` is what a page puts into the file; what has no key is lost there, and must not be."""
    field = 'gravity = { deflection = "6 arcsec", anomaly = "30 mGal", distance = ["20 km", 3e4, "30 km"] }'
    truth = read_config(write(TEXT + CALIBRATED, by={'start = "zero"': f'start = "zero"\n{field}'})).truth
    again = ModelErrors.model_validate(keys_of(truth)).build(Path())
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-14), again, truth)
    assert str(again.states) == str(truth.states)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{ scale = { gyro_sd = 1 } }', "[truth]: there is no key 'calibration.scale'; the keys are scale_factor,"),
        ('{ g_sensitivity = { accel_sd = 1 } }', "no key 'calibration.g_sensitivity.accel_sd'; the keys are gyro_sd."),
        ('{ misalignment = { gyro_sd = "1 m" } }', "[truth], calibration.misalignment.gyro_sd: '1 m' has a unit that"),
        ('{ misalignment = 1 }', "[truth], calibration.misalignment: "),
        ('{ scale_factor = { gyro_sd = -1 } }', "[truth]: ScaleFactor: gyro_sd"),
        ('{ scale_factor = { gyro_sd = [1, 2] } }', "[truth]: ScaleFactor: gyro_sd is one number or three"),
    ],
)  # fmt: skip
def test_a_calibration_that_is_none(write, text, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        read_config(write(by={'start = "zero"': f'start = "zero"\ncalibration = {text}'}))


def test_gravity_beside_the_model_in_its_customary_units(write):
    """In whatever way the errors are stated, for truth and filters alike."""
    field = 'gravity = { deflection = "6 arcsec", anomaly = "30 mGal", distance = ["20 km", 3e4, "30 km"] }'
    by = {'start = "zero"': f'start = "zero"\n{field}', "rate = 50\n": f"rate = 50\n{field}\n"}
    found = read_config(write(by=by))
    for errors in (found.truth, found.filters["WN only"], found.filters["right"]):
        assert isinstance(errors, ImuErrors)
        assert errors.gravity is not None
        sd = [9.80665 * np.deg2rad(6 / 3600)] * 2
        np.testing.assert_allclose(errors.gravity.sd, [*sd, 30e-5])
        np.testing.assert_allclose(errors.gravity.distance, [20e3, 30e3, 30e3])
    with pytest.raises(ValueError, match="distance"):
        read_config(write(by={'start = "zero"': 'start = "zero"\ngravity = { anomaly = "30 mGal" }'}))
