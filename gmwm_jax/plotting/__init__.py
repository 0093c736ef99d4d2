"""The figures, one file a room: every figure is a function that takes a result and gives a figure of Matplotlib.

A result draws itself by them: ``fit.plot(datasheet=...)`` is ``plot_fit(fit, datasheet=...)``. A new figure registers
for its class of results by ``@draw.register(Result)``. No figure is known to pyplot: none is left open, a notebook
shows one once, threads may draw at the same time.
"""

from gmwm_jax.plotting._style import draw as draw
from gmwm_jax.plotting.fitting import plot_fit as plot_fit
from gmwm_jax.plotting.fitting import plot_fits as plot_fits
from gmwm_jax.plotting.inference import plot_bootstrap as plot_bootstrap
from gmwm_jax.plotting.inference import plot_selection as plot_selection
from gmwm_jax.plotting.inference import plot_selections as plot_selections
from gmwm_jax.plotting.multisignal import plot_cross_validation as plot_cross_validation
from gmwm_jax.plotting.multisignal import plot_joint_fit as plot_joint_fit
from gmwm_jax.plotting.multisignal import plot_joint_fits as plot_joint_fits
from gmwm_jax.plotting.multisignal import plot_near_stationarity as plot_near_stationarity
from gmwm_jax.plotting.multisignal import plot_record_comparison as plot_record_comparison
from gmwm_jax.plotting.recordings import plot_recording as plot_recording
from gmwm_jax.plotting.regression import plot_regression as plot_regression
from gmwm_jax.plotting.variance import plot_allan_deviation as plot_allan_deviation
from gmwm_jax.plotting.variance import plot_robust_comparison as plot_robust_comparison
from gmwm_jax.plotting.variance import plot_wavelet_variance as plot_wavelet_variance
