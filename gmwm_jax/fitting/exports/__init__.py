"""Noise models as the parameter files of filters, one format a file, all of them rows of `registry`.

| format | what it is | numbers, two-sided densities | what becomes of the model |
|---|---|---|---|
| ``kalibr`` | ``imu.yaml`` | N u/sqrt(Hz), K u/s/sqrt(Hz), one for all axes | white noise and a random walk |
| ``openvins`` | ``kalibr_imu_chain.yaml`` | the same | the same |
| ``vins`` | lines of a VINS-Mono or VINS-Fusion configuration | sqrt(2) N/sqrt(step), K/sqrt(step), one for all axes | the same |
| ``kf-gins`` | ``imunoise`` of ``kf-gins.yaml`` | deg/sqrt(h), m/s/sqrt(h), deg/h, mGal, h, three axes | white noise and Gauss-Markov processes of one correlation time |
| ``pyins`` | arguments of ``InertialSensorModel``, Python | N, K in SI, three axes | white noise and a random walk |
| ``gtsam`` | covariances of ``PreintegrationCombinedParams``, Python | N^2, K^2 in SI, three axes | the same |
| ``px4`` | parameters of EKF2, as QGroundControl loads them | N/sqrt(step), K/sqrt(step), one for all axes | the same |
| ``ros`` | covariances of ``sensor_msgs/Imu`` | N^2/step, three axes | white noise only |
| ``nav-jax`` | what ``nav-jax`` reads as ``fit = "fit.json"`` | parameters per sample | everything as it is |

N and K are those of `gmwm_jax.fitting.bias`. Every text but the last, which is JSON, says in comments: rate, step, units,
which components are in which number, which approximation was made and what was left out.

A new format is one file with a function from `ImuNoise` to text, one row in ``registry.py`` and one in its tests.
"""  # noqa: E501
