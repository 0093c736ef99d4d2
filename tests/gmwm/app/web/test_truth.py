"""The truth of a simulated record is put beside the parameter that it is the truth of, and beside no other."""

import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.app.web import tables
from gmwm_jax.app.web.truth import beside

DRAWN = "RW(gamma2=3.0) + GM(beta=0.001, variance=5.0) + GM(beta=2.0, variance=7.0)"
NAN = float("nan")


@pytest.mark.parametrize(
    ("fitted", "expected"),
    [
        ("RW + 2*GM", [3.0, 2.0, 7.0, 0.001, 5.0]),  # the fast one first, as in a fit
        ("WN + RW + GM", [0.0, 3.0, NAN, NAN]),  # which of the two it is, nobody knows
        ("QN + AR1", [0.0, NAN, NAN]),
    ],
)
def test_each_parameter_has_its_own_truth(fitted, expected):
    np.testing.assert_array_equal(beside(gj.parse_model(fitted), gj.parse_model(DRAWN)), expected)


def test_the_table_has_it_beside_the_estimate():
    x = np.random.default_rng(0).normal(size=2000)
    fit = gj.fit(gj.wavelet_variance(gj.Recording.from_array(x, rate=100.0, units="rad/s")), "WN")
    table = tables.estimates(fit, gj.parse_model("WN(sigma2=1.0)"))
    assert table.columns[2:4] == ("truth", "estimate")
    assert table.rows[0][2] == 1.0
    assert len(table.units) == len(table.columns) == len(table.rows[0])
    assert "WN(sigma2=1)" in table.text
    test = gj.goodness_of_fit(fit)
    assert [row[3] for row in tables.goodness(fit).rows] == list(test.pulls)
