"""Outages that are simulated on a record, and what is made of them; noise that grows with vibration."""

import dataclasses

import numpy as np
import pytest

import nav_jax as nj
from nav_jax.imu.vibration import running_variance
from nav_jax.recorded import OutageStudy, outage_study
from nav_jax.recorded.outages import without

RATE = 20.0
OUTAGES = ((5.0, 8.0), (12.0, 14.0))


@pytest.fixture(scope="module")
def record():
    samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=20.0, rate=RATE))
    rng = np.random.default_rng(3)
    imu = nj.Imu(samples.time, samples.gyro, samples.accel + rng.normal(0.0, 0.2, (len(samples), 3)), RATE)
    p, time = exact.position[20::20], exact.time[20::20]
    gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    fixes = nj.Fixes(gnss, time, p + rng.normal(0.0, 0.02, p.shape))
    height = nj.Fixes(nj.Barometer(height=0.5), time, -p[:, 2:])
    filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=RATE)
    start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    return imu, [fixes, height], filter, start | {"initial": nj.InitialUncertainty(0.1, 0.1, 0.01), "every": 10}


def test_what_is_withheld_is_what_an_outage_of_the_sensor_withholds(record):
    imu, (fixes, height), filter, start = record
    found = nj.navigate(imu, [fixes, height], filter, **start, outages=OUTAGES)
    sensor = nj.GnssPosition(horizontal=0.02, vertical=0.02, outages=OUTAGES)
    expected = nj.navigate(imu, [dataclasses.replace(fixes, sensor=sensor), height], filter, **start)
    np.testing.assert_array_equal(found.trajectory.position, expected.trajectory.position)
    assert set(found.withheld) == {"gnss_position"}
    np.testing.assert_array_equal(found.withheld["gnss_position"].error, expected.withheld["gnss_position"].error)
    assert found.withheld["gnss_position"].outages == OUTAGES
    named = nj.navigate(imu, [fixes, height], filter, **start, outages={"barometer": [(3.0, 4.0)]})
    assert set(named.withheld) == {"barometer"}


@pytest.mark.parametrize(
    ("outages", "said"),
    [
        ([(5.0, 8.0, 9.0)], "An outage is a pair (start, end) in s"),
        ([(8.0, 5.0)], "The outage (8, 5) ends before it starts"),
        ([(5.2, 5.8)], "No fix lies in the outage 5.2 to 5.8 s"),
        ([(60.0, 75.0)], "No fix lies in the outage 60 to 75 s"),
        ([(0.5, 3.0)], "No fix comes before the outage 0.5 to 3 s"),
        ([(5.0, 8.0), (7.0, 9.0)], "The outages 5 to 8 s and 7 to 9 s overlap"),
        ([(float("nan"), 9.0)], "An outage's time"),
        ({"gps": [(5.0, 8.0)]}, "There is no sensor 'gps' for outages; there are gnss_position, barometer"),
    ],
)
def test_what_is_no_outage_is_said(record, outages, said):
    with pytest.raises(ValueError, match=said.replace("(", r"\(").replace(")", r"\)")):
        without(record[1], outages)


def test_without_a_receiver_the_sensor_is_named(record):
    with pytest.raises(ValueError, match="No receiver has fixes to be withheld, of barometer: name the sensor"):
        without(record[1][1:], [(5.0, 8.0)])


def test_a_study_judges_the_end_of_each_outage(record, tmp_path):
    imu, fixes, filter, start = record
    steps = []
    study = outage_study(imu, fixes, filter, [OUTAGES[:1], OUTAGES[1:]], **start, progress=lambda k, n: steps.append(k))
    assert steps[-1] == 2
    assert study.schedule.tolist() == [0, 1]
    for k, outage in enumerate(OUTAGES):
        one = nj.navigate(imu, fixes, filter, **start, outages=[outage]).withheld["gnss_position"]
        np.testing.assert_array_equal(study.error[k], one.error[-1, :2])
        expected = one.error[-1, :2] @ np.linalg.inv(one.covariance[-1, :2, :2]) @ one.error[-1, :2]
        assert study.nees[k] == pytest.approx(expected, rel=1e-9)
    assert study.rms == pytest.approx(np.sqrt(np.mean(np.sum(study.error**2, axis=1))))
    assert f"median {study.median:.3g}, RMS {study.rms:.3g}" in repr(study)
    assert study.plot().axes[0].get_ylabel() == "horizontal error [m]"
    again = nj.load(study.save(tmp_path / "study.json"))
    assert isinstance(again, OutageStudy)
    np.testing.assert_array_equal(again.covariance, study.covariance)
    assert study.to_xarray().sizes == {"outage": 2}


def test_a_study_of_nothing_is_refused(record):
    imu, fixes, filter, start = record
    with pytest.raises(ValueError, match="Give at least one schedule"):
        outage_study(imu, fixes, filter, [], **start)
    with pytest.raises(ValueError, match="a smoother knows what comes after"):
        outage_study(imu, fixes, filter, [OUTAGES], **start, smooth=True)
    with pytest.raises(ValueError, match="No fix of barometer was withheld, only of gnss_position"):
        outage_study(imu, fixes, filter, [OUTAGES], **start, sensor="barometer")


def test_the_variance_of_a_window_is_that_of_its_samples():
    x = 1e3 + np.random.default_rng(0).normal(size=(50, 2))
    for width in (1, 5, 8):
        found = running_variance(x, width)
        for k in range(50):
            first = max(k - width // 2, 0)
            window = x[first : min(k - width // 2 + width, 50)]
            np.testing.assert_allclose(found[k], window.var(axis=0), atol=1e-11)


def test_vibration_adds_white_noise_where_there_is_some(record):
    """Of a record that shakes at the same strength all over, as a model with so much more white noise."""
    imu, _, filter, start = record
    alternating = np.where(np.arange(len(imu)) % 2, 1.0, -1.0)[:, None] * [0.3, 0.3, 0.3]
    shaken = nj.Imu(imu.time, imu.gyro, np.broadcast_to([0.0, 0.0, -9.8], imu.accel.shape) + alternating, RATE)
    kappa = 0.5
    noise = nj.imu.VibrationNoise(accel=kappa, gyro=0.0, window=0.2)  # four samples
    more = nj.ImuErrors(f"WN(sigma2={0.04 + kappa * 0.09!r})", "WN(sigma2=1e-8)", rate=RATE)
    found = nj.navigate(shaken, [], filter, **start, vibration=noise, throw=False)
    expected = nj.navigate(shaken, [], more, **start, throw=False)
    # the ends have windows of fewer samples
    np.testing.assert_allclose(found.sd[-1, :9], expected.sd[-1, :9], rtol=2e-3)
    plain = nj.navigate(shaken, [], filter, **start, throw=False)
    assert found.sd[-1, 5] > 1.2 * plain.sd[-1, 5]
    none = nj.navigate(shaken, [], filter, **start, vibration=nj.imu.VibrationNoise(accel=0.0, gyro=0.0), throw=False)
    np.testing.assert_allclose(none.sd, plain.sd, rtol=1e-12)


def test_a_vibration_that_is_none_is_refused(record):
    with pytest.raises(ValueError, match="VibrationNoise: accel"):
        nj.imu.VibrationNoise(accel=-0.1)
    with pytest.raises(ValueError, match="VibrationNoise: window"):
        nj.imu.VibrationNoise(window=0.0)
    imu, fixes, filter, start = record
    with pytest.raises(ValueError, match="vibration"):
        nj.navigate(imu, fixes, filter, **start, vibration=0.1)
