"""Does a model describe the data? A chi-square test over all scales, and the pull of each scale.

A fit prints the statistic and the largest pull (`Fit.chi_square`); here are the pulls of all scales. With the inverse
covariance as weights the statistic is the objective itself (Sargan's and Hansen's J); for other weights see
`gmwm_jax._internal.chi_square`. Wavelet variances at the longest spans are far from normal: with few degrees of freedom
at many scales, prefer the p-value of a `bootstrap`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.fitting.result import Fit


@saved(not_finite=("p_value", "pulls"))
@dataclass(frozen=True, repr=False)
class GoodnessOfFit(Saved):
    """The result of `goodness_of_fit`: the test, and where the model fails.

    Attributes
    ----------
    fit
        What was tested.
    statistic, dof, p_value
        Of the chi-square test of the model, with the amplitudes that weights of its own give it, see
        `gmwm_jax.fitting.misfit`; p is NaN where no degree of freedom is left.
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
        of = "" if self.fit.weighs_covariances else "\nchi-square and p: with amplitudes by weights of the model itself"
        return (
            f"Goodness of fit of {model} to {wv.channels[0]}: chi-square {self.statistic:.4g} "
            f"with {self.dof} degrees of freedom, p = {self.p_value:.3g}\n{format_table(head, rows, left=0)}\n"
            "pull: residual in its standard deviations (! beyond 2, !! beyond 3, !!! beyond 4)" + of
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
    if fit.chi_square is None:
        raise ValueError("A test of fit needs the number of samples, the scales 2 .. 2^J, the MODWT, and no SIN.")
    return GoodnessOfFit(fit, *fit.chi_square)
