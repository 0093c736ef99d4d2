"""Priors, shared parameters, constraints, bounds: the log-density of parameters, its mode, and what is known there.

The wavelet variance is close to normal, nu_hat ~ N(nu(theta), V), with V taken under a first fit; on the real line of
each parameter (its logarithm, or logit), eta, a prior is normal too. Hence, for channels that need not be independent
in what they share,

    log p(eta | nu_hat) = -1/2 sum_channels (nu_hat - nu(eta))' V^-1 (nu_hat - nu(eta)) - 1/2 sum_i ((eta_i - m_i)/s_i)^2,

up to a constant, on the flat set C eta = d of what is shared and constrained, in whose own coordinates z it is a function
of nothing else. Without priors its mode is the fit with ``weights="covariance"``; the covariance at the mode is the inverse
of N'(sum A'V^-1 A + diag(1/s^2))N with A = d nu/d eta and N a basis of the set (Laplace's approximation, with the expected
curvature: Gelman et al. 2013, ch. 4; Chernozhukov & Hong 2003 for the quasi-likelihood of moments).

Bounds cut the density off: it is zero outside. The mode then lies at some of them, which a primal-dual active set finds
(Hintermueller, Ito & Kunisch 2003), and the others are those of the problem in which these are held. To first order what
is at a bound is the projection of an estimate without it, whose standard error, s, it has: its interval runs from the
bound inwards by z s (as far as the other bound), and holds the truth in 95 % or more wherever between the bounds that is.
The intervals of the others are those of a held one, and longer, by the root of the sum of squares, on the side to which
they would move with it. All intervals end at the bounds. `gmwm_jax.fitting.boundary` has the same for zeros.
"""  # noqa: E501

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float

from gmwm_jax._internal.cached import cached_property
from gmwm_jax._internal.checks import confidence, integer, positive, require_x64, typed_key
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.labelled import UNIT_OF_PARAMETER, Arrays, Labelled, Values
from gmwm_jax._internal.optional import import_optional
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.fitting.bounds import Bounds, checked
from gmwm_jax.fitting.estimation import estimate
from gmwm_jax.fitting.estimator import fit
from gmwm_jax.fitting.outcome import Outcome
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.tables import EstimateTable, parameter_table
from gmwm_jax.fitting.weights import root_of
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.parameter import Parameter
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.wavelet import WaveletVariance, WaveletVariances, as_wavelet_variance

if TYPE_CHECKING:
    import optimistix as optx

_MAX_STEPS = 500
_DEPENDENT = 1e-10
"""Of the largest singular value of the constraints: rows below it say what others say."""
_TOUCHES = 1e-8
"""Of a parameter on the real line: this close to a bound it is at it."""
_CLOSE = 1e-5
"""Standard errors from the mode at which a search has converged."""
_ONE = 1e-9
"""1 - correlation^2 of parameters that are one; part of a parameter's way that is none."""
_MAX_EXCHANGES = 30
"""Of what is taken to be at a bound."""


class Prior(NamedTuple):
    """A prior on a parameter: normal on its real line (log, or logit where it is bounded on both sides).

    Examples
    --------
    >>> prior = gj.fitting.Prior(0.01, factor=2.0)  # a datasheet's value, right within a factor of 2 (one sigma)
    """

    median: float
    """Per sample, as the parameter."""
    factor: float
    """exp of the standard deviation: two thirds of the prior lie within median/factor and median * factor."""


class Constraint(NamedTuple):
    """sum_i coefficients[name_i] line(parameter_i) = value, with log as the line of all but phi.

    Examples
    --------
    >>> gj.fitting.Constraint({"GM_1 beta": 1.0, "GM_2 beta": -1.0}, 2.302585).value  # beta_1 = 10 beta_2
    2.302585
    """

    coefficients: Mapping[str, float]
    value: float = 0.0


