"""The estimator as a pure function: from moments and weights to estimates, for one's own `jit`, `vmap` and `grad`.

The minimum is found by the search of `gmwm_jax.fitting.search`, through which nobody differentiates. What is
differentiated is the condition that holds there (the implicit function theorem): with z the search coordinates and the
logarithms of the amplitudes that are inside their range, g = dQ/dz = 0 for all data, so that

    dz = -(dg/dz)^-1 (dg/dnu dnu + dg/dOmega dOmega + ...),

of any order, forward and in reverse. A component whose amplitude is zero, or a shape at an end of its range, does not
move with the data: the derivative is that of the problem without it, from the side on which it stays there. A direction
that the data do not see is left out (a least-squares solve).
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float

from gmwm_jax._internal.checks import concrete, require_x64
from gmwm_jax._internal.xla_threads import few_at_a_time
from gmwm_jax.fitting.bounds import Bounds
from gmwm_jax.fitting.problem import Problem, require_fittable
from gmwm_jax.fitting.reduced import Data, Layout, columns_and_slopes
from gmwm_jax.fitting.search import SIZE, Solution, minimise, smallest_slope
from gmwm_jax.fitting.weights import AbstractWeights, WeightsLike, as_weights, root_of
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.parameter import Fixed
from gmwm_jax.processes.registry import as_model
from gmwm_jax.variance.wavelet import WaveletVariance, WaveletVariances

_UNSEEN = 1e-11
"""Of the largest singular value of the second derivative: a direction below it is not seen by the data."""
_AT_END = 1e-6
"""Of a search coordinate: this close to an end of its range it is there."""


class Estimates(eqx.Module):
    """What `estimate` returns; a pytree, with a leading axis where it was mapped over a batch."""

    model: Composite
    """The estimated model; components of a kind from the shortest correlation time on, those at zero last."""
    objective: Float[Array, "*B"]
    """Q = (nu_hat - nu)' Omega (nu_hat - nu)."""
    converged: Bool[Array, "*B"]
    """Did the search end at a minimum?"""
    at_zero: Bool[Array, "*B P"]
    """Components, in the order of the model, whose amplitude is zero."""
    at_bound: Bool[Array, "*B Q"]
    """Parameters, in the order of `parameters`, that are at one of the bounds they were given."""
    agreement: Float[Array, "*B"]
    """Share of the descents that came to this minimum."""

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters by name, such as ``GM_1 beta``."""
        model = self.model
        return {
            f"{label} {q.name}": value
            for label, p in zip(model.labels, model.processes, strict=True)
            for q, value in zip(p.parameters, p.values, strict=True)
        }

    def __repr__(self) -> str:
        """In two lines: values, shapes of a batch, question marks while they are traced."""
        if not all(map(eqx.is_array_like, jax.tree.leaves(self))):  # shapes, specifications, whatever a tree may hold
            return eqx.tree_pformat(self)
        converged, objective, agreement = map(concrete, (self.converged, self.objective, self.agreement))
        if converged is None or objective is None or agreement is None:
            said = "traced"
        elif converged.ndim:
            said = (
                f"a batch of {' x '.join(map(str, converged.shape))}, of which {np.sum(converged)} searches converged"
            )
        else:
            end = "converged" if converged else "did NOT converge"
            said = f"objective {objective:.8g}; the search {end}, {agreement:.0%} of the descents came to this minimum"
            held = concrete(self.at_bound)
            names = (
                [name for name, there in zip(self.parameters, held, strict=True) if there] if held is not None else []
            )
            said += f"; at a bound: {', '.join(names)}" if names else ""
        return f"Estimates: {self.model!r}\n{said}"


def estimate(
    wv: WaveletVariance | WaveletVariances,
    model: str | AbstractProcess | Composite,
    *,
    weights: WeightsLike = None,
    bounds: Bounds | None = None,
) -> Estimates:
    """Estimate a model from the wavelet variance of one channel: `gmwm_jax.fit` as a pure function of its arrays.

    jit it, vmap it over wavelet variances, weights, starting and held values, differentiate it by them to any order.

    Parameters
    ----------
    wv
        One channel; for a batch, map over a `WaveletVariance` whose arrays have a leading axis, or over arrays with
        which `dataclasses.replace` makes one.
    model
        As for `gmwm_jax.fit`; what it holds or starts from may be traced.
    weights
        As for `gmwm_jax.fit`, but not ``"iterated"``; an array may be traced: (J,), or (J, J) positive definite.
        A scale whose weight is zero is left out.
    bounds
        Name of a parameter -> the two values, per sample, that it lies between, which may be traced:
        ``{"GM beta": (1 / (1000 * rate), 1 / (10 * rate))}`` for a correlation time of 10 to 1000 s; 0 or infinity
        where one of them is open. Components with bounds stay where they stand in the model.

    Returns
    -------
    Estimates

    Raises
    ------
    ValueError
        More free parameters than scales, unknown process, iterated weights, weights of another shape, several channels;
        bounds of a parameter that is unknown or held, that are no range, or of a shape that is searched for together
        with others (ARMA).
    RuntimeError
        x64 is off.

    Notes
    -----
    Derivatives are those of the minimum that was found. Where a component comes or goes, or the minimum changes to
    another one, the estimate has a kink or a jump, and its derivative is one-sided. A parameter at a bound moves with
    the bound and with nothing else; the others move as where it is held. Nothing is raised while values are traced:
    look at `converged`.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> found = gj.fitting.estimate(wv, "WN + RW")
    >>> abs(float(found.objective) / gj.fit(wv, "WN + RW").objective - 1) < 1e-9
    True
    >>> from dataclasses import replace
    >>> by_scale = jax.grad(lambda nu: gj.fitting.estimate(replace(wv, variance=nu), "WN").parameters["WN sigma2"])
    >>> by_scale(jnp.asarray(wv.variance)).shape == wv.scales.shape
    True
    """
    require_x64()
    model, weights = as_model(model), as_weights(weights)
    if not isinstance(wv, WaveletVariance) or np.ndim(wv.variance) != 1:
        raise ValueError(f"estimate() takes one channel, and this has {np.shape(wv.variance)}: take wv[0], or vmap it.")
    if weights.num_rounds > 1:
        raise ValueError(f'Weights "{weights.name}" go on until nothing changes, which no pure function does: take '
                         '"covariance", or fit().')  # fmt: skip
    require_fittable(model, wv)
    if weights.needs_theory:
        wv.require_theory(f'Weights "{weights.name}"')
    problem = Problem.of(model, float(wv.scales[-1]), bounds)
    places = problem.starting_points(None)
    return _with_weights(problem, places, wv, weights)


def _with_weights(
    problem: Problem, places: tuple[Any, Any], wv: WaveletVariance, weights: AbstractWeights
) -> Estimates:
    """Estimate with weights that may need a first estimate."""
    if weights.first is None:
        omega = weights.omega(wv)
    else:
        first = _with_weights(problem, places, wv, weights.first).model
        omega = weights.omega(wv, first, wv.covariance_under(first) if weights.needs_theory else None)
    return solve(problem, places, wv.scales, wv.variance, omega)


def solve(problem: Problem, places: tuple[Any, Any], tau: Any, nu: Any, omega: Any) -> Estimates:
    """The minimum of a problem for moments nu and weights Omega, and how it moves with them.

    Parameters
    ----------
    problem
        The model; what it holds may be traced.
    places
        Where the search starts, see `Problem.starting_points`.
    tau, nu, omega
        Spans (J,), moments (J,), weights (J, J).
    """
    z, objective, solution = _solve(
        problem.layout, places, jnp.asarray(tau), jnp.asarray(nu), jnp.asarray(omega), problem.bounds, problem.shapes,
        problem.held, None if problem.box is None else problem.box[:4],
    )  # fmt: skip
    model, order = _assembled(problem, z)
    converged = jnp.isfinite(solution.objective) & (solution.slope <= smallest_slope(solution.objective))
    agreement = solution.num_agreeing / problem.num_descents
    at_bound = [z.at_bound[k, : len(p.parameters)] for k, p in zip(order, model.processes, strict=True)]
    at_zero = (solution.amplitudes == 0)[jnp.stack(order)]
    return Estimates(model, objective, converged, at_zero, jnp.concatenate(at_bound), agreement)


class _Point(NamedTuple):
    """Where the optimality condition is solved."""

    coordinates: Float[Array, " C"]
    relative: Float[Array, " P"]
    """Amplitudes over those that were found; one where nothing was."""


class _Condition(NamedTuple):
    """What the condition depends on."""

    layout: Layout
    tau: Float[Array, " J"]
    nu: Float[Array, " J"]
    omega: Float[Array, "J J"]
    shapes: Any
    held: Float[Array, " P"]
    free: Bool[Array, " P"]
    """Amplitudes that are neither held nor at a bound."""
    found: _Point
    active: _Point
    """Whether each moves with the data."""
    amplitudes: Float[Array, " P"]
    unit: Float[Array, ""]


class _Minimum(NamedTuple):
    coordinates: Float[Array, " C"]
    amplitudes: Float[Array, " P"]
    at_zero: Bool[Array, " P"]
    at_bound: Bool[Array, "P N"]
    """Of each parameter; N is the largest number that a component has."""


def _solve_once(
    layout: Layout, places: Any, tau: Any, nu: Any, omega: Any, bounds: Any, shapes: Any, held: Any, box: Any
) -> tuple[_Minimum, Array, Solution]:
    import lineax as lx  # with optimistix 0.1 s to import
    import optimistix as optx

    still = jax.lax.stop_gradient
    whitener = root_of(still(omega))
    whitened = whitener @ still(nu)
    unit = jnp.max(jnp.abs(whitened)) / SIZE
    bounds, held = jnp.asarray(bounds), jnp.asarray(held)
    limits = None if box is None else jnp.asarray(box[1])
    data = Data(whitened / unit, whitener / unit, tau, still(bounds), still(shapes), still(held), limits=still(limits))
    solution = minimise(layout, *map(jnp.asarray, still(places)), data)

    zero = solution.amplitudes == 0
    at_bound, limit = _at_bounds(layout, solution, data.bounds, limits, box)
    free = jnp.asarray(layout.free_amplitude) & ~at_bound.amplitudes
    inside = jnp.all(jnp.abs(solution.coordinates[:, None] - data.bounds) > _AT_END, axis=1)
    owned = zero[layout.owners] if layout.num_shapes else jnp.zeros(0, dtype=bool)
    active = _Point(inside & ~owned, free & ~zero)
    at = still(jnp.where(zero, 1.0, solution.amplitudes))
    # amplitudes that are held or at a bound move with what holds them, and so do coordinates at a bound
    held = jnp.where(at_bound.amplitudes, limit, held)
    nearest = jnp.argmin(jnp.abs(solution.coordinates[:, None] - data.bounds), axis=1)
    ends = jnp.take_along_axis(bounds, nearest[:, None], axis=1)[:, 0]
    found = _Point(jnp.where(at_bound.coordinates, ends, solution.coordinates), jnp.ones_like(at))
    condition = _Condition(layout, tau, nu, omega, shapes, held, free, found, active, at, unit)
    solver = lx.SVD(rcond=_UNSEEN)
    # functions that capture nothing, as it asks
    z, _ = optx.ImplicitAdjoint(solver).apply(
        lambda inputs: (inputs[0].found, None), lambda z, _, inputs: _slope(z, inputs[0]), (condition,), frozenset()
    )
    amplitudes = jnp.where(zero, 0.0, jnp.where(free, at * z.relative, held))
    minimum = _Minimum(z.coordinates, amplitudes, zero, _by_parameter(layout, at_bound, zero))
    residual = nu - amplitudes @ _columns(layout, z.coordinates, shapes, tau)[0]
    return minimum, residual @ omega @ residual, solution


_solve = few_at_a_time(jax.jit(_solve_once, static_argnums=0))


class _AtBounds(NamedTuple):
    """Which of them are at a bound of the user."""

    coordinates: Bool[Array, " C"]
    amplitudes: Bool[Array, " P"]


def _at_bounds(
    layout: Layout, solution: Solution, bounds: Float[Array, "C 2"], limits: Float[Array, "P 2"] | None, box: Any
) -> tuple[_AtBounds, Float[Array, " P"]]:
    """What is at a bound, and the bound that each amplitude is nearest to."""
    if box is None or limits is None:
        none = _AtBounds(*(jnp.zeros(len(x), dtype=bool) for x in (solution.coordinates, solution.amplitudes)))
        return none, jnp.zeros_like(solution.amplitudes)
    _, _, given_coordinates, given_amplitudes = (jnp.asarray(part) for part in box)
    near = jnp.abs(solution.coordinates[:, None] - bounds) <= _AT_END
    there = (solution.amplitudes[:, None] == jax.lax.stop_gradient(limits)) & given_amplitudes
    there = there & jnp.asarray(layout.free_amplitude)[:, None]
    coordinates = jnp.any(near & given_coordinates, axis=1)
    return _AtBounds(coordinates, jnp.any(there, axis=1)), jnp.where(there[:, 1], limits[:, 1], limits[:, 0])


def _by_parameter(layout: Layout, at_bound: _AtBounds, zero: Bool[Array, " P"]) -> Bool[Array, "P N"]:
    """The same by component and parameter; the shape of a component that is zero is nowhere."""
    rows = [[jnp.asarray(False)] * len(kind.parameters) for kind in layout.kinds]
    for i, row in enumerate(rows):
        row[-1] = at_bound.amplitudes[i]
        at = layout.position(i) if i < layout.num_shapes else None
        if isinstance(at, int):
            row[0] = at_bound.coordinates[at] & ~zero[i]
    num = max(map(len, rows))
    return jnp.stack([jnp.stack(row + [jnp.asarray(False)] * (num - len(row))) for row in rows])


def _slope(z: _Point, c: _Condition) -> _Point:
    """dQ/2 by what moves with the data, and by how much the rest has moved: zero at the minimum."""
    amplitudes = jnp.where(c.free, c.amplitudes * z.relative * _kept(c), c.held)
    columns, slopes = _columns(c.layout, z.coordinates, c.shapes, c.tau)
    pull = -(c.omega @ (c.nu - amplitudes @ columns)) / c.unit**2
    slope = _Point(amplitudes[c.layout.owners] * (slopes @ pull), c.amplitudes * (columns @ pull))
    return jax.tree.map(lambda g, now, then, on: jnp.where(on, g, now - then), slope, z, c.found, c.active)


def _kept(c: _Condition) -> Float[Array, " P"]:
    """One for amplitudes that are not zero."""
    return jnp.where(c.free & ~c.active.relative, 0.0, 1.0)


def _columns(
    layout: Layout, coordinates: Float[Array, " C"], shapes: Any, tau: Float[Array, " J"]
) -> tuple[Float[Array, "P J"], Float[Array, "C J"]]:
    """Unit wavelet variances of all components, and their derivatives along the search coordinates."""
    given = [k.unit_wavelet_variance(s, tau) for k, s in zip(layout.kinds[layout.num_shapes :], shapes, strict=True)]
    if not layout.num_shapes:
        return jnp.stack(given), jnp.zeros((0, tau.shape[0]))
    columns, slopes = columns_and_slopes(layout, coordinates, tau)
    return jnp.concatenate([columns, *(g[None] for g in given)]), slopes


def _assembled(problem: Problem, z: _Minimum) -> tuple[Composite, list[Array]]:
    """The model with its estimates in the user's order, and which component of the problem stands where."""
    layout, values = problem.layout, []
    for i, p in enumerate(problem.processes):
        shape = p.shape
        if layout.free_shape[i]:
            shape = tuple(p.shape_from_coordinate(z.coordinates[layout.position(i)]))
        # the square root that some values are of their amplitude has no slope at zero
        value = jnp.where(z.at_zero[i], 0.0, p.value_of(jnp.where(z.at_zero[i], 1.0, z.amplitudes[i])))
        values.append((*shape, value))
    placed: dict[int, AbstractProcess] = {}
    place: dict[int, Array] = {}
    for members in _alike(problem):
        p = problem.processes[members[0]]
        columns = [jnp.stack([jnp.asarray(values[m][k]) for m in members]) for k in range(len(p.parameters))]
        order = jnp.arange(len(members))
        if len(members) > 1:
            times = jnp.stack([jnp.asarray(p.correlation_time(values[m][:-1])) for m in members])
            order = jnp.argsort(jnp.where(z.at_zero[jnp.asarray(members)], jnp.inf, jax.lax.stop_gradient(times)))
        build: Any = type(p)
        for k, position in enumerate(sorted(problem.order[m] for m in members)):
            named = {q.name: column[order[k]] for q, column in zip(p.parameters, columns, strict=True)}
            placed[position] = build(**{n: Fixed(v) if n in p.fixed else v for n, v in named.items()})
            place[position] = jnp.asarray(members)[order[k]]
    positions = sorted(placed)
    return Composite([placed[i] for i in positions]), [place[i] for i in positions]


def _alike(problem: Problem) -> list[list[int]]:
    """Components that may change places: of one kind, holding the same, and without bounds."""
    groups: dict[Any, list[int]] = {}
    for i, p in enumerate(problem.processes):
        own = problem.box is not None and problem.box.of_component[i]
        groups.setdefault((type(p), p.fixed, i if own else None), []).append(i)
    return list(groups.values())
