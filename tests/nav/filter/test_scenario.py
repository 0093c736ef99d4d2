"""A scenario checks its parts, says what it is, can be changed and sent elsewhere, and is what every function takes."""

import dataclasses
import inspect
import pickle

import jax
import jaxtyping
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter import LinearisationWarning

REFERENCE = nj.motions.lemniscate(5.0, 20.0)
AIDING = setups.aiding(2.5, 4.0)
START = nj.InitialUncertainty(0.1, 0.05, 0.005)
ERRORS = nj.ImuErrors(gj.WN(6e-5), gj.WN(1.5e-6), 20.0)


@pytest.fixture
def no_type_checks(monkeypatch):
    """Users have none."""
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)


@pytest.mark.usefixtures("no_type_checks")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"reference": REFERENCE.position}, "reference must be of the class Trajectory"),
        ({"aiding": setups.aiding(3.0, 7.0)}, "outage 3 to 7 s.*outside the run"),
        ({"aiding": setups.aiding(0.5, 5.0)}, "lie in its outages"),
        ({"aiding": setups.aiding(rate=0.1)}, "no fix"),
        ({"aiding": (AIDING[0], AIDING[0])}, "one name"),
        ({"aiding": ("gps",)}, "sensors such as GnssPosition"),
        ({"initial": 0.1}, "initial must be of the class InitialUncertainty"),
        ({"earth": 9.8}, "earth must be of the class AbstractEarth"),
        ({"every": 0}, "every"),
        ({"every": 2.5}, "every"),
        ({"output_interval": 0.0}, "output_interval"),
        ({"output_interval": 6.0}, "longer than the run"),
    ],
)
def test_what_is_wrong_is_seen_when_it_is_made(options, message):
    with pytest.raises(ValueError, match=message):
        nj.Scenario(**({"reference": REFERENCE, "aiding": AIDING} | options))


def test_it_says_what_it_is():
    full = nj.Scenario(REFERENCE, list(AIDING), START, nj.FlatEarth(9.8), every=10, output_interval=0.5)
    assert repr(full).splitlines() == [
        "Scenario: lemniscate of 5 s from an uncertain start; covariance every 10 samples, results every 0.5 s",
        "aiding: gnss_position 1 Hz (outage 2.5 .. 4 s), gnss_velocity 1 Hz (outage 2.5 .. 4 s), barometer 1 Hz; "
        "FlatEarth(gravity=9.8)",
    ]
    assert repr(nj.Scenario(REFERENCE)).splitlines() == [
        "Scenario: lemniscate of 5 s from a start that is known; covariance every sample, results every 1 s",
        "aiding: none; FlatEarth(gravity=9.80665)",
    ]


@pytest.mark.slow
def test_it_is_changed_by_replace_and_survives_a_way_to_another_process():
    one = nj.Scenario(REFERENCE, AIDING, START)
    other = dataclasses.replace(one, every=4)
    assert (one.every, other.every) == (1, 4)
    assert other.aiding is one.aiding
    sent = pickle.loads(pickle.dumps(other))
    inputs = [
        nj.filter.draw_inputs(nj.filter.prepare(s, rate=20.0), ERRORS, nj.filter.run_keys(jax.random.key(1), 0, 2))
        for s in (other, sent)
    ]
    np.testing.assert_array_equal(inputs[0].z, inputs[1].z)
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.every = 3


def test_all_functions_take_it_first():
    """Then the truth, then the filters: one vocabulary and one order."""
    expected = {
        "compare": ["scenario", "truth", "filters"],
        "monte_carlo": ["scenario", "truth", "filter"],
        "analyse": ["scenario", "truth", "filters"],
        "error_budget": ["scenario", "truth", "filter"],
        "sensitivities": ["scenario", "truth", "filter"],
        "design": ["scenario", "truth"],
        "calibration_effect": ["scenario", "accel", "gyro"],
        "navigate": ["imu", "aiding", "filter"],
        "tune": ["imu", "aiding", "filter"],
    }
    for name, first in expected.items():
        parameters = inspect.signature(getattr(nj, name)).parameters
        assert [
            n for n, p in parameters.items() if p.kind is not p.KEYWORD_ONLY and p.kind is not p.VAR_KEYWORD
        ] == first
        # what a scenario has is stated there and nowhere else
        if first[0] == "scenario":
            assert not {f.name for f in dataclasses.fields(nj.Scenario)} & set(parameters)
    assert list(inspect.signature(nj.filter.prepare).parameters) == ["scenario", "rate"]


def test_the_covariance_step_has_one_default():
    default = nj.Scenario(REFERENCE).every
    assert default == 1
    for f in (nj.navigate, nj.tune):
        assert inspect.signature(f).parameters["every"].default == default


def test_an_attitude_that_no_linearisation_holds_is_said():
    reference = nj.motions.static(2.0, 10.0)
    with pytest.warns(LinearisationWarning, match=r"30 deg, .* Align first"):
        nj.Scenario(reference, initial=nj.InitialUncertainty(attitude_sd=np.deg2rad([1.0, 1.0, 30.0])))
    nj.Scenario(reference, initial=nj.InitialUncertainty(attitude_sd=np.deg2rad([1.0, 1.0, 10.0])))
