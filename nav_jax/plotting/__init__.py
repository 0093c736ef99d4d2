"""The figures, one file a room: every figure is a function that takes a result and gives a figure of Matplotlib.

A result draws itself by them: ``comparison.plot(at=120.0)`` is ``plot_comparison(comparison, at=120.0)``. A new figure
registers for its class of results by ``@draw.register(Result)``. All take ``axes=``: an Axes for each frame, in reading
order. What ``plot_budget`` shows, ``budget_data`` returns as arrays with labels and units, a `Frame` for each pair of
axes, and so do all others: another library can draw the same.

No figure is known to pyplot, see `gmwm_jax.plotting`.
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
from nav_jax.plotting._style import draw as draw
from nav_jax.plotting.campaign import plot_statistics as plot_statistics
from nav_jax.plotting.campaign import statistics_data as statistics_data
from nav_jax.plotting.comparison import comparison_data as comparison_data
from nav_jax.plotting.comparison import consistency_data as consistency_data
from nav_jax.plotting.comparison import mean_errors_data as mean_errors_data
from nav_jax.plotting.comparison import nis_data as nis_data
from nav_jax.plotting.comparison import plot_comparison as plot_comparison
from nav_jax.plotting.comparison import plot_consistency as plot_consistency
from nav_jax.plotting.comparison import plot_mean_errors as plot_mean_errors
from nav_jax.plotting.comparison import plot_nis as plot_nis
from nav_jax.plotting.inspection import inspection_data as inspection_data
from nav_jax.plotting.inspection import plot_inspection as plot_inspection
from nav_jax.plotting.levels import plot_two_level as plot_two_level
from nav_jax.plotting.levels import two_level_data as two_level_data
from nav_jax.plotting.lincov import analysis_data as analysis_data
from nav_jax.plotting.lincov import budget_data as budget_data
from nav_jax.plotting.lincov import calibration_data as calibration_data
from nav_jax.plotting.lincov import design_data as design_data
from nav_jax.plotting.lincov import plot_analysis as plot_analysis
from nav_jax.plotting.lincov import plot_budget as plot_budget
from nav_jax.plotting.lincov import plot_calibration as plot_calibration
from nav_jax.plotting.lincov import plot_design as plot_design
from nav_jax.plotting.lincov import plot_sensitivities as plot_sensitivities
from nav_jax.plotting.lincov import sensitivities_data as sensitivities_data
from nav_jax.plotting.navigation import innovations_data as innovations_data
from nav_jax.plotting.navigation import navigation_data as navigation_data
from nav_jax.plotting.navigation import plot_innovations as plot_innovations
from nav_jax.plotting.navigation import plot_navigation as plot_navigation
from nav_jax.plotting.navigation import plot_sensor_estimates as plot_sensor_estimates
from nav_jax.plotting.navigation import plot_withheld as plot_withheld
from nav_jax.plotting.navigation import sensor_estimates_data as sensor_estimates_data
from nav_jax.plotting.navigation import withheld_data as withheld_data
from nav_jax.plotting.recorded import noise_in_motion_data as noise_in_motion_data
from nav_jax.plotting.recorded import outages_data as outages_data
from nav_jax.plotting.recorded import plot_noise_in_motion as plot_noise_in_motion
from nav_jax.plotting.recorded import plot_outages as plot_outages
from nav_jax.plotting.recorded import plot_tuning as plot_tuning
from nav_jax.plotting.recorded import tuning_data as tuning_data
from nav_jax.plotting.runs import errors_data as errors_data
from nav_jax.plotting.runs import plot_errors as plot_errors
from nav_jax.plotting.runs import plot_realisations as plot_realisations
from nav_jax.plotting.runs import plot_sensor_states as plot_sensor_states
from nav_jax.plotting.runs import realisations_data as realisations_data
from nav_jax.plotting.runs import sensor_states_data as sensor_states_data
from nav_jax.plotting.trajectory import plot_trajectory as plot_trajectory
from nav_jax.plotting.trajectory import trajectory_data as trajectory_data
