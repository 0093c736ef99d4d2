"""What the noise model of an inertial sensor does to navigation: strapdown INS/GNSS/baro Monte Carlo in JAX.

Conventions
-----------
Frames: n = local north, east, down; b = body front, right, down. C_nb and q_nb take b to n; quaternions are Hamilton's,
scalar first, of unit length. Gyros measure the body rate in rad/s, accelerometers the specific force in m/s^2 (at rest,
minus gravity). The Earth is flat and does not turn.

Errors are estimate minus truth; the attitude error is the rotation vector of C_est C_true' in n. NEES is e' P^-1 e, its
expectation the number of states; coverage is the share of runs in which it is below the chi-square quantile.

Time is axis 0 of a record, components are the last axis, runs the outermost axis of a result. Inside the filter
components come first and runs last. IMU sample k lasts from t_k to t_{k+1}: N samples span N + 1 epochs. Noise models
are those of `gmwm_jax`, with parameters per sample at a stated rate. Everything is SI in 64-bit floats; the package
never changes JAX's configuration: turn them on first, ``jax.config.update("jax_enable_x64", True)``.

References
----------
Cucci, D. A., Voirol, L., Khaghani, M. & Guerrier, S. (2023). On performance evaluation of inertial navigation systems:
the case of stochastic calibration. IEEE Trans. Instrum. Meas. 72.
Groves, P. D. (2013). Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.
Sola, J. (2017). Quaternion kinematics for the error-state Kalman filter. arXiv:1711.02508.
Bar-Shalom, Y., Li, X. R. & Kirubarajan, T. (2001). Estimation with Applications to Tracking and Navigation, ch. 5.
"""

from nav_jax.aiding.barometer import Barometer as Barometer
from nav_jax.aiding.base import AbstractAiding as AbstractAiding
from nav_jax.aiding.gnss import GnssPosition as GnssPosition
from nav_jax.aiding.gnss import GnssVelocity as GnssVelocity
from nav_jax.filter.experiment import Experiment as Experiment
from nav_jax.filter.experiment import draw_inputs as draw_inputs
from nav_jax.filter.experiment import gains_of as gains_of
from nav_jax.filter.experiment import prepare as prepare
from nav_jax.filter.experiment import run_filter as run_filter
from nav_jax.filter.experiment import run_keys as run_keys
from nav_jax.filter.initial import InitialUncertainty as InitialUncertainty
from nav_jax.filter.status import Status as Status
from nav_jax.imu.errors import ImuErrors as ImuErrors
from nav_jax.imu.imu import Imu as Imu
from nav_jax.imu.imu import NoisyReferenceWarning as NoisyReferenceWarning
from nav_jax.imu.imu import perfect_imu as perfect_imu
from nav_jax.imu.recorded import RecordedErrors as RecordedErrors
from nav_jax.kinematics.earth import FlatEarth as FlatEarth
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
from nav_jax.lincov.filter_design import Scenario as Scenario
from nav_jax.lincov.filter_design import design as design
from nav_jax.recorded.files import read_fixes as read_fixes
from nav_jax.recorded.files import read_imu as read_imu
from nav_jax.recorded.likelihood import innovation_loss as innovation_loss
from nav_jax.aiding.fixes import Fixes as Fixes
from nav_jax.recorded.navigation import Navigation as Navigation
from nav_jax.recorded.navigation import navigate as navigate
from nav_jax.recorded.tuning import Tuning as Tuning
from nav_jax.recorded.tuning import tune as tune
from nav_jax.simulation.campaign import compare as compare
from nav_jax.simulation.campaign import monte_carlo as monte_carlo
from nav_jax.simulation.comparison import Comparison as Comparison
from nav_jax.simulation.ranking import Ranking as Ranking
from nav_jax.simulation.runs import Runs as Runs
from nav_jax.simulation.runs import Track as Track
from nav_jax.statistics.energy import energy_score as energy_score
from nav_jax.statistics.summaries import coverage as coverage
from nav_jax.statistics.summaries import mean_nees as mean_nees
from nav_jax.statistics.summaries import mean_norm as mean_norm
from nav_jax.statistics.summaries import paired as paired
from nav_jax.statistics.summaries import rms as rms
from nav_jax.trajectory.files import read_trajectory as read_trajectory
from nav_jax.trajectory.files import save_trajectory as save_trajectory
from nav_jax.trajectory.motions import circle as circle
from nav_jax.trajectory.motions import climb as climb
from nav_jax.trajectory.motions import from_path as from_path
from nav_jax.trajectory.motions import helix as helix
from nav_jax.trajectory.motions import lemniscate as lemniscate
from nav_jax.trajectory.motions import racetrack as racetrack
from nav_jax.trajectory.motions import static as static
from nav_jax.trajectory.motions import straight as straight
from nav_jax.trajectory.motions import waypoints as waypoints
from nav_jax.trajectory.trajectory import Trajectory as Trajectory
