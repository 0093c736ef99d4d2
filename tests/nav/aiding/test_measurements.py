"""Every aiding sensor: one row of CASES, and all tests run on it."""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from gmwm_jax import GM, RW, WN
from nav_jax.aiding.barometer import Barometer
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.gnss import GnssPosition, GnssVelocity
from nav_jax.filter.ekf import NavState, inject

pytestmark = pytest.mark.usefixtures("quick_compilation")


@dataclass(frozen=True)
class Case:
    """A sensor, how it is built, and what it measures by definition."""

    cls: type[AbstractAiding]
    noise: dict[str, float]
    sd: tuple[float, ...]
    measures: Any
    """(position, velocity) of one run -> the components."""


CASES = (
    Case(GnssPosition, {"horizontal": 0.025, "vertical": 0.05}, (0.025, 0.025, 0.05), lambda p, v: p),
    Case(GnssVelocity, {"horizontal": 0.01, "vertical": 0.02}, (0.01, 0.01, 0.02), lambda p, v: v),
    Case(Barometer, {"height": 0.5}, (0.5,), lambda p, v: -p[2:]),
)
every_sensor = pytest.mark.parametrize("case", CASES, ids=[c.cls.__name__ for c in CASES])


@every_sensor
def test_it_measures_what_it_says(case):
    rng = np.random.default_rng(1)
    p, v = rng.normal(size=(2, 3, 5))
    seen = case.cls(**case.noise).predict(jnp.asarray(p), jnp.asarray(v))
    for run in range(5):
        np.testing.assert_array_equal(seen[:, run], case.measures(p[:, run], v[:, run]))


@every_sensor
def test_the_jacobian_is_the_derivative_along_an_injected_error(case):
    sensor = case.cls(**case.noise)
    rng = np.random.default_rng(2)
    state = NavState(*(jnp.asarray(rng.normal(size=(n, 1))) for n in (3, 3)), jnp.ones((4, 1)) / 2, jnp.zeros((0, 1)))

    def h(error):
        moved = inject(state, error[:, None])
        return sensor.predict(moved.p, moved.v)[:, 0]

    np.testing.assert_allclose(sensor.jacobian(), jax.jacfwd(h)(jnp.zeros(9)), atol=1e-12)


@every_sensor
def test_standard_deviations_are_those_of_the_noise_unless_told_otherwise(case):
    np.testing.assert_allclose(case.cls(**case.noise).believed, case.sd, rtol=1e-12)
    doubled = 1.0 if len(case.sd) == 1 else (1.0, 2.0)
    assert case.cls(**case.noise, believed=doubled).believed[0] == 1.0


@every_sensor
def test_noise_has_its_variance_and_nothing_else(case, key):
    sensor = case.cls(**case.noise)
    num, runs = 400, 50
    drawn = np.asarray(sensor.draw(num, jax.random.split(key, runs)))
    assert drawn.shape == (num, len(sensor.axes), runs)
    count = num * runs
    # a variance of n normal numbers has the relative deviation sqrt(2/n); five sigma
    np.testing.assert_allclose(drawn.var(axis=(0, 2)), np.square(case.sd), rtol=5 * np.sqrt(2 / count))
    lagged = (drawn[1:] * drawn[:-1]).mean(axis=(0, 2)) / np.square(case.sd)
    assert (np.abs(lagged) < 5 / np.sqrt(count)).all()
    if len(sensor.axes) > 1:
        assert np.abs((drawn[:, 0] * drawn[:, 1]).mean()) / (case.sd[0] * case.sd[1]) < 5 / np.sqrt(count)


@every_sensor
def test_fixes_come_at_their_rate_from_one_period_on(case):
    sensor = case.cls(3.0, **case.noise)
    np.testing.assert_allclose(sensor.fixes(10.0, 12.0), 10 + np.arange(1, 7) / 3, rtol=1e-14)
    np.testing.assert_allclose(case.cls(3.0, first=0.0, **case.noise).fixes(0.0, 1.0), np.arange(4) / 3)


@every_sensor
def test_the_ends_of_an_outage_belong_to_it(case):
    sensor = case.cls(**case.noise, outages=[(7, 8), (2.0, 4.0)])
    times = sensor.fixes(0.0, 10.0)
    np.testing.assert_array_equal(times[sensor.available(times)], [1, 5, 6, 9, 10])
    assert sensor.outages == ((2.0, 4.0), (7.0, 8.0))


@every_sensor
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rate": 0.0}, "positive"),
        ({"rate": -1.0}, "positive"),
        ({"rate": float("nan")}, "positive"),
        ({"outages": [(3.0, 2.0)]}, "ends before it starts"),
        ({"outages": [(3.0,)]}, "a pair"),
        ({"outages": [(0.0, float("nan"))]}, "finite"),
        ({"first": -1.0}, "non-negative"),
    ],
)
def test_bad_options_are_refused(case, options, message):
    with pytest.raises(ValueError, match=message):
        case.cls(**{**case.noise, **options})


@every_sensor
@pytest.mark.parametrize("sd", [0.0, -1.0, float("nan"), float("inf")])
def test_bad_standard_deviations_are_refused(case, sd):
    with pytest.raises(ValueError, match="positive"):
        case.cls(**dict.fromkeys(case.noise, sd))


@every_sensor
def test_a_sensor_without_fixes_is_refused(case):
    with pytest.raises(ValueError, match="no fix between 0 and 5 s"):
        case.cls(0.1, **case.noise).fixes(0.0, 5.0)
    with pytest.raises(ValueError, match="lies outside the run"):
        case.cls(**case.noise, outages=[(4.0, 6.0)]).fixes(0.0, 5.0)
    with pytest.raises(ValueError, match="All fixes"):
        case.cls(**case.noise, outages=[(0.0, 5.0)]).fixes(0.0, 5.0)


def test_correlated_noise_is_believed_with_its_whole_variance(key):
    model = WN(0.04) + GM(0.1, 0.09)
    sensor = Barometer(height=model)
    np.testing.assert_allclose(sensor.believed, [np.sqrt(0.13)])
    drawn = np.asarray(sensor.draw(50, jax.random.split(key, 2000)))[:, 0]
    # from the first fix on stationary: each row has 2000 independent runs
    np.testing.assert_allclose(drawn.var(axis=1), 0.13, rtol=5 * np.sqrt(2 / 2000))
    expected = 0.09 * np.exp(-0.1 * 10)
    assert (drawn[10:] * drawn[:-10]).mean() == pytest.approx(expected, abs=5 * 0.13 / np.sqrt(2000))


def test_noise_without_a_variance_needs_a_belief():
    with pytest.raises(ValueError, match="RW has no constant variance"):
        Barometer(height=WN(0.04) + RW(1e-4))
    assert Barometer(height=WN(0.04) + RW(1e-4), believed=0.3).believed[0] == 0.3
