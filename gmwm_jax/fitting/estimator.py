"""`fit`: from a wavelet variance and a model to its estimates, all channels at once."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, overload

import jax
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.checks import agreed_rate, concrete, confidence, require_x64, typed_key
from gmwm_jax._internal.compiling import compiled_quickly
from gmwm_jax._internal.host import known
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax._internal.xla_threads import few_at_a_time
from gmwm_jax.fitting.problem import Problem, require_fittable
from gmwm_jax.fitting.reduced import Data, Layout
from gmwm_jax.fitting.result import Fit, Status
from gmwm_jax.fitting.search import SIZE, Solution, minimise, smallest_slope
from gmwm_jax.fitting.weights import AbstractWeights, WeightsLike, as_weights, root_of
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.wavelet import WaveletVariance, WaveletVariances, as_wavelet_variance

_BEYOND = "beyond floating point: take other units, or scale the data."

_SETTLED = 1e-6
"""Relative change of the fitted variance at which iterated weights are final."""


@overload
def fit(
    data: WaveletVariance,
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    weights: WeightsLike = None,
    key: PRNGKey | None = None,
    level: float = 0.95,
    throw: bool = True,
) -> Fit: ...
@overload
def fit(
    data: WaveletVariances,
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    weights: WeightsLike = None,
    key: PRNGKey | None = None,
    level: float = 0.95,
    throw: bool = True,
) -> Channels[Fit]: ...
@overload
def fit(
    data: Recording,
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    weights: WeightsLike = None,
    key: PRNGKey | None = None,
    level: float = 0.95,
    throw: bool = True,
) -> Fit | Channels[Fit]: ...
def fit(
    data: WaveletVariance | WaveletVariances | Recording,
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    weights: WeightsLike = None,
    key: PRNGKey | None = None,
    level: float = 0.95,
    throw: bool = True,
) -> Fit | Channels[Fit]:
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
    weights
        An object of `gmwm_jax.fitting.weights`, or its name. ``"default"`` or None: 1/(ci_high - ci_low)^2 on the
        diagonal, the choice of R's simts, so that objectives compare (those of intervals at 95 %; a wavelet variance
        with intervals at another level has other objectives). ``"two-step"``: the same with the variance of that first
        fit in place of the measured one, which takes out a bias (see Notes). ``"covariance"``: the inverse of the whole
        covariance of the wavelet variance under that two-step fit. ``"iterated"``: the same until it no longer changes.
        An array: a vector (J,), the diagonal of Omega, or a positive definite matrix (J, J).
    key
        Moves the starting points at random. The result should not depend on it; to check that is its use.
    level
        Confidence of the intervals.
    throw
        Raise if the search does not converge; False returns the fit with its status.

    Returns
    -------
    Fit for one channel, `Channels` of them by name for several.

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
    model compiles once for records of any length, up to eight channels; once more for each larger number of channels.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> fit = gj.fit(wv, "WN + RW")
    >>> fit.status.name, fit.model.labels
    ('converged', ('WN', 'RW'))
    >>> gj.fit(wv, "WN + RW", weights="two-step").objective > 0
    True
    """
    require_x64()
    if key is not None:
        typed_key(key)
    level = confidence(level)
    model = as_model(model)
    wv = as_wavelet_variance(data, "fit")
    if concrete(wv.variance) is None:
        raise TypeError(
            "fit() makes tables and messages of numbers, and these are traced: inside of jit, vmap and grad take "
            "gmwm_jax.fitting.estimate, the same estimator as a pure function."
        )
    rate = agreed_rate(wv.rate, rate)
    weights = as_weights(weights)
    if weights.needs_theory:
        wv.require_theory(f'Weights "{weights.name}"')
    channels = [wv[i] for i in range(len(wv.channels))]

    def search(omegas: list[Float[np.ndarray, "J J"]], weights: AbstractWeights) -> list[Fit]:
        return fit_channels(channels, model, omegas, rate=rate, key=key, level=level, weights=weights)

    def omega_of(weights: AbstractWeights, i: int, before: Fit | None) -> Float[np.ndarray, "J J"]:
        if before is None:
            return weights.omega(channels[i])
        if before.status is Status.non_finite:  # the weights that it had
            return before.omega
        V = before.wv_covariance if weights.needs_theory else None
        return weights.omega(before.wv, before.model, V)

    fits = fit_by_steps(weights, len(channels), omega_of, search)
    if throw:
        for f in fits:
            if f.status is not Status.converged:
                raise RuntimeError(f"{f.wv.channels[0]}: {f.status.value}. throw=False returns the fit as it is.")
    return fits[0] if isinstance(wv, WaveletVariance) else Channels.of(wv.channels, fits)


