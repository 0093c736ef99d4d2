"""Inputs of the room are the keys of a configuration, and what they state is that configuration."""

import dataclasses
import tomllib

import numpy as np
import pytest

import gmwm_jax as gj
import nav_jax as nj
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.rooms.joined import joined
from nav_jax.app.sections import AIDING, MOTIONS
from nav_jax.app.web import controls, study
from nav_jax.app.web.followed import follow
from nav_jax.app.web.inputs import make_ui
from nav_jax.app.web.models import errors_of, fits_of
from nav_jax.app.web.room import ROOM
from nav_jax.app.web.state import NavigationState
from nav_jax.app.web.study import OWN, PAGE, RIGHT, UNCALIBRATED, config_of_text, tables_of, toml_of
from nav_jax.filter.scenario import Scenario
from nav_jax.imu.channels import CHANNELS
from nav_jax.imu.deterministic import DETERMINISTIC
from nav_jax.imu.errors import ImuErrors, sensor_errors
from nav_jax.trajectory.files import save_trajectory, to_geodetic

TEXT = {"nav_truth": "text", "nav_accel": "WN(sigma2=1e-4)", "nav_gyro": "WN(sigma2=1e-6)", "nav_rate": "20"}


def config(state, models=None):
    return config_of_text(toml_of(tables_of(state, models or {})))


def test_the_page_finds_the_room():
    found = joined(())
    if not found.rooms and not found.failures:
        pytest.skip("the package is installed without its entry points: install it again")
    assert ROOM in found.rooms


def test_each_field_of_a_scenario_has_inputs():
    """Where this fails, a scenario has learnt something: give it a row in `controls.OF_SCENARIO`."""
    assert set(controls.OF_SCENARIO) == {field.name for field in dataclasses.fields(Scenario)}
    assert {c.name for c in controls.motions()} == {*MOTIONS, controls.FILE}
    assert {c.name for c in controls.aiding()} == set(AIDING)
    assert {c.name for c in controls.calibration()} == set(DETERMINISTIC)
    names = [c.name for c in controls.every()]
    assert len(names) == len(set(names))
    assert set(names) < set(NavigationState.model_fields)


def test_units_stand_in_labels():
    labels = {c.name: c.label for c in controls.every()}
    assert labels["nav_lemniscate_size"] == "size [m]"
    assert labels["nav_gnss_velocity_horizontal"] == "horizontal [m/s]"
    assert labels["nav_barometer_rate"] == "rate [Hz]"
    assert labels["nav_run_gravity"] == "gravity [m/s^2]"
    assert labels["nav_start_attitude_sd"] == "attitude sd [rad]"


def test_the_defaults_are_the_demonstration():
    found = config(NavigationState())
    assert found.scenario.reference.duration == 300.0
    assert {s.name: tuple(s.outages) for s in found.scenario.aiding} == {
        "gnss_position": ((260.0, 300.0),), "gnss_velocity": ((260.0, 300.0),), "barometer": (),
    }  # fmt: skip
    assert found.scenario.every == 10
    assert list(found.filters) == [RIGHT]
    assert repr(found.truth) == repr(sensor_errors("mti-g"))


def test_what_is_one_of_a_few_is_chosen():
    choices = {c.key: c.choices for c in (*controls.computed(), *controls.runs()) if c.choices}
    assert choices == {
        "earth": ("flat", "wgs84"),
        "gains": ("estimate", "reference"),
        "stop": ("significant", "anytime"),
    }
    shown = str(make_ui(NavigationState(nav_run_earth="wgs84"), Limits()))
    assert '<option value="wgs84" selected="">wgs84</option>' in shown
    assert '<option value="" selected="">estimate</option>' in shown


def test_the_earth_is_chosen():
    origin = '["46 deg", "6 deg", 500]'
    found = config(NavigationState.from_query(dict(TEXT, nav_run_earth="wgs84", nav_run_origin=origin)))
    np.testing.assert_allclose(found.scenario.earth.origin, [*np.deg2rad([46.0, 6.0]), 500.0])
    with pytest.raises(ValueError, match="where positions are zero"):
        config(NavigationState.from_query(dict(TEXT, nav_run_earth="wgs84")))