@saved(not_finite=("low", "high"))
class LogDensity(eqx.Module):
    """log p(z | nu_hat), up to a constant: a pure function of the coordinates z, for any sampler or optimiser.

    ``density.eta(z)`` are the parameters of all channels on the real line, ``density.models(z)`` the models.
    """

    template: Composite
    """A model of the structure that all channels have."""
    tau: Float[Array, " J"]
    nu: Float[Array, "C J"]
    whiteners: Float[Array, "C J J"]
    """L' with V^-1 = L L'."""
    origin: Float[Array, " E"]
    """A point of the flat set."""
    basis: Float[Array, "E Z"]
    """N, orthonormal: eta = origin + N z."""
    median: Float[Array, " E"]
    precision: Float[Array, " E"]
    """1/s of the priors; 0 where there is none."""
    low: Float[Array, " E"]
    """Lower bounds; -inf where there are none."""
    high: Float[Array, " E"]
    """Upper bounds; inf where there are none."""

    @property
    def num_coordinates(self) -> int:
        """Number of coordinates z."""
        return self.basis.shape[1]

    def eta(self, z: Float[Array | np.ndarray, " Z"]) -> Float[Array, " E"]:
        """All parameters on the real line, channel by channel."""
        return self.origin + self.basis @ z

    def coordinates(self, eta: Float[Array | np.ndarray, " E"]) -> Float[Array, " Z"]:
        """The point of the set that is nearest to eta."""
        return self.basis.T @ (eta - self.origin)

    def models(self, z: Float[Array | np.ndarray, " Z"]) -> list[Composite]:
        """The model of each channel."""
        return [self.template.with_unconstrained(own) for own in self.eta(z).reshape(self.nu.shape[0], -1)]

    def residuals(self, z: Float[Array | np.ndarray, " Z"]) -> Float[Array, " R"]:
        """Whitened residuals of data and priors: the log-density is -1/2 the sum of their squares."""
        eta = self.eta(z)

        def of_channel(own: Array, nu: Array, whitener: Array) -> Array:
            return whitener @ (nu - self.template.with_unconstrained(own).wavelet_variance(self.tau))

        data = jax.vmap(of_channel)(eta.reshape(self.nu.shape[0], -1), self.nu, self.whiteners)
        return jnp.concatenate([data.ravel(), (eta - self.median) * self.precision])

    def __call__(self, z: Float[Array | np.ndarray, " Z"]) -> Float[Array, ""]:
        """Log p(z | nu_hat) up to a constant; -inf beyond a bound."""
        r, eta = self.residuals(z), self.eta(z)
        inside = jnp.all((eta >= self.low - _TOUCHES) & (eta <= self.high + _TOUCHES))
        return jnp.where(inside, -jnp.sum(r * r) / 2, -jnp.inf)


def _check(found: "Posterior") -> None:
    """Raise a ValueError for what `posterior` does not make, in a file."""
    density, num = found.density, len(found.names)
    if num != len(found.fits) * density.template.num_parameters or len(found.fits) != len(density.nu):
        raise ValueError(f"It has {num} parameters of {len(found.fits)} channels of {density.template}.")
    if density.basis.shape != (num, len(found.z)) or found.covariance.shape != (num, num):
        raise ValueError(f"It has {num} parameters, and a basis or covariance of another number.")
    unknown = set(found.at_bounds) - set(found.names)
    if unknown:
        raise ValueError(f"It has no parameter {min(unknown)!r}.")


