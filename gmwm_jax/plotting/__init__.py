"""The figures, one file a room: every figure is a function that takes a result and gives a figure of Matplotlib.

A result draws itself by them: ``fit.plot(datasheet=...)`` is ``plot_fit(fit, datasheet=...)``. A new figure registers
for its class of results by ``@draw.register(Result)``. All take ``axes=``: an Axes for each frame, in reading order.
What ``plot_fit`` shows, ``fit_data`` returns as arrays with labels and units, a `Frame` for each pair of axes, and so
do all others: another library can draw the same.

No figure is known to pyplot: none is left open, a notebook shows one as the last expression of a cell and once, threads
may draw at the same time. To see one in a window, draw into Axes of pyplot: ``fit.plot(axes=plt.subplots(2)[1])``.
"""

from gmwm_jax._internal.figure_data import Axis as Axis
from gmwm_jax._internal.figure_data import Band as Band
from gmwm_jax._internal.figure_data import Bars as Bars
from gmwm_jax._internal.figure_data import Frame as Frame
from gmwm_jax._internal.figure_data import Histogram as Histogram
from gmwm_jax._internal.figure_data import Line as Line
from gmwm_jax._internal.figure_data import Mark as Mark
from gmwm_jax._internal.figure_data import Points as Points
from gmwm_jax._internal.figure_data import Span as Span
from gmwm_jax.plotting._style import draw as draw
from gmwm_jax.plotting.fitting import fit_data as fit_data
from gmwm_jax.plotting.fitting import fits_data as fits_data
from gmwm_jax.plotting.fitting import influence_data as influence_data
from gmwm_jax.plotting.fitting import plot_fit as plot_fit
from gmwm_jax.plotting.fitting import plot_fits as plot_fits
from gmwm_jax.plotting.fitting import plot_influence as plot_influence
from gmwm_jax.plotting.inference import bootstrap_data as bootstrap_data
from gmwm_jax.plotting.inference import plot_bootstrap as plot_bootstrap
from gmwm_jax.plotting.inference import plot_selection as plot_selection
from gmwm_jax.plotting.inference import plot_selections as plot_selections
from gmwm_jax.plotting.inference import selection_data as selection_data
from gmwm_jax.plotting.inference import selections_data as selections_data
from gmwm_jax.plotting.multisignal import cross_validation_data as cross_validation_data
from gmwm_jax.plotting.multisignal import cross_validations_data as cross_validations_data
from gmwm_jax.plotting.multisignal import joint_fit_data as joint_fit_data
from gmwm_jax.plotting.multisignal import joint_fits_data as joint_fits_data
from gmwm_jax.plotting.multisignal import near_stationarity_data as near_stationarity_data
from gmwm_jax.plotting.multisignal import plot_cross_validation as plot_cross_validation
from gmwm_jax.plotting.multisignal import plot_cross_validations as plot_cross_validations
from gmwm_jax.plotting.multisignal import plot_joint_fit as plot_joint_fit
from gmwm_jax.plotting.multisignal import plot_joint_fits as plot_joint_fits
from gmwm_jax.plotting.multisignal import plot_near_stationarity as plot_near_stationarity
from gmwm_jax.plotting.multisignal import plot_record_comparison as plot_record_comparison
from gmwm_jax.plotting.multisignal import record_comparison_data as record_comparison_data
from gmwm_jax.plotting.posterior import plot_posterior as plot_posterior
from gmwm_jax.plotting.posterior import posterior_data as posterior_data
from gmwm_jax.plotting.recordings import plot_recording as plot_recording
from gmwm_jax.plotting.recordings import recording_data as recording_data
from gmwm_jax.plotting.regression import plot_regression as plot_regression
from gmwm_jax.plotting.regression import regression_data as regression_data
from gmwm_jax.plotting.variance import allan_deviation_data as allan_deviation_data
from gmwm_jax.plotting.variance import plot_allan_deviation as plot_allan_deviation
from gmwm_jax.plotting.variance import plot_robust_comparison as plot_robust_comparison
from gmwm_jax.plotting.variance import plot_stability_deviation as plot_stability_deviation
from gmwm_jax.plotting.variance import plot_wavelet_variance as plot_wavelet_variance
from gmwm_jax.plotting.variance import robust_comparison_data as robust_comparison_data
from gmwm_jax.plotting.variance import stability_deviation_data as stability_deviation_data
from gmwm_jax.plotting.variance import wavelet_variance_data as wavelet_variance_data
