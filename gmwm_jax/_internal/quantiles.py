"""Quantiles of the normal distribution for intervals."""

from scipy.special import ndtri


def normal_quantile(level: float) -> float:
    """Return z such that a normal variable lies within +-z with probability `level` (1.96 for 0.95)."""
    return float(ndtri((1 + level) / 2))
