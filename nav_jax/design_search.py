"""The loss of a filter along trajectories, and the search for the filters of many structures at once."""

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Float, Int

from nav_jax.design_family import Family
from nav_jax.error_model import Motion
from nav_jax.experiment import Experiment
from nav_jax.linalg import log_det_and_trace
from nav_jax.lincov import Noise, covariances_along
from nav_jax.sensor_bank import SensorBank

_BROKEN = 1e10


class Course(eqx.Module):
    """A scenario, prepared."""

    experiment: Experiment
    motion: Motion
    noise: Noise
    epochs: Int[Array, " E"]
    """The segments that count."""


def mean_loss(courses: tuple[Course, ...], bank: SensorBank, objective: str) -> Float[Array, ""]:
    """Mean over the scenarios."""
    total = jnp.zeros(())
    for course in courses:
        e = course.experiment
        found = covariances_along(e, course.motion, course.noise, bank, e.initial)
        T, C = found.true.navigation[course.epochs], found.claimed.navigation[course.epochs]
        if objective == "error":
            total = total + jnp.mean(jnp.log(jnp.trace(T[:, :3, :3], axis1=1, axis2=2))) / 2
        else:
            total = total + jnp.mean(_score(T, C))
    return total / len(courses)


def _score(T: Float[Array, "E 9 9"], C: Float[Array, "E 9 9"]) -> Float[Array, " E"]:
    """(log det C + tr(C^-1 T))/2."""
    log_det, trace = log_det_and_trace(jnp.moveaxis(C, 0, -1), jnp.moveaxis(T, 0, -1))
    return (log_det + trace) / 2


@eqx.filter_jit
def losses(
    courses: tuple[Course, ...], family: Family, vectors: Array, masks: Array, objective: str
) -> Float[Array, " lanes"]:
    """Of many filters at once."""
    return jax.vmap(lambda x, m: mean_loss(courses, family.bank(x, m), objective))(vectors, masks)


@eqx.filter_jit
def search_filters(
    courses: tuple[Course, ...], family: Family, vectors: Array, masks: Array, objective: str, max_steps: int
) -> tuple[Array, Array, Array]:
    """Vectors, losses and whether they converged, of all lanes at once."""
    solver = optx.BFGS(rtol=1e-5, atol=1e-5)

    def one(start: Array, mask: Array):
        def loss(x: Array, _: None) -> Array:
            value = mean_loss(courses, family.bank(x, mask), objective)
            # a filter that breaks down is as bad as can be
            return jnp.where(jnp.isfinite(value), value, _BROKEN)

        found = optx.minimise(loss, solver, start, max_steps=max_steps, throw=False)
        return found.value, loss(found.value, None), found.result == optx.RESULTS.successful

    return jax.vmap(one)(vectors, masks)
