"""Figures of navigation on recorded sensors: what is drawn is the data, and the data are the solution's."""

import numpy as np
import pytest
from drawn import assert_shows

import nav_jax as nj
from nav_jax import plotting
from nav_jax.recorded.withheld import Withheld
from nav_jax.trajectory import motions

pytestmark = pytest.mark.usefixtures("rendered_figures")

TIME = np.arange(0.0, 20.5, 0.5)
FIXES = np.arange(1.0, 21.0)


def make_navigation(*, outages=((5.0, 8.0), (12.0, 15.0)), aided=True):
    """A solution without a filter: numbers that are easily told apart."""
    t = motions.lemniscate(duration=20.0, rate=2.0)
    rng = np.random.default_rng(1)
    sd = np.linspace(0.1, 2.0, len(TIME))[:, None] * np.arange(1.0, 16.0)
    sd[:, 9:12] = 0.0
    gnss, baro = nj.GnssPosition(horizontal=0.1, vertical=0.2, outages=outages), nj.Barometer(height=0.5)
    fixes = (
        nj.Fixes(gnss, FIXES, t.at(FIXES).position + rng.normal(0.0, 0.5, (20, 3))),
        nj.Fixes(baro, FIXES, rng.normal(0.0, 1.0, (20, 1))),
    )
    nu = {f.sensor.name: rng.normal(size=(int(f.given.sum()), len(f.sensor.axes))) for f in fixes}
    withheld = {}
    if outages:
        kept = FIXES[~fixes[0].given]
        C = np.tile(np.diag([4.0, 5.0, 6.0]), (len(kept), 1, 1))
        withheld = {gnss.name: Withheld(kept, rng.normal(size=(len(kept), 3)), C, gnss.axes, "m", gnss.outages)}
    sensors = rng.normal(size=(len(TIME), 6)) * 1e-3 * np.array([0, 0, 0, 1, 1, 1])
    one = {name: np.ones_like(x) for name, x in nu.items()}
    nis = {name: (x**2).sum(axis=1) for name, x in nu.items()}
    ok = nj.filter.Status.ok
    if not aided:
        return nj.recorded.Navigation(t, sd, sensors, None, {}, {}, {}, ok)
    return nj.recorded.Navigation(t, sd, sensors, None, nu, one, nis, ok, fixes, withheld)


@pytest.fixture(autouse=True)
def untyped(monkeypatch):
    """These solutions have no side before the fixes."""
    monkeypatch.setattr("jaxtyping.config.jaxtyping_disable", True)


@pytest.mark.parametrize(
    ("plot", "data"),
    [
        (plotting.plot_navigation, plotting.navigation_data),
        (plotting.plot_innovations, plotting.innovations_data),
        (plotting.plot_sensor_estimates, plotting.sensor_estimates_data),
        (plotting.plot_withheld, plotting.withheld_data),
    ],
)
def test_what_is_drawn_is_what_the_data_say(plot, data):
    solution = make_navigation()
    assert_shows(plot(solution), data(solution))


def test_the_track_and_its_fixes():
    solution = make_navigation()
    plan, height = plotting.navigation_data(solution)
    shown = {item.label: item for item in plan.items}
    given = solution.fixes[0].given
    np.testing.assert_array_equal(shown["fix"].x, solution.fixes[0].value[given, 1])
    np.testing.assert_array_equal(shown["fix kept from the filter"].y, solution.fixes[0].value[~given, 0])
    np.testing.assert_array_equal(shown["navigation"].x, solution.trajectory.position[:, 1])
    band = height.items[0]
    np.testing.assert_allclose(band.high - band.low, 6 * solution.sd[:, 2])
    assert len(solution.plot().axes) == 2
    assert [i.label for i in plotting.navigation_data(make_navigation(outages=()))[0].items][:2] == [
        "fix",
        "navigation",
    ]


def test_what_innovations_should_be():
    solution = make_navigation()
    first, *_, last = plotting.innovations_data(solution)
    nu = solution.innovation["gnss_position"][:, 0]
    assert first.title.startswith(
        f"gnss_position n: sd 1 m in the median\nrms {np.sqrt(np.mean(nu**2)):.2f} of 1, outside"
    )
    assert first.title.endswith("of 0.3 %")
    assert last.title.startswith("barometer ")
    with pytest.raises(ValueError, match="Without aiding"):
        plotting.plot_innovations(make_navigation(aided=False))


def test_sensors_without_a_state_say_so():
    figure = plotting.plot_sensor_estimates(make_navigation())
    assert [ax.get_title(loc="right") for ax in figure.axes] == ["no state", ""] * 3


def test_errors_in_outages():
    solution = make_navigation()
    within, at_end = plotting.withheld_data(solution)
    w = solution.withheld["gnss_position"]
    np.testing.assert_allclose(within.items[0].y, np.linalg.norm(w.error[:4, :2], axis=1))
    np.testing.assert_allclose(within.items[1].y, 3.0)
    np.testing.assert_allclose(at_end.items[1].x, np.linalg.norm(w.error[[3, 7], :2], axis=1))
    assert at_end.y.names == ("5", "12")
    with pytest.raises(ValueError, match="give outages of a sensor"):
        plotting.plot_withheld(make_navigation(outages=()))


def test_what_is_in_a_record():
    imu, exact = nj.perfect_imu(motions.racetrack(duration=40.0, rate=20.0, straight=40.0, turn=20.0))
    fixes = nj.recorded.GnssRecord(exact.time[::10], exact.position[::10])
    keep = np.delete(np.arange(800), slice(300, 320))
    found = nj.recorded.inspect_record(imu.time[keep], imu.gyro[keep], imu.accel[keep], fixes)
    frames = plotting.inspection_data(found)
    assert [f.title for f in frames] == ["specific force", "turn rate", "speed of the fixes", "offset of the clocks"]
    assert_shows(plotting.plot_inspection(found), frames)
    assert any(item.label == "gap" for item in frames[0].items)
