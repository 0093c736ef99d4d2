"""First-order standard errors: from the covariance of the wavelet variance to that of the parameters.

Near the minimum, eta_hat - eta = (A' Omega A)^-1 A' Omega (nu_hat - nu) with A = d nu / d eta. Hence the sandwich
Psi = B V B', B = (A' Omega A)^-1 A' Omega, V = Cov(nu_hat) (Guerrier et al. 2013). eta are the parameters mapped to the
real line (log, or logit for phi), on which intervals are symmetric: they never leave the range of the parameter.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float

from gmwm_jax._internal.compiling import compiled_quickly
from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.xla_threads import few_at_a_time
from gmwm_jax.fitting._batch import while_each
from gmwm_jax.processes.base import Composite

_RANK_TOLERANCE = 1e-8
"""Of the singular values of the whitened derivative: beyond it no data tell two parameters apart."""
_NUM_STEPS, _LONGEST_STEP = 12, 1.0
"""Of Gauss and Newton, from a minimum to one beside it; on the log scale."""
_SETTLED = 1e-6
"""The step, on that scale, after which there is no other."""


def parameter_covariance(
    model: Composite,
    active: tuple[int, ...],
    tau: Any,
    whitener: Any,
    V: Any,
) -> Float[Array | np.ndarray, "P P"]:
    """Sandwich covariance of the active parameters on the real line; NaN for those that data cannot tell apart.

    Parameters
    ----------
    model
        The fitted model.
    active
        Positions (in the order of `Composite.unconstrained`) of the parameters that were estimated and lie inside
        their range; the others are held.
    tau
        Spans, samples; shape (J,).
    whitener
        L' with Omega = L L', shape (J, J).
    V
        Covariance of the wavelet variance, shape (J, J).
    """
    at = np.asarray(active, dtype=int)
    (whole,) = known(_sandwich(model, _mask(model, active), tau, whitener, V)[0])
    return whole[np.ix_(at, at)]


@compiled_quickly()
def _sandwich(
    model: Composite, active: Any, tau: Any, whitener: Any, V: Any
) -> tuple[Float[Array, "Q Q"], Float[Array, " J"], Float[Array, "J Q"], Float[Array, "Q J"], Float[Array, "C J"]]:
    """B V B', nu, A, B and the components for unit amplitude: one program for whoever wants one of them."""
    A = _wv_jacobian(model, active, tau)
    B, lost = _estimator(A, whitener)
    covariance = jnp.where(lost[:, None] | lost[None, :], jnp.nan, B @ V @ B.T)
    unit = jnp.stack([p.unit_wavelet_variance(p.shape, tau) for p in model.processes])
    return covariance, model.wavelet_variance(tau), A, B, unit


class Linearised(NamedTuple):
    """A model at its estimates, eta the active parameters on the real line."""

    variance: Any
    """Shape (J,): Its wavelet variance nu."""
    slopes: Any
    """Shape (J, P): A = d nu/d eta."""
    estimator: Any
    """Shape (P, J): B = d eta_hat/d nu_hat; directions that data do not see are left out."""
    unit: Any
    """Shape (C, J): Wavelet variance of each component for unit amplitude."""


def linearised(model: Composite, active: tuple[int, ...], tau: Any, whitener: Any) -> Linearised:
    """Linearise a fitted model, by the program of `parameter_covariance`; arguments as there."""
    at = np.asarray(active, dtype=int)
    # no covariance of the wavelet variance is asked for
    nothing = np.zeros((len(tau), len(tau)))
    _, nu, A, B, unit = known(*_sandwich(model, _mask(model, active), tau, whitener, nothing))
    return Linearised(nu, A[:, at], B[at], unit)


def _mask(model: Composite, active: tuple[int, ...]) -> Bool[np.ndarray, " Q"]:
    """The active ones among all parameters of the model: data of a program, which then serves all boundaries."""
    mask = np.zeros(model.num_parameters, dtype=bool)
    mask[list(active)] = True
    return mask


def _wv_jacobian(model: Composite, active: Any, tau: Float[Array, " J"]) -> Float[Array, "J Q"]:
    return _jacobian(lambda m: m.wavelet_variance(tau), model, active)


