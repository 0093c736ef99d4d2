"""Stochastic calibration of inertial sensors: from a static recording to the noise model a Kalman filter wants.

Conventions
-----------
Symbols: sigma^2 variance of white noise, nu_j^2 wavelet variance at level j = 1..J, tau_j = 2^j samples the span of the
Haar filter, theta the parameters, Omega the weights, f the sampling rate in Hz, u the unit of the signal.

Time is axis 0 of a record, channels are axis 1. Inside everything is SI (rad/s, m/s^2) in 64-bit floats; other units
are converted at the door. Process parameters are *per sample*; they become continuous-time densities or datasheet
entries only through `Fit.continuous`, `Fit.datasheet` and `gmwm_jax.units`, with the sampling rate stated.

The package never changes JAX's configuration: turn 64-bit floats on first,
``jax.config.update("jax_enable_x64", True)``.

References
----------
Guerrier, S., Skaloud, J., Stebler, Y. & Victoria-Feser, M.-P. (2013). Wavelet-variance-based estimation for composite
stochastic processes. JASA 108, 1021-1030.
Percival, D. B. & Walden, A. T. (2000). Wavelet Methods for Time Series Analysis. Cambridge.
IEEE Std 952-1997, annex C. Guide for single-axis interferometric fibre-optic gyros.
"""

from gmwm_jax import units as units
from gmwm_jax.fitting.estimator import fit as fit
from gmwm_jax.fitting.estimator import objective as objective
from gmwm_jax.fitting.result import Fit as Fit
from gmwm_jax.fitting.result import Fits as Fits
from gmwm_jax.fitting.result import Status as Status
from gmwm_jax.fitting.tables import Estimate as Estimate
from gmwm_jax.fitting.tables import EstimateTable as EstimateTable
from gmwm_jax.fitting.tables import continuous_table as continuous_table
from gmwm_jax.inference.bootstrapping import bootstrap as bootstrap
from gmwm_jax.inference.selection import Candidate as Candidate
from gmwm_jax.inference.selection import Selection as Selection
from gmwm_jax.inference.selection import Selections as Selections
from gmwm_jax.inference.goodness import GoodnessOfFit as GoodnessOfFit
from gmwm_jax.inference.goodness import goodness_of_fit as goodness_of_fit
from gmwm_jax.inference.bootstrapping import Bootstrap as Bootstrap
from gmwm_jax.inference.selection import select as select
from gmwm_jax.multisignal.comparison import ParameterSpread as ParameterSpread
from gmwm_jax.multisignal.comparison import RecordComparison as RecordComparison
from gmwm_jax.multisignal.comparison import compare_records as compare_records
from gmwm_jax.multisignal.cross_validation import CrossValidation as CrossValidation
from gmwm_jax.multisignal.cross_validation import ModelScore as ModelScore
from gmwm_jax.multisignal.cross_validation import cross_validate as cross_validate
from gmwm_jax.multisignal.joint import JointFit as JointFit
from gmwm_jax.multisignal.joint import JointFits as JointFits
from gmwm_jax.multisignal.joint import fit_records as fit_records
from gmwm_jax.multisignal.resampling import RecordResamples as RecordResamples
from gmwm_jax.multisignal.resampling import resample_records as resample_records
from gmwm_jax.multisignal.stationarity import NearStationarity as NearStationarity
from gmwm_jax.multisignal.stationarity import near_stationarity as near_stationarity
from gmwm_jax.processes.arma import AR as AR
from gmwm_jax.processes.arma import ARMA as ARMA
from gmwm_jax.processes.arma import MA as MA
from gmwm_jax.processes.band_flicker import FLK as FLK
from gmwm_jax.processes.base import AbstractProcess as AbstractProcess
from gmwm_jax.processes.base import Composite as Composite
from gmwm_jax.processes.datasheet import from_datasheet as from_datasheet
from gmwm_jax.processes.drift import DR as DR
from gmwm_jax.processes.flicker import BI as BI
from gmwm_jax.processes.flicker import flicker_ladder as flicker_ladder
from gmwm_jax.processes.fractional import FGN as FGN
from gmwm_jax.processes.gauss_markov import AR1 as AR1
from gmwm_jax.processes.gauss_markov import GM as GM
from gmwm_jax.processes.matern import MAT32 as MAT32
from gmwm_jax.processes.matern import MAT52 as MAT52
from gmwm_jax.processes.parameter import Fixed as Fixed
from gmwm_jax.processes.quantisation import QN as QN
from gmwm_jax.processes.random_walk import RW as RW
from gmwm_jax.processes.registry import parse_model as parse_model
from gmwm_jax.processes.simulation import simulate as simulate
from gmwm_jax.processes.sinusoid import SIN as SIN
from gmwm_jax.processes.state_space import StateSpace as StateSpace
from gmwm_jax.processes.white_noise import WN as WN
from gmwm_jax.processes.whitening import GeneralisedLeastSquares as GeneralisedLeastSquares
from gmwm_jax.processes.whitening import Whitened as Whitened
from gmwm_jax.processes.whitening import covariance_times as covariance_times
from gmwm_jax.processes.whitening import generalised_least_squares as generalised_least_squares
from gmwm_jax.processes.whitening import whiten as whiten
from gmwm_jax.recordings import datasets as datasets
from gmwm_jax.recordings.files import read_recording as read_recording
from gmwm_jax.recordings.files import save_recording as save_recording
from gmwm_jax.recordings.outliers import OutliersMasked as OutliersMasked
from gmwm_jax.recordings.outliers import mask_outliers as mask_outliers
from gmwm_jax.recordings.recording import Recording as Recording
from gmwm_jax.regression.regression import Coefficient as Coefficient
from gmwm_jax.regression.regression import Coefficients as Coefficients
from gmwm_jax.regression.regression import Regression as Regression
from gmwm_jax.regression.regression import regress as regress
from gmwm_jax.regression.regressors import Regressor as Regressor
from gmwm_jax.regression.regressors import polynomial as polynomial
from gmwm_jax.regression.regressors import seasonal as seasonal
from gmwm_jax.regression.regressors import step as step
from gmwm_jax.regression.regressors import trend as trend
from gmwm_jax.variance.allan import AllanDeviation as AllanDeviation
from gmwm_jax.fitting.slopes import SlopeRegression as SlopeRegression
from gmwm_jax.variance.allan import allan_deviation as allan_deviation
from gmwm_jax.fitting.slopes import read_off as read_off
from gmwm_jax.fitting.slopes import slope_regression as slope_regression
from gmwm_jax.variance.covariance import wv_covariance as wv_covariance
from gmwm_jax.variance.haar import haar_dwt_variance as haar_dwt_variance
from gmwm_jax.variance.haar import haar_wavelet_variance as haar_wavelet_variance
from gmwm_jax.recordings.outliers import OutlierRun as OutlierRun
from gmwm_jax.variance.robust_comparison import RobustComparison as RobustComparison
from gmwm_jax.variance.robust_comparison import compare_robust as compare_robust
from gmwm_jax.variance.wavelet import WaveletVariance as WaveletVariance
from gmwm_jax.variance.wavelet import wavelet_variance as wavelet_variance

__version__ = "0.1.0"
