"""The loss of filters along trajectories, and the search for the best filter of a structure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float, Int

from gmwm_jax._internal.programs import bounded
from nav_jax.filter.error_model import Motion
from nav_jax.filter.experiment import Experiment
from nav_jax.filter.joint_covariance import Noise, covariances_along
from nav_jax.imu.bank import SensorBank
from nav_jax.kinematics.linalg import log_det_and_trace
from nav_jax.lincov._family import Family, Start, Structure

_BROKEN = 1e10
"""Loss of a filter that breaks down: as bad as can be."""
_PULL = 1e-5
"""Of the squared way from the start: what the scenarios do not determine, such as a variance near zero, has an end."""


class Course(eqx.Module):
    """A scenario, prepared."""

    experiment: Experiment
    motion: Motion
    noise: Noise
    epochs: Int[Array, " E"]
    """The segments that count."""


def mean_loss(courses: tuple[Course, ...], bank: SensorBank, objective: str) -> Float[Array, ""]:
    """Mean over the scenarios, of the filter with these states."""
    total = jnp.zeros(())
    for course in courses:
        e = course.experiment
        found = covariances_along(e, course.motion, course.noise, bank, e.initial)
        T, C = (jnp.moveaxis(c.navigation[course.epochs], 0, -1) for c in (found.true, found.claimed))
        if objective == "error":
            losses = jnp.log(jnp.trace(T[:3, :3])) / 2
        else:
            log_det, trace = log_det_and_trace(C, T)
            # rounding makes true covariances negative where a filter believes in noise of 1e38, and the score a bargain
            losses = jnp.where(trace > 0, (log_det + trace) / 2, jnp.nan)
        total = total + jnp.mean(losses)
    return total / len(courses)


class Ended(NamedTuple):
    """The best filter of a structure, and the best part of the truth."""

    best: Start
    loss: float
    converged: bool
    naive: Start | None
    loss_naive: float


@dataclass(frozen=True)
class Search:
    """The search for the best filter of a structure; one compiled program serves all."""

    courses: tuple[Course, ...]
    family: Family
    objective: str
    num_starts: int
    max_steps: int

    def __call__(self, structure: Structure, found: Mapping[Structure, Ended]) -> Ended:
        """The best filter of a structure; `found` are those of smaller ones."""
        starts = self.family.starts(structure)
        mask = self.family.mask(structure)
        at_start = np.array([self._loss(s, mask) for s in starts])
        order = np.argsort(at_start)
        chosen = [starts[i] for i in order[: self.num_starts]]
        chosen += [self.family.extended(found[s].best, s, structure) for s in _smaller(structure, found)][:1]
        # always as many lanes: a search of fewer would be another program
        lanes = self._lanes([*chosen, *[chosen[0]] * (self.num_starts + 1 - len(chosen))], mask)
        ended = _descend(self.courses, self.family, *lanes, self.objective, self.max_steps)
        vectors, converged = (np.asarray(a)[: len(chosen)] for a in ended)
        ends = [s._replace(vector=v, is_part=False) for s, v in zip(chosen, vectors, strict=True)]
        reached = [self._loss(s, mask) for s in ends]
        best, first = int(np.argmin(reached)), starts[order[0]]
        return Ended(
            ends[best],
            reached[best],
            bool(converged[best]),
            first if first.is_part else None,
            float(at_start[order[0]]) if first.is_part else np.nan,
        )

    def _loss(self, start: Start, mask: Any) -> float:
        # one by one: how many there are differs, and each number would be another program
        loss = float(_loss(self.courses, self.family, start.vector, mask, start.walks, self.objective))
        return loss if np.isfinite(loss) else _BROKEN

    def _lanes(self, starts: Sequence[Start], mask: Any) -> tuple[Any, Any, Any]:
        vectors, walks = (jnp.asarray(np.stack([s[i] for s in starts])) for i in range(2))
        return vectors, jnp.broadcast_to(mask, (len(starts), len(mask))), walks


def _smaller(structure: Structure, found: Mapping[Structure, Ended]) -> list[Structure]:
    """Structures with one process less that are done, the better one first."""
    accel, gyro = structure
    return sorted(({(accel - 1, gyro), (accel, gyro - 1)} & found.keys()), key=lambda s: found[s].loss)


@bounded
@eqx.filter_jit
def _loss(
    courses: tuple[Course, ...], family: Family, vector: Any, mask: Array, walks: Any, objective: str
) -> Float[Array, ""]:
    return mean_loss(courses, family.bank(jnp.asarray(vector), mask, jnp.asarray(walks)), objective)


@bounded
@eqx.filter_jit
def _descend(
    courses: tuple[Course, ...],
    family: Family,
    vectors: Array,
    masks: Array,
    walks: Array,
    objective: str,
    max_steps: int,
) -> tuple[Array, Array]:
    """Vectors and whether they converged, of all starts of a structure at once."""
    solver = optx.BFGS(rtol=1e-5, atol=1e-5)

    def one(start: Array, mask: Array, walk: Array):
        def loss(x: Array, _: None) -> Array:
            # a program of its own, which the solver traces once wherever it asks for the loss
            value = _loss(courses, family, x, mask, walk, objective)
            return jnp.where(jnp.isfinite(value), value, _BROKEN) + _PULL * jnp.sum((x - start) ** 2)

        found = optx.minimise(loss, solver, start, max_steps=max_steps, throw=False)
        return found.value, found.result == optx.RESULTS.successful

    return jax.vmap(one)(vectors, masks, walks)
