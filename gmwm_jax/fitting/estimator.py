"""`fit`: from a wavelet variance and a model to its estimates, all channels at once."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.checks import agreed_rate, confidence, require_x64, typed_key
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.fitting._start import lattice
from gmwm_jax.fitting.problem import Problem, pose, slots
from gmwm_jax.fitting.result import Fit, Fits, Status
from gmwm_jax.fitting.search import NUM_DESCENTS, NUM_ROUNDS, SIZE, Data, Layout, Solution, minimise, smallest_slope
from gmwm_jax.fitting.tables import AT, ZERO
from gmwm_jax.fitting.weights import (
    DEFAULT,
    GIVEN,
    ITERATED,
    STEPPED,
    covariance_weights,
    default_weights,
    given_weights,
    require_theory,
    two_step_weights,
)
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.parameter import Fixed
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.covariance import require_no_mean
from gmwm_jax.variance.wavelet import WaveletVariance, as_wavelet_variance

_BEYOND = "beyond floating point: take other units, or scale the data."

_MAX_ITERATIONS = 20
_SETTLED = 1e-6
"""Relative change of the fitted variance at which iterated weights are final."""


def fit(
    data: WaveletVariance | Recording,
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    omega: Any = None,
    key: PRNGKey | None = None,
    level: float = 0.95,
    throw: bool = True,
) -> Any:
    """Fit a model to a wavelet variance by the Generalized Method of Wavelet Moments.

    Parameters
    ----------
    data
        The wavelet variance of one or several channels, or a recording.
    model
        ``"WN + RW + 2*GM"`` or a sum of processes. Values in it are starting values (of correlation times; amplitudes
        are solved for exactly and need none), or held if they are marked as fixed.
    rate
        Sampling rate in Hz, if the data do not know theirs; without one there are no continuous-time tables.
    omega
        Weights: None for 1/(ci_high - ci_low)^2 on the diagonal, the choice of R's simts, so that objectives compare
        (those of intervals at 95 %; a wavelet variance with intervals at another level has other objectives);
        ``"two-step"`` for the same with the variance of that first fit in place of the measured one, which takes out
        a bias (see Notes); ``"covariance"`` for the inverse of the whole covariance of the wavelet variance under that
        two-step fit; ``"iterated"`` for the same until it no longer changes; or a vector (J,), the diagonal; or a
        positive definite matrix (J, J).
    key
        Moves the starting points at random. The result should not depend on it; to check that is its use.
    level
        Confidence of the intervals.
    throw
        Raise if the search does not converge; False returns the fit with its status.

    Returns
    -------
    Fit for one channel, Fits for several.

    Raises
    ------
    ValueError
        More free parameters than scales, unknown process, bad weights, weights from a covariance that is not known or
        singular, a rate that disagrees with the data, a level outside 0 to 1, a drift
        and a robust wavelet variance.
    RuntimeError
        x64 is off, or (with `throw`) a search that did not converge, iterated weights that did not settle.
    TypeError
        Data, model or key of another kind.

    Notes
    -----
    With the default weights a scale whose variance came out low by chance counts for more. A component that lives on
    scales with eta degrees of freedom is biased by about 4/eta: 1 to 2 % for a correlation time of 100 samples in
    100,000, a quarter of its standard error. Two-step weights do not depend on the scatter.

    Deterministic: nothing depends on chance unless a key is given. The method is in `gmwm_jax.fitting.search`. The same
    model on the same number of scales and channels compiles once.
    """
    require_x64()
    if key is not None:
        typed_key(key)
    level = confidence(level)
    model = as_model(model)
    wv = as_wavelet_variance(data, "fit")
    rate = agreed_rate(wv.rate, rate)
    require_fittable(model, wv)
    channels = [wv[i] for i in range(len(wv.channels))]
    if isinstance(omega, str) and omega not in STEPPED:
        names = ", ".join(f'"{name}"' for name in STEPPED)
        raise ValueError(f"omega must be None, {names} or an array, and is {omega!r}.")
    weights = DEFAULT if omega is None else omega if isinstance(omega, str) else GIVEN
    if weights in STEPPED[1:]:
        require_theory(wv, f'Weights "{weights}"')
    search = partial(fit_channels, channels, model, rate=rate, key=key, level=level, weights=weights)
    if weights == GIVEN:
        fits = search([given_weights(omega, channel) for channel in channels])
    else:
        fits = search([default_weights(channel) for channel in channels])
    if weights in STEPPED:
        fits = search([_two_step(f) for f in fits])
    if weights in STEPPED[1:]:
        fits = search([_inverse_covariance(f) for f in fits])
    if weights == ITERATED:
        fits = _iterate(search, fits)
    if throw:
        for f in fits:
            if f.status is not Status.converged:
                raise RuntimeError(f"{f.wv.channels[0]}: {f.status.value}. throw=False returns the fit as it is.")
    return fits[0] if wv.is_single else Fits(tuple(fits))


def require_fittable(model: Composite, wv: WaveletVariance) -> None:
    """Raise a ValueError if there are fewer scales than free parameters, or a drift in a robust wavelet variance."""
    if wv.efficiency is not None:
        require_no_mean(model)
    if model.num_free > wv.num_scales:
        raise ValueError(
            f"{model} has {model.num_free} free parameters and the wavelet variance {wv.num_scales} scales: "
            "take a longer record, a smaller model, or hold parameters."
        )


def fit_channels(
    channels: list[WaveletVariance],
    model: Composite,
    omegas: list[Float[np.ndarray, "J J"]],
    *,
    rate: float | None,
    key: PRNGKey | None,
    level: float,
    weights: str,
) -> list[Fit]:
    """Fit channels on the same scales, each with its weights, in one compiled call."""
    whiteners = np.stack([np.linalg.cholesky(o).T for o in omegas])
    whitened = np.einsum("cij,cj->ci", whiteners, np.stack([c.variance for c in channels]))
    if not np.all(np.isfinite(whitened)):
        raise ValueError(f"Weights times wavelet variance are {_BEYOND}")
    unit = np.max(np.abs(whitened), axis=1) / SIZE

    tau_max = float(channels[0].scales[-1])
    problem = pose(model, tau_max)
    placements, nodes = starting_points(problem, tau_max, key)
    num_descents = NUM_ROUNDS * NUM_DESCENTS if problem.searched else 1
    minimise_channels = _compiled_quickly if len(channels) <= _FEW_CHANNELS else _compiled_well
    solutions = minimise_channels(
        problem.layout,
        placements,
        nodes,
        whitened / unit[:, None],
        whiteners / unit[:, None, None],
        channels[0].scales,
        problem.bounds,
        problem.shapes,
        problem.held,
    )
    solutions = jax.tree.map(np.asarray, solutions)
    return [
        as_fit(
            problem,
            Solution(*(leaf[c] for leaf in solutions)),
            channel,
            omegas[c],
            unit=float(unit[c]),
            num_descents=num_descents,
            weights=weights,
            rate=rate,
            level=level,
        )
        for c, channel in enumerate(channels)
    ]


def as_fit(
    problem: Problem,
    solution: Solution,
    channel: WaveletVariance,
    omega: Float[np.ndarray, "J J"],
    *,
    unit: float,
    num_descents: int,
    weights: str,
    rate: float | None,
    level: float,
) -> Fit:
    """The fit that a solution of a problem is; `unit` is what L' nu_hat was divided by for the search."""
    fitted, at_boundary = _assemble(problem, solution, float(channel.scales[-1]))
    objective = float(solution.objective) * unit * unit
    return Fit(
        model=fitted,
        wv=channel,
        objective=objective,
        omega=omega,
        weights=weights,
        status=_status(solution) if np.isfinite(objective) else Status.non_finite,
        at_boundary=at_boundary,
        agreement=float(solution.num_agreeing) / num_descents,
        rate=rate,
        level=level,
    )


