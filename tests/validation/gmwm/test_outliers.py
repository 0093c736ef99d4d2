"""Outliers by comparison of scales: how often a clean record is marked."""

import numpy as np

import gmwm_jax as gj


def white(num, seed=0):
    return np.random.default_rng(seed).standard_normal(num)


def test_a_clean_record_is_seldom_marked(judge):
    """300 records, each with both tests at 5 %: at most 5 % + 4 standard errors of 1.26 % are marked."""
    seen = [gj.variance.compare_robust(white(4096, seed)) for seed in range(300)]
    scales, runs = np.mean([np.any(c.significant) for c in seen]), np.mean([bool(c.runs) for c in seen])
    judge("share of clean records marked, by scales and by runs", [scales, runs], 0, 0.10, num_draws=300)
    # intervals of the kind eta 3 are wider than white noise needs, most of all at long spans
    z = np.array([c.z for c in seen])
    assert 0.7 < np.std(z[:, 0]) < 1.1
    assert np.all(np.std(z, axis=0) < 1.2)
