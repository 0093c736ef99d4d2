"""The error-state Kalman filter: its layout, its one time loop, the smoother, and a prepared scenario."""

from nav_jax.filter.experiment import Experiment as Experiment
from nav_jax.filter.experiment import draw_inputs as draw_inputs
from nav_jax.filter.experiment import gains_of as gains_of
from nav_jax.filter.experiment import prepare as prepare
from nav_jax.filter.experiment import run_filter as run_filter
from nav_jax.filter.experiment import run_keys as run_keys
from nav_jax.filter.history import Estimates as Estimates
from nav_jax.filter.initial import InitialUncertainty as InitialUncertainty
from nav_jax.filter.scenario import Scenario as Scenario
from nav_jax.filter.status import Status as Status
