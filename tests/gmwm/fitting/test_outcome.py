"""What became of a component is a member of an enumeration, whose value is what tables say."""

import json

import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.fitting import Outcome
from gmwm_jax.processes import Limit


@pytest.mark.parametrize("limit", Limit)
def test_every_limit_of_a_process_has_an_outcome(limit):
    outcome = Outcome.at(limit)
    assert outcome.at_boundary == bool(limit)
    assert outcome == (f"at boundary: {limit}" if limit else "")


def test_which_outcomes_are_boundaries():
    inside = {Outcome.ESTIMATED, Outcome.FIXED, Outcome.NOT_IDENTIFIED, Outcome.NOT_TOLD_APART}
    assert {o for o in Outcome if not o.at_boundary} == inside
    ends = {Outcome.ZERO, Outcome.LOWER_BOUND, Outcome.UPPER_BOUND}
    assert {o for o in Outcome if o.at_boundary} - ends == {Outcome.at(limit) for limit in Limit if limit}


def test_results_have_members_and_print_their_sentences():
    tau = 2.0 ** np.arange(1, 12)
    nu = np.asarray(gj.parse_model("RW(gamma2=1e-6)").wavelet_variance(tau))
    wv = gj.variance.WaveletVariance.from_table(tau, nu, 0.9 * nu, 1.1 * nu)
    fit = gj.fit(wv, "WN + GM(beta=0.1 fixed)")
    assert fit.at_boundary["WN"] is Outcome.ZERO or fit.at_boundary["GM"] is Outcome.ZERO
    notes = {(e.component, e.symbol): e.note for e in fit.parameters()}
    assert notes["GM", "beta"] is Outcome.FIXED
    assert "at boundary: zero" in repr(fit)
    assert json.loads(json.dumps(fit.to_dict()))["parameters"][1]["note"] == "fixed"
