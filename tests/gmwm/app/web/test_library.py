"""The published wavelet variances are those of their source, digit for digit."""

import json

import numpy as np
import pytest

from gmwm_jax.app.web import library

NAMES = {"MTiG": "mti-g", "navchip": "navchip", "imar": "imar", "ln200": "ln200"}


def test_all_channels_are_there():
    published = [library.published(e.name) for e in library.entries() if e.kind == library.PUBLISHED]
    assert sum(len(wv.channels) for wv in published) == 21
    assert {e.has_samples for e in library.entries() if e.kind == library.PUBLISHED} == {False}


def test_numbers_are_those_of_the_source(shared):
    source = json.loads((shared / "reference" / "imu_wv_library.json").read_text())
    for sensor, channels in source.items():
        wv = library.published(NAMES[sensor])
        for name, row in channels.items():
            one = wv[name.lower().replace(".", "_")]
            for key, values in (("variance", one.variance), ("ci_low", one.ci_low), ("ci_high", one.ci_high)):
                np.testing.assert_array_equal(values, row[key])
            np.testing.assert_array_equal(one.scales, row["scales"])
            assert (one.num_samples, one.rate) == (row["N"], row["freq"])


def test_another_sensor_is_refused():
    with pytest.raises(ValueError, match="there are mti-g, navchip"):
        library.published("adis")
