"""The parametric bootstrap: its replicates against theory and against full fits, its intervals by coverage."""

import jax
import numpy as np
import pytest
from drawn import assert_shows
from helpers import Told, assert_covariance, assert_mean
from programs import fitted, simulated, with_variance

import gmwm_jax as gj
from gmwm_jax.fitting.refit import refit
from gmwm_jax.inference import bootstrapping as module
from gmwm_jax.variance.replicates import variance_draws


@pytest.fixture(scope="module")
def wv():
    return simulated()


@pytest.fixture(scope="module")
def fit():
    return fitted()


@pytest.fixture(scope="module")
def boot(fit):
    return gj.bootstrap(fit, 1000, key=jax.random.key(6))


def test_variances_are_drawn_from_their_theory(fit):
    """Means and variances exactly, correlations as far as a Gaussian copula keeps them: to 0.05."""
    keys = jax.random.split(jax.random.key(1), 20_000)
    nu, V = variance_draws(fit.fitted, fit.wv_covariance)(keys), fit.wv_covariance
    assert_mean(nu, fit.fitted)
    assert_covariance(nu, nu, np.diag(V), mean_a=fit.fitted, mean_b=fit.fitted)
    sd = np.sqrt(np.diag(V))
    assert np.abs(np.corrcoef(nu, rowvar=False) - V / np.outer(sd, sd)).max() < 0.05
    assert nu.min() > 0


@pytest.mark.slow
@pytest.mark.parametrize("omega", [None, "two-step", "covariance"])
def test_a_refit_is_a_fit(wv, omega):
    """The same minimum as a global search of each replicate, with weights of the same kind."""
    first = gj.fit(wv, "WN + GM", weights=omega)
    nu = gj.bootstrap(first, 10, key=jax.random.key(2)).variances
    ours = refit(first, nu)
    given = first.omega if omega == "covariance" else omega
    for b, row in enumerate(nu):
        f = gj.fit(with_variance(wv, row), "WN + GM", weights=given)
        assert ours.objective[b] == pytest.approx(f.objective, rel=1e-6)
        np.testing.assert_allclose(ours.values[b], [float(v) for p in f.model.processes for v in p.values], rtol=1e-4)
    assert ours.converged.all()


@pytest.mark.slow
def test_components_keep_their_places():
    """Order of the user, from fast to slow; what is held stays."""
    truth = gj.parse_model(
        "RW(gamma2=1e-6) + GM(beta=0.5, variance=1.0) + GM(beta=0.005, variance=0.5) + WN(sigma2=1.0)"
    )
    x = gj.simulate(truth, 100_000, key=jax.random.key(3))
    held = gj.RW(gj.Fixed(1e-6)) + 2 * gj.GM() + gj.WN()
    boot = gj.bootstrap(gj.fit(gj.wavelet_variance(np.asarray(x)), held), 20, key=jax.random.key(4))
    assert boot.names == ("RW gamma2", "GM_1 beta", "GM_1 variance", "GM_2 beta", "GM_2 variance", "WN sigma2")
    np.testing.assert_allclose(boot.values[:, 0], 1e-6)
    median = np.median(boot.values, axis=0)
    np.testing.assert_allclose(np.log(median[1:]), np.log([0.5, 1.0, 0.005, 0.5, 1.0]), atol=0.5)


def test_a_wrong_model_is_found(wv):
    assert gj.bootstrap(gj.fit(wv, "WN"), 300, key=jax.random.key(1)).p_value < 0.02
    assert gj.bootstrap(gj.fit(wv, "WN + GM"), 300, key=jax.random.key(1)).p_value > 0.02


@pytest.mark.slow
def test_tables(fit, boot):
    """Intervals of functions of one parameter are the functions of its interval; kinds are mirrored and scaled."""
    low, high = boot.interval()
    sample, filters = boot.parameters(), boot.continuous()
    assert sample["GM", "beta"].ci_low == low[1]
    assert filters["GM", "beta"].ci_high == pytest.approx(100 * high[1], rel=1e-9)
    assert boot.datasheet()["WN", "N"].ci_low == pytest.approx(np.sqrt(low[0] / 100), rel=1e-9)
    estimate = np.array([e.value for e in sample])
    np.testing.assert_allclose(boot.interval("basic")[0], estimate**2 / high, rtol=1e-9)
    narrow, wide = boot.interval(level=0.5), boot.interval(level=0.98)
    assert np.all((wide[0] < narrow[0]) & (narrow[1] < wide[1]))
    # nearly normal on the log scale: all kinds are near that of theory
    theory = fit.parameters()
    for kind in ("percentile", "basic", "studentised"):
        for e in boot.parameters(kind):
            t = theory[e.component, e.symbol]
            width = np.log(t.ci_high / t.ci_low)
            assert abs(np.log(e.ci_high / t.ci_high)) < 0.2 * width
            assert abs(np.log(e.ci_low / t.ci_low)) < 0.2 * width
    assert "1000 replicates by variances" in repr(boot)
    assert "percentile intervals from 1000 replicates" in repr(boot)
    assert boot.correlation.shape == (3, 3)
    np.testing.assert_allclose(np.diag(boot.correlation), 1.0)