@saved(not_finite=("covariance",), check=_check)
@dataclass(frozen=True, repr=False)
class Posterior(Drawable, Saved, Labelled):
    """What `posterior` returns: the log-density, its mode and the covariance there.

    Attributes
    ----------
    density
        The log-density, a pure function.
    fits
        The fits that it was made from, one a channel: their covariance is V, and where the search began.
    names
        Of the parameters of all channels, as ``GM beta``, or ``gyro_x GM beta`` where there are several channels.
    z, converged
        The mode, and whether the search ended there: less than 1e-5 standard errors from it.
    covariance
        Of all parameters on the real line; shared ones are perfectly correlated, and one at a bound is held.
    level
        Confidence of intervals.
    at_bounds
        Name of a parameter that is at a bound -> at which.
    """

    density: LogDensity
    fits: tuple[Fit, ...]
    names: tuple[str, ...]
    z: Float[np.ndarray, " Z"]
    converged: bool
    covariance: Float[np.ndarray, "E E"]
    level: float
    at_bounds: Mapping[str, Outcome]

    @cached_property
    def models(self) -> dict[str, Composite]:
        """The model of each channel at the mode."""
        found = self.density.models(jnp.asarray(self.z))
        return {f.wv.channels[0]: jax.tree.map(np.asarray, m) for f, m in zip(self.fits, found, strict=True)}

    def parameters(self, channel: str | int = 0) -> EstimateTable:
        """The parameters of one channel per sample, with intervals from the covariance at the mode.

        Beside bounds they are no longer symmetric on the real line, see `gmwm_jax.fitting.bayes`.
        """
        number = list(self.models).index(channel) if isinstance(channel, str) else channel
        model, size = list(self.models.values())[number], self.density.template.num_parameters
        own = slice(number * size, (number + 1) * size)
        ends = None if self._ends is None else (self._ends[0][own], self._ends[1][own])
        errors = np.sqrt(np.diag(self.covariance))[own]
        unit, z = self.fits[number].unit, normal_quantile(self.level)
        table = parameter_table(model, unit, z=z, level=self.level, errors=errors, boundary={}, ends=ends)
        noted = [
            replace(e, note=self.at_bounds.get(name, e.note)) for e, name in zip(table, self.names[own], strict=True)
        ]
        return replace(table, estimates=tuple(noted))

    @cached_property
    def standard_deviations(self) -> Float[np.ndarray, " E"]:
        """Of all parameters per sample, to first order; NaN for one that is at a bound or fixed."""
        lines, errors = np.asarray(self.density.eta(self.z)), np.sqrt(np.diag(self.covariance))
        slopes = [
            (v - q.lower) * (1.0 if np.isinf(q.upper) else (q.upper - v) / (q.upper - q.lower))
            for q, v in zip(self._parameters, self._per_sample(lines), strict=True)
        ]
        return np.where(errors > 0, np.array(slopes) * errors, np.nan)

    @property
    def _parameters(self) -> list[Parameter]:
        """Of all channels."""
        return [q for _ in self.fits for p in self.density.template.processes for q in p.parameters]

    def _per_sample(self, lines: Float[np.ndarray, "*S E"]) -> Float[np.ndarray, "*S E"]:
        """Parameters from the real line."""
        columns = zip(self._parameters, np.moveaxis(lines, -1, 0), strict=True)
        return np.stack([q.from_line(x) for q, x in columns], axis=-1)

    def marginal(self, name: str) -> tuple[float, float]:
        """Mean and standard deviation of Laplace's approximation for a parameter on the real line.

        For one at a bound those of the normal that the bound cuts off.
        """
        i = self.names.index(name)
        if not self._held[i]:
            return float(self.density.eta(self.z)[i]), float(np.sqrt(self.covariance[i, i]))
        free = np.asarray(_covariance(self.density, self.z, np.zeros(len(self.names), dtype=bool)))
        step = np.asarray(_step(self.density, self.z))
        return float(self.density.eta(self.z)[i] + step[i]), float(np.sqrt(free[i, i]))

    @cached_property
    def _held(self) -> Bool[np.ndarray, " E"]:
        """Which of all parameters are at a bound."""
        return np.array([name in self.at_bounds for name in self.names])

    @cached_property
    def _ends(self) -> tuple[Float[np.ndarray, " E"], Float[np.ndarray, " E"]] | None:
        """Both ends of the intervals of all parameters on the real line; None without bounds."""
        low, high = np.asarray(self.density.low), np.asarray(self.density.high)
        if not np.any(np.isfinite(low) | np.isfinite(high)):
            return None
        z, eta = normal_quantile(self.level), np.asarray(self.density.eta(self.z))
        half = z * np.sqrt(np.diag(self.covariance))
        squares = np.stack([half**2, half**2])
        free = np.asarray(_covariance(self.density, self.z, np.zeros(len(eta), dtype=bool)))
        left = self._held.copy()
        own = {}
        for k in np.flatnonzero(self._held):
            inwards = 1.0 if self.at_bounds[self.names[k]] is Outcome.LOWER_BOUND else -1.0
            length = min(z * np.sqrt(free[k, k]), high[k] - low[k])
            own[k] = (eta[k], eta[k] + inwards * length)
            if not left[k]:  # it is one with another that has run
                continue
            one = free[k] ** 2 > (1 - _ONE) * free[k, k] * np.diag(free)
            left = left & ~one
            C = np.asarray(_covariance(self.density, self.z, self._held & ~one))
            moves = C[k] / C[k, k] * inwards * length
            squares += np.maximum(np.stack([-moves, moves]), 0) ** 2
        ends = np.clip(eta - np.sqrt(squares[0]), low, high), np.clip(eta + np.sqrt(squares[1]), low, high)
        for k, (at, inner) in own.items():
            ends[0][k], ends[1][k] = min(at, inner), max(at, inner)
        none = ~(np.diag(free) > 0)  # it was fixed
        return np.where(none, np.nan, ends[0]), np.where(none, np.nan, ends[1])

    def sample(self, num_samples: int, *, key: PRNGKey, num_warmup: int = 500) -> Float[np.ndarray, "S E"]:
        """Draw from the posterior by the no-U-turn sampler (Hoffman & Gelman 2014); needs the extra ``sampling``.

        Parameters
        ----------
        num_samples, num_warmup
            Draws that are returned, and that adapt the step before.
        key
            ``jax.random.key(seed)``.

        Returns
        -------
        Parameters on the real line, in the order of `names`. The draws of one chain: they are correlated. `plot` shows
        them.
        """
        typed_key(key)
        num_samples = integer("num_samples", num_samples, 1)
        blackjax = import_optional("blackjax", "sampling")
        # in coordinates of unit covariance
        free = _covariance(self.density, self.z, np.zeros(len(self.names), dtype=bool))
        scale = np.linalg.cholesky(self.density.basis.T @ free @ self.density.basis)

        def density(x: Array) -> Array:
            return self.density(jnp.asarray(self.z) + scale @ x)

        warm, chain = jax.random.split(key)
        with jax.numpy_dtype_promotion("standard"):  # which the sampler relies on
            x = _chain(blackjax, density, len(self.z), num_samples, num_warmup, warm, chain)
        return np.asarray(jax.vmap(self.density.eta)(jnp.asarray(self.z + x @ scale.T)))

    def plot(self, *, draws: Float[np.ndarray, "S E"] | None = None, axes: GivenAxes | None = None) -> Figure:
        """Draw the marginals of Laplace's approximation, and those of draws beside them.

        Parameters
        ----------
        draws
            Of `sample`.
        axes
            An Axes for each parameter that is not fixed; a new figure if left out.

        Returns
        -------
        Figure
            See `gmwm_jax.plotting.plot_posterior`.
        """
        return self._draw(draws=draws, axes=axes)

    def __repr__(self) -> str:
        """A table a channel: mode, standard deviation and credible interval of each parameter."""
        end = "the search converged" if self.converged else "the search did not converge"
        dims = f"{len(self.names)} parameters with {len(self.z)} degrees of freedom"
        lines = [f"Posterior of {' + '.join(self.density.template.labels)}: {dims}; {end}"]
        head = ["component", "quantity", "mode", "sd", f"{100 * self.level:g} % low", "high", "unit", "note"]
        sd = np.reshape(self.standard_deviations, (len(self.fits), -1))
        for i, f in enumerate(self.fits):
            rows = [
                [e.component, e.symbol, *map(number, (e.value, s, e.ci_low, e.ci_high)), e.unit, e.note]
                for e, s in zip(self.parameters(i), sd[i], strict=True)
            ]
            kept = len(head) if any(row[-1] for row in rows) else -1
            table = format_table(head[:kept], [row[:kept] for row in rows], left=2)
            lines += ["", f"{f.wv.channels[0]} [{f.unit}], per sample", table]
        return "\n".join(lines)

    def _arrays(self) -> Arrays:
        """A row a parameter; the covariance is that on the real line."""
        estimates = [e for i in range(len(self.fits)) for e in self.parameters(i)]
        variables = {
            "mode": Values("parameter", [e.value for e in estimates], UNIT_OF_PARAMETER),
            "sd": Values("parameter", self.standard_deviations, UNIT_OF_PARAMETER),
            "low": Values("parameter", [e.ci_low for e in estimates], UNIT_OF_PARAMETER),
            "high": Values("parameter", [e.ci_high for e in estimates], UNIT_OF_PARAMETER),
            "note": Values("parameter", [str(e.note) for e in estimates]),
            "covariance": Values(("parameter", "other"), self.covariance, "1"),
            "converged": Values((), self.converged),
        }
        coordinates = {
            "parameter": Values("parameter", self.names),
            "other": Values("other", self.names),
            "parameter_unit": Values("parameter", [e.unit for e in estimates]),
        }
        attributes = {"model": " + ".join(p.kind for p in self.density.template.processes), "level": self.level}
        return Arrays(variables, coordinates, attributes, ("parameter",))


