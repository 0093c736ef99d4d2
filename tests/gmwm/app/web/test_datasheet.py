"""Datasheet entries as typed, against the models and the numbers that they mean."""

from dataclasses import replace

import numpy as np
import pytest
from programs import RATE, fitted, simulated

import gmwm_jax as gj
from gmwm_jax.app.web import datasheet


def test_typed_entries_are_those_of_the_library():
    text = "N=0.15 deg/sqrt(h), B = 10deg/h; f0=0.5 Hz, K=2 deg/h/sqrt(h), GM=20 deg/h @ 100 s"
    given = {"N": "0.15 deg/sqrt(h)", "B": "10 deg/h", "f0": "0.5 Hz", "K": "2 deg/h/sqrt(h)"}
    own, signal = datasheet.model(text, RATE)
    expected, _ = gj.from_datasheet(given, RATE, gauss_markov=(("20 deg/h", "100 s"),))
    assert (own, signal) == (expected, "rad/s") or (str(own), signal) == (str(expected), "rad/s")
    both = datasheet.overlay("N=0.15 deg/sqrt(h) | N=50 ug/sqrt(Hz)", RATE)
    assert list(both) == ["rad/s", "m/s^2"]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("0.15 deg/sqrt(h)", "a name and a value"),
        ("N=1 deg/h, N=2 deg/h", "given twice"),
        ("GM=20 deg/h", "correlation time"),
    ],
)
def test_what_cannot_be_read_is_said(text, complaint):
    with pytest.raises(ValueError, match=complaint):
        datasheet.entries(text)
    with pytest.raises(ValueError, match="about rad/s"):
        datasheet.overlay("N=1 deg/sqrt(h) | K=1 deg/h/sqrt(h)", RATE)


def test_the_verdict_compares_with_the_interval():
    fit = replace(fitted(), wv=replace(simulated(), units=("rad/s",)))
    N = np.degrees(fit.white_and_bias().N) * 60
    for factor, answer in ((1.0, "within the interval"), (2.0, "better than stated"), (0.5, "worse than stated")):
        verdict, bias = datasheet.verdicts(fit, f"N={factor * N} deg/sqrt(h), B=1 deg/s")
        assert verdict.answer == answer
        assert verdict.ratio == pytest.approx(1 / factor, rel=1e-12)
        assert bias.measured == pytest.approx(np.degrees(fit.white_and_bias().B), rel=1e-12)
        assert bias.answer == "no interval"
    with pytest.raises(ValueError, match="this channel is in rad/s"):
        datasheet.verdicts(fit, "N=50 ug/sqrt(Hz)")
