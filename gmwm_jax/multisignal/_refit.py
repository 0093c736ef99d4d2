"""Many joint estimates that resemble one already made: resamples, replicates and splits of records, vmapped."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from gmwm_jax.fitting.refit import Refits, refit_whitened
from gmwm_jax.multisignal._pool import whitened
from gmwm_jax.multisignal.joint import JointFit


def joint_refit(
    joint: JointFit,
    omega: Float[np.ndarray, "B J J"],
    moment: Float[np.ndarray, "B J"],
    told: Callable[[int], object] = lambda count: None,
) -> Refits:
    """Estimate the model of a joint fit from B sums of quadratic forms, descending from its estimate.

    Parameters
    ----------
    joint
        Where to start.
    omega, moment
        Sums over records of Omega_i and of Omega_i nu_i.
    told
        Hears how many more are done.
    """
    whitener, y = whitened(omega, moment)
    return refit_whitened(joint.model, joint.wv.scales, y, whitener, told)