def _chain(
    blackjax: Any, density: Any, num: int, num_samples: int, num_warmup: int, warm: PRNGKey, keys: PRNGKey
) -> Float[np.ndarray, "S Z"]:
    """Draws of one chain from a log-density of about unit covariance around zero."""
    adapted = blackjax.window_adaptation(blackjax.nuts, density)
    (state, parameters), _ = adapted.run(warm, jnp.zeros(num), num_steps=num_warmup)
    kernel = blackjax.nuts(density, **parameters)

    @jax.jit
    def draw(state: Any, keys: Any) -> Any:
        def step(state: Any, key: Any) -> tuple[Any, Array]:
            state, _ = kernel.step(key, state)
            return state, state.position

        return jax.lax.scan(step, state, keys)[1]

    return np.asarray(draw(state, jax.random.split(keys, num_samples)))


def posterior(
    data: WaveletVariance | WaveletVariances | Recording,
    model: str | AbstractProcess | Composite,
    *,
    priors: Mapping[str, Prior] | None = None,
    shared: Sequence[str] = (),
    constraints: Sequence[Constraint] = (),
    bounds: Bounds | None = None,
    solver: "optx.AbstractLeastSquaresSolver | optx.AbstractMinimiser | None" = None,
    level: float = 0.95,
) -> Posterior:
    """Estimate a model with priors, parameters that channels share, linear constraints, and bounds.

    Parameters
    ----------
    data
        The wavelet variance of one or several channels whose theory is known, or a recording.
    model
        As for `gmwm_jax.fit`; each channel has one. A value that is marked as fixed is held in all of them.
    priors
        Name of a parameter -> its prior: ``{"GM beta": Prior(0.01, factor=2)}`` for all channels, or with the channel in
        front, ``"gyro_x GM beta"``, for one.
    shared
        Names of parameters that all channels have in common.
    constraints
        On the real line of the parameters, see `Constraint`; without the name of a channel it holds in each.
    bounds
        Name of a parameter -> the two values, per sample, that it lies between, for all channels or for one:
        ``{"GM beta": (1 / (1000 * rate), 1 / (10 * rate))}`` for a correlation time of 10 to 1000 s; 0 or infinity where
        one of them is open. A parameter that comes to lie at a bound is marked, and its interval begins there.
    solver
        Of optimistix, a least-squares solver or a minimiser; by default Levenberg-Marquardt. It starts from the fits of the
        channels alone, which were searched for globally, between the bounds.
    level
        Confidence of the intervals.

    Returns
    -------
    Posterior

    Raises
    ------
    ValueError
        An unknown name, no theory, constraints that contradict each other or the bounds, a component that the data push
        to zero or to a limit and whose amplitude has no prior; a prior that is not positive, bounds that are no range; a
        model with coordinates that are no parameters (ARMA).
    RuntimeError
        x64 is off, or a fit of one channel did not converge.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> found = gj.fitting.posterior(wv, "WN + RW", priors={"RW gamma2": gj.fitting.Prior(1e-9, factor=3.0)})
    >>> found.names, found.converged
    (('WN sigma2', 'RW gamma2'), True)
    >>> found = gj.fitting.posterior(wv, "WN + RW", bounds={"RW gamma2": (1e-12, 1e-11)})
    >>> found.parameters()["RW", "gamma2"].note.value
    'at its upper bound'
    """  # noqa: E501
    require_x64()
    level = confidence(level)
    model, wv = as_model(model), as_wavelet_variance(data, "posterior")
    wv.require_theory("A likelihood and its priors")
    if any(p.num_coordinates > 1 for p in model.processes):
        raise ValueError(
            f"{model}: the coefficients of ARMA processes share their range, and have no priors of their own."
        )
    fits = tuple(fit(wv[i], model, weights="covariance", level=level) for i in range(len(wv.channels)))
    names = _names(fits)
    median, precision = _priors(names, len(fits), priors or {})
    between = _between(names, len(fits), bounds or {}, model)
    low, high = _on_lines(between, model, len(fits))
    start = np.clip(_start(_begin(fits, between, names, model), names, median, precision), low, high)
    C, d = _constraints(names, fits, shared, constraints, start)
    origin, basis = _flat(C, d, start)
    density = LogDensity(
        template=fits[0].model,
        tau=jnp.asarray(wv.scales),
        nu=jnp.stack([jnp.asarray(f.wv.variance) for f in fits]),
        whiteners=jnp.stack([jnp.asarray(root_of(f.omega)) for f in fits]),
        origin=jnp.asarray(origin),
        basis=jnp.asarray(basis),
        median=jnp.asarray(median),
        precision=jnp.asarray(precision),
        low=jnp.asarray(low),
        high=jnp.asarray(high),
    )
    at = density.coordinates(jnp.asarray(start))
    z, held, converged = _mode_between(density, at, _levenberg() if solver is None else solver)
    ends = {1: Outcome.UPPER_BOUND, -1: Outcome.LOWER_BOUND}
    at_bounds = {name: ends[int(side)] for name, side in zip(names, held, strict=True) if side}
    covariance = np.asarray(_covariance(density, z, held != 0))
    return Posterior(density, fits, names, np.asarray(z), converged, covariance, level, at_bounds)


