"""The same without random numbers: covariances, error budget, derivatives, effect of a calibration, design."""

from nav_jax.lincov.analysis import Analysis as Analysis
from nav_jax.lincov.analysis import Covariances as Covariances
from nav_jax.lincov.analysis import analyse as analyse
from nav_jax.lincov.budget import Budget as Budget
from nav_jax.lincov.budget import error_budget as error_budget
from nav_jax.lincov.calibration import CalibrationEffect as CalibrationEffect
from nav_jax.lincov.calibration import calibration_effect as calibration_effect
from nav_jax.lincov.covariance import Lincov as Lincov
from nav_jax.lincov.covariance import linear_covariance as linear_covariance
from nav_jax.lincov.covariance import motion_of as motion_of
from nav_jax.lincov.derivatives import Sensitivities as Sensitivities
from nav_jax.lincov.derivatives import sensitivities as sensitivities
from nav_jax.lincov.filter_design import Candidate as Candidate
from nav_jax.lincov.filter_design import Design as Design
from nav_jax.lincov.filter_design import design as design
