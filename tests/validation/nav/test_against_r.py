"""R's Monte Carlo (navigation 0.0.2, 50 runs of three models, reference/nav_mc_lemniscate.json), redone with 1000.

Every curve of R at every second is one draw from what our runs say of a mean of 50: of a gamma distribution with the
moments of our runs (means are skewed: of 50 runs a mean NEES is chi-square with 150 degrees of freedom, not normal),
and for coverage of a binomial one. Sigmas are those of a normal number with the same probability. 51 curves of 300
epochs are 15,300 comparisons, correlated along a curve and between curves: were they independent, one would be beyond
4.
"""

import json

import jax
import numpy as np
import pytest
import scipy.stats
from nav import setups

import nav_jax as nj

NUM_R, NUM_RUNS = 50, 1000
MODELS = {"right": "correct", "wrong": "wrong", "partial": "partial"}
SIGMAS = 4.0


@pytest.fixture(scope="module")
def r(shared):
    return json.loads((shared / "reference" / "nav_mc_lemniscate.json").read_text())["results"]


@pytest.fixture(scope="module")
def ours():
    """R's example: errors that start from zero, an exact start, an outage of 40 s at the end."""
    scenario = nj.Scenario(
        nj.motions.lemniscate(300.0, setups.RATE, attitude="navigation"),
        setups.aiding(260.0, 300.0, first=0.0),
        earth=nj.FlatEarth(setups.GRAVITY),
        every=10,
    )
    return nj.compare(
        scenario,
        setups.imu_errors("right", "zero"),
        {name: setups.imu_errors(name, "zero") for name in MODELS},
        num_runs=NUM_RUNS,
        key=jax.random.key(7),
    )


def curve(r, name):
    """A curve of R at 1, 2 .. 300 s."""
    t, v = np.round(r[name]["t"]).astype(int), np.asarray(r[name]["v"])
    np.testing.assert_array_equal(t[t >= 1], np.arange(1, 301))
    return v[..., t >= 1]


def sigmas_of_mean(seen, draws):
    """Of a mean of 50 like `draws` (runs, epochs): two-sided, from the gamma distribution of equal moments."""
    mean, variance = draws.mean(axis=0), draws.var(axis=0, ddof=1) * (1 / NUM_R + 1 / len(draws))
    law = scipy.stats.gamma(mean**2 / variance, scale=variance / mean)
    return scipy.stats.norm.isf(np.minimum(law.cdf(seen), law.sf(seen)))


def sigmas_of_share(seen, inside):
    """Of a share of 50 like `inside` (runs, epochs); at most half a count in 1000 is known of a rare event."""
    p = np.clip(inside.mean(axis=0), 0.5 / len(inside), 1 - 0.5 / len(inside))
    law, count = scipy.stats.binom(NUM_R, p), np.round(seen * NUM_R)
    return scipy.stats.norm.isf(np.minimum(np.minimum(law.cdf(count), law.sf(count - 1)), 0.5))


@pytest.fixture
def assert_close(judge):
    """Judge a curve of R by its sigmas at every second."""

    def close(curve, sigmas):
        assert np.isfinite(sigmas).all()
        judge(f"{curve}, worst of R's seconds in sigmas", sigmas.max(), -np.inf, SIGMAS, num_draws=NUM_RUNS)

    return close


@pytest.mark.parametrize("name", MODELS)
def test_mean_errors(ours, r, name, assert_close):
    error, expected = ours.runs[name].error, r[MODELS[name]]
    assert_close(
        "position", sigmas_of_mean(curve(expected, "mean_position_err_m"), np.linalg.norm(error[..., :3], axis=-1))
    )
    turned = np.degrees(np.linalg.norm(error[..., 6:9], axis=-1))
    assert_close("orientation", sigmas_of_mean(curve(expected, "mean_orientation_err_deg"), turned))


@pytest.mark.parametrize("name", MODELS)
def test_rms_of_each_component(ours, r, name, assert_close):
    """Nine mean squares; R's angles are roll, pitch, yaw."""
    error = ours.runs[name].error[..., :9].copy()
    reference = ours.reference
    euler = reference.euler[::100][1:]
    _, p, y = euler.T
    # rotation vector in n to small changes of roll, pitch, yaw
    north, east, down = np.moveaxis(error[..., 6:9], -1, 0)
    roll = (np.cos(y) * north + np.sin(y) * east) / np.cos(p)
    error[..., 6:9] = np.stack([roll, np.cos(y) * east - np.sin(y) * north, down + np.sin(p) * roll], -1)
    rms = curve({"rms": {**r[MODELS[name]]["rms"], "t": np.arange(301)}}, "rms")
    ours_of = [0, 1, 2, 6, 7, 8, 3, 4, 5]
    for i, column in enumerate(ours_of):
        assert_close(f"mean square of component {column}", sigmas_of_mean(rms[i] ** 2, error[..., column] ** 2))


@pytest.mark.parametrize("name", MODELS)
def test_nees(ours, r, name, assert_close):
    for theirs, group in (("1_3", "position"), ("1_6", "pose"), ("1_9", "navigation")):
        assert_close(
            f"NEES of {group}", sigmas_of_mean(curve(r[MODELS[name]], f"nees_idx{theirs}"), ours.runs[name].nees[group])
        )


@pytest.mark.parametrize("name", MODELS)
def test_coverage(ours, r, name, assert_close):
    for level, theirs, group in (("0.70", "1_6", "pose"), ("0.95", "1_6", "pose"), ("0.95", "1_3", "position")):
        inside = ours.runs[name].nees[group] <= scipy.stats.chi2.ppf(float(level), ours.runs[name].dof[group])
        assert_close(
            f"coverage of {group} at {level}",
            sigmas_of_share(curve(r[MODELS[name]], f"coverage_a{level}_idx{theirs}"), inside),
        )