def posterior_mode(
    density: LogDensity,
    start: Float[Array, " Z"],
    *,
    solver: "optx.AbstractLeastSquaresSolver | optx.AbstractMinimiser | None" = None,
) -> Float[Array, " Z"]:
    """The mode of a log-density: pure, so that it moves with moments and priors under grad, by the solver's adjoint.

    A parameter that is at a bound at the start stays there, and moves with that bound alone; look whether another one
    leaves its bounds on the way.

    Parameters
    ----------
    density
        Whose leaves may be traced: ``dataclasses.replace(found.density, nu=nu)``.
    start
        Where the solver begins, such as the mode for other moments.
    solver
        Of optimistix, as of `posterior`.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> found = gj.fitting.posterior(wv, "WN + RW")
    >>> bool(np.allclose(gj.fitting.posterior_mode(found.density, jnp.asarray(found.z)), found.z))
    True
    """
    eta = density.eta(start)
    lower, upper = eta <= density.low + _TOUCHES, eta >= density.high - _TOUCHES
    return _mode(density, start, lower, upper, _levenberg() if solver is None else solver)


def _levenberg() -> Any:
    import optimistix as optx  # 0.1 s to import

    return optx.LevenbergMarquardt(rtol=1e-10, atol=1e-10)


class _Held(NamedTuple):
    """A problem some of whose parameters are at a bound: z = origin + P y."""

    density: LogDensity
    origin: Float[Array, " Z"]
    P: Float[Array, "Z Z"]

    def z(self, y: Array) -> Array:
        return self.origin + self.P @ y