def fit_by_steps(
    weights: AbstractWeights,
    num: int,
    omega_of: Callable[[AbstractWeights, int, Fit | None], Any],
    search: Callable[[list[Any], AbstractWeights], list[Fit]],
) -> list[Fit]:
    """Fit problems with weights that need a first fit, and that with weights which may need one before.

    Parameters
    ----------
    weights
        Of the last fit.
    num
        Number of problems.
    omega_of
        From weights, the number of a problem and its fit before (None if there is none) to what `search` weights with.
    search
        Fits all problems.
    """
    fits: Sequence[Fit | None] = [None] * num
    if weights.first is not None:
        fits = fit_by_steps(weights.first, num, omega_of, search)
    if weights.num_rounds == 1:
        return search([omega_of(weights, i, f) for i, f in enumerate(fits)], weights)
    change = np.zeros(num)
    for _ in range(weights.num_rounds):
        before, fits = fits, search([omega_of(weights, i, f) for i, f in enumerate(fits)], weights)
        change = np.array([np.max(np.abs(f.fitted / b.fitted - 1)) for f, b in zip(fits, before, strict=True) if b])
        if np.max(change) < _SETTLED:
            return fits
    return [
        replace(f, status=Status.unsettled) if f.status is Status.converged and not c < _SETTLED else f
        for f, c in zip(fits, change, strict=True)
        if f
    ]


