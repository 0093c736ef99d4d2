"""The latent processes, one a file, and their sums.

Each knows its theory (wavelet variance, spectrum, autocovariance, covariance of Haar coefficients), its text, how to
draw it, its state space and its continuous-time form. Parameters are per sample.
"""

from gmwm_jax.processes.arma import AR as AR
from gmwm_jax.processes.arma import ARMA as ARMA
from gmwm_jax.processes.arma import MA as MA
from gmwm_jax.processes.band_flicker import FLK as FLK
from gmwm_jax.processes.base import AbstractProcess as AbstractProcess
from gmwm_jax.processes.base import Composite as Composite
from gmwm_jax.processes.continuous import from_continuous as from_continuous
from gmwm_jax.processes.continuous import to_continuous as to_continuous
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
from gmwm_jax.processes.parameter import Limit as Limit
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
