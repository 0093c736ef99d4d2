"""Configuration files, the command line ``nav-jax``, reports and the demonstration.

Filters are compared from a file, here `comparison.toml`:

```toml
[trajectory]
motion = "lemniscate" # or file = "flight.csv", smooth = "0.5 s"
duration = "5 min"

[truth]
sensor = "mti-g" # or fit = "fit.json", recording = "static.npz", or accel, gyro and rate as below

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
```

```sh
nav-jax compare comparison.toml --num-runs 500 --out results --save results/runs.zarr
nav-jax run comparison.toml --filter right --json -
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

Noise parameters are tuned by recorded navigation data, `nav-jax tune record.toml --out results`:

```toml
[record]
imu = "imu.csv" # columns time, gyro_x .. gyro_z, accel_x .. accel_z; or columns = { gyro_x = "wx", ... }
units = { gyro = "deg/s", accel = "g" }
velocity = ["10 m/s", 0, 0] # at the start, north, east, down
attitude = [0, 0, "90 deg"] # roll, pitch, yaw
origin = ["45 deg", "7 deg", "100 m"] # where fixes are latitude, longitude, height

[filters.static] # where the search starts
fit = "fit.json"

[[aiding]]
type = "gnss_position"
file = "gnss.csv" # on the clock of the IMU
angles = "deg"
horizontal = "1 m"
vertical = "2 m"

[initial]
velocity_sd = "0.1 m/s"
attitude_sd = "1 deg"
```
"""
