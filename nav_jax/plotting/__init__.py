"""The figures, one file a room: every figure is a function that takes a result and gives a figure of Matplotlib.

A result draws itself by them: ``comparison.plot(at=120.0)`` is ``plot_comparison(comparison, at=120.0)``. A new figure
registers for its class of results by ``@draw.register(Result)``. No figure is known to pyplot: none is left open, a
notebook shows one once, threads may draw at the same time.
"""

from nav_jax.plotting._style import draw as draw
from nav_jax.plotting.comparison import plot_comparison as plot_comparison
from nav_jax.plotting.comparison import plot_consistency as plot_consistency
from nav_jax.plotting.comparison import plot_mean_errors as plot_mean_errors
from nav_jax.plotting.comparison import plot_nis as plot_nis
from nav_jax.plotting.lincov import plot_analysis as plot_analysis
from nav_jax.plotting.lincov import plot_budget as plot_budget
from nav_jax.plotting.lincov import plot_calibration as plot_calibration
from nav_jax.plotting.lincov import plot_design as plot_design
from nav_jax.plotting.lincov import plot_sensitivities as plot_sensitivities
from nav_jax.plotting.recorded import plot_tuning as plot_tuning
from nav_jax.plotting.runs import plot_errors as plot_errors
from nav_jax.plotting.runs import plot_realisations as plot_realisations
from nav_jax.plotting.runs import plot_sensor_states as plot_sensor_states
from nav_jax.plotting.trajectory import plot_trajectory as plot_trajectory
