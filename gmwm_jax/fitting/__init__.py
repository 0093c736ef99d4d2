"""The estimator: from a wavelet variance and a model to a `Fit`, by the Generalized Method of Wavelet Moments.

The search, the weights, the standard errors and the tables of parameters; slopes of the Allan deviation beside it.
"""

from gmwm_jax._internal.channels import Channels as Channels
from gmwm_jax.fitting import weights as weights
from gmwm_jax.fitting.estimator import fit as fit
from gmwm_jax.fitting.estimator import objective as objective
from gmwm_jax.fitting.outcome import Outcome as Outcome
from gmwm_jax.fitting.result import Fit as Fit
from gmwm_jax.fitting.result import Status as Status
from gmwm_jax.fitting.slopes import SlopeRegression as SlopeRegression
from gmwm_jax.fitting.slopes import read_off as read_off
from gmwm_jax.fitting.slopes import slope_regression as slope_regression
from gmwm_jax.fitting.tables import Estimate as Estimate
from gmwm_jax.fitting.tables import EstimateTable as EstimateTable
from gmwm_jax.fitting.tables import continuous_table as continuous_table
