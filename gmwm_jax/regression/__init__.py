"""Known effects (a trend, a season, a step) estimated together with the dependent noise around them."""

from gmwm_jax.regression.regression import Coefficient as Coefficient
from gmwm_jax.regression.regression import Coefficients as Coefficients
from gmwm_jax.regression.regression import Regression as Regression
from gmwm_jax.regression.regression import regress as regress
from gmwm_jax.regression.regressors import Regressor as Regressor
from gmwm_jax.regression.regressors import polynomial as polynomial
from gmwm_jax.regression.regressors import seasonal as seasonal
from gmwm_jax.regression.regressors import step as step
from gmwm_jax.regression.regressors import trend as trend
