"""Arrays in, arrays out: errors, NEES, coverage, the energy score and paired tests over runs."""

from nav_jax.statistics.energy import energy_score as energy_score
from nav_jax.statistics.levels import TwoLevelMean as TwoLevelMean
from nav_jax.statistics.levels import controlled_mean as controlled_mean
from nav_jax.statistics.levels import num_dear as num_dear
from nav_jax.statistics.levels import two_level_mean as two_level_mean
from nav_jax.statistics.summaries import coverage as coverage
from nav_jax.statistics.summaries import mean_nees as mean_nees
from nav_jax.statistics.summaries import mean_norm as mean_norm
from nav_jax.statistics.summaries import paired as paired
from nav_jax.statistics.summaries import rms as rms