UNIT = {
    "nav_scale_factor_gyro_sd": "1000 ppm", "nav_misalignment_accel_sd": "[1e-3, 0, 0]",
    "nav_g_sensitivity_gyro_sd": "1 deg/h/g", "nav_temperature_bias_gyro_sd": "1 deg/h/K",
    "nav_run_temperature_rise": "20", "nav_gravity_anomaly": "30 mGal", "nav_gravity_distance": "20 km",
}  # fmt: skip


def test_what_a_calibration_leaves_is_switched_on():
    """The right filter knows of it, the one beside it does not; what is empty is not there."""
    found = config(NavigationState.from_query(TEXT | UNIT))
    assert isinstance(found.truth, ImuErrors)
    assert [type(d) for d in found.truth.deterministic] == list(DETERMINISTIC.values())
    assert found.truth.gravity is not None
    assert found.filters[RIGHT] is found.truth
    without = found.filters[UNCALIBRATED]
    assert (without.deterministic, without.gravity) == ((), None)
    assert repr(without.models) == repr(found.truth.linear.models)
    assert found.scenario.temperature[-1] == pytest.approx(20 * (1 - np.exp(-1)))  # 300 s, as its time constant
    full = tables_of(NavigationState.from_query(TEXT | UNIT), {}, study.Caps(filters=1))
    assert list(full["filters"]) == [RIGHT]  # the one beside is left out before a server refuses
    alone = config(NavigationState.from_query(TEXT | UNIT | {"nav_uncalibrated": False}))
    assert list(alone.filters) == [RIGHT]
    assert list(config(NavigationState.from_query(TEXT)).filters) == [RIGHT]


def test_each_switch_says_what_it_does():
    shown = str(make_ui(NavigationState(), Limits()))
    assert all(kind.effect in shown for kind in DETERMINISTIC.values())


def test_a_trajectory_that_is_sent_is_followed(tmp_path):
    """Geodetic, in degrees, with semicolons: kept as a table that needs no options."""
    there, kept = tmp_path / "0.csv", tmp_path / "kept"
    kept.mkdir()
    circle = nj.motions.circle(duration=10.0, rate=20.0)
    origin = np.array([0.8, 0.1, 300.0])
    lla = to_geodetic(circle, origin)
    table = np.column_stack([circle.time, np.rad2deg(lla[:, :2]), lla[:, 2], np.rad2deg(circle.euler)])
    np.savetxt(there, table, "%.14g", ";", header="time;lat;lon;h;roll;pitch;yaw", comments="")
    options = {"angles": "deg", "origin": "[0.8, 0.1, 300]", "delimiter": ";", "position": ""}
    followed = follow(there, "drive.csv", options, Limits(), kept)
    assert followed.duration == pytest.approx(10.0)
    assert followed.origin == pytest.approx(tuple(origin))
    own = TEXT | {"nav_motion": "file", "nav_file_smooth": "0.5", "nav_aiding": "barometer"}
    for earth in ("flat", "wgs84"):
        state = NavigationState.from_query(dict(own, nav_run_earth=earth))
        text = toml_of(tables_of(state, {}, followed=followed))
        found = config_of_text(text, kept).scenario.reference
        assert np.abs(found.position - circle.position).max() < 0.5
        assert f'file = "{followed.name}"' in text
    with pytest.raises(ValueError, match="Trajectory: send its file"):
        tables_of(state, {})
    with pytest.raises(ValueError, match=r"drive\.csv: "):
        follow(there, "drive.csv", {"angles": "gon"}, Limits(), kept)
    with pytest.raises(ValueError, match=r"\[trajectory\]"):
        follow(there, "drive.csv", {"position": "north"}, Limits(), kept)


def test_trajectories_that_differ_in_velocities_have_other_names(tmp_path):
    """Else what was computed of the one would be shown for the other."""
    first = nj.motions.circle(duration=2.0, rate=20.0)
    second = dataclasses.replace(first, velocity=first.velocity + 1e-3)
    names = []
    for k, trajectory in enumerate((first, second)):
        there = save_trajectory(trajectory, tmp_path / f"{k}.npz")
        names.append(follow(there, "drive.npz", {}, Limits(), tmp_path).name)
    assert names[0] != names[1]


