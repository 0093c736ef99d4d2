"""Noise models of one axis as nav_jax takes them from gmwm_jax: checked, drawn, in state-space form."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Key

from gmwm_jax import GM, RW, WN, Composite, parse_model, simulate
from gmwm_jax._internal.checks import as_float, concrete, positive
from gmwm_jax._internal.host import known
from gmwm_jax._internal.typing import Real
from gmwm_jax.processes import StateSpace

NoiseModel = Composite
"""The noise of one axis of a sensor; no other file needs to know whose class it is."""


def as_model(model: Any, what: str) -> Composite:
    """Return a complete composite from a process, sum, text or fit, without its components of amplitude zero.

    Of a fit its reduced form: a Gauss-Markov process at its limit is a random walk or white noise, whose stationary
    variance means nothing.

    Raises
    ------
    ValueError
        It is none of these, or has a parameter without value.
    """
    model = getattr(model, "reduced", model)
    if isinstance(model, str):
        model = parse_model(model)
    elif not isinstance(model, Composite):
        try:
            model = Composite((model,))
        except TypeError as error:
            raise ValueError(
                f"{what}: a noise model is wanted (of gmwm_jax, or a fit), and this is {model!r}."
            ) from error
    for process in model.processes:
        process.require_complete()
    # a component that a fit has put to zero is no state: its variance would be singular
    kept = [p for p in model.processes if (a := concrete(p.amplitude)) is None or a > 0]
    return Composite(kept or model.processes[:1])


def axis_noise(given: Any, what: str) -> NoiseModel:
    """Return the noise of one axis: white with a standard deviation if it is a number, else a model.

    Raises
    ------
    ValueError
        A standard deviation that is not positive, or no model.
    """
    if isinstance(given, int | float | np.ndarray | np.number | Array):
        positive(f"{what}: a standard deviation", given)
        (sd,) = known(as_float(given))
        return Composite((WN(sd**2),))
    return as_model(given, what)


def scaled(model: NoiseModel, factor: Real) -> NoiseModel:
    """The same noise with standard deviations so many times as large."""

    def process(p: Any) -> Any:
        # the amplitude of a process is that of its covariance
        value = as_float(p.value_of(factor**2 * p.amplitude))
        return eqx.tree_at(lambda q: getattr(q, p.parameters[-1].name), p, value)

    return eqx.tree_at(lambda m: m.processes, model, tuple(process(p) for p in model.processes))


def markov_form(model: NoiseModel, what: str) -> StateSpace:
    """The state-space form of all processes of a model together.

    Raises
    ------
    ValueError
        A process has none.
    """
    forms = [complete_form(p, what) for p in model.processes]
    return StateSpace(
        block_diagonal([f.transition for f in forms]),
        block_diagonal([f.driving for f in forms]),
        jnp.concatenate([f.readout for f in forms]),
        block_diagonal([f.initial for f in forms]),
        jnp.sum(jnp.stack([f.white for f in forms])),
    )


@jax.jit
def filter_form(process: Any) -> StateSpace | None:
    """`AbstractProcess.filter_form` as one program."""
    return process.filter_form()


def states_in_filter(process: Any) -> int | None:
    """Number of states by which a filter holds a process, 0 of white noise; None where it leaves the process out."""
    form = jax.eval_shape(filter_form, process)
    return None if form is None else len(form.readout)


def constant_form(sd: Float[Array, ""]) -> StateSpace:
    """The state-space form of a constant that is drawn once, with this standard deviation."""
    one, zero = jnp.ones((1, 1)), jnp.zeros((1, 1))
    return StateSpace(one, zero, jnp.ones(1), sd**2 * one, zero[0, 0])


def markov_model(white: float, processes: Sequence[tuple[float, float]], walks: Sequence[float] = ()) -> NoiseModel:
    """White noise of a variance, Gauss-Markov processes of inverse correlation times and driving variances, walks."""
    parts = [GM(beta, driving / -np.expm1(-2 * beta)) for beta, driving in processes]
    return Composite((WN(white), *parts, *(RW(gamma2) for gamma2 in walks)))


def correlation_time(form: StateSpace, longest: float) -> tuple[float, float]:
    """Variance of what a form adds to a sample, and the samples after which its autocorrelation is below 1/e."""
    Phi, h, P = (np.asarray(a, dtype=float) for a in (form.transition, form.readout, form.initial))
    variance, lag, power = h @ P @ h, 1, Phi
    while lag < longest and h @ power @ P @ h > variance / np.e:
        lag, power = 2 * lag, power @ power
    return float(variance), float(lag)


def draw(model: NoiseModel, num_samples: int, keys: Key[Array, " R"]) -> Float[Array, "N R"]:
    """Draw a short record of a model for each key, as of an aiding sensor."""
    return jax.vmap(lambda key: simulate(model, num_samples, key=key), out_axes=1)(keys)


def draw_each(models: Sequence[NoiseModel], num_samples: int, keys: Key[Array, "K R"]) -> Float[Array, "N K R"]:
    """Draw a record of each model for each of its keys.

    Models that differ in numbers only are drawn together, once in a program, which is sooner compiled.
    """
    if len({jax.tree.structure(model) for model in models}) > 1:
        return jnp.stack([draw(m, num_samples, k) for m, k in zip(models, keys, strict=True)], axis=1)
    together = jax.tree.map(lambda *values: jnp.stack(values), *models)
    return jax.vmap(lambda model, keys: draw(model, num_samples, keys), out_axes=1)(together, keys)


@jax.jit
def white_sd(model: NoiseModel) -> Float[Array, ""]:
    """Standard deviation of a sample of a model: what a filter that takes it as white noise should believe.

    Raises
    ------
    ValueError
        The model has none that lasts (a random walk, a drift).
    """
    variance = jnp.zeros(())
    for process in model.processes:
        try:
            variance = variance + process.autocovariance(jnp.zeros(1))[0]
        except ValueError as error:
            raise ValueError(
                f"{process.kind} has no constant variance that a filter could take as white: state the standard "
                "deviation that the filter believes."
            ) from error
    return jnp.sqrt(variance)


def complete_form(process: Any, what: str) -> StateSpace:
    """The state-space form of a process, also of one that no filter holds.

    Raises
    ------
    ValueError
        It has none.
    """
    form = process.state_space()
    if form is not None:
        return form
    raise ValueError(
        f"{process.kind} of {what} has no state-space form, and so no covariance that could be propagated: replace "
        "it, a flicker noise by gmwm_jax.processes.flicker_ladder, or run a Monte Carlo."
    )


def block_diagonal(parts: list[Any]) -> Float[Array, "M M"]:
    """Matrices along the diagonal; of none, a matrix without rows."""
    # block_diag of nothing has a row
    return jax.scipy.linalg.block_diag(*parts) if parts else jnp.zeros((0, 0))
