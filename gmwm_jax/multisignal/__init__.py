"""Several records of one sensor type: a joint fit, how much the records differ, which model serves records left out.

```python
units = [
    gj.wavelet_variance(gj.datasets.simulated("mti-g", 50_000, channels=["accel_x"], key=jax.random.key(i)))
    for i in range(4)
]
joint = gj.fit_records(units, "WN + RW", weights="two-step")  # with the tables and figures of a Fit
print(gj.multisignal.compare_records(joint))  # scatter of each parameter over records, against what estimation explains
print(gj.multisignal.near_stationarity(joint, 200, key=jax.random.key(0)))  # p-value of "all have the same parameters"
```

Hundreds of recordings, each by itself: by several processes or a cluster, kept in a folder from which the same lines
continue, and what cannot be read or fitted is named at the end.

```py
fits = gj.fit_each(
    sorted(Path("static").glob("*.csv")), "WN + RW + GM", reading={"rate": 100.0, "units": {"gyro": "deg/s"}},
    executor=gj.multisignal.processes(8), store="fits", progress=True,
)
print(fits)  # a row a channel; fits["static/unit_17.csv"]["gyro_x"] is a Fit
```

`resample_records` gives intervals by resampling records, `cross_validate` compares models by records left out.
"""

from gmwm_jax._internal.executors import processes as processes
from gmwm_jax.multisignal.comparison import ParameterSpread as ParameterSpread
from gmwm_jax.multisignal.comparison import RecordComparison as RecordComparison
from gmwm_jax.multisignal.comparison import compare_records as compare_records
from gmwm_jax.multisignal.cross_validation import CrossValidation as CrossValidation
from gmwm_jax.multisignal.cross_validation import ModelScore as ModelScore
from gmwm_jax.multisignal.cross_validation import cross_validate as cross_validate
from gmwm_jax.multisignal.each import EachFit as EachFit
from gmwm_jax.multisignal.each import fit_each as fit_each
from gmwm_jax.multisignal.joint import JointFit as JointFit
from gmwm_jax.multisignal.joint import fit_records as fit_records
from gmwm_jax.multisignal.resampling import RecordResamples as RecordResamples
from gmwm_jax.multisignal.resampling import resample_records as resample_records
from gmwm_jax.multisignal.stationarity import NearStationarity as NearStationarity
from gmwm_jax.multisignal.stationarity import near_stationarity as near_stationarity
