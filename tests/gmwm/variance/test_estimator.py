"""Estimators of the wavelet variance as objects: shorthands, and what a new one takes."""

from dataclasses import dataclass

import jax
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.variance import Dwt, Modwt, Pairs, Robust
from gmwm_jax.variance.estimator import METHODS, AbstractEstimator, Estimated

X = np.random.default_rng(3).normal(size=4000)
GAPPY = np.where(np.arange(4000) % 9 == 4, np.nan, X)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("record", "estimator", "shorthand"),
    [
        (X, Modwt(), {}),
        (X, "modwt", {"method": "modwt"}),
        (X, Dwt(), {"method": "dwt"}),
        (X, Robust(0.7), {"efficiency": 0.7}),
        (X, "robust", {"efficiency": 0.6}),
        (GAPPY, Pairs(), {"gaps": "pairs"}),
        (X, Pairs(), {}),  # nothing is missing
    ],
)
def test_shorthands_mean_objects(record, estimator, shorthand):
    seen, expected = gj.wavelet_variance(record, estimator=estimator), gj.wavelet_variance(record, **shorthand)
    for name in ("variance", "ci_low", "ci_high"):
        np.testing.assert_array_equal(getattr(seen, name), getattr(expected, name))
    assert seen.estimator == expected.estimator
    assert repr(seen) == repr(expected)


def test_contradictions_are_refused():
    with pytest.raises(ValueError, match="not by both"):
        gj.wavelet_variance(X, estimator=Modwt(), efficiency=0.6)
    with pytest.raises(ValueError, match="estimator is one of 'modwt', 'dwt', 'robust', 'pairs'"):
        gj.wavelet_variance(X, estimator="haar")
    with pytest.raises(ValueError, match="efficiency must be a number between"):
        Robust(0.3)
    with pytest.raises(ValueError, match="NaN"):
        gj.wavelet_variance(GAPPY, estimator=Modwt())


@dataclass(frozen=True)
class HalfDense(AbstractEstimator):
    """The MODWT's of the first half of a record: an estimator that any user may write."""

    @property
    def name(self):
        return "half"

    def estimate(self, data, names, num_levels, *, scratch=None):
        return Modwt().estimate(data[: len(data) // 2], names, num_levels)

    def covariance(self, model, num_samples, num_levels, present):
        return None if num_samples is None else Modwt().covariance(model, num_samples // 2, num_levels, None)


def test_a_new_estimator_is_one_class():
    """Intervals, standard errors, replicates and joint fits ask the object."""
    half, whole = (
        gj.wavelet_variance(X, estimator=HalfDense(), num_levels=6),
        gj.wavelet_variance(X[:2000], num_levels=6),
    )
    np.testing.assert_array_equal(half.variance, whole.variance)
    np.testing.assert_array_equal(half.ci_high, whole.ci_high)
    assert half.num_samples == 4000
    fit = gj.fit(half, "WN")
    np.testing.assert_allclose(fit.covariance, gj.fit(whole, "WN").covariance, rtol=1e-12)
    boot = gj.bootstrap(fit, 4, key=jax.random.key(0))
    assert boot.converged.all()
    with pytest.raises(ValueError, match="half wavelet variance is not replicated by simulated records"):
        gj.bootstrap(fit, 4, key=jax.random.key(0), route="records")
    with pytest.raises(ValueError, match="Record 2 has the estimator modwt, and record 1 half"):
        gj.fit_records([half, whole], "WN")


def test_every_estimator_says_what_it_knows():
    """The facts that others ask for agree with what the object does."""
    model = gj.parse_model("WN(sigma2=1.0)")
    for name, estimator in METHODS.items():
        data = GAPPY if estimator.bears_gaps else X
        nu, dof, present, _ = estimator.estimate(data, ("x",), 5)
        assert isinstance(estimator.estimate(data, ("x",), 5), Estimated)
        assert nu.shape == (5,)
        assert np.all(dof >= 1)
        V = estimator.covariance(model, len(X), 5, present)
        assert (V is not None) == estimator.has_theory, name
        if estimator.replicates_records:
            rows = estimator.of_records(5, present)(np.stack([X, X[::-1]]))
            np.testing.assert_allclose(rows[0], nu, rtol=1e-12)
            assert rows.shape == (2, 5)
