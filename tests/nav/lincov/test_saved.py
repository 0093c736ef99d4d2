"""Analyses and designs come back from files as they were, and serve as before."""

import jax
import numpy as np
import pytest
from helpers import arrays_of, assert_same_result
from nav.synthetic_analysis import (
    OUTAGE,
    make_analysis,
    make_budget,
    make_calibration,
    make_design,
    make_sensitivities,
)

import gmwm_jax as gj
import nav_jax as nj
from gmwm_jax._internal.state_files import Content, write_state
from gmwm_jax._internal.states import State, registered, to_state

FORMATS = (".npz", ".json", ".nc", ".zarr")


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("make", [make_analysis, make_budget, make_calibration, make_design, make_sensitivities])
def test_a_result_comes_back_as_it_was(tmp_path, make, suffix):
    given = make()
    found = nj.load(given.save(tmp_path / f"x{suffix}"))
    assert_same_result(found, given)
    assert_same_result(type(given).load(tmp_path / f"x{suffix}"), given)


@pytest.mark.parametrize(
    ("make", "figure"),
    [
        (make_analysis, "analysis_data"), (make_budget, "budget_data"), (make_calibration, "calibration_data"),
        (make_design, "design_data"), (make_sensitivities, "sensitivities_data"),
    ],
)  # fmt: skip
def test_it_is_drawn_as_before(tmp_path, make, figure):
    given = make()
    data = getattr(nj.plotting, figure)
    shown = arrays_of(data(nj.load(given.save(tmp_path / "x.json"))))
    assert shown
    for a, b in zip(shown, arrays_of(data(given)), strict=True):
        np.testing.assert_array_equal(a, b)


def test_one_of_the_filters_alone(tmp_path):
    given = make_analysis()["optimist"]
    found = nj.load(given.save(tmp_path / "x.npz"))
    assert_same_result(found, given)
    np.testing.assert_array_equal(found.coverage("pose"), given.coverage("pose"))


