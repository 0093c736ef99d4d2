"""Intervals at their nominal level: with the degrees of freedom that the noise gives a variance, not those of fits.

The intervals of a wavelet variance, ``ci_low`` and ``ci_high``, are those of R's package: with eta = max(M/2^j, 1) they
hold the truth in 98 to 100 % where 95 % is said, whatever the noise. Fits take their weights from them, so that they
stay. A band is chi-square with eta = 2 nu^2/Var(nu), the variance by the exact covariance under a model, or without one
by the power law that each scale has with its neighbours, see `gmwm_jax.variance.power_law`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.checks import confidence
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax.variance.haar import interval_factors

LOCAL = "local power law"
"""Where degrees of freedom are from without a model."""

WEIGHTS = "weights of fits"
"""Where the noise is not known: the intervals that fits take their weights from."""


@saved(not_finite=("low", "high", "dof"))
@dataclass(frozen=True)
class Bands(Saved):
    """Intervals of variances at their nominal level.

    Attributes
    ----------
    low, high
        In the units of the variance, or of the deviation.
    dof
        Degrees of freedom; NaN where they are not known.
    level
        Confidence.
    basis
        Under which noise: a model, or `LOCAL`; or `WEIGHTS`.
    """

    low: Float[np.ndarray, "J *C"]
    high: Float[np.ndarray, "J *C"]
    dof: Float[np.ndarray, "J *C"]
    level: float
    basis: str

    @classmethod
    def of(
        cls, variance: Float[np.ndarray, "J *C"], dof: Float[np.ndarray, "J *C"], level: float, basis: str
    ) -> "Bands":
        """Return the chi-square intervals of variances with these degrees of freedom."""
        low, high = interval_factors(dof, confidence(level))
        return cls(variance * low, variance * high, dof, level, basis)

    @property
    def nominal(self) -> bool:
        """Whether they hold the truth as often as they say."""
        return self.basis != WEIGHTS

    @property
    def remark(self) -> str:
        """What they are, as a line below a table."""
        if not self.nominal:
            return "\nintervals of the weights of fits, wider than their level says: the noise is not known"
        under = "the " * (self.basis == LOCAL) + self.basis
        return f"\nintervals at their nominal level, dof of {under}; fits take weights from wider ones"

    @property
    def of_deviation(self) -> "Bands":
        """The same of the roots of the variances twice: of Allan deviations, if they are of wavelet variances."""
        return Bands(np.sqrt(2 * self.low), np.sqrt(2 * self.high), self.dof, self.level, self.basis)