def _projector(density: LogDensity, held: Any) -> tuple[Array, Array]:
    """P onto the directions in which nothing that is held moves, and the way of what is held in z, (Z, E)."""
    rows = density.basis * jnp.where(held, 1.0, 0.0)[:, None]
    inverse = jnp.linalg.pinv(rows, rtol=_DEPENDENT)
    return jnp.eye(density.num_coordinates) - inverse @ rows, inverse


def _mode(density: LogDensity, start: Array, lower: Any, upper: Any, solver: Any) -> Float[Array, " Z"]:
    """The mode with parameters held at a bound."""
    import optimistix as optx

    held, bound = lower | upper, jnp.where(lower, density.low, density.high)
    P, inverse = _projector(density, held)
    origin = start + inverse @ jnp.where(held, bound - density.eta(start), 0.0)
    problem = _Held(density, origin, P)
    options: Any = {"args": problem, "max_steps": _MAX_STEPS, "throw": False}
    zero = jnp.zeros_like(start)
    if isinstance(solver, optx.AbstractLeastSquaresSolver):
        found = optx.least_squares(_residuals, solver, zero, **options)
    else:
        found = optx.minimise(_minus_log, solver, zero, **options)
    return problem.z(found.value)


def _residuals(y: Array, problem: _Held) -> Array:
    """Those of the density, and y where it moves nothing."""
    return jnp.concatenate([problem.density.residuals(problem.z(y)), y - problem.P @ y])


def _minus_log(y: Array, problem: _Held) -> Array:
    r = _residuals(y, problem)
    return jnp.sum(r * r) / 2


def _mode_between(density: LogDensity, start: Array, solver: Any) -> tuple[Array, np.ndarray, bool]:
    """The mode between the bounds, where parameters are at one of them (-1 the lower, 1 the upper), and is it there?

    Held is what would go beyond its bound, until its slope leads inwards.
    """
    low, high = np.asarray(density.low), np.asarray(density.high)
    side, z = np.zeros(len(low), dtype=int), start
    for _ in range(_MAX_EXCHANGES):
        z = _mode(density, z, side < 0, side > 0, solver)
        eta, at = np.asarray(density.eta(z)), np.where(side < 0, low, high)
        if np.any(np.abs(eta - at)[side != 0] > _TOUCHES):
            raise ValueError("What is shared, held and constrained contradicts the bounds: no parameters satisfy both.")
        slope = np.linalg.lstsq(np.asarray(density.basis)[side != 0].T, np.asarray(_slope(density, z)))[0]
        kept = np.zeros_like(side)
        kept[side != 0] = np.where(side[side != 0] * slope <= 0, side[side != 0], 0)
        beyond = np.where(eta < low - _TOUCHES, -1, np.where(eta > high + _TOUCHES, 1, 0))
        following = np.where(beyond != 0, beyond, kept)
        if np.array_equal(following, side):
            return z, side, bool(_distance(density, z, side != 0) < _CLOSE)
        side = following
    return z, side, False


