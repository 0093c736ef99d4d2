"""Monte Carlo: hundreds of runs of several filters with common random numbers, and what they say."""

from nav_jax.simulation.campaign import compare as compare
from nav_jax.simulation.campaign import monte_carlo as monte_carlo
from nav_jax.simulation.comparison import Comparison as Comparison
from nav_jax.simulation.ranking import Ranking as Ranking
from nav_jax.simulation.runs import Runs as Runs
from nav_jax.simulation.runs import Track as Track
