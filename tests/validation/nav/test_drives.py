"""Real drives with simulated outages, set up by what is known of them, and by nothing that the outages show."""

import numpy as np
import pytest
from nav import real_drives

from nav_jax.recorded import outage_study


def lasting(*starts):
    return [(float(a), float(a) + 15.0) for a in starts]


@pytest.fixture(scope="module")
def drive():
    imu, fixes, filter, options = real_drives.roof()
    schedules = [lasting(*range(60, 481, 60)), lasting(*range(90, 511, 60))]
    return lambda *left_out: outage_study(
        imu, [f for f in fixes if f.sensor.name not in left_out], filter, schedules, **options
    )


def test_a_car_with_an_imu_on_its_roof(drive):
    """16 outages of 15 s, where a filter as usually configured has a median of 5 and an RMS of 10 m."""
    study = drive()
    assert len(study.start) == 16
    assert study.median <= 1.5, study
    assert study.rms <= 2.3, study
    assert 0.5 <= study.mean_nees <= 1.8


def test_what_the_wheels_are_worth(drive):
    """Without the constraint it is several times worse, and the filter knows."""
    without = drive("non_holonomic")
    assert without.rms > 2 * drive().rms
    assert 0.2 <= without.mean_nees <= 1.8


def test_a_car_whose_receiver_filters_its_fixes():
    imu, fixes, filter, options = real_drives.loop()
    schedules = [lasting(44, 89, 134), lasting(59, 104, 149), lasting(74, 119)]
    study = outage_study(imu, fixes, filter, schedules, **options)
    assert study.median <= 1.8
    assert study.rms <= 4.5, study
    assert study.mean_nees <= 2.5
    assert np.isfinite(study.size).all()