SCENARIOS = {
    "all sensors": [
        nj.GnssPosition(horizontal=0.02, vertical="WN(sigma2=1e-4) + GM(beta=0.1, variance=1e-4)", outages=[OUTAGE]),
        nj.GnssPosition(2.0, covariance=np.array([[2.0, 0.3, 0.1], [0.3, 1.0, 0.2], [0.1, 0.2, 3.0]]), name="other"),
        nj.GnssVelocity(horizontal=0.01, vertical=0.02, believed=(0.1, 0.2, 0.3), lever_arm=(1.0, 0.1, -0.3)),
        nj.Barometer(height=0.5, first=0.5),
        nj.Odometer(10.0, speed=0.05, sideways=(0.02, 0.03), scale_sd=0.01, scale_noise="RW(gamma2=1e-10)"),
        nj.Odometer(5.0, speed=0.05, lever_arm=(-1.0, 0.0, 0.5), name="wheel"),
        nj.Odometer(5.0, speed=0.05, sideways=0.1, lever_arm_sd=0.1, mount_sd=(0.0, 0.02), name="mounted wheel"),
        nj.aiding.ZeroVelocity(5.0, sd=0.02),
        nj.aiding.Magnetometer(10.0, sd=2e-7, field=(22e-6, 1e-6, 43e-6), hard_iron_sd=1e-6),
        nj.aiding.DualAntenna(
            5.0, horizontal=0.005, vertical=0.01, baseline=(1.0, 0.0, 0.0), offset_sd=(0.0, 0.01, 0.01)
        ),
        nj.aiding.NonHolonomic(
            10.0,
            right=0.03,
            down="WN(sigma2=1e-3)",
            lever_arm=(-1.0, 0.0, 0.3),
            lever_arm_sd=(0.1, 0.2),
            mount_sd=0.01,
            mount_noise="RW(gamma2=1e-8)",
            believed=(0.1, 0.2),
            faster=2.0,
        ),
        nj.aiding.ZeroRate(2.0, sd="WN(sigma2=1e-8)", believed=2e-4, slower=0.05),
    ],
    "none": [],
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenarios_and_errors_are_those_that_they_were(tmp_path, name):
    """What a design was made for is in its file: with every sensor, and errors that are no noise."""
    truth = nj.ImuErrors(
        ["WN(sigma2=1e-4) + QN(q2=1e-9)", "WN(sigma2=2e-4)", "AR(2)(phi1=0.5, phi2=0.2, sigma2=1e-6)"],
        gj.WN(1e-8) + gj.RW(gj.Fixed(1e-12)),
        20.0,
        accel_bias_sd=[0.0, 0.1, 0.2],
        deterministic=[nj.imu.ScaleFactor(1e-3, [1e-4, 0.0, 2e-4]), nj.imu.Misalignment(gyro_sd=1e-3)],
        start="zero",
    )
    start = nj.InitialUncertainty(0.1, (0.01, 0.02, 0.03), 1e-3)
    reference = nj.motions.lemniscate(30.0, 20.0)
    scenario = nj.Scenario(reference, SCENARIOS[name], start, nj.FlatEarth(9.81), every=4, output_interval=5)
    candidates = make_design().candidates
    given = nj.lincov.Design(candidates, make_design().right, "score", truth, (scenario,), complete=False)
    found = nj.load(given.save(tmp_path / "x.json"))
    assert_same_result(found, given)
    leaves = [
        jax.tree.leaves((d.truth, *(s.aiding for s in d.scenarios), d.scenarios[0].initial)) for d in (found, given)
    ]
    for a, b in zip(*leaves, strict=True):
        np.testing.assert_array_equal(a, b)
    structures = [jax.tree.structure((d.truth, d.scenarios[0].aiding)) for d in (found, given)]
    assert structures[0] == structures[1]
    assert [s.label for s in found.truth.bank().states] == [s.label for s in truth.bank().states]
    assert repr(found.scenarios) == repr(given.scenarios)


class MyFlatEarth(nj.FlatEarth):
    """Of a user."""


def test_an_earth_of_a_user_is_refused(tmp_path):
    design = make_design()
    own = nj.Scenario(design.scenarios[0].reference, earth=MyFlatEarth())
    given = nj.lincov.Design(design.candidates, design.right, "score", design.truth, (own,))
    with pytest.raises(ValueError, match=r"A Design cannot be saved: scenarios\.0\.earth is a MyFlatEarth of"):
        given.save(tmp_path / "x.npz")


def test_states_that_are_wrong_are_refused(tmp_path):
    state = to_state(make_analysis())
    for tree, complaint in (
        ({**state.tree, "filters": {}}, "it is no Analysis: There is no filter in it"),
        (
            {**state.tree, "filters": {"a": {**state.tree["filters"]["right"], "channels": ["x"]}}},
            "filters.a.channels.0",
        ),
        ({**state.tree, "reference": 1}, "reference must be of type str"),
    ):
        path = write_state(tmp_path / "x.json", Content("nav_jax.Analysis", State(tree, state.arrays)))
        with pytest.raises(ValueError, match=complaint):
            nj.load(path)
    state = to_state(make_design())
    path = write_state(
        tmp_path / "x.json", Content("nav_jax.Design", State({**state.tree, "candidates": []}, state.arrays))
    )
    with pytest.raises(ValueError, match="There is no candidate in it"):
        nj.load(path)


def test_files_know_these_classes():
    own = [name for name in registered() if name.startswith("nav_jax.")]
    assert own == [
        f"nav_jax.{name}"
        for name in (
            "Analysis", "Anytime", "Barometer", "Budget", "CalibrationEffect", "Candidate", "Comparison",
            "Covariances", "Definition", "Design", "DualAntenna", "Estimates", "Fixes", "FlatEarth", "GSensitivity",
            "Gnss", "GnssPosition", "GnssVelocity", "GravityDisturbance", "ImuErrors", "ImuSpecification",
            "InitialUncertainty", "Magnetometer", "Misalignment", "Navigation", "NoiseInMotion", "NonHolonomic",
            "Odometer", "OutageStudy", "Output", "OwnState", "Precision", "ReferenceErrors", "Runs", "ScaleFactor",
            "Scenario", "Sensitivities", "Significant", "Statistics", "Stopped", "TemperatureBias", "Track",
            "Trajectory", "Tuning", "TwoLevel", "VibrationNoise", "Wgs84", "Withheld", "ZeroRate", "ZeroVelocity",
        )
    ]  # fmt: skip
