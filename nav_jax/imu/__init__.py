"""Inertial sensors: perfect ones, the models of their errors (the door to gmwm_jax), and how both are emulated.

Noise, turn-on biases, and what a calibration has left of scale factors and misalignments are emulated, and believed by
filters, from one object:

```python
errors = nj.ImuErrors(
    accel={"x": "WN(sigma2=6e-5)", "y": "WN(sigma2=6e-5)", "z": "WN(sigma2=9e-5) + RW(gamma2=1e-11)"},  # or one for all
    gyro="WN(sigma2=1.5e-6) + GM(beta=3e-3, variance=4e-9)",
    rate=100.0,
    gyro_bias_sd=1e-4,
    deterministic=[nj.imu.ScaleFactor(accel_sd=300e-6, gyro_sd=300e-6), nj.imu.Misalignment(gyro_sd=1e-4)],
)
print(errors)
```

A sensor as its datasheet has it is an `ImuSpecification`, of which `devices` are many; what is emulated of it and what
a filter believes are both such errors:

```python
print(nj.devices)
sheet = nj.devices["ADIS16405"]
truth, believed = sheet.truth(100.0, effects=["range", "LSB"]), sheet.filter(100.0)
print(sheet.open)
```
"""

from nav_jax.imu.datasheets import devices as devices
from nav_jax.imu.deterministic import DETERMINISTIC as DETERMINISTIC
from nav_jax.imu.deterministic import GSensitivity as GSensitivity
from nav_jax.imu.deterministic import Misalignment as Misalignment
from nav_jax.imu.deterministic import ScaleFactor as ScaleFactor
from nav_jax.imu.deterministic import TemperatureBias as TemperatureBias
from nav_jax.imu.errors import ImuErrors as ImuErrors
from nav_jax.imu.gravity import GravityDisturbance as GravityDisturbance
from nav_jax.imu.imu import Imu as Imu
from nav_jax.imu.imu import NoisyReferenceWarning as NoisyReferenceWarning
from nav_jax.imu.imu import perfect_imu as perfect_imu
from nav_jax.imu.output import Output as Output
from nav_jax.imu.output import SaturationWarning as SaturationWarning
from nav_jax.imu.recorded import RecordedErrors as RecordedErrors
from nav_jax.imu.samples import imu_of_samples as imu_of_samples
from nav_jax.imu.specification import ImuSpecification as ImuSpecification
from nav_jax.imu.vibration import VibrationNoise as VibrationNoise
