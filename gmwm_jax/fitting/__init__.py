"""The estimator: from a wavelet variance and a model to a `Fit`, by the Generalized Method of Wavelet Moments.

The search, the weights, the standard errors and the tables of parameters; slopes of the Allan deviation beside it.

How to read a fit
-----------------
* objective: Σ (ν̂² - ν²)²/(width of the 95 % interval)², the weights of R's simts, so that values compare. It can only fall
  as a model grows: `gmwm_jax.inference.select` weighs what a component gains against what it costs.
* weights: the default ones come from the data and bias a component whose scales have few degrees of freedom by 1 to 2 %, a
  fraction of its standard error; ``weights="two-step"`` takes them from a first fit and does not. ``weights="covariance"``
  takes the whole covariance of the wavelet variance: for long records, the smallest standard errors.
* status: ``converged``, or what went wrong. `fit` raises unless ``throw=False``. It is about the search: a search for the
  best of wrong models converges too.
* test of fit: chi-square over all scales, by the covariance that the intervals are from, and the largest pull. Where the data
  are beyond what chance does under the model, a warning stands before the estimates, in overviews of channels, in JSON and in
  the comments of exports: the intervals are then of little use. Its test knows how skew a variance of few degrees of freedom
  is, so that a right model is hardly ever warned of; p, which does not, is below 5 % for 3 to 7 % of right models.
* at boundary: a component that the data do not want is exactly zero and stays in the table, with an interval from 0 to
  what it may be all the same. A Gauss-Markov process whose correlation time leaves the range that the record can show is
  a random walk, or white noise: reported is then what that limit has (q, or the variance and N_0), with its interval;
  what it has not is no value, but may have an interval up to the limit (beta from 0 to the largest that the data leave).
* not told apart from others: the data fix a sum of components and not its parts; these have a value but no interval.
* agreement: the share of descents, from many starting points, that came to the same minimum. A low one says that the data
  hardly tell the components apart.
* white noise and bias: what is my angle or velocity random walk? N of the last table, the density of all components that are
  white at the step of the filter together: white noise that comes out as zero beside a Gauss-Markov process of half a sample
  is there again. K is the random walk that stands for all the others, B the lowest Allan deviation over 0.664: see `bias`.
* intervals: 95 %, by the delta method from the exact covariance of the wavelet variance under the fitted model, symmetric on
  the log (phi: logit) scale. Beside a component that is at a boundary, or near one, they are longer, on the side to which
  the others move if it is a little inside: see `gmwm_jax.fitting.boundary`. They assume that the model is right and the
  noise Gaussian.

Out to other filters
--------------------
Fits of all channels write the parameter files of Kalibr, OpenVINS, VINS, KF-GINS, pyins, GTSAM, PX4, ROS and nav-jax; their
comments say units, rate, what was left out and which approximation was made. The table of formats is that of `exports`.

```python
fits = gj.fit(gj.datasets.simulated("mti-g", 20_000), "WN + RW + GM")
fits.export("kalibr", path="imu.yaml")
print(fits.export("px4", step=0.01))  # white noise is what is white at the step of the filter
print(fits["gyro_x"].white_and_bias())
```

The estimator inside of one's own program
-----------------------------------------
`estimate` is the estimator of `fit` as a pure function of moments, weights and held values, for jit, vmap and grad; at a
minimum inside its range its derivatives are exact (implicit function theorem), and a component at zero stays there.

```python
from dataclasses import replace

wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 20_000, channels=["gyro_x"]))


def correlation_time(nu):
    found = gj.fitting.estimate(replace(wv, variance=nu), "WN + GM")
    return 1 / (found.parameters["GM beta"] * wv.rate)


by_scale = jax.jit(jax.grad(correlation_time))(jnp.asarray(wv.variance))
many = jax.jit(jax.vmap(correlation_time))(wv.variance * np.linspace(0.9, 1.1, 20)[:, None])
```

Priors, bounds, shared parameters, constraints
----------------------------------------------
```python
wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 20_000, channels=["gyro_x", "gyro_y"]))
found = gj.fitting.posterior(
    wv, "WN + GM", shared=["GM beta"], priors={"WN sigma2": gj.fitting.Prior(8e-6, factor=1.5)}
)
print(found)
tau = {"GM beta": (1 / (1000 * wv.rate), 1 / (10 * wv.rate))}  # a correlation time between 10 and 1000 s
print(gj.fitting.posterior(wv, "WN + GM", bounds=tau))
```

How to keep a fit
-----------------
``fit.save("accel_x.json")``, or ``.npz``, or with the extra ``io`` ``.nc``; ``gj.load`` gives it back, to the last bit. So have
all results of this package. A process of your own is in no file: who reads it may not have it.
"""  # noqa: E501

from gmwm_jax._internal.channels import Channels as Channels
from gmwm_jax._internal.compiled import keep_compiled as keep_compiled
from gmwm_jax._internal.saved import load as load
from gmwm_jax.fitting import weights as weights
from gmwm_jax.fitting.bayes import Constraint as Constraint
from gmwm_jax.fitting.bayes import LogDensity as LogDensity
from gmwm_jax.fitting.bayes import Posterior as Posterior
from gmwm_jax.fitting.bayes import Prior as Prior
from gmwm_jax.fitting.bayes import posterior as posterior
from gmwm_jax.fitting.bayes import posterior_mode as posterior_mode
from gmwm_jax.fitting.bias import WhiteAndBias as WhiteAndBias
from gmwm_jax.fitting.bias import white_and_bias as white_and_bias
from gmwm_jax.fitting.estimation import Estimates as Estimates
from gmwm_jax.fitting.estimation import estimate as estimate
from gmwm_jax.fitting.estimator import fit as fit
from gmwm_jax.fitting.estimator import objective as objective
from gmwm_jax.fitting.influences import Influence as Influence
from gmwm_jax.fitting.influences import influence as influence
from gmwm_jax.fitting.outcome import Outcome as Outcome
from gmwm_jax.fitting.result import Fit as Fit
from gmwm_jax.fitting.result import Status as Status
from gmwm_jax.fitting.slopes import SlopeRegression as SlopeRegression
from gmwm_jax.fitting.slopes import read_off as read_off
from gmwm_jax.fitting.slopes import slope_regression as slope_regression
from gmwm_jax.fitting.tables import Estimate as Estimate
from gmwm_jax.fitting.tables import EstimateTable as EstimateTable
from gmwm_jax.fitting.tables import continuous_table as continuous_table
