"""A model as the estimator sees it: what is static, what is searched for, what is held; and the way back."""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.checks import concrete
from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.fitting._start import lattice
from gmwm_jax.fitting.bounds import Bounds, Box, box_of, by_component
from gmwm_jax.fitting.outcome import Outcome
from gmwm_jax.fitting.reduced import Layout
from gmwm_jax.fitting.search import NUM_DESCENTS, NUM_ROUNDS, Solution
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.parameter import Fixed
from gmwm_jax.variance.wavelet import WaveletVariance

_MOVED = np.log(4.0)
"""How far starts lie from an estimate: where the objective differs by noise alone, so does its minimum."""


class Problem(NamedTuple):
    """Components with a shape to search for come first, those of a kind together."""

    processes: tuple[AbstractProcess, ...]
    order: tuple[int, ...]
    """Position of each in the model."""
    layout: Layout
    bounds: Float[np.ndarray, "C 2"]
    shapes: tuple[Any, ...]
    """Of the components whose shape is given."""
    held: Float[np.ndarray, " P"]
    """Amplitudes that are held; 0 for those that are free."""
    tau_max: float
    """Longest span."""
    box: Box | None = None
    """Bounds of the user; None without them."""

    @classmethod
    def of(cls, model: Composite, tau_max: float, bounds: Bounds | None = None) -> "Problem":
        """Pose the problem of estimating a model from spans up to tau_max, with parameters between bounds.

        Raises
        ------
        ValueError
            Some of the shape parameters of a process are held, and others are not; bounds that cannot be.
        """
        kinds = [type(p) for p in model.processes]
        order = sorted(
            range(len(kinds)), key=lambda i: (not _has_free_shape(model.processes[i]), kinds.index(kinds[i]))
        )
        processes = tuple(model.processes[i] for i in order)
        layout = Layout(
            kinds=tuple(type(p) for p in processes),
            free_shape=tuple(_has_free_shape(p) for p in processes),
            free_amplitude=tuple(p.parameters[-1].name not in p.fixed for p in processes),
            bounded=bool(bounds),
        )
        searched, given = processes[: layout.num_shapes], processes[layout.num_shapes :]
        held = [0.0 if free else p.amplitude for p, free in zip(processes, layout.free_amplitude, strict=True)]
        ends = np.concatenate(
            [np.zeros((0, 2)), *(np.reshape(p.coordinate_bounds(tau_max), (-1, 2)) for p in searched)]
        )
        box = None
        if bounds:
            own = by_component(bounds, model)
            places = [layout.position(k) for k in range(layout.num_shapes)]
            box = box_of(processes, [own[i] for i in order], ends, places)
        return cls(
            processes,
            tuple(order),
            layout,
            ends if box is None else box.coordinates,
            tuple(p.shape for p in given),
            namespace(*known(*held)).stack(known(*held)),
            tau_max,
            box,
        )

    @property
    def searched(self) -> tuple[AbstractProcess, ...]:
        """The components with a shape to search for."""
        return self.processes[: self.layout.num_shapes]

    @property
    def num_descents(self) -> int:
        """Of a global search."""
        return NUM_ROUNDS * NUM_DESCENTS if self.searched else 1

    # -- where to look --------------------------------------------------------------------------------------------

    def starting_points(
        self, key: PRNGKey | None
    ) -> tuple[Float[Array | np.ndarray, "S C"], Float[Array | np.ndarray, "S C"]]:
        """The lattice, and once more with the starting values that the model gives."""
        searched, box = self.searched, self.box
        placements, nodes = lattice(tuple(type(p) for p in searched), self.tau_max, key, alike=box is None)
        if box is not None:  # as many starts within a range of the user as there were in all
            placements, nodes = (box.scaled(at) for at in (placements, nodes))
        given = {k: p.coordinate_from_shape(known(*p.shape)) for k, p in enumerate(searched) if None not in p.shape}
        if given:
            xp, at = namespace(*given.values()), [placements[:, c] for c in range(placements.shape[1])]
            for k, coordinates in given.items():
                if box is not None:
                    coordinates = xp.clip(coordinates, *box.coordinates[self.layout.position(k)].T)
                for c, value in zip(np.r_[self.layout.position(k)], xp.atleast_1d(coordinates), strict=True):
                    at[c] = xp.broadcast_to(value, at[c].shape)
            moved = xp.stack(at, axis=1)
            placements, nodes = xp.concatenate([moved, placements]), np.concatenate([nodes, nodes])
        return placements, nodes

    def starts_near(self) -> Float[np.ndarray, "S C"]:
        """Starts around the coordinates of the model itself."""
        at = [np.zeros(0), *(np.atleast_1d(p.coordinate_from_shape(known(*p.shape))) for p in self.searched)]
        return self.starts_around(np.concatenate(at))

    def starts_around(self, at: Float[np.ndarray, " C"]) -> Float[np.ndarray, "S C"]:
        """Coordinates, and those with one of them moved."""
        moves = _MOVED * np.eye(len(at))
        return np.clip(np.concatenate([at[None], at + moves, at - moves]), *self.bounds.T)

    # -- the way back ---------------------------------------------------------------------------------------------

    def assemble(self, solution: Solution) -> tuple[Composite, dict[str, Outcome]]:
        """The model with its estimates in the user's order, and which components are at a boundary."""
        layout, fitted = self.layout, []
        for i, p in enumerate(self.processes):
            shape, note = p.shape, Outcome.ESTIMATED
            if layout.free_shape[i]:
                own = solution.coordinates[layout.position(i)]
                shape = tuple(float(s) for s in p.shape_from_coordinate(own))
                limit = p.limit_of(shape, self.tau_max)
                # where both parameters run off together, one that is held keeps the other
                if limit and (layout.free_amplitude[i] or p.parameters[-1].determined_at is limit):
                    note = Outcome.at(limit)
            amplitude = float(solution.amplitudes[i])
            if amplitude == 0:
                note = Outcome.ZERO
            values = (*shape, p.value_of(amplitude))
            named = {q.name: v for q, v in zip(p.parameters, values, strict=True)}
            build: Any = type(p)
            fitted.append((build(**{n: Fixed(v) if n in p.fixed else v for n, v in named.items()}), note))

        times = [float(p.correlation_time(known(*p.shape))) if p.shape else 0.0 for p, _ in fitted]
        placed = [fitted[i] for i in self._slots(times, [note is Outcome.ZERO for _, note in fitted])]
        model = Composite([p for p, _ in placed])
        return model, {label: note for label, (_, note) in zip(model.labels, placed, strict=True) if note}

    def parameter_values(self, solution: Solution) -> Float[np.ndarray, "B P"]:
        """Parameters of B solutions in the order of the model."""
        columns, times = [], []
        for i, p in enumerate(self.processes):
            shape = p.shape
            if i < self.layout.num_shapes:
                shape = p.shape_from_coordinate(solution.coordinates[:, self.layout.position(i)])
            values = [*shape, p.value_of(solution.amplitudes[:, i])]
            columns.append(np.stack(np.broadcast_arrays(*map(np.asarray, values)), axis=1))
            times.append(np.broadcast_to(p.correlation_time(shape) if shape else 0.0, len(solution.objective)))
        time, gone = np.stack(times, axis=1), solution.amplitudes == 0
        return np.stack(
            [np.concatenate([columns[i][b] for i in self._slots(time[b], gone[b])]) for b in range(len(time))]
        )

    def fitted_variances(self, solution: Solution, tau: Float[np.ndarray, " J"]) -> Float[np.ndarray, "B J"]:
        """Wavelet variances of B solutions."""
        return np.asarray(_fitted_variances(self.layout, self.shapes, solution, tau))

    def _slots(self, times: Sequence[float] | Float[np.ndarray, " P"], gone: Any) -> list[int]:
        """For each position in the model, the component (in the order of the problem) that belongs there.

        Components of a kind stand from fast to slow; what has no variance has no correlation time either, and comes
        last.

        Parameters
        ----------
        times
            Correlation time of each component.
        gone
            Which of them have no variance.
        """
        placed = [0] * len(self.order)
        for kind in set(self.layout.kinds):
            members = [i for i, k in enumerate(self.layout.kinds) if k is kind]
            ranked = sorted(members, key=lambda i: (bool(gone[i]), float(times[i])))
            for position, member in zip(sorted(self.order[i] for i in members), ranked, strict=True):
                placed[position] = member
        return placed