def objective(wv: WaveletVariance | Recording, model: str | AbstractProcess | Composite, *, omega: Any = None) -> float:
    """Q = (nu_hat - nu)' Omega (nu_hat - nu) of a model whose parameters are all given, for one channel.

    Parameters
    ----------
    wv
        Wavelet variance of one channel, or a recording of one.
    model
        All parameters given.
    omega
        Weights: None or an array, as for `fit`.

    Raises
    ------
    ValueError
        A parameter without a value, several channels, bad weights.
    TypeError
        No wavelet variance.
    """
    wv = as_wavelet_variance(wv, "objective")
    if not wv.is_single:
        raise ValueError(f"Choose one channel, as in wv[{wv.channels[0]!r}]: there are {wv.channels}.")
    residual = wv.variance - np.asarray(as_model(model).wavelet_variance(wv.scales))
    return float(residual @ (default_weights(wv) if omega is None else given_weights(omega, wv)) @ residual)


def _two_step(fit: Fit) -> Float[np.ndarray, "J J"]:
    """Two-step weights under a fit; those it had if there is none."""
    return fit.omega if fit.status is Status.non_finite else two_step_weights(fit.model, fit.wv)


def _inverse_covariance(fit: Fit) -> Float[np.ndarray, "J J"]:
    """Weights from the covariance under a fit; those it had if there is none."""
    if fit.status is Status.non_finite:
        return fit.omega
    if fit.wv_covariance is None:
        raise ValueError(f"There is no theory of the scatter of {fit.model}: take other weights.")
    return covariance_weights(fit.model, fit.wv_covariance)