@jax.jit
def _slope(density: LogDensity, z: Array) -> Float[Array, " Z"]:
    """Of minus the log-density."""
    return jax.grad(lambda z: jnp.sum(density.residuals(z) ** 2) / 2)(z)


@jax.jit
def _step(density: LogDensity, z: Array) -> Float[Array, " E"]:
    """From a mode at bounds to where it would be without them, to first order."""
    nothing = jnp.zeros(density.low.shape, dtype=bool)
    return -density.basis @ (_inner(density, z, nothing) @ _slope(density, z))


@jax.jit
def _distance(density: LogDensity, z: Array, held: Bool[Array, " E"]) -> Float[Array, ""]:
    """From a mode, in its standard errors; a solver whose steps are below rounding does not say that it is there."""
    slope = _slope(density, z)
    return jnp.sqrt(slope @ _inner(density, z, held) @ slope)


@jax.jit
def _covariance(density: LogDensity, z: Array, held: Bool[Array, " E"]) -> Float[Array, "E E"]:
    """N P (P J'J P)^-1 P N' with J the derivative of all residuals by z, what is held apart.

    What then cannot move has no variance, of which rounding would leave a little of either sign.
    """
    P, _ = _projector(density, held)
    moves = jnp.linalg.norm(density.basis @ P, axis=1) > _ONE * jnp.linalg.norm(density.basis, axis=1)
    basis = jnp.where(moves[:, None], density.basis, 0.0)
    return basis @ _inner(density, z, held) @ basis.T


def _inner(density: LogDensity, z: Array, held: Bool[Array, " E"]) -> Float[Array, "Z Z"]:
    P, _ = _projector(density, held)
    J = jax.jacfwd(density.residuals)(z) @ P
    return P @ jnp.linalg.inv(J.T @ J + jnp.eye(len(z)) - P) @ P


def _names(fits: Sequence[Fit]) -> tuple[str, ...]:
    model = fits[0].model
    own = [f"{label} {q.name}" for label, p in zip(model.labels, model.processes, strict=True) for q in p.parameters]
    return tuple(own if len(fits) == 1 else (f"{f.wv.channels[0]} {name}" for f in fits for name in own))


def _positions(name: str, names: Sequence[str], num_channels: int) -> list[int]:
    """Where a parameter stands: one place, or one a channel where the name has no channel."""
    if name in names:
        return [names.index(name)]
    found = [i for i, known in enumerate(names) if num_channels > 1 and known.endswith(f" {name}")]
    if not found:
        raise ValueError(f"There is no parameter {name!r}; there are {', '.join(names)}.")
    return found


def _priors(names: Sequence[str], num_channels: int, priors: Mapping[str, Prior]) -> tuple[np.ndarray, np.ndarray]:
    """Medians, per sample, and 1/s; of those named with their channel last, which so override."""
    median, precision = np.ones(len(names)), np.zeros(len(names))
    for name in sorted(priors, key=lambda n: n in names):
        prior = priors[name]
        positive(f"The median of the prior on {name}", np.asarray(prior.median, dtype=float))
        if not 1 < prior.factor < np.inf:
            raise ValueError(f"The factor of the prior on {name} is above 1, and is {prior.factor}.")
        for i in _positions(name, names, num_channels):
            median[i], precision[i] = prior.median, 1 / np.log(prior.factor)
    return median, precision


def _between(
    names: Sequence[str], num_channels: int, bounds: Bounds, model: Composite
) -> dict[int, tuple[float, float]]:
    """Position -> bounds per sample; those named with their channel override."""
    parameters = [q for _ in range(num_channels) for p in model.processes for q in p.parameters]
    found = {}
    for name in sorted(bounds, key=lambda n: n in names):
        for i in _positions(name, names, num_channels):
            low, high = checked(name, bounds[name], parameters[i])
            found[i] = float(low), float(high)
    return found


def _on_lines(
    between: Mapping[int, tuple[float, float]], model: Composite, num_channels: int
) -> tuple[np.ndarray, np.ndarray]:
    """The bounds of all parameters on the real line, infinite where there are none."""
    parameters = [q for _ in range(num_channels) for p in model.processes for q in p.parameters]
    ends = [
        [float(q.to_line(x)) for x in between[i]] if i in between else [-np.inf, np.inf]
        for i, q in enumerate(parameters)
    ]
    low, high = np.array(ends).T
    return low, high


