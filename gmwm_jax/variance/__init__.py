"""Wavelet and Allan variance of recordings, and how they scatter under a model.

The classic estimator, the robust one, the one for records with gaps; their covariances and replicates.
"""

from gmwm_jax.variance.allan import AllanDeviation as AllanDeviation
from gmwm_jax.variance.allan import allan_deviation as allan_deviation
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
from gmwm_jax.variance.wavelet import WaveletVariance as WaveletVariance
from gmwm_jax.variance.wavelet import WaveletVariances as WaveletVariances
from gmwm_jax.variance.wavelet import wavelet_variance as wavelet_variance
