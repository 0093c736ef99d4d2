"""Offsets of clocks are as sure as they claim: rates, lengths and noise of all kinds, two ways to drive, 4 sigma."""

import numpy as np
import pytest
from nav.recorded.test_clocks import car, deviations
from scipy import stats

DRIVES = 120
WAYS = {
    "as cars are driven": {},
    "gently": {"speed": (8.0, 1.0), "turning": 0.03, "slope": 0.01, "vibration": 0.1},
}


def drives(way):
    """Fixes at 1, 2 or 5 Hz for 2 to 10 min; positions are good to 1 cm to 1 m, velocities to 3 to 30 cm/s."""
    rng = np.random.default_rng(100 + list(WAYS).index(way))
    for i in range(DRIVES):
        position, velocity = 10 ** rng.uniform([-2.0, -1.5], [0.0, -0.5])
        hz, duration = (1.0, 2.0, 5.0)[i % 3], (120.0, 300.0, 600.0)[i // 3 % 3]
        yield car(rng, duration=duration, hz=hz, position=position, velocity=velocity, **WAYS[way])


@pytest.mark.parametrize("way", WAYS)
def test_intervals_cover(way, judge):
    """What is not known of tyres, and the larger one of two errors, make them too wide if any: squares by 2 at most."""
    for (fixes, signal), z in deviations(drives(way), most=2.0).items():
        n, name = len(z), f"of offsets by {signal} of {fixes}, {way}"
        assert n > DRIVES / 4
        covered = np.mean(np.abs(z) < stats.norm.ppf(0.975))
        judge(f"coverage {name}, 95 %", covered, 0.95 - 4 * np.sqrt(0.95 * 0.05 / n), 1.0, num_draws=n)
        low, high = stats.chi2.ppf(stats.norm.cdf([-4, 4]), n) / n
        judge(f"mean square {name}, in squared standard errors", np.mean(np.square(z)), 0.5 * low, high, num_draws=n)
