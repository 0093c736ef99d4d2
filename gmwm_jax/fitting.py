"""`fit`: from a wavelet variance and a model to its estimates, all channels at once."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from gmwm_jax._check import agreed_rate, confidence, require_x64, typed_key
from gmwm_jax._typing import PRNGKey
from gmwm_jax.estimate import NUM_DESCENTS, NUM_ROUNDS, Data, Layout, Solution, minimise
from gmwm_jax.estimates import AT, ZERO
from gmwm_jax.processes._base import AbstractProcess, Composite
from gmwm_jax.processes._parameter import Fixed
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recording import Recording
from gmwm_jax.result import DEFAULT, GIVEN, TWO_STEP, Fit, Fits, Status
from gmwm_jax.start import lattice
from gmwm_jax.variance import WaveletVariance, as_wavelet_variance
from gmwm_jax.wv_covariance import require_no_mean

_SIZE = 1e3
"""Largest entry of L' nu_hat as the search sees it, whatever the weights: its tolerances then mean the same always."""

_BEYOND = "beyond floating point: take other units, or scale the data."


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
        a bias (see Notes); or a vector (J,), the diagonal; or a positive definite matrix (J, J).
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
        More free parameters than scales, unknown process, bad weights, a rate that disagrees with the data, a level
        outside 0 to 1, a drift and a robust wavelet variance.
    RuntimeError
        x64 is off, or (with `throw`) a search that did not converge.
    TypeError
        Data, model or key of another kind.

    Notes
    -----
    With the default weights a scale whose variance came out low by chance counts for more. A component that lives on
    scales with eta degrees of freedom is biased by about 4/eta: 1 to 2 % for a correlation time of 100 samples in
    100,000, a quarter of its standard error. Two-step weights do not depend on the scatter.

    Deterministic: nothing depends on chance unless a key is given. See `gmwm_jax.estimate` for the method. The same
    model on the same number of scales and channels compiles once.
    """
    require_x64()
    if key is not None:
        typed_key(key)
    level = confidence(level)
    model = as_model(model)
    wv = as_wavelet_variance(data, "fit")
    rate = agreed_rate(wv.rate, rate)
    if wv.efficiency is not None:
        require_no_mean(model)
    if model.num_free > wv.num_scales:
        raise ValueError(
            f"{model} has {model.num_free} free parameters and the wavelet variance {wv.num_scales} scales: "
            "take a longer record, a smaller model, or hold parameters."
        )
    channels = [wv[i] for i in range(len(wv.channels))]
    if isinstance(omega, str) and omega != TWO_STEP:
        raise ValueError(f'omega must be None, "{TWO_STEP}" or an array, and is {omega!r}.')
    weights = DEFAULT if omega is None else omega if isinstance(omega, str) else GIVEN
    omegas = [_weights(None if weights == TWO_STEP else omega, channel) for channel in channels]
    search = partial(_fit_channels, channels, model, rate=rate, key=key, level=level, weights=weights)
    fits = search(omegas)
    if weights == TWO_STEP:
        fits = search([_second_step(f) for f in fits])
    if throw:
        for f in fits:
            if f.status is not Status.converged:
                raise RuntimeError(f"{f.wv.channels[0]}: {f.status.value}. throw=False returns the fit as it is.")
    return fits[0] if wv.is_single else Fits(tuple(fits))


def _fit_channels(
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
    unit = np.max(np.abs(whitened), axis=1) / _SIZE

    # components with a shape to search for come first, those of a kind together
    kinds = [type(p) for p in model.processes]
    order = sorted(range(len(kinds)), key=lambda i: (not _has_free_shape(model.processes[i]), kinds.index(kinds[i])))
    processes = [model.processes[i] for i in order]
    layout = Layout(
        kinds=tuple(type(p) for p in processes),
        free_shape=tuple(_has_free_shape(p) for p in processes),
        free_amplitude=tuple(p.parameters[-1].name not in p.fixed for p in processes),
    )
    searched, given = processes[: layout.num_shapes], processes[layout.num_shapes :]
    tau_max = float(channels[0].scales[-1])
    bounds = np.array([p.coordinate_bounds(tau_max) for p in searched]).reshape(-1, 2)
    placements, nodes = _placements(searched, tau_max, key)
    num_descents = NUM_ROUNDS * NUM_DESCENTS if searched else 1
    held = [0.0 if free else float(p.amplitude) for p, free in zip(processes, layout.free_amplitude, strict=True)]
    minimise_channels = _compiled_quickly if len(channels) <= _FEW_CHANNELS else _compiled_well
    solutions = minimise_channels(
        layout,
        placements,
        nodes,
        whitened / unit[:, None],
        whiteners / unit[:, None, None],
        channels[0].scales,
        bounds,
        tuple(p.shape for p in given),
        np.array(held),
    )
    solutions = jax.tree.map(np.asarray, solutions)
    fits = []
    for c, channel in enumerate(channels):
        solution = Solution(*(leaf[c] for leaf in solutions))
        fitted, at_boundary = _assemble(processes, order, layout, solution, tau_max)
        objective = float(solution.objective) * float(unit[c]) * float(unit[c])
        fits.append(
            Fit(
                model=fitted,
                wv=channel,
                objective=objective,
                omega=omegas[c],
                weights=weights,
                status=_status(solution) if np.isfinite(objective) else Status.non_finite,
                at_boundary=at_boundary,
                agreement=float(solution.num_agreeing) / num_descents,
                rate=rate,
                level=level,
            )
        )
    return fits


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
    return float(residual @ _weights(omega, wv) @ residual)


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


def _has_free_shape(p: AbstractProcess) -> bool:
    return any(q.name not in p.fixed for q in p.parameters[:-1])


def _placements(
    searched: list[AbstractProcess], tau_max: float, key: PRNGKey | None
) -> tuple[Float[np.ndarray, "S K"], Float[np.ndarray, "S K"]]:
    """The lattice, and once more with the starting values that the model gives."""
    placements, nodes = lattice(tuple(type(p) for p in searched), tau_max, key)
    given = {k: float(p.coordinate_from_shape(p.shape)) for k, p in enumerate(searched) if None not in p.shape}
    if given:
        moved = placements.copy()
        for k, coordinate in given.items():
            moved[:, k] = coordinate
        placements, nodes = np.concatenate([moved, placements]), np.concatenate([nodes, nodes])
    return placements, nodes


def _assemble(
    processes: list[AbstractProcess],
    order: list[int],
    layout: Layout,
    solution: Solution,
    tau_max: float,
) -> tuple[Composite, dict[str, str]]:
    """The model with its estimates in the user's order (those of a kind by correlation time), and its boundaries."""
    fitted: list[tuple[AbstractProcess, str]] = [(p, "") for p in processes]
    for i, p in enumerate(processes):
        shape, note = p.shape, ""
        if layout.free_shape[i]:
            shape = tuple(float(s) for s in p.shape_from_coordinate(jnp.asarray(solution.coordinates[i])))
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
        fitted[i] = (build(**{n: Fixed(v) if n in p.fixed else v for n, v in named.items()}), note)

    placed: list[Any] = [None] * len(order)
    for kind in set(layout.kinds):
        members = [i for i, k in enumerate(layout.kinds) if k is kind]
        # fast to slow; what has no variance has no correlation time either, and comes last
        ranked = sorted((fitted[i] for i in members), key=lambda f: (f[1] == ZERO, _correlation_time(f[0])))
        for position, member in zip(sorted(order[i] for i in members), ranked, strict=True):
            placed[position] = member
    model = Composite([p for p, _ in placed])
    return model, {label: note for label, (_, note) in zip(model.labels, placed, strict=True) if note}


