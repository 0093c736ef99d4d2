"""Texts for other filters are read back with the numbers of the fit, or there is a reason."""

import json
import re
from dataclasses import replace

import pytest
from programs import fitted, simulated

from gmwm_jax.app.web import snippets


def of(unit, name):
    """The fit as one of a channel of a sensor."""
    return replace(fitted(), wv=replace(simulated(), units=(unit,), channels=(name,)), rate=100.0)


IMU = [of("rad/s", "gyro_x"), of("m/s^2", "accel_x")]


@pytest.mark.slow
def test_every_format_has_a_file_and_a_text():
    made = snippets.snippets(IMU)
    assert [s.format for s in made] == list(snippets.formats())
    assert all(s.text and not s.reason and s.file for s in made)
    assert len({s.file for s in made}) == len(made)


def test_numbers_are_read_back():
    own = IMU[0].white_and_bias()
    text = snippets.snippet(IMU, "kalibr").text
    read = {k: float(v) for k, v in re.findall(r"^(gyroscope\w+): (\S+)", text, re.MULTILINE)}
    assert read == {
        "gyroscope_noise_density": pytest.approx(own.N, rel=1e-9),
        "gyroscope_random_walk": pytest.approx(own.K, rel=1e-9),
    }
    channels = json.loads(snippets.snippet(IMU, "nav-jax").text)
    assert channels[1]["processes"][0]["sigma2"] == float(fitted().model.processes[0].sigma2)
    coarse = IMU[0].white_and_bias(step=0.02)
    px4 = snippets.snippet(IMU[:1], "px4", step=0.02).text
    noise = float(re.search(r"EKF2_GYR_NOISE\t(\S+)", px4)[1])
    assert noise == pytest.approx(coarse.N / 0.02**0.5, rel=1e-8)


def test_what_does_not_suit_has_a_reason():
    assert "accelerometers" in snippets.snippet(IMU[:1], "kalibr").reason
    assert "no fit" in snippets.snippet([], "gtsam").reason
    with pytest.raises(ValueError, match="no format"):
        snippets.snippet(IMU, "matlab")
