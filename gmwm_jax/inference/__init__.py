"""How sure a fit is, how good, and which model: bootstrap, test of fit, intervals, selection."""

from gmwm_jax.inference.bootstrapping import Bootstrap as Bootstrap
from gmwm_jax.inference.bootstrapping import bootstrap as bootstrap
from gmwm_jax.inference.goodness import GoodnessOfFit as GoodnessOfFit
from gmwm_jax.inference.goodness import goodness_of_fit as goodness_of_fit
from gmwm_jax.inference.selection import Candidate as Candidate
from gmwm_jax.inference.selection import Selection as Selection
from gmwm_jax.inference.selection import select as select