def _correlation_time(p: AbstractProcess) -> float:
    return float(p.correlation_time(p.shape)) if p.shape else 0.0


def _status(solution: Solution) -> Status:
    # the first-order gain of moving a correlation time by a tenth of its logarithm is below 1e-5 of the objective
    small = 1e-4 * solution.objective + 1e-10 * _SIZE**2
    return Status.converged if solution.slope <= small else Status.stalled


def _weights(omega: Any, wv: WaveletVariance) -> Float[np.ndarray, "J J"]:
    """Omega as a matrix, checked."""
    J = wv.num_scales
    if omega is None:
        with np.errstate(divide="ignore", over="ignore"):
            weights = 1 / (wv.ci_high - wv.ci_low) ** 2
        if not np.all(np.isfinite(weights) & (weights > 0)):
            raise ValueError(
                f"The intervals are {wv.ci_high[0] - wv.ci_low[0]:g} wide, and the squares of widths are {_BEYOND}"
            )
        return np.diag(weights)
    omega = np.asarray(omega, dtype=np.float64)
    if omega.shape == (J,):
        omega = np.diag(omega)
    if omega.shape != (J, J):
        raise ValueError(f"omega must have the shape ({J},) or ({J}, {J}), one entry a scale; it has {omega.shape}.")
    if not np.all(np.isfinite(omega)) or not np.allclose(omega, omega.T, rtol=1e-10, atol=0):
        raise ValueError("omega must be finite and symmetric.")
    scale = np.sqrt(np.abs(np.diag(omega)))
    if np.any(scale == 0) or np.linalg.eigvalsh(omega / np.outer(scale, scale))[0] <= 0:
        raise ValueError("omega must be positive definite: every eigenvalue above zero.")
    return omega


def _second_step(fit: Fit) -> Float[np.ndarray, "J J"]:
    """The default weights with the fitted variance in place of the measured one."""
    if fit.status is Status.non_finite:
        return fit.omega
    wv = fit.wv
    if np.any(fit.fitted <= 0):
        raise ValueError(f"{TWO_STEP} weights need a model with a variance, and {fit.model} has none at some scale.")
    return np.diag((wv.variance / (fit.fitted * (wv.ci_high - wv.ci_low))) ** 2)
