"""Wavelet and Allan variance of recordings, and how they scatter under a model.

The classic estimator, the robust one, the one for records with gaps; their covariances and replicates.

`wavelet_variance` takes a recording, an array (N,) or (N, C) in SI, a memory map, or an iterator of blocks. An iterator is
one channel; for several, give a memory map, or make one call each. Scales are spans of the Haar filter, tau_j = 2^j
samples, j = 1 .. floor(log2 N) - 1. A robust wavelet variance gives outliers no weight, and `fit` takes it as it is:

```python
rec = gj.datasets.simulated("mti-g", 100_000, channels=["gyro_x", "accel_x"])
robust = gj.wavelet_variance(rec, efficiency=0.6)  # Tukey's biweight (Mondal & Percival 2012)
print(gj.variance.compare_robust(rec["accel_x"]))  # which scales differ, and where the outliers are
```

Prints and figures show intervals at their nominal level, `WaveletVariance.bands`: chi-square with the degrees of freedom that
the noise gives each scale. The fields `ci_low` and `ci_high` have those of R's package, which fits take their weights from;
they hold the truth in 98 to 100 % where 95 % is said.

```python
wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 20_000, channels=["gyro_x"]))
print(wv.bands().high / wv.ci_high)  # under the power law of each scale and its neighbours
print(wv.bands(gj.fit(wv, "WN + RW").model).dof)  # under a fitted model, by its exact covariance
print(gj.variance.hadamard_deviation(gj.datasets.simulated("mti-g", 20_000, channels=["gyro_x"])))
```
"""  # noqa: E501

from gmwm_jax.variance.allan import AllanDeviation as AllanDeviation
from gmwm_jax.variance.allan import allan_deviation as allan_deviation
from gmwm_jax.variance.bands import Bands as Bands
from gmwm_jax.variance.contributions import BlockSums as BlockSums
from gmwm_jax.variance.contributions import block_sums as block_sums
from gmwm_jax.variance.covariance import wv_covariance as wv_covariance
from gmwm_jax.variance.estimator import AbstractEstimator as AbstractEstimator
from gmwm_jax.variance.estimator import Dwt as Dwt
from gmwm_jax.variance.estimator import Modwt as Modwt
from gmwm_jax.variance.estimator import Pairs as Pairs
from gmwm_jax.variance.estimator import Robust as Robust
from gmwm_jax.variance.haar import haar_dwt_variance as haar_dwt_variance
from gmwm_jax.variance.haar import haar_wavelet_variance as haar_wavelet_variance
from gmwm_jax.variance.robust_comparison import RobustComparison as RobustComparison
from gmwm_jax.variance.robust_comparison import compare_robust as compare_robust
from gmwm_jax.variance.stability import StabilityDeviation as StabilityDeviation
from gmwm_jax.variance.stability import hadamard_deviation as hadamard_deviation
from gmwm_jax.variance.stability import modified_allan_deviation as modified_allan_deviation
from gmwm_jax.variance.wavelet import WaveletVariance as WaveletVariance
from gmwm_jax.variance.wavelet import WaveletVariances as WaveletVariances
from gmwm_jax.variance.wavelet import wavelet_variance as wavelet_variance
