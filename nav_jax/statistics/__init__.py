"""Arrays in, arrays out: errors, NEES, coverage, the energy score and paired tests over runs."""

from nav_jax.statistics.energy import energy_score as energy_score
from nav_jax.statistics.summaries import coverage as coverage
from nav_jax.statistics.summaries import mean_nees as mean_nees
from nav_jax.statistics.summaries import mean_norm as mean_norm
from nav_jax.statistics.summaries import paired as paired
from nav_jax.statistics.summaries import rms as rms
