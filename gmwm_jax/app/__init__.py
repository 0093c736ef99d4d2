"""The command line ``gmwm-jax`` and its demonstration.

```console
$ gmwm-jax data simulate mti-g --samples 100000 --out imu.npz
$ gmwm-jax fit imu.npz --channels gyro_x,accel_x --model "WN + RW + GM" --plot fit.png --json fit.json
...
Datasheet units (at 100 Hz)
component  quantity   estimate  95 % low       high           unit
---------  --------  ---------  --------  ---------  -------------
WN         N            44.602         0     73.537    ug/sqrt(Hz)
RW         K            13.669     8.145      20.14  m/s/h/sqrt(h)
...
GMWM fits, parameters per sample
channel  unit   objective     search  p of fit   WN.sigma2   RW.gamma2  GM.beta  GM.variance
-------  -----  ---------  ---------  --------  ----------  ----------  -------  -----------
gyro_x   rad/s  0.5291314  converged    0.0032  1.3012e-05  2.3127e-11   1.7347   3.8279e-05
accel_x  m/s^2  0.3303232  converged     0.069  1.9132e-05  4.0046e-11   1.8347   6.3682e-05
```

A public recording, recognised by its content, needs neither rate nor unit; nor does a file of `save_recording`, or
one of a logger that is known. Others do:

```sh
gmwm-jax fit adis_16405_imu1.rda --channels all --model "WN + 2*GM + RW"
gmwm-jax wv static.csv --time time --units "gyro=deg/s,accel=g" --allan --plot allan.png
gmwm-jax wv static.csv --time time --units "gyro=deg/s,accel=g" --hadamard --plot hadamard.png
gmwm-jax wv logger.npy --rate 200 --units deg/s --modified-allan --json -
gmwm-jax wv MT_0312.txt.gz --gaps nan
gmwm-jax wv run.bag --variable /imu/data --channels gyro
gmwm-jax wv imu.txt --format kf-gins
gmwm-jax wv span.asc --scale adis16488
gmwm-jax wv counts.csv --time t_ms --scale "gyro=0.1 deg/s,accel=1.25 mg"
```

What was understood (format, rate, jitter, missing samples, columns, units) is said on standard error. A file whose
columns have no names is read by `--columns 1,2,3`; every option of `read_recording` is there, by its name.

Which model, and how sure? `select` ranks all sub-models; `fit` takes replicates, other weights, and a wavelet variance
that gives outliers no weight:

```sh
gmwm-jax select imu.npz --channels accel_x --model "WN + QN + RW + 2*GM" --plot selection.png
gmwm-jax fit imu.npz --channels accel_x --model "WN + RW + GM" --weights covariance --bootstrap 500 --robust
```

The parameter files of other filters, whose comments say units, rate and what was left out:

```sh
gmwm-jax fit imu.npz --model "WN + RW + GM" --export kalibr=imu.yaml --export px4=ekf2.params --export nav-jax=fit.json
```

All of this is a page in the browser, too: ``gmwm-jax app`` serves it on this machine alone (extra ``web``), and Ctrl-C
ends it. There is no login: ``--host`` shows it to others, behind a proxy with ``--root-path``.

Units, without any data:

```console
$ gmwm-jax units 0.15 "deg/sqrt(h)" "rad/s/sqrt(Hz)"
0.15 deg/sqrt(h) = 4.36332313e-05 rad/s/sqrt(Hz)
$ gmwm-jax units --model "GM(beta=0.001, variance=1e-7)" --rate 100
GM(beta=0.001, variance=1e-07)  (per sample at 100 Hz)

Continuous time, SI (at 100 Hz)
component  quantity  estimate         unit
---------  --------  --------  -----------
GM         beta           0.1          1/s
GM         q            2e-08  (rad/s)^2/s
...
$ gmwm-jax units --datasheet "N=0.15 deg/sqrt(h), K=2 deg/h/sqrt(h)" --rate 400
WN(sigma2=7.61544e-07) + RW(gamma2=6.52901e-17)  (per sample at 400 Hz)
...
```
"""
