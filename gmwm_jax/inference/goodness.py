"""Does a model describe the data? A chi-square test over all scales, and the pull of each scale.

Residuals at the estimate are r = M (nu_hat - nu) to first order, M = 1 - A B with A = d nu/d eta and B the estimator's
derivative (`Fit.derivatives`), so their covariance is M V M', of rank J less the number of parameters. Hence the
statistic r' (M V M')^+ r, asymptotically chi-square for whatever weights (Hansen 1982; with the inverse covariance as
weights it is the objective itself, Sargan's and Hansen's J). Wavelet variances at the longest spans are far from
normal: with few degrees of freedom at many scales, prefer the p-value of a `bootstrap`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import chdtrc

from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.fitting.result import Fit

_RANK = 1e-9
"""Of the largest eigenvalue of the correlation of the residuals: below it there is no residual."""


@saved(not_finite=("p_value", "pulls"))
@dataclass(frozen=True, repr=False)
class GoodnessOfFit(Saved):
    """The result of `goodness_of_fit`: the test, and where the model fails.

    Attributes
    ----------
    fit
        What was tested.
    statistic, dof, p_value
        Of the chi-square test; p is NaN where no degree of freedom is left.
    pulls
        Residual of each scale in standard deviations, shape (J,); NaN at a scale that is fitted exactly.
    """

    fit: Fit
    statistic: float
    dof: int
    p_value: float
    pulls: Float[np.ndarray, " J"]

    def __repr__(self) -> str:
        """The test and a row a scale."""
        wv = self.fit.wv
        rows = [
            [number(t), number(v), number(f), f"{p:+.1f}", "!" * int(min(3, max(0.0, abs(p) - 1)))]
            for t, v, f, p in zip(wv.times, wv.variance, self.fit.fitted, self.pulls, strict=True)
        ]
        head = ["span [s]" if wv.rate else "span [samples]", "data", "model", "pull", ""]
        model = " + ".join(self.fit.model.labels)
        return (
            f"Goodness of fit of {model} to {wv.channels[0]}: chi-square {self.statistic:.4g} "
            f"with {self.dof} degrees of freedom, p = {self.p_value:.3g}\n{format_table(head, rows, left=0)}\n"
            "pull: residual in its standard deviations (! beyond 2, !! beyond 3, !!! beyond 4)"
        )


def goodness_of_fit(fit: Fit) -> GoodnessOfFit:
    """Test whether a fitted model describes its data.

    Parameters
    ----------
    fit
        Of a wavelet variance whose theory is known.

    Raises
    ------
    ValueError
        There is no theory of this wavelet variance.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> fit = gj.fit(wv, "WN + RW")
    >>> 0 <= gj.goodness_of_fit(fit).p_value <= 1
    True
    """
    V = fit.wv_covariance
    if V is None:
        raise ValueError("A test of fit needs the number of samples, the scales 2 .. 2^J, the MODWT, and no SIN.")
    A, B = fit.derivatives
    M = np.eye(fit.wv.num_scales) - A @ B
    statistic, dof, p_value, pulls = chi_square(fit.residuals, M, V)
    return GoodnessOfFit(fit, statistic, dof, p_value, pulls)


def chi_square(
    residuals: Float[np.ndarray, " J"], M: Float[np.ndarray, "J J"], V: Float[np.ndarray, "J J"]
) -> tuple[float, int, float, Float[np.ndarray, " J"]]:
    """Test whether residuals r = M e are those of errors e of the covariance V.

    Returns
    -------
    statistic, dof, p_value, pulls
        As of `GoodnessOfFit`.
    """
    sd = np.sqrt(np.diag(V))
    # as a correlation, so that scales of all sizes count
    scaled = M * sd[None, :] / sd[:, None]
    covariance = scaled @ (V / np.outer(sd, sd)) @ scaled.T
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    seen = values > _RANK * values[-1]
    projected = vectors.T @ (residuals / sd)
    statistic, dof = float(np.sum(projected[seen] ** 2 / values[seen])), int(seen.sum())
    own = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        pulls = np.where(own > np.sqrt(_RANK), residuals / sd / own, np.nan)
    return statistic, dof, float(chdtrc(dof, statistic)) if dof else np.nan, pulls
