"""What the doors return is known to a type checker: this file is checked by pyright, and by its tests."""

import ast
import inspect
from pathlib import Path
from typing import TYPE_CHECKING, assert_type

import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.fitting import Channels
from gmwm_jax.fitting.estimator import fit
from gmwm_jax.inference import Selection
from gmwm_jax.inference.selection import select
from gmwm_jax.multisignal import JointFit
from gmwm_jax.multisignal.joint import fit_records
from gmwm_jax.variance import WaveletVariance, WaveletVariances

if TYPE_CHECKING:

    def doors(one: WaveletVariance, several: WaveletVariances, rec: gj.Recording) -> None:
        assert_type(gj.fit(one, "WN"), gj.Fit)
        assert_type(gj.fit(several, "WN", weights="two-step"), Channels[gj.Fit])
        assert_type(gj.fit(rec, "WN"), gj.Fit | Channels[gj.Fit])
        assert_type(gj.fit(several["x"], "WN"), gj.Fit)
        assert_type(gj.fit(several, "WN")["x"], gj.Fit)
        assert_type(gj.select(one, "WN + RW"), Selection)
        assert_type(gj.select(several, ["WN", "RW"]), Channels[Selection])
        assert_type(gj.fit_records([one, one], "WN"), JointFit)
        assert_type(gj.fit_records([several, several], "WN"), Channels[JointFit])
        assert_type(gj.fit_records([one, one], "WN").fit, gj.Fit)
        assert_type(gj.wavelet_variance(rec), WaveletVariance | WaveletVariances)


@pytest.mark.parametrize("door", [fit, select, fit_records])
def test_no_overload_returns_anything(door):
    """Read from the source: the tests run under a hook that wraps functions."""
    tree = ast.parse(Path(inspect.getfile(inspect.unwrap(door))).read_text())
    doors = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == door.__name__]
    returned = [ast.unparse(node.returns) for node in doors if node.returns]
    assert len(returned) == 4  # one channel, several, what is known when it runs, and the body
    assert not any("Any" in text for text in returned)


def test_the_classes_are_those_of_one_channel_and_of_several():
    x = np.random.default_rng(0).normal(size=(200, 2))
    one, several = gj.wavelet_variance(x[:, 0]), gj.wavelet_variance(x)
    assert type(one) is WaveletVariance
    assert type(several) is WaveletVariances
    assert type(several[0]) is type(one[0]) is WaveletVariance
    np.testing.assert_array_equal(several[0].variance, one.variance)
    with pytest.raises(ValueError, match="of several channels make a WaveletVariances"):
        WaveletVariance(several.scales, several.variance, several.ci_low, several.ci_high)
    with pytest.raises(ValueError, match="of one channel make a WaveletVariance"):
        WaveletVariances(one.scales, one.variance, one.ci_low, one.ci_high)


def test_results_of_channels_are_found_by_name_and_number():
    x = np.random.default_rng(0).normal(size=(200, 2))
    fits = gj.fit(gj.wavelet_variance(x), "WN")
    assert isinstance(fits, Channels)
    assert list(fits) == ["channel_0", "channel_1"]
    assert fits["channel_1"] is fits[1] is list(fits.values())[-1]
    assert "channel_1" in repr(fits)
    assert repr(fits).startswith("GMWM fits, parameters per sample")
    with pytest.raises(KeyError, match="No channel 'x'; there are channel_0, channel_1"):
        fits["x"]
