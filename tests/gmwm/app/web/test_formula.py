"""The converter against numbers worked out by hand, and its formulas against its values."""

import math
import re

import pytest

from gmwm_jax.app.web import formula

F = 100.0


def evaluated(numbers):
    """The formula with its numbers, by Python's own arithmetic."""
    assert re.fullmatch(r"[-+*/^(). 0-9esqrtxp]+", numbers)
    return eval(numbers.replace("^", "**"), {"__builtins__": {}}, {"sqrt": math.sqrt, "exp": math.exp})


@pytest.mark.parametrize(
    ("kind", "parameters", "expected"),
    [
        ("WN", [4.926494e-05], {"q": 4.926494e-07, "sqrt(q)": 7.018899e-04}),
        ("RW", [4.755070e-13], {"q": 4.755070e-11, "sqrt(q)": 6.895702e-06}),
        ("DR", [3.913529e-09], {"R": 3.913529e-07}),
        ("QN", [1.681227e-06], {"Q": 1.296621e-05}),
        (
            "GM",
            [2.023686, 4.896453e-05],
            {"beta_c": 202.3686, "T": 4.94148e-3, "sqrt(q)": 0.1407756},
        ),
        ("GM", [1.688923e-03, 1.190042e-07], {"T": 5.92093, "sqrt(q)": 2.004939e-04}),
        ("GM", [8.818780e-05, 1.153260e-07], {"T": 113.3944, "sqrt(q)": 4.510066e-05}),
    ],
)
def test_to_filters(kind, parameters, expected):
    """Worked out from the definitions: white noise over a density, a random walk's growth in a second, 2 beta var."""
    steps = {s.symbol: s for s in formula.to_filter(kind, parameters, F, "rad/s")}
    for symbol, value in expected.items():
        assert steps[symbol].value == pytest.approx(value, rel=1e-6)
    for step in steps.values():
        assert evaluated(step.numbers) == pytest.approx(step.value, rel=1e-5)


@pytest.mark.parametrize("kind", formula.kinds())
def test_there_and_back(kind):
    parameters = [0.02, 3.0] if kind == "GM" else [0.02]
    wanted = {"GM": ("beta_c", "q"), "DR": ("R",), "QN": ("Q",)}.get(kind, ("q",))
    there = {s.symbol: s.value for s in formula.to_filter(kind, parameters, F, "m/s^2")}
    back = formula.to_samples(kind, [there[symbol] for symbol in wanted], F, "m/s^2")
    assert [s.value for s in back] == pytest.approx(parameters, rel=1e-12)
    for step in back:
        assert evaluated(step.numbers) == pytest.approx(step.value, rel=1e-5)


def test_the_trap_of_the_two_variances():
    """One in the place of the other: 1.8 % at a fast process, 297 times at a slow one."""
    for beta, ratio in ((2.023686, 1.018), (1.688923e-03, 296.6)):
        assert formula.innovation_to_stationary(beta, 1.0).value == pytest.approx(ratio, rel=1e-3)


def test_units():
    step = formula.converted(7.018899e-04, "rad/s/sqrt(Hz)", "deg/sqrt(h)")
    assert step.value == pytest.approx(2.412920, rel=1e-6)
    assert evaluated(step.numbers) == pytest.approx(step.value, rel=1e-5)
    with pytest.raises(ValueError, match="cannot be converted"):
        formula.converted(1.0, "deg/h", "m/s^2")
    with pytest.raises(ValueError, match="none of the processes"):
        formula.to_filter("ARMA", [1.0], F, "rad/s")
