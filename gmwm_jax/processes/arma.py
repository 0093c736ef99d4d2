"""Autoregressive moving-average processes of any order: AR(p), MA(q), ARMA(p, q), each order a class of its own.

x_t = phi_1 x_{t-1} + .. + phi_p x_{t-p} + e_t + theta_1 e_{t-1} + .. + theta_q e_{t-q}, as R and statsmodels write it.

Estimation searches over the partial autocorrelations: r_1 .. r_p, each in (-1, 1), are the stationary autoregressions
one to one (Barndorff-Nielsen & Schou 1973), and the same map (Monahan 1984) makes the moving averages invertible,
without which two of them would be one process. Moments are those of `_doubling`.
"""

import math
from functools import lru_cache
from types import new_class
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Float

from gmwm_jax._internal.checks import concrete, integer, spans
from gmwm_jax._internal.host import namespace
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.processes._maths import doubling as _doubling
from gmwm_jax.processes._maths.arma_covariance import haar_covariance
from gmwm_jax.processes.base import AbstractProcess, scaled
from gmwm_jax.processes.continuous_form import ContinuousForm
from gmwm_jax.processes.gauss_markov import AR1, GM
from gmwm_jax.processes.parameter import Limit, Parameter
from gmwm_jax.processes.state_space import StateSpace

MAX_ORDER = 10
"""Of either part: beyond it differences of that order lose digits, and no wavelet variance tells so many apart."""
_END = math.log(2e6)
"""Bounds of the coordinates: 1e-6 from a partial autocorrelation of +-1."""
_SMALLEST_GAP_TAU = 1e-9
"""The first coordinate goes on to where 1 - r_1, times the longest span, is a random walk to all digits a fit sees."""
_UNIT_ROOT_TAU = 1e-2
_UNIT_ROOT = 1e-5
"""Nearer than these to a unit root, seen from the longest span or at all, a fit reports it."""
_INNER = 5.0
"""Coordinates within which most of the starts lie, +-0.987."""
_BLOCK = 64


