"""The temperature of an IMU through all that asks for it: scenarios, records, covariances, campaigns."""

from dataclasses import replace

import jax
import numpy as np
import pytest

import nav_jax as nj
from gmwm_jax._internal.states import from_state, to_state

RATE = 20.0
EACH_SECOND = slice(int(RATE), None, int(RATE))
REST = nj.motions.static(8.0, RATE)
WARMING = 20.0 + 10.0 * np.sin(REST.time / 4.0)
SMALL = ("WN(sigma2=1e-8)", "WN(sigma2=1e-12)", RATE)
ERRORS = nj.ImuErrors(*SMALL, deterministic=[nj.imu.TemperatureBias(accel_sd=[0.02, 0.03, 0.0])])
GNSS = nj.GnssPosition(1.0, horizontal=0.01, vertical=0.01)


def scenario(*sensors, temperature=WARMING, **options):
    options = {"initial": nj.InitialUncertainty(), "every": 4, "output_interval": 1.0} | options
    return nj.Scenario(REST, sensors, temperature=temperature, **options)


def test_the_drift_is_the_integral_of_what_the_thermometer_says():
    """At rest, free inertial: the velocity drifts by c times the integral of T - T_0, sample by sample."""
    found = nj.analyse(scenario(), ERRORS)["filter"]
    middle = REST.time[:-1] + 0.5 / RATE
    warmer = np.interp(middle, REST.time, WARMING)
    integral = np.append(0.0, np.cumsum(warmer - warmer[0]) / RATE)[np.rint(found.time * RATE).astype(int)]
    of_noise = nj.analyse(scenario(), nj.ImuErrors(*SMALL))["filter"].true
    for axis, sd in enumerate((0.02, 0.03, 0.0)):
        variance = found.true[:, 3 + axis, 3 + axis] - of_noise[:, 3 + axis, 3 + axis]
        np.testing.assert_allclose(variance, (sd * integral) ** 2, rtol=1e-6, atol=1e-15)


def test_only_differences_count():
    a, b = (nj.analyse(scenario(GNSS, temperature=T), ERRORS)["filter"].true for T in (WARMING, WARMING + 273.15))
    np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-18)


@pytest.mark.slow
def test_runs_are_the_same_on_two_devices_and_in_small_chunks():
    options = {"num_runs": 4, "key": jax.random.key(1), "gains": "estimate"}
    one = nj.monte_carlo(scenario(GNSS), ERRORS, **options)
    for other in ({"devices": jax.devices()[:2]}, {"chunk_size": 3}):
        found = nj.monte_carlo(scenario(GNSS), ERRORS, **options, **other)
        np.testing.assert_allclose(found.error, one.error, rtol=1e-9, atol=1e-12)


def test_a_scenario_says_and_keeps_it_and_a_campaign_depends_on_it():
    one = scenario(GNSS)
    assert "an IMU of 20 to 30 K or deg C" in repr(scenario(temperature=np.linspace(20, 30, len(REST.time))))
    np.testing.assert_array_equal(from_state(to_state(one)).temperature, WARMING)

    def specification(temperature):
        return nj.Campaign(
            replace(one, temperature=temperature), ERRORS, key=jax.random.key(1), num_runs=8
        ).specification

    assert specification(WARMING) == specification(WARMING.copy())
    assert len({specification(T) for T in (WARMING, WARMING + 1.0, None)}) == 3


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: scenario(temperature=WARMING[:-1]), r"temperature of a scenario has the shape \(161\)"),
        (lambda: scenario(temperature=np.where(REST.time == 1.0, np.nan, WARMING)), r"first \(nan\) at index 20"),
        (lambda: nj.analyse(scenario(temperature=None), ERRORS), "depends on the temperature, which nobody has stated"),
        (
            lambda: nj.compare(
                scenario(temperature=None), nj.ImuErrors(*SMALL), {"f": ERRORS}, num_runs=2, key=jax.random.key(1)
            ),
            "depends on the temperature, which nobody has stated",
        ),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_record_has_a_thermometer():
    """A coefficient that only a filter with the thermometer finds; the column may have any name."""
    samples, exact = nj.perfect_imu(REST)
    warm, c = np.interp(samples.time + 0.5 / RATE, REST.time, WARMING), np.array([0.02, -0.03, 0.0])
    force = samples.accel + c * (warm - warm[0])[:, None]
    named = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]
    table = dict(zip(named, np.concatenate([samples.gyro, force], axis=1).T, strict=True))
    # T is a name of the time where nobody says otherwise
    table |= {"time": samples.time, "T": warm}
    units = {"gyro": "rad/s", "accel": "m/s^2"}
    imu = nj.read_imu(table, units=units, columns={"temperature": "T"}, samples="held")
    np.testing.assert_array_equal(imu.temperature, warm)
    assert "temperature" in repr(imu)
    assert nj.recorded.mounted(imu, (0.0, 0.0, 0.1)).temperature is not None
    np.testing.assert_array_equal(imu.part(3, 9).temperature, warm[3:9])
    fixes = nj.Fixes(GNSS, exact.time[EACH_SECOND], exact.position[EACH_SECOND])
    start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    start["initial"] = nj.InitialUncertainty()
    for smooth in (False, True):
        found = nj.navigate(imu, [fixes], ERRORS, smooth=smooth, **start)
        last = c[:2] * (warm[-1] - warm[0])
        np.testing.assert_allclose(found.sensor_errors[-1, :2], last, atol=4 * found.sd[-1, 9:11].max())
        assert found.sd[-1, 9:11].max() < 0.1 * np.abs(last).min()
    with pytest.raises(ValueError, match="a recorded Imu likewise"):
        nj.navigate(replace(imu, temperature=None), [fixes], ERRORS, **start)
    broken = table | {"T": np.where(np.arange(len(warm)) == 5, np.nan, warm)}
    with pytest.raises(ValueError, match=r"temperature .* at index 5"):
        nj.read_imu(broken, units=units, columns={"temperature": "T"})
    other = {("warmth" if name == "T" else name): x for name, x in broken.items()}
    assert nj.read_imu(other, units=units).temperature is None  # nobody has asked for it