def require_fittable(model: Composite, wv: WaveletVariance, omega: Any = None) -> None:
    """Raise a ValueError if there are fewer scales than free parameters, or a drift in a robust wavelet variance.

    Parameters
    ----------
    model, wv
        What is fitted to what.
    omega
        Its weights, shape (J, J): scales whose weights are zero do not count.
    """
    wv.estimator.require_fittable(model)
    seen = None if omega is None else concrete(omega)
    left_out = 0 if seen is None else int(np.sum(np.diagonal(seen) == 0))
    if model.num_free > wv.num_scales - left_out:
        without = f", {left_out} of which have no weight" if left_out else ""
        raise ValueError(
            f"{model} has {model.num_free} free parameters and the wavelet variance {wv.num_scales} scales{without}: "
            "take a longer record, a smaller model, or hold parameters."
        )


def _has_free_shape(p: AbstractProcess) -> bool:
    names = [q.name for q in p.parameters[:-1]]
    held = [n for n in names if n in p.fixed]
    if held and len(held) < len(names):
        raise ValueError(f"{p.kind}: the coefficients are estimated together. Hold all of {', '.join(names)} or none.")
    return len(held) < len(names)


@partial(jax.jit, static_argnums=0)
def _fitted_variances(layout: Layout, shapes: Any, solution: Solution, tau: Any) -> Float[Array, "B J"]:
    total = jnp.zeros((solution.amplitudes.shape[0], tau.shape[0]))
    for i, kind in enumerate(layout.kinds):
        if i < layout.num_shapes:
            unit = jax.vmap(lambda z, kind=kind: kind.unit_wavelet_variance(kind.shape_from_coordinate(z), tau))(
                solution.coordinates[:, layout.position(i)]
            )
        else:
            unit = kind.unit_wavelet_variance(shapes[i - layout.num_shapes], tau)[None]
        total = total + solution.amplitudes[:, i, None] * unit
    return total
