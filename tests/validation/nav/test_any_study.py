"""Any sensors with any states, any errors, either Earth, either gains, through all that one may ask of a study.

A study is one seed, and a failure names it: ``any_study.study(seed)`` is it again.
"""

import jax
import matplotlib.pyplot as plt
import numpy as np
import pytest
from nav.any_study import study
from scipy import stats

import nav_jax as nj

pytestmark = pytest.mark.usefixtures("quick_compilation")

RUNS = 16
RARE = 1e-7


def of_results(one):
    """All results of a study, by the door that they come from."""
    same = {"num_runs": RUNS, "key": jax.random.key(5), "gains": one.gains}
    return {
        "compare": nj.compare(one.scenario, one.truth, one.filters, **same),
        "smoother": nj.monte_carlo(one.scenario, one.truth, smooth=True, **same),
        "analyse": nj.analyse(one.scenario, one.truth, one.filters),
        "budget": nj.error_budget(one.scenario, one.truth, one.filters["less"]),
        "sensitivities": nj.sensitivities(one.scenario, one.truth, one.filters["less"]),
    }


@pytest.mark.parametrize("seed", [*range(8), 19])
def test_every_door(seed, tmp_path):
    one = study(seed)
    results = of_results(one)
    runs, smooth, exact, budget, slopes = results.values()
    E = len(exact["right"].time)

    # what comes out is finite, and runs have the covariance that is computed without them
    for name in one.filters:
        assert runs[name].num_good == RUNS
        assert np.isfinite(runs[name].error).all()
        assert runs[name].error.shape == (RUNS, E, 15)
        for group, nees in runs[name].nees.items():
            assert runs[name].dof[group] == exact[name].dof(group)
            assert np.isfinite(nees).all() == np.isfinite(exact[name].nees(group)).all()
        N, error = exact[name].true[-1, :9, :9], runs[name].error[:, -1, :9]
        normalised = np.einsum("ri,ij,rj->", error, np.linalg.inv(N), error)
        low, high = stats.chi2.ppf([RARE, 1 - RARE], 9 * RUNS)
        assert low < normalised < high, (name, normalised / (9 * RUNS))
        for sensor, nis in runs[name].nis.items():
            assert np.isfinite(nis).all(), sensor

    # a filter that knows all there is says what is true
    right = exact["right"]
    if one.matches:
        np.testing.assert_allclose(right.nees("navigation"), 9.0, rtol=1e-6)
        np.testing.assert_allclose(right.claimed[:, :9, :9], right.true[:, :9, :9], rtol=1e-7, atol=1e-14)

    # the smoother is surer than the filter
    assert smooth.num_good == RUNS
    assert np.isfinite(smooth.error).all()
    assert (smooth.sd[:, :, :9] <= runs["right"].sd[:, :, :9] * (1 + 1e-6)).all()

    whole = np.einsum("eii->ei", exact["less"].true[:, :9, :9])
    np.testing.assert_allclose(budget.part.sum(axis=0), whole, rtol=1e-12)

    assert len(set(zip(slopes.names, slopes.sides, strict=True))) == len(slopes.names)
    for quantity, derivative in slopes.derivative.items():
        assert derivative.shape == (E, len(slopes.names))
        assert np.isfinite(derivative).all(), quantity
        np.testing.assert_allclose(slopes.rms[quantity] > 0, True)

    for door, result in results.items():
        assert repr(result)
        plt.close(result.plot())
        file = tmp_path / f"{door}.npz"
        result.save(file)
        again = nj.load(file)
        assert repr(again) == repr(result), door