def test_what_is_typed_is_what_is_computed():
    typed = {
        "nav_motion": "circle", "nav_circle_duration": "10 s", "nav_circle_radius": "30", "nav_aiding": "barometer",
        "nav_barometer_height": "20 cm", "nav_start_position_sd": "[1, 2, 3]", "nav_run_every": "2",
        "nav_run_seed": "4", "nav_own_accel": "WN(sigma2=1e-6)", "nav_own_gyro": "WN(sigma2=1e-8)",
    }  # fmt: skip
    state = NavigationState.from_query(dict(TEXT, **typed, nav_unknown="x"))
    found = config(state)
    assert found.scenario.reference.name == "circle"
    assert found.scenario.reference.duration == 10.0
    (barometer,) = found.scenario.aiding
    assert np.allclose(np.asarray(barometer.believed), 0.2)
    assert np.allclose(np.sqrt(np.diag(found.scenario.initial.covariance))[:3], [1, 2, 3])
    assert (found.scenario.every, found.run.seed) == (2, 4)
    assert list(found.filters) == [RIGHT, OWN]


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"nav_circle_radius": "5 kg", "nav_motion": "circle"}, r"\[trajectory\], radius: '5 kg'"),
        ({"nav_motion": "loop"}, "Trajectory: there is no 'loop'"),
        ({"nav_aiding": "lidar"}, "Aiding: there is no 'lidar'"),
        ({"nav_lemniscate_duration": "9000"}, "takes 9000 s, and this server computes 7200 s"),
        ({"nav_lemniscate_duration": "7000", "nav_rate": "1000"}, "more than 2000000 samples"),
        ({"nav_run_num_runs": "5000"}, "Runs: 5000, and this server computes 2000"),
        ({"nav_right": False}, "There is no filter"),
        ({"nav_gyro": ""}, "a model of the accelerometers and one of the gyros"),
        ({"nav_own_gyro": "WN(sigma2=1)"}, "A filter of your own takes"),
        ({"nav_truth": "fit"}, "is not there: see the room Model & fit"),
        ({"nav_barometer_height": "[[[["}, "barometer|height|aiding"),
        ({"nav_barometer_outages": "[[280, 400]]"}, "outage"),
    ],
)
def test_what_is_wrong_is_said(wrong, sentence):
    with pytest.raises(ValueError, match=sentence):
        config(NavigationState(**dict(TEXT, **wrong)))


@pytest.mark.parametrize("text", ["1\nfile = 'x'", "/etc/passwd", "{file = 'x'}", '"""', "1979-05-27"])
def test_a_field_is_a_value_and_nothing_else(text):
    value = study.value_of(text)
    again = tomllib.loads(toml_of({"trajectory": {"radius": value}}))
    assert again == {"trajectory": {"radius": value}}
    assert not isinstance(value, dict)


@pytest.fixture(scope="module")
def wv():
    return gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000))


def test_models_of_the_page_are_those_of_its_channels(wv):
    found = errors_of(fits_of(wv, "WN"), "mti-g")
    assert not found.remarks
    fits = gj.fit(wv, "WN")
    for model, channel in zip(found.errors.models, CHANNELS, strict=True):
        assert float(model.processes[0].values[0]) == float(
            fits[channel.replace(" ", "_")].model.processes[0].values[0]
        )


def test_what_is_missing_stands_for_a_known_sensor(wv):
    found = errors_of(fits_of(wv["gyro_y"], "WN"), "mti-g")
    assert len(found.remarks) == 2
    assert repr(found.errors.models[:3]) == repr(sensor_errors("mti-g").models[:3])
    assert len({repr(m) for m in found.errors.models[3:]}) == 1


def test_filters_of_the_page_come_to_the_rate_of_the_truth(wv):
    walk = ImuErrors("RW(gamma2=1e-9)", "RW(gamma2=1e-9)", 50.0)
    models = {PAGE: errors_of(fits_of(wv, "WN"), "mti-g").errors, "RW": walk}
    found = config(NavigationState(**TEXT), models)
    assert list(found.filters) == [RIGHT, PAGE, "RW"]
    assert {f.rate for f in found.filters.values()} == {20.0}
    assert list(config(NavigationState(nav_truth="fit"), models).filters) == [RIGHT, "RW"]
