"""Held values: the data contradict those that are wrong by orders of magnitude, and none that is right."""

import jax
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.processes.simulation import simulate_each

N = 4096
TRUTH = "WN(sigma2=1.0) + GM(beta=0.02, variance=0.5)"


@pytest.fixture(scope="module")
def variances():
    """Of 100 records, all by one program."""
    x = np.asarray(simulate_each(gj.parse_model(TRUTH), jax.random.split(jax.random.key(5), 100), N))
    return gj.wavelet_variance(x.T, rate=1.0)


def channel(variances, i=0):
    return variances[variances.channels[i]]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "label", "wanted"),
    [
        ("WN(sigma2=1e4 fixed) + GM", "WN sigma2", 1.0),
        ("WN + GM(beta=0.02 fixed, variance=1e6 fixed)", "GM variance", 0.5),
        ("WN(sigma2=1e-4 fixed) + RW", "WN sigma2", 1.0),
        ("GM(beta=1e-4 fixed)", "GM beta", 1.0),
        ("WN + RW(gamma2=1.0 fixed)", "RW gamma2", 1e-3),
    ],
)
def test_what_is_wrong_is_said(variances, model, label, wanted):
    fit = gj.fit(channel(variances), model)
    (text,) = (t for t in fit.contradictions if t.startswith(f"{label} is held at "))
    near = float(text.split(" near ")[1].split()[0])
    assert wanted / 30 < near < 30 * wanted
    assert f"\nwarning: {label} is held" in repr(fit)
    assert fit.to_dict()["contradictions"] == list(fit.contradictions)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["WN(sigma2=1.0 fixed) + GM", "WN + GM(beta=0.02 fixed)"])
def test_what_is_right_is_never_doubted(variances, model):
    """200 fits of records of the model, 100 of each."""
    fits = gj.fit(variances, model)
    assert [fits[c].contradictions for c in fits] == [()] * 100


@pytest.mark.slow
def test_what_nobody_sees_is_not_doubted(variances):
    """A component far below the others, and one for which another stands in."""
    for model in ("WN + GM + RW(gamma2=1e-20 fixed)", "WN + GM + QN(q2=1e-12 fixed)", "WN + GM"):
        assert gj.fit(channel(variances), model).contradictions == ()
