"""Monte Carlo: hundreds of runs of several filters with common random numbers, and what they say.

Every filter sees the same runs, run for run: differences are tested in pairs. ``gains="reference"`` shares one covariance
and one set of gains, computed along the reference, among all runs: exact to first order in the errors and several times
faster. ``every=10`` of a scenario propagates the covariance over ten samples at once, with the transition accumulated over
all of them. ``smooth=True`` judges the fixed-interval smoother. ``cmp.save("runs.nc")``, or ``.zarr``, or without the extra
``io`` ``.npz``, keeps the runs, and ``nj.load("runs.nc")`` gives the comparison back, with table and figures;
``cmp.to_xarray()`` is a Dataset (model, run, time, component) with units.

``gains="two-level"`` gives the means of filters with gains of their own from few runs: with what linear filters do in the
same runs, whose means are known, or else with many runs on shared gains. It says what either leaves out (a `TwoLevel`);
``nj.simulation.two_level`` says how exactly.

How to read a comparison
------------------------
* position, rms, orientation: over the runs at the judged epoch, by default the end of the last outage.
* energy score: of the position that the filter claims with its covariance, in m; lower is better. It punishes a wrong
  covariance as well as a wrong position.
* NEES/dof: 1 for a filter that knows its errors; an asterisk marks a value outside the chi-square band for this many runs.
  Above: it believes too much of itself. In band: the share of epochs inside.
* coverage: the share of runs in which the truth lies in the claimed 95 % region, with the exact binomial band.
* verdict: from paired differences with Holm's correction over all pairs. "Not distinguishable" comes with the number of runs
  that would be needed.
"""  # noqa: E501

from gmwm_jax._internal.saved import load as load
from gmwm_jax._internal.xla_loops import fast_loops as fast_loops
from nav_jax.simulation.campaign import compare as compare
from nav_jax.simulation.campaign import monte_carlo as monte_carlo
from nav_jax.simulation.campaign import two_level as two_level
from nav_jax.simulation.comparison import Comparison as Comparison
from nav_jax.simulation.levels import TwoLevel as TwoLevel
from nav_jax.simulation.ranking import Ranking as Ranking
from nav_jax.simulation.runs import Runs as Runs
from nav_jax.simulation.runs import Track as Track
from nav_jax.simulation.stopping import Anytime as Anytime
from nav_jax.simulation.stopping import Precision as Precision
from nav_jax.simulation.stopping import Significant as Significant
