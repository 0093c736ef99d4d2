"""Updates that refuse fixes which the filter holds for impossible.

The normalised innovation squared of a fix of K components, nu' S^-1 nu, is chi-square with K degrees of freedom where
the filter is right (Bar-Shalom, Li, Kirubarajan 2001, sec. 5.4). A gate takes the fix as a whole where that lies below
a quantile, and leaves estimate and covariance as they are where it does not. Innovations of scalars that are taken in
turn are independent, so that it is the sum of nu^2/s over them, and the test comes with the update.
"""

from collections.abc import Sequence

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from nav_jax.filter.ekf import Update, correction, update


def gated_update(
    P: Float[Array, "n n R"],
    H: Float[Array, "K m #R"],
    residual: Float[Array, "K R"],
    variance: Float[Array, " K"],
    valid: Float[Array, " K"],
    sizes: Sequence[int],
    limits: Float[Array, " S"],
) -> tuple[Float[Array, "n n R"], Update, Float[Array, "n R"], Float[Array, "K R"], Bool[Array, "S R"]]:
    """Take the fixes of S sensors in turn, each as a whole or not at all.

    Parameters
    ----------
    P, H, variance, valid
        As of `update`.
    residual
        Measured - predicted.
    sizes
        Number of scalars of each sensor.
    limits
        Of the normalised innovation squared of each; infinite where all fixes are taken.

    Returns
    -------
    tuple
        Covariance, update, correction, innovations, and which fixes passed. Innovations and their variances are those
        of each scalar given those before it in its fix, also where the fix is refused; gains are 0 there.
    """
    c = jnp.zeros((P.shape[0], residual.shape[1]))
    seen, first = H.shape[1], 0
    updates, innovations, passes = [], [], []
    for size, limit in zip(sizes, limits, strict=True):
        own = slice(first, first + size)
        first += size
        after, done = update(P, H[own], variance[own], valid[own])
        left = residual[own] - jnp.sum(H[own] * c[None, :seen], axis=1)
        more, nu = correction(done.gain, left, H[own])
        squares = valid[own, None] * nu**2 / done.variance
        passed = ~(jnp.sum(squares, axis=0) > limit)  # a filter that failed does not hide behind its gate
        P, c = jnp.where(passed, after, P), c + jnp.where(passed, more, 0.0)
        updates.append(Update(jnp.where(passed, done.gain, 0.0), done.variance))
        innovations.append(nu)
        passes.append(passed)
    gain, s = (jnp.concatenate(parts) for parts in zip(*updates, strict=True))
    return P, Update(gain, s), c, jnp.concatenate(innovations), jnp.stack(passes)
