"""The shapes, models, records and fits that tests share.

Each new number of samples or of scales, and each new structure of a model, is a program to compile, which takes longer
than to run it: tests take these unless another one is their point. What is made here is made once in a process, for
tests that only read it.
"""

from dataclasses import replace
from functools import cache

import jax
import numpy as np

import gmwm_jax as gj
from gmwm_jax.variance.replicates import variance_draws

MEDIUM, LARGE = 20_000, 200_000
"""Samples of a record: 13 and 16 scales."""

RATE = 100.0
"""Of the records below, in Hz."""

TRUTH = gj.parse_model("WN(sigma2=1.0) + GM(beta=0.03, variance=0.2)")
"""Both components show in `MEDIUM` samples."""

FAINT = gj.parse_model("WN(sigma2=1.0) + GM(beta=0.02, variance=0.1)")
"""Both show in `LARGE` ones."""

WANDERING = "WN(sigma2=1.0) + GM(beta=0.02, variance=0.5) + RW(gamma2=1e-5)"


def white(num_samples, seed=0):
    """White noise of variance 1."""
    return np.random.default_rng(seed).standard_normal(num_samples)


# -- wavelet variances ------------------------------------------------------------------------------------------------


@cache
def simulated():
    """The wavelet variance of `MEDIUM` samples of `TRUTH`."""
    return gj.wavelet_variance(np.asarray(gj.simulate(TRUTH, MEDIUM, key=jax.random.key(5))), rate=RATE)


@cache
def fitted():
    """`simulated` by the model that it is of, with two-step weights."""
    return gj.fit(simulated(), "WN + GM", weights="two-step")


@cache
def blank(num_samples):
    """A wavelet variance of so many samples, for `with_variance` and `as_channels`, which change its values."""
    return gj.wavelet_variance(white(num_samples), rate=RATE)


def with_variance(wv, variance):
    """A wavelet variance of other values (J,), with the relative intervals of `wv`."""
    low, high = wv.ci_low / wv.variance, wv.ci_high / wv.variance
    return replace(wv, variance=variance, ci_low=variance * low, ci_high=variance * high)


def as_channels(wv, variances):
    """Wavelet variances (B, J) as channels "0", "1", .., with the relative intervals of `wv`."""
    low, high = wv.ci_low / wv.variance, wv.ci_high / wv.variance
    names = tuple(str(i) for i in range(len(variances)))
    columns = (variances.T, (variances * low).T, (variances * high).T)
    return gj.variance.WaveletVariances(
        wv.scales, *columns, wv.num_samples, wv.level, wv.rate, names, ("1",) * len(variances)
    )


def draws(truth, num_samples, num, seed):
    """Wavelet variances (num, J) of records of a truth, drawn from their theory."""
    scales = blank(num_samples).scales
    covariance = np.asarray(gj.variance.wv_covariance(truth, num_samples, len(scales)))
    draw = variance_draws(np.asarray(truth.wavelet_variance(scales)), covariance)
    return draw(jax.random.split(jax.random.key(seed), num))


def drawn_channels(truth, num_samples, num, seed):
    """The same as channels."""
    return as_channels(blank(num_samples), draws(truth, num_samples, num, seed))


NUM_RECORDS = 4
"""In a set of records of `MEDIUM` samples."""


def sets_of_records(num_sets, seed, spread=0.0):
    """Sets of records of `TRUTH`, by the theory of their wavelet variance.

    The correlation times of a set scatter by `spread` in the log.
    """
    wv = blank(MEDIUM)
    rows = draws(TRUTH, MEDIUM, NUM_RECORDS * num_sets, seed)
    relative = rows / np.asarray(TRUTH.wavelet_variance(wv.scales))
    rng = np.random.default_rng(seed)
    wvs = []
    for row in relative:
        model = gj.WN(1.0) + gj.GM(beta=0.03 * np.exp(spread * rng.normal()), variance=0.2)
        wvs.append(with_variance(wv, np.asarray(model.wavelet_variance(wv.scales)) * row))
    return [wvs[NUM_RECORDS * i : NUM_RECORDS * (i + 1)] for i in range(num_sets)]


# -- records with outliers --------------------------------------------------------------------------------------------


def recording(x, **options):
    """Samples without unit at 10 Hz."""
    return gj.Recording.from_array(x, **{"rate": 10.0, "units": "1", **options})


def with_bursts(x, length, seed=0, size=10.0):
    """1 % of the samples moved by +-size, in bursts of a length that share the sign; and which they are."""
    rng = np.random.default_rng(seed)
    first = length * rng.choice(len(x) // length, len(x) // 100 // length, replace=False)
    moved = (first[:, None] + np.arange(length)).ravel()
    y, outlying = x.copy(), np.zeros(len(x), dtype=bool)
    y[moved] += np.repeat(size * rng.choice([-1, 1], len(first)), length)
    outlying[moved] = True
    return y, outlying


def masked(x, **options):
    """Which samples are taken for outliers."""
    return np.isnan(gj.recordings.mask_outliers(recording(x), **options).recording.data[:, 0])