def _iterate(search: Callable[..., list[Fit]], fits: list[Fit]) -> list[Fit]:
    """Repeat the fit of all channels with the weights under the last one, until none changes."""
    for _ in range(_MAX_ITERATIONS):
        before = fits
        fits = search([_inverse_covariance(f) for f in fits])
        change = [np.max(np.abs(f.fitted / b.fitted - 1)) for f, b in zip(fits, before, strict=True)]
        if np.max(change) < _SETTLED:
            return fits
    return [
        replace(f, status=Status.unsettled) if f.status is Status.converged and not c < _SETTLED else f
        for f, c in zip(fits, change, strict=True)
    ]


def _minimise_channels(
    layout: Layout,
    placements: Any,
    nodes: Any,
    y: Any,
    whitener: Any,
    tau: Any,
    bounds: Any,
    shapes: Any,
    amplitudes: Any,
) -> Solution:
    def one(y: Any, whitener: Any) -> Solution:
        return minimise(layout, placements, nodes, Data(y, whitener, tau, bounds, shapes, amplitudes))

    return jax.vmap(one)(y, whitener)


# Six channels of WN + RW + 3*GM on two cores: 2.8 s to compile and 0.19 s to run without XLA's optimising passes, 3.7 s
# and 0.10 s with them. The passes pay where many channels are fitted at once.
_FEW_CHANNELS = 8
_compiled_quickly = jax.jit(
    _minimise_channels, static_argnums=0, compiler_options={"xla_backend_optimization_level": 0}
)
_compiled_well = jax.jit(_minimise_channels, static_argnums=0)


def starting_points(
    problem: Problem, tau_max: float, key: PRNGKey | None
) -> tuple[Float[np.ndarray, "S C"], Float[np.ndarray, "S C"]]:
    """The lattice, and once more with the starting values that the model gives."""
    searched = problem.searched
    placements, nodes = lattice(tuple(type(p) for p in searched), tau_max, key)
    given = {k: np.asarray(p.coordinate_from_shape(p.shape)) for k, p in enumerate(searched) if None not in p.shape}
    if given:
        moved = placements.copy()
        for k, coordinates in given.items():
            moved[:, problem.layout.position(k)] = coordinates
        placements, nodes = np.concatenate([moved, placements]), np.concatenate([nodes, nodes])
    return placements, nodes


def _assemble(problem: Problem, solution: Solution, tau_max: float) -> tuple[Composite, dict[str, str]]:
    """The model with its estimates in the user's order (those of a kind by correlation time), and its boundaries."""
    layout, fitted = problem.layout, []
    for i, p in enumerate(problem.processes):
        shape, note = p.shape, ""
        if layout.free_shape[i]:
            own = jnp.asarray(solution.coordinates[layout.position(i)])
            shape = tuple(float(s) for s in p.shape_from_coordinate(own))
            limit = p.limit_of(shape, tau_max)
            # where both parameters run off together, one that is held keeps the other
            if limit and (layout.free_amplitude[i] or p.parameters[-1].determined_at == limit):
                note = f"{AT}{limit}"
        amplitude = float(solution.amplitudes[i])
        if amplitude == 0:
            note = ZERO
        values = (*shape, p.value_of(jnp.asarray(amplitude)))
        named = {q.name: v for q, v in zip(p.parameters, values, strict=True)}
        build: Any = type(p)
        fitted.append((build(**{n: Fixed(v) if n in p.fixed else v for n, v in named.items()}), note))

    times = np.array([_correlation_time(p) for p, _ in fitted])
    placed = [fitted[i] for i in slots(problem, times, [note == ZERO for _, note in fitted])]
    model = Composite([p for p, _ in placed])
    return model, {label: note for label, (_, note) in zip(model.labels, placed, strict=True) if note}


def _correlation_time(p: AbstractProcess) -> float:
    return float(p.correlation_time(p.shape)) if p.shape else 0.0


def _status(solution: Solution) -> Status:
    return Status.converged if solution.slope <= smallest_slope(solution.objective) else Status.stalled
