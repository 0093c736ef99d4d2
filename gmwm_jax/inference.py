"""First-order standard errors: from the covariance of the wavelet variance to that of the parameters.

Near the minimum, eta_hat - eta = (A' Omega A)^-1 A' Omega (nu_hat - nu) with A = d nu / d eta. Hence the sandwich
Psi = B V B', B = (A' Omega A)^-1 A' Omega, V = Cov(nu_hat) (Guerrier et al. 2013). eta are the parameters mapped to the
real line (log, or logit for phi), on which intervals are symmetric: they never leave the range of the parameter.
"""

from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float
from scipy.special import ndtri

from gmwm_jax.processes._base import Composite


@partial(jax.jit, static_argnames="active")
def parameter_covariance(
    model: Composite,
    active: tuple[int, ...],
    tau: Float[Array, " J"],
    whitener: Float[Array, "J J"],
    V: Float[Array, "J J"],
) -> Float[Array, "P P"]:
    """Sandwich covariance of the active parameters on the real line.

    Parameters
    ----------
    model
        The fitted model.
    active
        Positions (in the order of `Composite.unconstrained`) of the parameters that were estimated and lie inside
        their range; the others are held.
    tau
        Spans, samples.
    whitener
        L' with Omega = L L'.
    V
        Covariance of the wavelet variance.
    """
    A = whitener @ _jacobian(lambda m: m.wavelet_variance(tau), model, active)
    # columns of unit length, so that the pseudo-inverse cuts directions the data do not see, not small units
    length = jnp.linalg.norm(A, axis=0)
    B = (jnp.linalg.pinv(A / length[None, :]) / length[:, None]) @ whitener
    return B @ V @ B.T


@partial(jax.jit, static_argnames=("quantity", "active"))
def delta_method(
    quantity: Callable[[Composite], Array],
    model: Composite,
    active: tuple[int, ...],
    covariance: Float[Array, "P P"],
) -> Float[Array, " Q"]:
    """Standard errors of functions of the model.

    Parameters
    ----------
    quantity
        Model -> vector.
    model, active, covariance
        As of `parameter_covariance`.

    Returns
    -------
    The standard error of each entry of the vector.
    """
    J = _jacobian(quantity, model, active)
    return jnp.sqrt(jnp.sum((J @ covariance) * J, axis=1))


@partial(jax.jit, static_argnums=0)
def evaluate(quantity: Callable[[Composite], Array], model: Composite) -> Array:
    """Value of a (hashable) function of the model, compiled as a whole."""
    return quantity(model)


def normal_quantile(level: float) -> float:
    """Return z such that a normal variable lies within +-z with probability `level` (1.96 for 0.95)."""
    return float(ndtri((1 + level) / 2))


def _jacobian(quantity: Callable[[Composite], Array], model: Composite, active: tuple[int, ...]) -> Array:
    at = jnp.asarray(active, dtype=jnp.int32)
    eta = model.unconstrained()

    def of_active(values: Array) -> Array:
        return quantity(model.with_unconstrained(eta.at[at].set(values)))

    return jax.jacfwd(of_active)(eta[at])


def correlation(covariance: Float[np.ndarray, "P P"]) -> Float[np.ndarray, "P P"]:
    """Correlation matrix of a covariance matrix."""
    sd = np.sqrt(np.diag(covariance))
    return covariance / np.outer(sd, sd)
