"""The same without random numbers: covariances, error budget, derivatives, effect of a calibration, design.

The covariance of the errors of a filter that believes another model than the truth, and the one that it claims, follow from
linear algebra (linear covariance analysis), in a tenth of a second instead of some 500 runs. From them come the error
budget and the derivative of the error by every parameter.

```python
accel = "WN(sigma2=6e-5) + GM(beta=1.8e-3, variance=5e-8) + GM(beta=9e-5, variance=1.4e-7)"
gyro = "WN(sigma2=1.5e-6) + GM(beta=3e-3, variance=4e-9) + GM(beta=1e-4, variance=6e-9)"
imu = nj.ImuErrors(accel, gyro, rate=100.0)
white = nj.ImuErrors("WN(sigma2=6e-5)", "WN(sigma2=1.5e-6)", rate=100.0)
aid = [nj.GnssPosition(horizontal=0.025, vertical=0.05, outages=[(40.0, 60.0)]), nj.Barometer(height=0.5)]
scenario = nj.Scenario(nj.motions.lemniscate(duration=60.0, rate=100.0), aid, every=10)
analysis = nj.analyse(scenario, truth=imu, filters={"right": imu, "WN only": white})
print(analysis)  # true and claimed errors, expected NEES, coverage
analysis.plot().savefig("analysis.png")
print(nj.error_budget(scenario, imu, white))  # which source makes which part of the error; exact, it adds up
print(nj.sensitivities(scenario, imu, white))  # d RMS / d log parameter, of the truth and of the filter
```

The smallest filter that navigates as well as the full one is not a part of the truth, but what serves best along your
trajectories: ``nj.design(scenario, truth, max_accel=2, max_gyro=2)`` finds it by gradients for every number of states
(Gauss-Markov processes, and random walks where the truth has them), as a table of states against error, and
``.confirm(num_runs=1000, key=key)`` checks it by a Monte Carlo. ``nj.calibration_effect(scenario, accel_fit, gyro_fit,
key=key)`` carries the uncertainty of fits into an interval of the navigation error, and says whether a longer static
recording would help.

`linear_covariance` is the pure function behind it, differentiable in every parameter of truth, filter, aiding and start:

```python
course = nj.filter.prepare(nj.Scenario(scenario.reference, [nj.Barometer(height=0.5)], every=10), rate=100.0)


def height(log_sigma2):  # logarithm of the true mean square of the height at the end
    believed = nj.ImuErrors(gj.WN(jnp.exp(log_sigma2)), gj.WN(1.5e-6), rate=100.0)
    return jnp.log(nj.lincov.linear_covariance(course, imu, believed).true.navigation[-1, 2, 2])


slope = jax.grad(height)(jnp.log(6e-5))
# 64 filters in one call, stacked as jax.vmap builds them
stacked = jax.vmap(lambda s: nj.ImuErrors(gj.WN(s), gj.WN(1.5e-6), rate=100.0))(jnp.geomspace(1e-5, 1e-3, 64))
heights = nj.lincov.linear_covariance(course, imu, stacked).true.navigation[:, -1, 2, 2]
```
"""  # noqa: E501

from nav_jax.filter.joint_covariance import Lincov as Lincov
from nav_jax.filter.joint_covariance import linear_covariance as linear_covariance
from nav_jax.filter.joint_covariance import motion_of as motion_of
from nav_jax.lincov.analysis import Analysis as Analysis
from nav_jax.lincov.analysis import Covariances as Covariances
from nav_jax.lincov.analysis import analyse as analyse
from nav_jax.lincov.budget import Budget as Budget
from nav_jax.lincov.budget import error_budget as error_budget
from nav_jax.lincov.calibration import CalibrationEffect as CalibrationEffect
from nav_jax.lincov.calibration import calibration_effect as calibration_effect
from nav_jax.lincov.derivatives import Sensitivities as Sensitivities
from nav_jax.lincov.derivatives import sensitivities as sensitivities
from nav_jax.lincov.filter_design import Candidate as Candidate
from nav_jax.lincov.filter_design import Design as Design
from nav_jax.lincov.filter_design import design as design
