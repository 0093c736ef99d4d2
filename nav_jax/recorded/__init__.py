"""Recorded drives: read, navigated, and their noise parameters tuned.

Recorded sensors, without a reference:

```python
reference = nj.motions.lemniscate(duration=60.0, rate=100.0)
errors = nj.ImuErrors("WN(sigma2=6e-5)", "WN(sigma2=1.5e-6)", rate=100.0)
samples, truth = nj.perfect_imu(reference)  # stands for a recorded IMU, whose arrays go into nj.Imu(time, gyro, accel, rate)
seconds = slice(100, None, 100)
fixes = nj.Fixes(nj.GnssPosition(horizontal=0.025, vertical=0.05), truth.time[seconds], truth.position[seconds])
solution = nj.navigate(
    samples,
    [fixes],
    errors,
    position=truth.position[0],
    velocity=truth.velocity[0],
    quaternion=truth.quaternion[0],
    initial=nj.InitialUncertainty(position_sd=0.1, velocity_sd=0.1, attitude_sd=0.01),
)
print(solution)
```

`tune`, with the arguments of `navigate`, finds the noise parameters that make the innovations of a recorded drive most
likely, with standard errors, and marks what the drive does not show. ``smooth=True`` in `navigate` gives the fixed-interval
smoother.
"""  # noqa: E501

from nav_jax.recorded.alignment import align_by_course as align_by_course
from nav_jax.recorded.alignment import between as between
from nav_jax.recorded.alignment import mounted as mounted
from nav_jax.recorded.clocks import clock_offsets as clock_offsets
from nav_jax.recorded.files import read_fixes as read_fixes
from nav_jax.recorded.files import read_imu as read_imu
from nav_jax.recorded.files import read_samples as read_samples
from nav_jax.recorded.gnss.reading import read_gnss as read_gnss
from nav_jax.recorded.gnss.record import GnssRecord as GnssRecord
from nav_jax.recorded.inspection import Inspection as Inspection
from nav_jax.recorded.inspection import inspect_record as inspect_record
from nav_jax.recorded.likelihood import innovation_loss as innovation_loss
from nav_jax.recorded.navigation import Navigation as Navigation
from nav_jax.recorded.navigation import navigate as navigate
from nav_jax.recorded.tuning import Tuning as Tuning
from nav_jax.recorded.tuning import tune as tune