def fit_channels(
    channels: list[WaveletVariance],
    model: Composite,
    omegas: list[Float[np.ndarray, "J J"]],
    *,
    rate: float | None,
    key: PRNGKey | None,
    level: float,
    weights: AbstractWeights,
) -> list[Fit]:
    """Fit channels on the same scales, each with its Omega.

    Raises
    ------
    ValueError
        Fewer scales than free parameters, a drift and a robust wavelet variance, numbers beyond floating point.
    """
    for omega in omegas:
        require_fittable(model, channels[0], omega)
    whiteners = np.stack([root_of(o) for o in omegas])
    whitened = np.einsum("cij,cj->ci", whiteners, np.stack([c.variance for c in channels]))
    if not np.all(np.isfinite(whitened)):
        raise ValueError(f"Weights times wavelet variance are {_BEYOND}")
    unit = np.max(np.abs(whitened), axis=1) / SIZE

    problem = Problem.of(model, float(channels[0].scales[-1]))
    placements, nodes = problem.starting_points(key)
    whitened, whiteners, scales = _padded(whitened / unit[:, None], whiteners / unit[:, None, None], channels[0].scales)
    rest = scales, problem.bounds, problem.shapes, problem.held
    if len(channels) <= _FEW_CHANNELS:
        each = [
            _search(problem.layout, placements, nodes, y, whitener, *rest)
            for y, whitener in zip(whitened, whiteners, strict=True)
        ]
        solutions = [jax.tree.map(np.asarray, solution) for solution in each]
    else:
        found = jax.tree.map(np.asarray, _compiled_well(problem.layout, placements, nodes, whitened, whiteners, *rest))
        solutions = [Solution(*(leaf[c] for leaf in found)) for c in range(len(channels))]
    return [
        as_fit(
            problem,
            solutions[c],
            channel,
            omegas[c],
            unit=float(unit[c]),
            num_descents=problem.num_descents,
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
    weights: AbstractWeights,
    rate: float | None,
    level: float,
) -> Fit:
    """The fit that a solution of a problem is; `unit` is what L' nu_hat was divided by for the search."""
    fitted, at_boundary = problem.assemble(solution)
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


def objective(
    wv: WaveletVariance | Recording, model: str | AbstractProcess | Composite, *, weights: WeightsLike = None
) -> float | Float[Array, ""]:
    """Compute Q = (nu_hat - nu)' Omega (nu_hat - nu) of a model with all parameters given, for one channel.

    Pure in the parameters of the model, the wavelet variance and the weights: jit, grad and vmap it.

    Parameters
    ----------
    wv
        Wavelet variance of one channel, or a recording of one.
    model
        All parameters given.
    weights
        As for `fit`, but none that need a first fit.

    Raises
    ------
    ValueError
        A parameter without a value, several channels, bad weights.
    TypeError
        No wavelet variance.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> fit = gj.fit(wv, "WN + RW")
    >>> abs(float(gj.fitting.objective(wv, fit.model)) - fit.objective) < 1e-6
    True
    """
    one = as_wavelet_variance(wv, "objective")
    if not isinstance(one, WaveletVariance):
        raise ValueError(f"Choose one channel, as in wv[{one.channels[0]!r}]: there are {one.channels}.")
    return _objective(one, as_model(model), as_weights(weights))


def _objective(wv: WaveletVariance, model: Composite, weights: AbstractWeights) -> float | Array:
    omega, (fitted,) = weights.omega(wv), known(model.wavelet_variance(wv.scales))
    residual = wv.variance - fitted
    value: Any = residual @ omega @ residual
    seen = concrete(value)
    return value if seen is None else float(seen)


_NUM_SCALES = 24
"""Of records of up to 2^26 samples, or fewer: the search pads them to as many, and one program serves all."""


def _padded(
    y: Float[np.ndarray, "C J"], whiteners: Float[np.ndarray, "C J J"], tau: Float[np.ndarray, " J"]
) -> tuple[Float[np.ndarray, "C L"], Float[np.ndarray, "C L L"], Float[np.ndarray, " L"]]:
    """Whitened wavelet variances with scales of no weight after their own; the minimum is the same."""
    more = (0, max(_NUM_SCALES - len(tau), 0))
    return np.pad(y, ((0, 0), more)), np.pad(whiteners, ((0, 0), more, more)), np.pad(tau, more, mode="edge")


def _minimise_channel(
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
    return minimise(layout, placements, nodes, Data(y, whitener, tau, bounds, shapes, amplitudes))


def _minimise_channels(layout: Layout, placements: Any, nodes: Any, y: Any, whitener: Any, *rest: Any) -> Solution:
    def one(y: Any, whitener: Any) -> Solution:
        return _minimise_channel(layout, placements, nodes, y, whitener, *rest)

    return jax.vmap(one)(y, whitener)


# By the second of XLA's levels a search takes a third of the time that it takes by the first, and half a second more to
# compile; by all passes it compiles as long again and runs no faster, but for many channels at once. Which it is
# depends on nothing that was fitted before: they differ in the last digits.
_FEW_CHANNELS = 8
_compiled_quickly = few_at_a_time(compiled_quickly(static_argnums=(0,))(_minimise_channel))
_compiled_better = few_at_a_time(compiled_quickly(static_argnums=(0,), level=1)(_minimise_channel))
_compiled_well = few_at_a_time(jax.jit(_minimise_channels, static_argnums=0))


def _search(layout: Layout, *rest: Any) -> Solution:
    """The minimum for one channel."""
    quick = not layout.num_shapes or jax.config.read("jax_disable_most_optimizations")
    return (_compiled_quickly if quick else _compiled_better)(layout, *rest)


def _status(solution: Solution) -> Status:
    return Status.converged if solution.slope <= smallest_slope(solution.objective) else Status.stalled
