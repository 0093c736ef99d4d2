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
likely, with standard errors, and marks what the drive does not show. With ``tune_aiding=True, hold=["accel", "gyro"]`` it
finds by how much receivers are wrong about themselves, and `Tuning.applied` corrects the fixes. ``smooth=True`` in
`navigate` gives the fixed-interval smoother.

How good is it where there are no fixes? Outages are simulated all over the record, and their ends judged by the fixes that
were withheld. A car gains most by what its wheels do not do, by the moments at which it stands, and by noise that grows with
vibration:

```python
sides = nj.aiding.NonHolonomic(10.0, right=0.05, down=0.05, mount_sd=0.02, mount_noise="RW(gamma2=5e-8)")
wheels = nj.recorded.constrained(sides, samples)
schedules = [[(20.0, 30.0), (50.0, 58.0)], [(35.0, 45.0)]]  # a run each
study = nj.recorded.outage_study(
    samples,
    [fixes, wheels],
    errors,
    schedules,
    position=truth.position[0],
    velocity=truth.velocity[0],
    quaternion=truth.quaternion[0],
    initial=nj.InitialUncertainty(position_sd=0.1, velocity_sd=0.1, attitude_sd=0.01),
    vibration=nj.imu.VibrationNoise(accel=0.1, gyro=0.1),
    every=10,
)
print(study)
```

How an IMU sits in a car, `find_mounting` finds by turns and braking, with a covariance; `mounted` turns the samples. Where
nothing is known of the attitude, `align_at_rest` and `align_on_the_move` find it with its covariance.

Does the noise at rest hold in motion? `noise_in_motion` tests it by the likelihood of the innovations, axis by axis, and gives
the factors for ``vibration``, with intervals.

`stops` finds where the vehicle stands, `standing` makes the updates by zero velocity and zero rate for it, and `nj.Gnss` with
``averaged`` and ``time_offset_sd`` knows receivers whose velocities are old and whose clocks are off.
"""  # noqa: E501

from nav_jax.recorded.alignment import align_by_course as align_by_course
from nav_jax.recorded.alignment import between as between
from nav_jax.recorded.at_rest import StartAtRest as StartAtRest
from nav_jax.recorded.at_rest import align_at_rest as align_at_rest
from nav_jax.recorded.clocks import clock_offsets as clock_offsets
from nav_jax.recorded.constraints import constrained as constrained
from nav_jax.recorded.files import read_fixes as read_fixes
from nav_jax.recorded.files import read_imu as read_imu
from nav_jax.recorded.files import read_samples as read_samples
from nav_jax.recorded.gates import RefusedFixesWarning as RefusedFixesWarning
from nav_jax.recorded.gnss.reading import read_gnss as read_gnss
from nav_jax.recorded.gnss.record import GnssRecord as GnssRecord
from nav_jax.recorded.inspection import Inspection as Inspection
from nav_jax.recorded.inspection import inspect_record as inspect_record
from nav_jax.recorded.likelihood import innovation_loss as innovation_loss
from nav_jax.recorded.motion_noise import NoiseInMotion as NoiseInMotion
from nav_jax.recorded.motion_noise import noise_in_motion as noise_in_motion
from nav_jax.recorded.mounting import Mounting as Mounting
from nav_jax.recorded.mounting import find_mounting as find_mounting
from nav_jax.recorded.mounting import mounted as mounted
from nav_jax.recorded.navigation import Navigation as Navigation
from nav_jax.recorded.navigation import navigate as navigate
from nav_jax.recorded.on_the_move import StartOnTheMove as StartOnTheMove
from nav_jax.recorded.on_the_move import align_on_the_move as align_on_the_move
from nav_jax.recorded.plausibility import ImplausibleRecordWarning as ImplausibleRecordWarning
from nav_jax.recorded.standstill import standing as standing
from nav_jax.recorded.standstill import stops as stops
from nav_jax.recorded.study import OutageStudy as OutageStudy
from nav_jax.recorded.study import outage_study as outage_study
from nav_jax.recorded.tuning import Tuning as Tuning
from nav_jax.recorded.tuning import tune as tune