class AbstractArma(AbstractProcess):
    """What the orders have in common; `ARMA` makes the classes."""

    num_ar: ClassVar[int]
    num_ma: ClassVar[int]

    def __init__(self, *values: Any, **named: Any):
        names = [p.name for p in self.parameters]
        given = {**dict(zip(names, values, strict=False)), **named}
        if len(values) > len(names) or len(given) < len(values) + len(named) or not set(given) <= set(names):
            raise TypeError(f"{self.kind} takes {', '.join(names)}, each once.")
        self._set(**{n: given.get(n) for n in names})

    def _set(self, **values: Any) -> None:
        super()._set(**values)
        seen = [None if v is None else concrete(v) for v in self.shape]
        phi, theta = self._parts(seen)
        self._require_roots(phi, "phi", "stationary")
        self._require_roots([None if t is None else -t for t in theta], "theta", "invertible")

    def _require_roots(self, coefficients: list[Any], name: str, property_: str) -> None:
        if any(c is None for c in coefficients):
            return
        with np.errstate(divide="ignore", invalid="ignore"):
            partial = [float(r) for r in partial_autocorrelations(coefficients)]
        if not all(-1 < r < 1 for r in partial):
            values = ", ".join(f"{name}{i}={getattr(self, f'{name}{i}'):g}" for i in range(1, len(coefficients) + 1))
            raise ValueError(
                f"{self.kind}: with {values} it is not {property_}: a root of its polynomial lies on or inside the "
                f"unit circle (partial autocorrelations {', '.join(f'{r:.4g}' for r in partial)}, which must lie in "
                "(-1, 1))."
            )

    @classmethod
    def _parts(cls, shape: Any) -> tuple[list[Any], list[Any]]:
        return list(shape[: cls.num_ar]), list(shape[cls.num_ar :])

    @classmethod
    def _form(cls, shape: Any) -> _doubling.Form:
        return _doubling.form(*cls._parts(shape))

    @classmethod
    def unit_wavelet_variance(cls, shape, tau):
        """At spans that are powers of two; NaN at others."""
        return _doubling.wavelet_variance(cls._form(shape), tau)

    @classmethod
    def _unit_wavelet_variance_of_any_span(cls, shape, tau):
        return _doubling.wavelet_variance_of_any_span(cls._form(shape), tau)

    def wavelet_variance(self, tau: Any) -> Float[jax.Array, "*J"]:
        """As of every process; spans that are no powers of two take longer, and must not be traced (else NaN)."""
        seen = concrete(spans(tau))
        if seen is None or np.all(np.log2(seen) % 1 == 0):
            return super().wavelet_variance(tau)
        self.require_complete()
        return scaled(self._unit_wavelet_variance_of_any_span, self.amplitude, self.shape, spans(tau))

    @classmethod
    def unit_psd(cls, shape, frequency):
        """|theta(z)|^2/|phi(z)|^2 in powers of 1 - z, which does not cancel at low frequencies."""
        phi, theta = cls._parts(shape)
        real, imaginary = 2 * jnp.sin(jnp.pi * frequency) ** 2, jnp.sin(2 * jnp.pi * frequency)

        def squared(coefficients: list[Any]) -> Any:
            a, b = jnp.zeros_like(frequency), jnp.zeros_like(frequency)
            for c in reversed(_doubling.in_differences(coefficients, len(coefficients))):
                a, b = a * real - b * imaginary + c, a * imaginary + b * real
            return a * a + b * b

        one = jnp.ones(())
        return squared([one, *theta]) / squared([one, *(-a for a in phi)])

    @classmethod
    def unit_autocovariance(cls, shape, lag):
        """H' F^m P h."""
        form = cls._form(shape)
        start = _doubling.stationary_covariance(form) @ form.readout
        F = jnp.eye(len(start)) + form.step
        return jnp.reshape(_doubling.powers_times(F, start, lag.ravel()) @ form.readout, lag.shape)

    @classmethod
    def unit_haar_covariance(cls, shape, lag, parity, n_j, n_k):
        """See `_arma_covariance`."""
        return haar_covariance(cls._form(shape), lag, parity, n_j, n_k)

    @classmethod
    def ringing(cls, shape):
        """Of the root that turns the most, between lags of one parity; of three turns while it is unknown."""
        phi = [concrete(a) for a in shape[: cls.num_ar]]
        if any(a is None for a in phi):
            return 6 * math.pi if cls.num_ar > 1 else 0.0
        roots = _roots(np.array(phi, dtype=float)).astype(complex)
        turns, falls = np.abs(np.angle(roots * roots)), -2 * np.log(np.clip(np.abs(roots), 1e-300, 1 - 1e-16))
        return float(np.max(turns / falls))

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[jax.Array, " N"]:
        """From the stationary distribution; blocks of samples in matrix products, see `_recursion`."""
        form = self.state_space()
        d, num_blocks = len(form.readout), -(-num_samples // _BLOCK)
        start, driving = jax.random.split(key)
        # in units of the states' deviations, which differ by powers of a correlation time
        size = jnp.sqrt(jnp.diagonal(form.initial))
        size = jnp.where(size > 0, size, 1.0)
        factor = jnp.linalg.cholesky(form.initial / (size[:, None] * size[None, :]))
        state = size * (factor @ jax.random.normal(start, (d,), dtype=jnp.float64))
        e = jnp.sqrt(self.amplitude) * jax.random.normal(driving, (num_blocks, _BLOCK), dtype=jnp.float64)
        # rows: h' F^i for i = 0 .. B; columns: F^i (1, 1, ..)' for i = 0 .. B - 1
        at = jnp.arange(_BLOCK + 1, dtype=jnp.float64)
        seen = _doubling.powers_times(form.transition.T, form.readout, at)
        driven = _doubling.powers_times(form.transition, jnp.ones(d), at[:-1])
        response = driven @ form.readout
        a, b = jnp.arange(_BLOCK)[:, None], jnp.arange(_BLOCK)[None, :]
        toeplitz = jnp.where(a >= b, response[jnp.maximum(a - b, 0)], 0.0)
        across = jax.vmap(_doubling.powers_times, (None, 0, None), 1)(form.transition, jnp.eye(d), at[-1:])[0].T
        pushes = e @ driven[::-1]
        _, states = lax.scan(lambda x, push: (across @ x + push, x), state, pushes)
        return (e @ toeplitz.T + states @ seen[1:].T).reshape(-1)[:num_samples]

    def state_space(self) -> StateSpace:
        """The autoregressive part u and its backward differences; x = theta(B) u."""
        self.require_complete()
        form, sigma2 = self._form(self.shape), self.amplitude
        d = len(form.readout)
        return StateSpace(
            jnp.eye(d) + form.step,
            sigma2 * jnp.ones((d, d)),
            form.readout,
            sigma2 * _doubling.stationary_covariance(form),
            jnp.zeros(()),
        )

    # -- coordinates -----------------------------------------------------------------------------------------------

    @classmethod
    def shape_from_coordinate(cls, coordinate):
        """From the partial autocorrelations tanh(z/2), those of the moving average with its sign."""
        xp = namespace(coordinate)
        z = [coordinate] if cls.num_coordinates == 1 else xp.moveaxis(xp.asarray(coordinate), -1, 0)
        phi, theta = cls._parts([xp.tanh(x / 2) for x in z])
        return (*coefficients(phi), *(-c for c in coefficients([-t for t in theta])))

    @classmethod
    def coordinate_from_shape(cls, shape):
        """Inverse of `shape_from_coordinate`."""
        z = cls._coordinates(shape)
        return z[0] if cls.num_coordinates == 1 else namespace(*z).stack(z, axis=-1)

    @classmethod
    def _coordinates(cls, shape: Any) -> list[Any]:
        phi, theta = cls._parts(shape)
        r = [*partial_autocorrelations(phi), *(-t for t in partial_autocorrelations([-t for t in theta]))]
        xp = namespace(*r)
        return [2 * xp.arctanh(xp.asarray(x)) for x in r]

    @classmethod
    def to_lines(cls, values):
        """Partial autocorrelations as in `shape_from_coordinate`, and the log of the variance."""
        return [*cls._coordinates(values[:-1]), cls.parameters[-1].to_line(values[-1])]

    def per_line(self):
        """The partial autocorrelations, those of the moving average with its sign, and the variance."""
        if self.num_coordinates == 1:
            return super().per_line()
        numbers = [*range(1, self.num_ar + 1), *range(1, self.num_ma + 1)]
        names = [f"{'phi' if k < self.num_ar else 'theta'} partial {i}" for k, i in enumerate(numbers)]
        partial = [jnp.tanh(z / 2) for z in self._coordinates(self.shape)]
        return dict(zip([*names, self.parameters[-1].name], [*partial, self.values[-1]], strict=True))

    @classmethod
    def from_unconstrained(cls, vector):
        """Inverse of `unconstrained`."""
        z = vector[0] if cls.num_coordinates == 1 else vector[:-1]
        return cls(*cls.shape_from_coordinate(z), cls.parameters[-1].from_line(vector[-1]))

    @classmethod
    def coordinate_bounds(cls, tau_max):
        """Towards r_1 = 1 far beyond the longest span."""
        if cls.num_coordinates == 1:
            return -_END, _END
        high = math.log(2 / max(_SMALLEST_GAP_TAU / tau_max, 1e-14)) if cls.num_ar else _END
        return (-_END, high), *[(-_END, _END)] * (cls.num_coordinates - 1)

    @classmethod
    def limit_of(cls, shape, tau_max):
        """A unit root, of the autoregression or of the moving average."""
        phi, theta = (np.array(part, dtype=float) for part in cls._parts(shape))
        root, root_of_ma = _roots(phi)[0], _roots(-theta)[0]
        near = max(abs(root), abs(root_of_ma)) > 1 - _UNIT_ROOT and abs(root - 1) > _UNIT_ROOT
        return Limit.UNIT_ROOT if near or abs(root - 1) * tau_max < _UNIT_ROOT_TAU else Limit.NONE

    @classmethod
    def start_nodes(cls, tau_max, num):
        """Points that fill a box evenly (Roberts 2018), and the ends of each coordinate."""
        d = cls.num_coordinates
        if d == 1:
            return -_END, *(float(z) for z in np.linspace(-_INNER, _INNER, num - 2)), _END
        ends = np.array(cls.coordinate_bounds(tau_max))
        low, high = np.full(d, -_INNER), np.full(d, _INNER)
        if cls.num_ar:
            high[0] = max(_INNER, math.log(20 * tau_max))
        middle = np.full(d, 0.1)
        points = [np.where(np.arange(d) == i, ends[:, side], middle) for i in range(d) for side in (0, 1)]
        ratio = 2.0
        for _ in range(50):  # the root of x^(d+1) = x + 1
            ratio = (1 + ratio) ** (1 / (d + 1))
        steps = ratio ** -np.arange(1.0, d + 1)
        inside = (0.5 + np.arange(1, max(num - 2 * d, 1) + 1)[:, None] * steps) % 1
        return tuple(map(tuple, [*points, *(low + (high - low) * inside)]))[:num]

    @classmethod
    def correlation_time(cls, shape):
        """Of the largest root; 0 for a moving average."""
        phi = np.stack(np.broadcast_arrays(*map(np.asarray, shape)), axis=-1)[..., : cls.num_ar]
        size = np.abs(_roots(phi)[..., 0])
        with np.errstate(divide="ignore"):
            return -1 / np.log(np.minimum(size, 1 - 1e-16))


def coefficients(partial: list[Any]) -> list[Any]:
    """phi_1 .. phi_p of 1 - phi_1 z - .. from the partial autocorrelations, by the Levinson recursion."""
    phi: list[Any] = []
    for r in partial:
        phi = [*(_less(a, r, b) for a, b in zip(phi, reversed(phi), strict=True)), r]
    return phi


def partial_autocorrelations(phi: list[Any]) -> list[Any]:
    """Inverse of `coefficients`."""
    partial: list[Any] = []
    while phi:
        *rest, r = phi
        partial.append(r)
        phi = [_less(a, -r, b) / ((1 - r) * (1 + r)) for a, b in zip(rest, reversed(rest), strict=True)]
    return partial[::-1]


def _less(a: Any, r: Any, b: Any) -> Any:
    """A - r b without cancellation where a = b or a = -b and r is near 1 or -1, as of two coefficients."""
    return namespace(a, r, b).where(r > 0, (a - b) + (1 - r) * b, (a + b) - (1 + r) * b)


def _roots(phi: Float[np.ndarray, "... p"]) -> Any:
    """The roots of z^p - phi_1 z^(p-1) - .., the largest in size first; 0 if there is none."""
    num = phi.shape[-1]
    if num == 0:
        return np.zeros((*phi.shape[:-1], 1))
    companion = np.broadcast_to(np.eye(num, k=-1), (*phi.shape, num)).copy()
    companion[..., 0, :] = phi
    roots = np.linalg.eigvals(companion)
    return np.take_along_axis(roots, np.argsort(-np.abs(roots), axis=-1), -1)


def AR(p: int) -> type[AbstractProcess]:
    """Return the class of autoregressions of order p; ``AR(2)(0.5, 0.2, 1.0)`` is one of them, see `ARMA`.

    Examples
    --------
    >>> gj.AR(2)(phi1=0.5, phi2=0.2, sigma2=1.0)
    AR(2)(phi1=0.5, phi2=0.2, sigma2=1)
    >>> gj.parse_model("WN + AR(2)")
    WN + AR(2)
    """
    return ARMA(p, 0)


def MA(q: int) -> type[AbstractProcess]:
    """Return the class of moving averages of order q; ``MA(1)(0.4, 1.0)`` is one of them, see `ARMA`.

    Examples
    --------
    >>> gj.MA(1)(theta1=0.5, sigma2=1.0).autocovariance(np.array([0, 1, 2])).tolist()
    [1.25, 0.5, 0.0]
    """
    return ARMA(0, q)


@lru_cache
def ARMA(p: int, q: int) -> type[AbstractProcess]:
    """Return the class of ARMA(p, q) processes, which model texts call ``ARMA(2,1)``.

    Parameters
    ----------
    p, q
        Orders of the autoregression and of the moving average, up to 10 each. ARMA(1, 0) is `AR1`.

    Returns
    -------
    A class with the parameters phi1 .. phip, theta1 .. thetaq, sigma2 (variance of the innovations, u^2):
    ``ARMA(2, 1)(0.5, 0.2, 0.4, sigma2=1.0)``. All of phi and theta are estimated together, or held together.

    Raises
    ------
    ValueError
        Orders that are no integers from 0 to 10, or both zero.

    Notes
    -----
    x_t = sum phi_i x_{t-i} + e_t + sum theta_i e_{t-i}, stationary and invertible. Wavelet variances keep 12 digits;
    near a unit root of multiplicity r, at 1 - delta, what the coefficients do, 1e-16/delta^r of that share.

    Examples
    --------
    >>> gj.ARMA(2, 1)(0.5, 0.2, 0.4, sigma2=1.0)
    ARMA(2,1)(phi1=0.5, phi2=0.2, theta1=0.4, sigma2=1)
    """
    p, q = integer("p", p, 0), integer("q", q, 0)
    if not 0 < max(p, q) <= MAX_ORDER:
        raise ValueError(f"An ARMA(p, q) has orders up to {MAX_ORDER}, not both 0, and these are {p} and {q}.")
    if (p, q) == (1, 0):
        return AR1
    name = f"ARMA({p},{q})" if p and q else f"AR({p})" if p else f"MA({q})"
    parts = (("phi", p, "coefficient"), ("theta", q, "coefficient of the moving average"))
    shape = tuple(
        # a root outside the unit circle bounds each coefficient by a binomial one
        Parameter(
            f"{symbol}{i}", "1", meaning, -float(math.comb(order, i)), float(math.comb(order, i)), Limit.UNIT_ROOT
        )
        for symbol, order, meaning in parts
        for i in range(1, order + 1)
    )
    sigma2 = Parameter("sigma2", "({u})^2", "variance of the innovations", determined_at=Limit.UNIT_ROOT)
    members = {
        "__doc__": f"{name} process, see `gmwm_jax.ARMA`.",
        "__module__": __name__,
        "__annotations__": {parameter.name: Any for parameter in (*shape, sigma2)},
        "kind": name,
        "parameters": (*shape, sigma2),
        "num_ar": p,
        "num_ma": q,
        "num_coordinates": p + q,
        "repeatable": q < p,
        "white_part": q - p if q >= p else None,
        "adjusts_white_part": q >= p,
    }
    made = new_class(name, (AbstractArma,), exec_body=lambda namespace: namespace.update(members))
    made.continuous = _continuous(made)
    return made


def _continuous(cls: type[AbstractArma]) -> ContinuousForm:
    """Coefficients belong to a sampling rate: what is left is the standard deviation, and white noise far beyond."""
    assert GM.continuous is not None
    _, q = GM.continuous.filter
    sigma, _, _, white = GM.continuous.datasheet
    reads = tuple(range(len(cls.parameters)))

    def density_of(*values: Any) -> Any:
        *shape, sigma2, f = values
        return sigma2 * cls.unit_psd(tuple(shape), jnp.zeros(())) / f

    def sigma_of(*values: Any) -> Any:
        *shape, sigma2, _ = values
        return jnp.sqrt(sigma2 * cls.unit_autocovariance(tuple(shape), jnp.zeros(())))

    return ContinuousForm(
        filter=(
            q._replace(
                symbol="q_0",
                meaning="PSD at frequency 0",
                suffix="^2/Hz",
                value=density_of,
                reads=reads,
                determined_at=Limit.NONE,
            ),
        ),
        datasheet=(
            sigma._replace(value=sigma_of, reads=reads, determined_at=Limit.NONE),
            white._replace(
                meaning="density as white noise, at long times",
                value=lambda *v: jnp.sqrt(density_of(*v)),
                reads=reads,
                determined_at=Limit.NONE,
            ),
        ),
        inverse=None,
    )
