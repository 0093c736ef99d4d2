"""A recording in SI units: from files, arrays and named data sets, with its rate and names, outliers marked.

Data, rates and units
---------------------
Read are ``.npy``, ``.npz``, text (``.csv``, ``.tsv``, ``.txt``, ``.dat``, ``.log``, ``.asc``, ``.imu``), ``.parquet``,
netCDF, R's ``.rda``, ``.RData`` and bags of ROS 1 and 2, each also packed (``.gz``, ``.bz2``, ``.xz``, ``.zip``). Of text
the separator, decimal commas, the encoding (UTF-8, UTF-16, Latin-1), the line of names, units in the names
(``gyro_x [deg/s]``, ``gyro_x_deg_s``) or in a line of their own are found; columns of text are left out. A rate or a unit
is never guessed: the file states it, or you do, or you name the column of time. The unit also tells what the samples are:
rates (``rad/s``, ``deg/s``, ``deg/h``, ``m/s^2``, ``g``, ``mg``, ``ug``), or increments per sample (``rad``, ``deg``,
``arcsec``, ``m/s``), which are multiplied by the rate; ``scale={"gyro": "0.1 deg/s"}`` is for counts. NaN, a gap in time
or a constant channel is an error that names the place. A column called ``time`` that you neither name nor leave out is
an error as well.

Files as loggers write them need no more than their path: exports of Xsens (``xsens``) and VectorNav, ``$VNIMU`` sentences
too (``vectornav``), text exports and bags of ROS (``ros``), raw IMU logs of NovAtel (``novatel``), ``data.csv`` of EuRoC
(``euroc``), folders ``oxts`` of KITTI (``kitti``). They are told by their content; files without names by you:
``format="kf-gins"``, ``format="rtklibexplorer"``. ``print(rec.understood)`` says what was understood.

Stamps are regressed, not trusted. Their jitter and rounding, missing samples and rows that were written twice are told;
``gaps="nan"`` puts NaN where samples are missing, so that wavelet variances are taken by pairs, ``gaps="longest"`` takes
the longest run, and neither is done unless asked. ``clock="gps_time"`` estimates the drift against a second clock.

`datasets.names` lists public recordings; `datasets.load` fetches one into a cache and checks its SHA-256. Without a
network, put the files into a folder and name it in the environment variable ``GMWM_JAX_DATA``. `datasets.simulated` draws
recordings of four sensors, with parameters estimated from published wavelet variances.

Your own recording, from a text file with columns ``time,gyro_x,accel_x`` in seconds, deg/s and g:

```python
rec = gj.read_recording("static.csv", time="time", units={"gyro": "deg/s", "accel": "g"})
gj.save_recording(rec, "static.npz")  # remembers rate, names and units
rec = gj.read_recording("static.npz")
```

Of spans longer than the distance between two outliers no wavelet coefficient is without one, and no robust estimator
helps: there the samples must go. They become missing, and the wavelet variance is taken by pairs of the others. With 1 %
of outliers of ten sigma, one by one or in bursts, parameters of the cleaned record stay within 0.5 % of the clean ones,
where the classic white noise is 100 % too large and ``efficiency=0.6`` alone leaves a random walk 49 % off.

```python
rec = gj.datasets.simulated("mti-g", 100_000, channels=["gyro_x", "accel_x"])
seen = gj.recordings.mask_outliers(rec)  # outlying samples become NaN; print(seen) says which
fits = gj.fit(seen.recording, "WN + RW + GM")  # intervals are those for these gaps; your own: gaps="pairs"
```
"""  # noqa: E501

from gmwm_jax.recordings import datasets as datasets
from gmwm_jax.recordings.files import read_recording as read_recording
from gmwm_jax.recordings.files import save_recording as save_recording
from gmwm_jax.recordings.outliers import OutlierRun as OutlierRun
from gmwm_jax.recordings.outliers import OutliersMasked as OutliersMasked
from gmwm_jax.recordings.outliers import mask_outliers as mask_outliers
from gmwm_jax.recordings.recording import Recording as Recording
from gmwm_jax.recordings.understood import Understood as Understood
