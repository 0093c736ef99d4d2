"""What the noise model of an inertial sensor does to navigation: strapdown INS/GNSS/baro Monte Carlo in JAX.

Conventions
-----------
Frames: n = local north, east, down; b = body front, right, down. C_nb and q_nb take b to n; quaternions are Hamilton's,
scalar first, of unit length. Gyros measure the body rate in rad/s, accelerometers the specific force in m/s^2 (at rest,
minus gravity). The Earth is flat and does not turn unless another one is given: `Wgs84`, or a class of one's own
(`nav_jax.kinematics.AbstractEarth`).

Errors are estimate minus truth; the attitude error is the rotation vector of C_est C_true' in n. NEES is e' P^-1 e, its
expectation the number of states; coverage is the share of runs in which it is below the chi-square quantile.

Time is axis 0 of a record, components are the last axis, runs the outermost axis of a result. Inside the filter
components come first and runs last. IMU sample k lasts from t_k to t_{k+1}: N samples span N + 1 epochs. Noise models
are those of `gmwm_jax`, with parameters per sample at a stated rate. Everything is SI in 64-bit floats; the package
never changes JAX's configuration: turn them on first, ``jax.config.update("jax_enable_x64", True)``.

Pure functions
--------------
`compare`, `analyse` and the like prepare a scenario and judge what comes out: they are no functions of arrays alone.
These are, once ``filter.prepare`` has made the schedule; jit, vmap and differentiate them by what is named.

| function | of |
|---|---|
| `filter.draw_inputs` | true errors, aiding noise, initial covariance; map it over keys |
| `filter.gains_of` | believed errors, aiding noise, initial covariance |
| `filter.run_filter` | believed errors, inputs |
| `lincov.linear_covariance` | true and believed errors, aiding noise, initial covariance |
| `recorded.innovation_loss` | believed errors, aiding noise |

Examples in docstrings suppose ``import gmwm_jax as gj``, ``import nav_jax as nj``, ``import numpy as np``,
``import jax`` and ``import jax.numpy as jnp``.

References
----------
Cucci, D. A., Voirol, L., Khaghani, M. & Guerrier, S. (2023). On performance evaluation of inertial navigation systems:
the case of stochastic calibration. IEEE Trans. Instrum. Meas. 72.
Groves, P. D. (2013). Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.
Sola, J. (2017). Quaternion kinematics for the error-state Kalman filter. arXiv:1711.02508.
Bar-Shalom, Y., Li, X. R. & Kirubarajan, T. (2001). Estimation with Applications to Tracking and Navigation, ch. 5.
"""

from typing import TYPE_CHECKING as _TYPE_CHECKING

if _TYPE_CHECKING:
    from gmwm_jax._internal.saved import load as load
    from gmwm_jax._internal.xla_loops import fast_loops as fast_loops
    from nav_jax import aiding as aiding
    from nav_jax import campaign as campaign
    from nav_jax import filter as filter
    from nav_jax import imu as imu
    from nav_jax import kinematics as kinematics
    from nav_jax import lincov as lincov
    from nav_jax import plotting as plotting
    from nav_jax import recorded as recorded
    from nav_jax import simulation as simulation
    from nav_jax import statistics as statistics
    from nav_jax import trajectory as trajectory
    from nav_jax.aiding import Barometer as Barometer
    from nav_jax.aiding import Fixes as Fixes
    from nav_jax.aiding import Gnss as Gnss
    from nav_jax.aiding import GnssPosition as GnssPosition
    from nav_jax.aiding import GnssVelocity as GnssVelocity
    from nav_jax.aiding import Odometer as Odometer
    from nav_jax.campaign import Campaign as Campaign
    from nav_jax.filter import InitialUncertainty as InitialUncertainty
    from nav_jax.filter import Scenario as Scenario
    from nav_jax.imu import Imu as Imu
    from nav_jax.imu import ImuErrors as ImuErrors
    from nav_jax.imu import ImuSpecification as ImuSpecification
    from nav_jax.imu import RecordedErrors as RecordedErrors
    from nav_jax.imu import devices as devices
    from nav_jax.imu import perfect_imu as perfect_imu
    from nav_jax.kinematics import FlatEarth as FlatEarth
    from nav_jax.kinematics import Wgs84 as Wgs84
    from nav_jax.lincov import analyse as analyse
    from nav_jax.lincov import calibration_effect as calibration_effect
    from nav_jax.lincov import design as design
    from nav_jax.lincov import error_budget as error_budget
    from nav_jax.lincov import sensitivities as sensitivities
    from nav_jax.recorded import navigate as navigate
    from nav_jax.recorded import read_fixes as read_fixes
    from nav_jax.recorded import read_gnss as read_gnss
    from nav_jax.recorded import read_imu as read_imu
    from nav_jax.recorded import tune as tune
    from nav_jax.simulation import Precision as Precision
    from nav_jax.simulation import compare as compare
    from nav_jax.simulation import monte_carlo as monte_carlo
    from nav_jax.trajectory import Trajectory as Trajectory
    from nav_jax.trajectory import motions as motions
    from nav_jax.trajectory import read_trajectory as read_trajectory
else:
    from gmwm_jax._internal.lazy import lazily as _lazily

    __getattr__, __dir__, __all__ = _lazily(__name__)

__version__ = "0.1.0"
