"""How often a right model is said to miss its data: the share of false warnings, with the weights that users take."""

import numpy as np
import pytest
from programs import drawn_channels

import gmwm_jax as gj

NUM = 400
CASES = {
    "WN(sigma2=1.0)": ("WN", 1000),
    "RW(gamma2=1.0)": ("RW", 2000),
    "WN(sigma2=1.0) + GM(beta=0.03, variance=0.2)": ("WN + GM", 20_000),
    # the second component shows at the longest spans only, and is often zero or nearly so
    "WN(sigma2=1.0) + RW(gamma2=1e-6)": ("WN + RW", 20_000),
    "WN(sigma2=1.0) + RW(gamma2=1e-8)": ("WN + RW", 200_000),
    "WN(sigma2=1.0) + GM(beta=0.0005, variance=0.02)": ("WN + GM", 50_000),
    "AR1(phi=0.3, sigma2=1.0)": ("AR1 + WN", 20_000),
}


@pytest.mark.parametrize("weights", ["default", "two-step"])
@pytest.mark.parametrize("truth", CASES)
def test_right_models_are_seldom_warned_of(truth, weights, judge):
    """Below 1 % in every case; a chi-square test with p below 1e-6 would warn of up to 11 %."""
    model, num_samples = CASES[truth]
    drawn = drawn_channels(gj.parse_model(truth), num_samples, NUM, 17)
    fits = list(gj.fit(drawn, model, weights=weights, throw=False).values())
    judge(f"{truth}, {weights}: share warned of", np.mean([bool(f.misfit) for f in fits]), 0, 0.01, num_draws=NUM)
    # 5 %, three standard errors of 400 draws, and 1 % for skewness that p does not know
    low = np.mean([f.chi_square.p_value < 0.05 for f in fits])
    judge(f"{truth}, {weights}: share with p of fit < 5 %", low, 0.01, 0.093, num_draws=NUM)