def _estimator(A: Float[Array, "J Q"], whitener: Float[Array, "J J"]) -> tuple[Float[Array, "Q J"], Bool[Array, " Q"]]:
    """B, and which parameters move along a direction that data do not see."""
    A = whitener @ A
    # columns of unit length, so that what is small is a direction that the data do not see, not a unit
    length = jnp.linalg.norm(A, axis=0)
    length = jnp.where(length > 0, length, 1.0)
    U, s, Wt = jnp.linalg.svd(A / length[None, :], full_matrices=False)
    seen = s > _RANK_TOLERANCE * s[0]
    B = ((Wt.T * jnp.where(seen, 1 / jnp.where(seen, s, 1.0), 0.0)[None, :]) @ U.T / length[:, None]) @ whitener
    # a parameter that moves along an unseen direction has no variance; the others have theirs
    return B, 1 - jnp.sum(jnp.where(seen[:, None], Wt * Wt, 0.0), axis=0) > _RANK_TOLERANCE


def delta_method(
    quantity: Callable[[Composite], Array],
    model: Composite,
    active: tuple[int, ...],
    covariance: Any,
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
    The standard error of each entry of the vector; NaN where it depends on a parameter that has none.
    """
    return with_errors(quantity, model, active, covariance)[1]


def with_errors(
    quantity: Callable[[Composite], Array],
    model: Composite,
    active: tuple[int, ...],
    covariance: Any,
) -> tuple[Float[Array, " Q"], Float[Array, " Q"], Float[Array, "Q Q"]]:
    """The values of functions of the model, their standard errors and covariance, in one program; see `delta_method`.

    A row and column of the covariance is NaN where the standard error is.
    """
    return _delta_method(quantity, model, _mask(model, active), _over_all(model, active, covariance))


def with_errors_and_components(
    quantity: Callable[[Composite], Array],
    model: Composite,
    active: tuple[int, ...],
    covariance: Any,
    tau: Any,
) -> tuple[Float[Array, " Q"], Float[Array, " Q"], Float[Array, "Q Q"], Float[Array, "C J"]]:
    """As `with_errors`, and the wavelet variance of each component at spans `tau`: all that tables ask of a fit."""
    return _tables(quantity, model, _mask(model, active), _over_all(model, active, covariance), tau)


def _over_all(model: Composite, active: tuple[int, ...], covariance: Any) -> Any:
    """The covariance of all parameters: zero in each row and column of those that are not active."""
    at = np.asarray(active, dtype=int)
    place = np.full(model.num_parameters, len(at))
    place[at] = np.arange(len(at))
    return namespace(covariance).pad(covariance, (0, 1))[np.ix_(place, place)]


@compiled_quickly(static_argnums=(0,))
def _tables(quantity: Any, model: Composite, active: Any, covariance: Any, tau: Any) -> tuple[Array, ...]:
    return *_delta_method(quantity, model, active, covariance), component_variances(model, tau)


@compiled_quickly(static_argnums=(0,))
def _delta_method(
    quantity: Any, model: Composite, active: Any, covariance: Any
) -> tuple[Float[Array, " R"], Float[Array, " R"], Float[Array, "R R"]]:
    J = _jacobian(quantity, model, active)
    lost = jnp.isnan(jnp.diagonal(covariance))
    found = jnp.where(lost[:, None] | lost[None, :], 0.0, covariance)
    unknown = jnp.any((J != 0) & lost[None, :], axis=1)
    whole = jnp.where(unknown[:, None] | unknown[None, :], jnp.nan, J @ found @ J.T)
    error = jnp.sqrt(jnp.sum((J @ found) * J, axis=1))
    return quantity(model), jnp.where(unknown, jnp.nan, error), whole


@compiled_quickly()
def component_variances(model: Composite, tau: Float[Array, " J"]) -> Float[Array, "C J"]:
    """The wavelet variance of each component."""
    return jnp.stack([p.amplitude * p.unit_wavelet_variance(p.shape, tau) for p in model.processes])


@compiled_quickly(static_argnums=(0,))
def evaluate(quantity: Callable[[Composite], Array], model: Composite) -> Array:
    """Value of a (hashable) function of the model, compiled as a whole."""
    return quantity(model)


def _jacobian(quantity: Callable[[Composite], Array], model: Composite, active: Any) -> Array:
    """In the active parameters; zero in the others, which may be infinite on the real line."""
    J = jax.jacfwd(lambda eta: quantity(model.with_unconstrained(eta)))(model.unconstrained())
    return jnp.where(active[None, :], J, 0.0)


class ConditionalFits(NamedTuple):
    """The model fitted again with some of its parameters held elsewhere, for each of N places of these."""

    values: Any
    """Shape (N, Q): Of the quantity."""
    slopes: Any
    """Shape (N, Q, P): Its derivatives in all parameters on the real line."""
    fitted: Any
    """Shape (N, J): Wavelet variance."""
    estimator: Any
    """Shape (N, P, J): B of the free parameters."""
    whole: Any
    """Shape (N, P, J): B of the free parameters and the tested one."""
    unseen: Any
    """Shape (N, P): Which of the latter move along a direction that data do not see."""


@few_at_a_time
@compiled_quickly(static_argnums=(0,))
def conditional_fits(
    quantity: Callable[[Composite], Array],
    model: Composite,
    places: Float[Array, "N P"],
    free: Bool[Array, " P"],
    tested: Bool[Array, " P"],
    target: Float[Array, " J"],
    whitener: Float[Array, "J J"],
    tau: Float[Array, " J"],
) -> ConditionalFits:
    """Fit a wavelet variance again with parameters held, from places near the minimum, by Gauss-Newton steps.

    Parameters
    ----------
    quantity
        Hashable; model -> vector.
    model
        Its structure; its values do not matter.
    places
        All parameters on the real line: where the free ones start, and where the others stay.
    free
        Those that are fitted.
    tested
        One more, held as well, which `whole` takes for free.
    target
        Wavelet variance to fit.
    whitener, tau
        As of `parameter_covariance`.
    """

    def moved(eta: Array) -> Array:
        return quantity(model.with_unconstrained(eta))

    @jax.jit  # traced once for the steps and for their end
    def linear(etas: Array) -> tuple[Array, Array]:
        """The wavelet variances and their derivatives."""
        return _values_and_jacobians(lambda eta: model.with_unconstrained(eta).wavelet_variance(tau), etas)

    def estimators(A: Array) -> tuple[Array, Array]:
        return jax.vmap(lambda own: _estimator(own, whitener))(A)

    def step(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        etas, _, count = state
        fitted, A = linear(etas)
        B, _ = estimators(jnp.where(free[None, None], A, 0.0))
        move = (B @ (target[None] - fitted)[:, :, None])[:, :, 0]
        move = jnp.clip(jnp.where(jnp.isfinite(move), move, 0.0), -_LONGEST_STEP, _LONGEST_STEP)
        return etas + move, jnp.max(jnp.abs(move), axis=1), count + 1

    def moves(state: tuple[Array, Array, Array]) -> Array:
        return (state[1] > _SETTLED) & (state[2] < _NUM_STEPS)

    num = len(places)
    etas, *_ = while_each(moves, step, (places, jnp.full(num, jnp.inf), jnp.zeros(num, dtype=int)))
    fitted, A = linear(etas)
    # as one batch of decompositions: of two, each may hold a thread of XLA's and wait for one (`few_at_a_time`)
    B, unseen = estimators(jnp.concatenate([jnp.where(taken[None, None], A, 0.0) for taken in (free, free | tested)]))
    return ConditionalFits(*_values_and_jacobians(moved, etas), fitted, B[:num], B[num:], unseen[num:])


def _values_and_jacobians(f: Callable[[Array], Array], at: Float[Array, "N P"]) -> tuple[Array, Array]:
    """A function and its derivatives, traced once for both."""

    def twice(x: Array) -> tuple[Array, Array]:
        value = f(x)
        return value, value

    slopes, values = jax.vmap(jax.jacfwd(twice, has_aux=True))(at)
    return values, slopes
