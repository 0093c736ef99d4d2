"""Stochastic calibration of inertial sensors: from a static recording to the noise model a Kalman filter wants.

Conventions
-----------
Symbols: sigma^2 variance of white noise, nu_j^2 wavelet variance at level j = 1..J, tau_j = 2^j samples the span of the
Haar filter, theta the parameters, Omega the weights, f the sampling rate in Hz, u the unit of the signal.

Time is axis 0 of a record, channels are axis 1. Inside everything is SI (rad/s, m/s^2) in 64-bit floats; other units
are converted at the door. Process parameters are *per sample*; they become continuous-time densities or datasheet
entries only through `Fit.continuous`, `Fit.datasheet` and `gmwm_jax.units`, with the sampling rate stated.

The package never changes JAX's configuration: turn 64-bit floats on first,
``jax.config.update("jax_enable_x64", True)``. On CPUs with few cores XLA has few threads (jaxlib 0.10). What several
threads of yours call here takes turns for them. Programs of your own that search for minima, run by several threads,
may wait for each other for ever, unless the environment gives XLA more before it starts: ``NPROC=16``.

Power spectral densities are two-sided: white noise of variance sigma2 per sample has q = sigma2/f. A one-sided
amplitude density is larger by sqrt(2). Scales are spans of the Haar filter; the wavelet variance is half the Allan
variance, nu^2(tau) = sigma_A^2(tau/2)/2, the same estimator with the same interval.

Pure functions
--------------
`fit`, `select` and the like look at what they are given, print, warn and raise: they are no functions of arrays alone.
These are; jit, vmap and differentiate them by what is named.

| function | of |
|---|---|
| `processes.Composite.wavelet_variance` | parameters |
| `processes.Composite.psd` | parameters, frequency |
| `processes.Composite.autocovariance` | parameters |
| `processes.Composite.unconstrained` | parameters |
| `processes.Composite.with_unconstrained` | the vector |
| `processes.simulate` | parameters; map it over keys |
| `processes.whiten` | parameters, columns |
| `processes.generalised_least_squares` | parameters, record, regressors |
| `processes.covariance_times` | parameters, columns |
| `variance.haar_wavelet_variance` | samples |
| `variance.haar_dwt_variance` | samples |
| `variance.block_sums` | samples |
| `variance.wv_covariance` | parameters |
| `fitting.objective` | parameters, wavelet variance, weights |
| `fitting.estimate` | wavelet variance, weights, held values |

Examples in docstrings suppose ``import gmwm_jax as gj``, ``import nav_jax as nj``, ``import numpy as np``,
``import jax`` and ``import jax.numpy as jnp``.

References
----------
Guerrier, S., Skaloud, J., Stebler, Y. & Victoria-Feser, M.-P. (2013). Wavelet-variance-based estimation for composite
stochastic processes. JASA 108, 1021-1030.
Percival, D. B. & Walden, A. T. (2000). Wavelet Methods for Time Series Analysis. Cambridge.
IEEE Std 952-1997, annex C. Guide for single-axis interferometric fibre-optic gyros.
"""

from typing import TYPE_CHECKING as _TYPE_CHECKING

if _TYPE_CHECKING:
    from gmwm_jax import fitting as fitting
    from gmwm_jax import inference as inference
    from gmwm_jax import multisignal as multisignal
    from gmwm_jax import plotting as plotting
    from gmwm_jax import processes as processes
    from gmwm_jax import recordings as recordings
    from gmwm_jax import regression as regression
    from gmwm_jax import units as units
    from gmwm_jax import variance as variance
    from gmwm_jax._internal.compiled import keep_compiled as keep_compiled
    from gmwm_jax._internal.saved import load as load
    from gmwm_jax.fitting import Fit as Fit
    from gmwm_jax.fitting import fit as fit
    from gmwm_jax.inference import bootstrap as bootstrap
    from gmwm_jax.inference import goodness_of_fit as goodness_of_fit
    from gmwm_jax.inference import select as select
    from gmwm_jax.multisignal import fit_each as fit_each
    from gmwm_jax.multisignal import fit_records as fit_records
    from gmwm_jax.processes import AR as AR
    from gmwm_jax.processes import AR1 as AR1
    from gmwm_jax.processes import ARMA as ARMA
    from gmwm_jax.processes import BI as BI
    from gmwm_jax.processes import DR as DR
    from gmwm_jax.processes import FGN as FGN
    from gmwm_jax.processes import FLK as FLK
    from gmwm_jax.processes import GM as GM
    from gmwm_jax.processes import MA as MA
    from gmwm_jax.processes import MAT32 as MAT32
    from gmwm_jax.processes import MAT52 as MAT52
    from gmwm_jax.processes import QN as QN
    from gmwm_jax.processes import RW as RW
    from gmwm_jax.processes import SIN as SIN
    from gmwm_jax.processes import WN as WN
    from gmwm_jax.processes import Composite as Composite
    from gmwm_jax.processes import Fixed as Fixed
    from gmwm_jax.processes import from_datasheet as from_datasheet
    from gmwm_jax.processes import parse_model as parse_model
    from gmwm_jax.processes import simulate as simulate
    from gmwm_jax.recordings import Recording as Recording
    from gmwm_jax.recordings import datasets as datasets
    from gmwm_jax.recordings import read_recording as read_recording
    from gmwm_jax.recordings import save_recording as save_recording
    from gmwm_jax.regression import regress as regress
    from gmwm_jax.variance import allan_deviation as allan_deviation
    from gmwm_jax.variance import wavelet_variance as wavelet_variance
else:
    from gmwm_jax._internal.lazy import lazily as _lazily

    __getattr__, __dir__, __all__ = _lazily(__name__)

__version__ = "0.1.0"
