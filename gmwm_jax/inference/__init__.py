"""How sure a fit is, how good, and which model: bootstrap, test of fit, intervals, selection.

Which model? Every sub-model of a superset is fitted in one compiled call and ranked by the wavelet information criterion
(WVIC: the objective that it would have on other data of the sensor), with standard errors of the differences. What no other
model is significantly better than is equivalent, and the simplest of those is recommended:

```python
wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 100_000, channels=["accel_x"]))
selection = gj.select(wv, "WN + QN + RW + 2*GM")  # 23 models; prints itself as a ranked table
print(selection)
fit = selection.recommended.fit  # a Fit like any other; selection["WN + RW"].fit is there as well
selection.plot().savefig("selection.png")
```

How sure is it? Weights from the whole covariance of the wavelet variance, and replicates of the fit:

```python
best = gj.fit(wv, "WN + RW + GM", weights="covariance")
print(gj.goodness_of_fit(best))  # chi-square test, and the pull of each scale: where a model fails
boot = gj.bootstrap(best, 200, key=jax.random.key(1))  # or 2000; route="records" simulates records
print(boot)  # test of fit by replicates, and intervals: boot.parameters("basic"), boot.continuous("studentised")
```

Replicates that take long are computed by several processes or a cluster, and kept: killed, the same lines continue.

```py
gj.bootstrap(fit, 10_000, key=key, route="records", executor=gj.inference.processes(8), store="replicates", progress=True)
```
"""  # noqa: E501

from gmwm_jax._internal.executors import processes as processes
from gmwm_jax.inference.bootstrapping import Bootstrap as Bootstrap
from gmwm_jax.inference.bootstrapping import bootstrap as bootstrap
from gmwm_jax.inference.goodness import GoodnessOfFit as GoodnessOfFit
from gmwm_jax.inference.goodness import goodness_of_fit as goodness_of_fit
from gmwm_jax.inference.selection import Candidate as Candidate
from gmwm_jax.inference.selection import Selection as Selection
from gmwm_jax.inference.selection import select as select
