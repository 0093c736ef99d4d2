"""The numbers of the example: printed ones are reproduced at the printed estimates, minima are lower."""

import pytest

import gmwm_jax as gj
from gmwm_jax.app.web import tutorial

MINIMA = {2: 540.4236, 3: 537.8544, 4: 28.4772, 6: 17.2349}
PRINTED = {c.number: c for c in tutorial.CHAPTERS if c.printed}


@pytest.mark.parametrize("number", PRINTED)
def test_objectives_at_the_printed_estimates(number):
    chapter = PRINTED[number]
    value = float(gj.fitting.objective(tutorial.data(), chapter.printed))
    assert value == pytest.approx(chapter.printed_objective, rel=1e-6)


@pytest.mark.parametrize("number", [2, 3, 4])
def test_the_minimum_is_beside_them(number):
    comparison = tutorial.compared(PRINTED[number])
    assert comparison.fit.objective == pytest.approx(MINIMA[number], rel=1e-5)
    assert ("not the minimum" in comparison.sentence) == (number > 2)
    assert f"{PRINTED[number].printed_objective:.7g}" in comparison.sentence


def test_units_of_the_slides():
    steps = {c.component: {s.symbol: s.value for s in c.steps} for c in tutorial.conversions(PRINTED[6])}
    expected = {
        "GM_1": {"T": 5.92093, "sqrt(q)": 2.004939e-04},
        "GM_2": {"T": 113.3944, "sqrt(q)": 4.510066e-05},
        "GM_3": {"T": 4.83568e-03, "sqrt(q)": 0.1448027},
        "WN": {"sqrt(q)": 6.251281e-05},
        "RW": {"sqrt(q)": 1.044447e-06},
    }
    for component, values in expected.items():
        for symbol, value in values.items():
            assert steps[component][symbol] == pytest.approx(value, rel=2e-6)
    traps = [c.trap for c in tutorial.conversions(PRINTED[6]) if c.component == "GM_1"]
    assert traps == [pytest.approx(296.6, rel=1e-3)]


def test_a_step_without_a_model_has_nothing_to_compare():
    with pytest.raises(ValueError, match="nothing is fitted"):
        tutorial.compared(tutorial.CHAPTERS[0])
    assert tutorial.conversions(tutorial.CHAPTERS[0]) == ()