@pytest.mark.slow
def test_a_component_at_zero_has_an_upper_end(wv):
    """Drift is not in the data: the interval starts at zero, and what cannot be had is not printed."""
    boot = gj.bootstrap(gj.fit(wv, "WN + GM + DR"), 250, key=jax.random.key(1))
    e = boot.parameters()["DR", "omega"]
    assert e.ci_low == 0
    assert 0 < e.ci_high < 1e-4


def test_figure(boot):
    figure = boot.plot()
    assert_shows(figure, gj.plotting.bootstrap_data(boot))
    assert [ax.get_xlabel() for ax in figure.axes] == [
        "WN sigma2 [(1)²]", "GM beta [1/sample]", "GM variance [(1)²]"
    ]  # fmt: skip
    labels = {text.get_text() for text in figure.legends[0].get_texts()}
    assert labels == {"replicates", "estimate", "95 % percentile", "95 % theory"}


def test_replicates_depend_on_their_key_alone(fit, boot):
    few = gj.bootstrap(fit, 70, key=jax.random.key(6))
    np.testing.assert_allclose(few.variances, boot.variances[:70], rtol=1e-12)
    np.testing.assert_allclose(few.values, boot.values[:70], rtol=1e-6)


@pytest.mark.slow
def test_replicates_from_simulated_records(fit, boot):
    """Eight of them: positive, of the same size as those from theory, with a fit each."""
    records = gj.bootstrap(fit, 8, key=jax.random.key(7), route="records")
    assert records.values.shape == (8, 3)
    assert records.variances.shape == (8, len(fit.fitted))
    assert records.num_failed == 0
    np.testing.assert_allclose(records.variances[:, 0].mean(), fit.fitted[0], rtol=0.1)
    assert np.all(np.abs(np.log(records.values / np.median(boot.values, axis=0))) < 1)


def test_an_interrupt_returns_what_is_done(fit, monkeypatch):
    done = []

    def interrupted(*arguments):
        if done:
            raise KeyboardInterrupt
        done.append(1)
        return refit(*arguments)

    monkeypatch.setattr(module, "refit", interrupted)
    boot = gj.bootstrap(fit, 300, key=jax.random.key(1), progress=True)
    assert len(boot.values) == 64
    assert "64 replicates of 300 asked for" in repr(boot)
    with pytest.raises(KeyboardInterrupt):
        gj.bootstrap(fit, 300, key=jax.random.key(1))


def test_progress_is_told_and_cancels(fit):
    told = Told()
    whole = gj.bootstrap(fit, 100, key=jax.random.key(1), progress=told)
    assert told.heard == [(0, 100), (64, 100), (100, 100)]
    part = gj.bootstrap(fit, 100, key=jax.random.key(1), progress=Told(64, KeyboardInterrupt))
    np.testing.assert_array_equal(part.values, whole.values[:64])
    with pytest.raises(LookupError, match="enough"):
        gj.bootstrap(fit, 100, key=jax.random.key(1), progress=Told(64))


def test_bad_input(fit, boot, wv):
    with pytest.raises(ValueError, match="60 replicates are too few for 95 % intervals, which take 200"):
        gj.bootstrap(fit, 60, key=jax.random.key(1)).parameters()
    with pytest.raises(ValueError, match="kind is one of percentile, basic, studentised"):
        boot.interval("normal")
    with pytest.raises(ValueError, match='route is "variances" or "records"'):
        gj.bootstrap(fit, 10, key=jax.random.key(1), route="fast")
    with pytest.raises(ValueError, match="num_replicates"):
        gj.bootstrap(fit, 0, key=jax.random.key(1))
    with pytest.raises(TypeError, match="key"):
        gj.bootstrap(fit, 10, key=3)
    short = gj.variance.WaveletVariance.from_table(wv.scales, wv.variance, wv.ci_low, wv.ci_high)
    with pytest.raises(ValueError, match=r"^Replicates need the covariance"):
        gj.bootstrap(gj.fit(short, "WN"), 10, key=jax.random.key(1))
