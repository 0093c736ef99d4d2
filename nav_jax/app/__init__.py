"""Configuration files, the command line ``nav-jax``, reports and the demonstration.

Filters are compared from a file, here `comparison.toml`:

```toml
[trajectory]
motion = "lemniscate" # or file = "flight.csv", smooth = "0.5 s"
duration = "5 min"

[truth]
sensor = "mti-g" # or fit = "fit.json", recording = "static.npz", or accel, gyro and rate as below
# gravity = { deflection = "6 arcsec", anomaly = "30 mGal", distance = "30 km" }, where it is not the Earth's alone
# calibration = { scale_factor = { gyro_sd = "300 ppm" } }, or misalignment, g_sensitivity, temperature_bias

[filters]
right = "truth"

[filters."WN only"]
accel = "WN(sigma2=1.2e-4)"
gyro = "WN(sigma2=4.9e-5)"
rate = "100 Hz"

[[aiding]]
type = "gnss_position" # gnss_velocity, barometer, odometer
horizontal = "2.5 cm"
vertical = "5 cm"
outages = [[260, 300]]

[run]
num_runs = 200
gains = "estimate" # a covariance a run; "reference": one for all, several times faster; "two-level": means, by few
earth = "wgs84" # the ellipsoid that turns, in place of a flat Earth of some gravity = "9.81 m/s^2"
origin = ["46.5 deg", "6.6 deg", "500 m"] # unless the file of the trajectory has geodetic positions
# temperature_rise = "20 K", of a sensor that warms up in a temperature_time = "5 min", for biases by temperature
```

```sh
nav-jax compare comparison.toml --num-runs 500 --out results --save results/runs.zarr
nav-jax run comparison.toml --filter right --json -
```

A night's work goes into a store, and is continued from there after a crash, or with more runs:

```sh
nav-jax campaign comparison.toml --store study.zarr --num-runs 5000 --workers 4 # or --scheduler tcp://... of Dask
```

A number is SI, a text has its unit. Unknown keys and units of another quantity are errors. `fit` reads what
`gmwm-jax fit --json` wrote; files are looked for beside the configuration. Ctrl-C writes what is done.

The same file serves analyses without random numbers: what makes the error of a filter and which parameter matters, and
the filters with few states that navigate best (written as a section that `compare` reads, if asked confirmed by a Monte
Carlo):

```sh
nav-jax budget comparison.toml --filter "WN only" --out results
nav-jax design comparison.toml --max-accel 1 --max-gyro 1 --confirm 1000 --out results
```

`nav-jax align drive.toml` finds roll, pitch and heading with their standard deviations, by a section [align] with
``motion = "at rest"`` or ``"moving"``; all commands for drives begin there if [initial] has ``align = true``. `nav-jax
inspect drive.toml` says on one page what is in a record: rates, gaps, rest, gravity, tilt, the course at the start, by
how much clocks are apart, and how the IMU is mounted. A recorded drive is navigated by `nav-jax navigate drive.toml
--out results --save drive.npz --export track.kml` (all of it for `nav_jax.load`; the track as .kml, .gpx, .csv or
.npz), and the noise parameters that make its innovations most likely are sought by `nav-jax tune drive.toml --out
results`. Whether the noise of the sensors at rest holds in motion says `nav-jax vibration drive.toml`, with the lines
for [run] where it does not. How far off it is after 15 s without fixes, simulated every minute, says `nav-jax outages
drive.toml --last 15 --every 60`:

```toml
[record]
imu = "imu.csv" # columns time, gyro_x .. gyro_z, accel_x .. accel_z; or columns = { gyro_x = "wx", ... }
units = { gyro = "deg/s", accel = "g" }
rate = "100 Hz"
samples = "averages" # or instants; corrected for coning and sculling
stamps = "end" # of each sample
mounting = [0, "-6.7 deg", "5 deg"] # roll, pitch, yaw of the IMU in the vehicle; "find": by turns and braking of a car
time_offset = "0.3 s" # by which the clock of the IMU is ahead of that of the fixes
# without velocity and attitude, the drive starts when its course tells where the vehicle heads

[filters.static] # what the filter believes, and where the search starts
fit = "fit.json"

[[aiding]]
type = "gnss_position"
file = "drive.pos" # RTKLIB, NMEA, GPX, or format = "kf-gins"; or a table with the names of its columns
exclude = ["single"] # qualities that are not used
outages = [[160000, 160030]] # these fixes are kept from the filter, and compared with it
# horizontal = "1 m" and vertical = "2 m" in place of the file's standard deviations, or sd_factor = 2

[[aiding]]
type = "gnss_velocity"
file = "drive.pos"

[[aiding]]
type = "non_holonomic" # of wheels, by the samples of the IMU; and zero_velocity, zero_rate where it stands
rate = "10 Hz"
right = "3 cm/s" # and down, more in turns (slip = 0.5) and over bumps (bumps = 1.0)
down = "5 cm/s"

[initial]
position_sd = "0.1 m"
velocity_sd = "0.1 m/s"
attitude_sd = ["2 deg", "2 deg", "5 deg"]

[reference] # if there is one
file = "reference.csv"

[run]
earth = "wgs84" # about the first fix, or [record] origin = ["46.5 deg", "6.6 deg", "500 m"]
```
"""