class _Begin(NamedTuple):
    """Where the search for the mode of one channel begins."""

    model: Composite
    at_boundary: Mapping[str, Outcome]


def _begin(
    fits: Sequence[Fit], between: Mapping[int, tuple[float, float]], names: Sequence[str], model: Composite
) -> list[_Begin]:
    """The fits of the channels alone, between the bounds."""
    if not between:
        return [_Begin(f.model, f.at_boundary) for f in fits]
    begin, size = [], model.num_parameters
    short = [f"{label} {q.name}" for label, p in zip(model.labels, model.processes, strict=True) for q in p.parameters]
    for c, f in enumerate(fits):
        own = {short[i - c * size]: ends for i, ends in between.items() if c * size <= i < (c + 1) * size}
        found = estimate(f.wv, model, weights=f.omega, bounds=own)
        at_boundary, at = {}, 0
        for k, (label, p) in enumerate(zip(found.model.labels, found.model.processes, strict=True)):
            shape = tuple(float(s) for s in p.shape)
            limit = Outcome.at(p.limit_of(shape, float(f.wv.scales[-1]))) if shape else Outcome.ESTIMATED
            if bool(found.at_zero[k]):
                at_boundary[label] = Outcome.ZERO
            elif limit and not np.any(np.asarray(found.at_bound)[at : at + len(shape)]) and not p.fixed:
                at_boundary[label] = limit
            at += len(p.parameters)
        begin.append(_Begin(found.model, at_boundary))
    return begin


def _start(begin: Sequence[_Begin], names: Sequence[str], median: np.ndarray, precision: np.ndarray) -> np.ndarray:
    """The fits of the channels alone on the real line, at a boundary the priors; medians become those of the line."""
    start, at = [], 0
    for f in begin:
        for label, p in zip(f.model.labels, f.model.processes, strict=True):
            for q, value in zip(p.parameters, p.values, strict=True):
                if precision[at]:
                    median[at] = float(q.to_line(q.check(median[at], p.kind, zero_ok=False)))
                x = float(q.to_line(value))
                if label in f.at_boundary:
                    if not precision[at]:
                        raise ValueError(
                            f"{names[at]}: the data put {label} at a boundary ({f.at_boundary[label]}), so that only a "
                            "prior says what it is there. Give it one, or leave the component out."
                        )
                    x = median[at]
                start.append(x)
                at += 1
    return np.array(start)


def _constraints(
    names: Sequence[str],
    fits: Sequence[Fit],
    shared: Sequence[str],
    constraints: Sequence[Constraint],
    start: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """C and d of C eta = d."""
    rows, values, num = [], [], len(fits)

    def add(entries: Mapping[int, float], value: float) -> None:
        row = np.zeros(len(names))
        for i, c in entries.items():
            row[i] = c
        rows.append(row)
        values.append(value)

    for name in shared:
        first, *rest = _positions(name, names, num)
        if not rest:
            raise ValueError(f"{name!r} names one parameter of one channel: there is nothing to share.")
        for i in rest:
            add({i: 1.0, first: -1.0}, 0.0)
    for coefficients, value in constraints:
        places = {name: _positions(name, names, num) for name in coefficients}
        for k in range(max(map(len, places.values()))):
            add({at[k if len(at) > 1 else 0]: coefficients[name] for name, at in places.items()}, value)
    held = [q.name in p.fixed for f in fits for p in f.model.processes for q in p.parameters]
    for i, is_held in enumerate(held):
        if is_held:
            add({i: 1.0}, start[i])
    return np.array(rows).reshape(-1, len(names)), np.array(values)


def _flat(C: np.ndarray, d: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The point of C eta = d nearest to the start, and an orthonormal basis of its directions."""
    if not len(C):
        return start, np.eye(len(start))
    U, s, Vt = np.linalg.svd(C)
    rank = int(np.sum(s > _DEPENDENT * s[0]))
    step = Vt[:rank].T @ ((U.T @ (d - C @ start))[:rank] / s[:rank])
    origin = start + step
    if not np.allclose(C @ origin, d, rtol=0, atol=1e-8 * (1 + np.abs(d).max())):
        raise ValueError("What is shared, held and constrained contradicts itself: no parameters satisfy all of it.")
    if rank == len(start):
        raise ValueError("What is shared, held and constrained leaves nothing to estimate.")
    return origin, Vt[rank:].T
