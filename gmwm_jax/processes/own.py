"""The base of a process of one's own: one law of it is given, all others follow by numbers."""

import math
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.processes._maths import by_lags, by_spectrum
from gmwm_jax.processes._maths.circulant import draw_stationary, negative_share
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.parameter import Limit, Parameter
from gmwm_jax.processes.state_space import StateSpace

_LAWS = ("unit_psd", "unit_autocovariance", "unit_wavelet_variance")
_OCTAVES = 60
"""Of spans, from which the variance of a mean follows."""
_EMBEDDING = 4
"""Half the length of the circulant of a simulation, in records."""
_CLIPPED = 0.01
"""Largest share of the variance that a simulation may miss."""
_PER_SAMPLE, _SAMPLES = "1/sample", "sample"
_BEYOND = 100.0
"""How far outside of what a record shows a time or a rate is looked for."""
_WIDEST = 1e3
"""Of a number without unit and without bounds, and its inverse."""
_INSIDE = 1e-3
"""Distance from the bounds of a parameter, of their distance."""


_AT_END = 1e-3
"""Of the range of a coordinate: this close to an end it is there."""


class OwnProcess(AbstractProcess):
    """A process of your own: define one of its laws, and the others follow numerically.

    A class names itself (`kind`) and its parameters, the last of which carries the amplitude, and defines one of three
    class methods for unit amplitude, with ``shape`` the other parameters in order:

    ``unit_psd(cls, shape, frequency)``
        Two-sided PSD at 0 < frequency <= 1/2, per cycle per sample, smooth in the logarithm of frequency (or of its
        distance from 1/2), not steeper than frequency^-2 towards 0. From it follow the wavelet variance to 1e-9 and, if
        ``stationary``, the autocovariance to 1e-10 of the variance.
    ``unit_autocovariance(cls, shape, lag)``
        At integers >= 0, up to 2^25. The wavelet variance follows to 1e-8, or to 1e-15 of the variance of a sample; the
        PSD to 1e-6 of its largest value, above 1e-6 cycles per sample.
    ``unit_wavelet_variance(cls, shape, tau)``
        At *all* even spans, not only powers of two, and up to 2^85. Of a process that is stationary the variance of a
        mean of m samples is then the sum of nu^2(2m) + nu^2(4m) + nu^2(8m) + .., and from it the autocovariance
        follows to 1e-9 of the variance, beyond 256 samples without what alternates from sample to sample, and the PSD
        to 1e-5 of its largest value. With ``stationary = False`` other processes have the same wavelet variance, so
        that nothing follows: a fit has no standard errors, and there is no simulation.

    The covariance of the wavelet variance, and with it standard errors, follows to 1e-6 of the standard deviations;
    from a wavelet variance to 1e-5 where the process remembers longer than the record.

    Whatever else a class defines replaces what would follow: ``simulate``, ``state_space`` (None unless defined: no
    filter then holds it), ``continuous``, ``amplitude_of`` and ``value_of``, ``correlation_time``, ``ringing``, the
    coordinates of the search. `register` makes it known to model texts and to saved files.

    Numbers are those of a spectrum whose features are an octave wide. A resonance of relative half width 0.25 keeps 8
    digits; for a narrower one set ``resolution`` to 2 or 4, and define ``ringing``.

    A search looks for a parameter with the unit ``1/sample`` from 0.01/tau_max to 3, for one with ``sample`` from 0.3
    to 100 tau_max, for others between the bounds of the `Parameter`, or from 1e-3 to 1e3. An estimate at such an end is
    marked as at the end of its range, unless the class says what the process is there, by `limit_of`.

    Examples
    --------
    >>> class Corner(gj.processes.OwnProcess):
    ...     fc: jax.Array | None
    ...     c: jax.Array | None
    ...     kind = "CORNER"
    ...     parameters = (
    ...         gj.processes.Parameter("fc", "1/sample", "corner"),
    ...         gj.processes.Parameter("c", "({u})^2", "PSD at 0"),
    ...     )
    ...     @classmethod
    ...     def unit_psd(cls, shape, frequency):
    ...         return 1 / (1 + (frequency / shape[0]) ** 2)
    >>> Corner(fc=0.01, c=2.0).wavelet_variance([2.0, 1024.0]).round(6).tolist()
    [0.001467, 0.001862]
    """

    stationary: ClassVar[bool] = True
    """Has it a variance?"""
    resolution: ClassVar[int] = 1
    """How much finer than usual spectrum and autocovariance are looked at."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        given = cls._laws()
        if not given:
            raise TypeError(f"{cls.__name__} must define one of {', '.join(_LAWS)}: all others follow from it.")
        for name in ("kind", "parameters"):
            if not hasattr(cls, name):
                raise TypeError(f"{cls.__name__} has no `{name}`: a process names itself and its parameters.")
        cls.determines_covariance = cls.stationary or given[0] != "unit_wavelet_variance"
        if "num_coordinates" not in vars(cls):
            cls.num_coordinates = max(len(cls.parameters) - 1, 1)

    def __init__(self, *values: Any, **named: Any):
        names = [p.name for p in self.parameters]
        given = dict(zip(names, values, strict=False))
        if len(values) > len(names) or (wrong := [n for n in named if n not in names or n in given]):
            said = f"{len(values)} values" if len(values) > len(names) else f"{', '.join(wrong)}, once more or unknown"
            raise TypeError(f"{self.kind} has the parameters {', '.join(names)}, and was given {said}.")
        self._set(**{name: None for name in names} | given | named)

    @classmethod
    def _laws(cls) -> list[str]:
        """What the class defines itself, the most telling first."""
        return [name for name in _LAWS if getattr(cls, name).__func__ is not getattr(OwnProcess, name).__func__]

    # -- what follows -------------------------------------------------------------------------------------------------

    @classmethod
    def unit_wavelet_variance(cls, shape: tuple[Any, ...], tau: Float[Array, "*J"]) -> Float[Array, "*J"]:
        """Return the Haar MODWT wavelet variance at even spans, from the PSD or the autocovariance."""
        if cls._laws()[0] == "unit_psd":
            p = by_spectrum.panels(cls.resolution)
            return by_spectrum.wavelet_variance(p, cls._spectrum(shape), tau)
        at = by_lags.lattice(cls.resolution)
        return by_lags.wavelet_variance(at, cls._on_lattice(shape)[0], tau)

    @classmethod
    def unit_psd(cls, shape: tuple[Any, ...], frequency: Float[Array, "*F"]) -> Float[Array, "*F"]:
        """Return the two-sided PSD, from the autocovariance."""
        cls._require_stationary("PSD")
        at = by_lags.lattice(cls.resolution)
        return by_lags.spectrum(at, cls._variance(shape), cls._on_lattice(shape)[1], frequency)

    @classmethod
    def unit_autocovariance(cls, shape: tuple[Any, ...], lag: Float[Array, "*L"]) -> Float[Array, "*L"]:
        """Return the autocovariance at integers >= 0, from the PSD or the wavelet variance."""
        cls._require_stationary("autocovariance")
        return cls._smooth_covariance(shape, lag, by_lags.parity_of(lag))

    @classmethod
    def unit_haar_covariance(
        cls,
        shape: tuple[Any, ...],
        lag: Float[Array, "*P"],
        parity: Float[Array, "*P"],
        n_j: Float[Array, "*P"],
        n_k: Float[Array, "*P"],
    ) -> Float[Array, "*P"]:
        """Cov(W_{j,t+lag}, W_{k,t}) of the Haar MODWT coefficients with half spans n_j, n_k, by second differences."""
        if not cls.determines_covariance:
            raise ValueError(
                f"The wavelet variance of {cls.kind}, which is not stationary, does not determine a covariance: define "
                "unit_psd."
            )
        return by_lags.haar_covariance(by_lags.lattice(cls.resolution), *cls._on_lattice(shape), lag, parity, n_j, n_k)

    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:
        """Draw from the autocovariance by circulant embedding; of a process that is not stationary, its steps from 0.

        Beyond the record lags go on ever slower, over three records, so that the circulant has no edge: where the
        autocovariance falls and is convex that is exact (Polya's criterion), however long the process remembers. Else
        some of its eigenvalues may be negative, and are set to zero.

        Raises
        ------
        RuntimeError
            What is negative is more than 1 % of the variance about the mean, as of a smooth process that remembers much
            longer than the record.
        """
        self.require_complete()
        if not self.determines_covariance:
            raise ValueError(f"{self.kind} has no covariance to draw from: define unit_psd, or simulate.")
        lag = jnp.arange(_EMBEDDING * num_samples + 1, dtype=jnp.float64)
        rest = (_EMBEDDING - 1) * num_samples
        beyond = jnp.maximum(lag - num_samples, 0.0) / rest
        seen = jnp.minimum(lag, num_samples) + rest * (beyond + jnp.sin(jnp.pi * beyond) / jnp.pi) / 2
        law = self._smooth_covariance if self.stationary else self._covariance_of_steps
        covariance = law(self.shape, seen, by_lags.parity_of(lag))
        share = negative_share(covariance)
        covariance = eqx.error_if(
            covariance,
            ~(share < _CLIPPED),
            f"{self.kind} cannot be drawn from its autocovariance: more than {100 * _CLIPPED:g} % of the variance of "
            "the circulant is negative, or the variance is not finite. It remembers longer than the record: draw a "
            "longer one and cut it, say `stationary = False` if its PSD has no integral, or define `simulate`.",
        )
        drawn = jnp.sqrt(self.amplitude) * draw_stationary(covariance, key)[:num_samples]
        return drawn if self.stationary else jnp.cumsum(drawn)

    def state_space(self) -> StateSpace | None:
        """None: a class that has one defines it."""
        self.require_complete()
        return None

    @classmethod
    def _require_stationary(cls, what: str) -> None:
        if not cls.stationary:
            raise ValueError(f"{cls.kind} is not stationary: it has no {what} that would follow.")

    @classmethod
    def _spectrum(cls, shape: tuple[Any, ...]) -> Float[Array, "B Q"]:
        f = by_spectrum.panels(cls.resolution).frequency
        return cls.unit_psd(shape, jnp.asarray(f.ravel())).reshape(f.shape)

    @classmethod
    def _variance(cls, shape: tuple[Any, ...]) -> Any:
        law = cls._laws()[0]
        if law == "unit_psd":
            return by_spectrum.variance(by_spectrum.panels(cls.resolution), cls._spectrum(shape))
        if law == "unit_autocovariance":
            return cls.unit_autocovariance(shape, jnp.zeros(1))[0]
        return cls._variance_of_sums(shape, jnp.ones(1))[0]

    @classmethod
    def _on_lattice(cls, shape: tuple[Any, ...]) -> tuple[Float[Array, " L"], Float[Array, " L"]]:
        """U and D of `by_lags`."""
        at = by_lags.lattice(cls.resolution)
        lags = jnp.asarray(at.lags)
        law = cls._laws()[0]
        if law == "unit_wavelet_variance":
            U = (lags * lags * cls._variance(shape) - cls._variance_of_sums(shape, lags)) / 2
            return U, by_lags.second_difference(at, U)
        if law == "unit_psd":
            D = by_spectrum.structure(cls.resolution, cls._spectrum(shape))
        else:
            D = cls._variance(shape) - cls.unit_autocovariance(shape, lags)
        return by_lags.second_sum(at, D), D

    @classmethod
    def _smooth_covariance(
        cls, shape: tuple[Any, ...], lag: Float[Array, " L"], sign: Float[Array, " L"]
    ) -> Float[Array, " L"]:
        """At real lags on the line of one parity."""
        return cls._variance(shape) - by_lags.interpolate(
            by_lags.lattice(cls.resolution), cls._on_lattice(shape)[1], lag, sign
        )

    @classmethod
    def _covariance_of_steps(
        cls, shape: tuple[Any, ...], lag: Float[Array, " L"], sign: Float[Array, " L"]
    ) -> Float[Array, " L"]:
        """Of x_t - x_{t-1}, whose PSD is 4 sin(pi f)^2 times that of x."""
        p, at = by_spectrum.panels(cls.resolution), by_lags.lattice(cls.resolution)
        spectrum = 4 * np.sin(np.pi * p.frequency) ** 2 * cls._spectrum(shape)
        D = by_spectrum.structure(cls.resolution, spectrum)
        return by_spectrum.variance(p, spectrum) - by_lags.interpolate(at, D, lag, sign)

    @classmethod
    def _variance_of_sums(cls, shape: tuple[Any, ...], m: Float[Array, " L"]) -> Float[Array, " L"]:
        """Of m samples: m^2 [nu^2(2m) + nu^2(4m) + ..], a mean being what the means of its halves have in common."""
        safe = jnp.maximum(m, 1.0)
        spans = safe[None] * (2.0 ** np.arange(1, _OCTAVES + 1))[:, None]
        nu = cls.unit_wavelet_variance(shape, spans.ravel()).reshape(spans.shape)
        ratio = nu[-1] / jnp.where(nu[-2] > 0, nu[-2], 1.0)
        rest = jnp.where(ratio < 1, nu[-1] * ratio / jnp.where(ratio < 1, 1 - ratio, 1.0), jnp.inf)
        return jnp.where(m > 0, safe * safe * (jnp.sum(nu[::-1], axis=0) + rest), 0.0)

    # -- the search ---------------------------------------------------------------------------------------------------

    @classmethod
    def _shape_parameters(cls) -> tuple[Parameter, ...]:
        if len(cls.parameters) == 1:
            raise NotImplementedError(f"{cls.kind} has no shape parameter.")
        return cls.parameters[:-1]

    @classmethod
    def shape_from_coordinate(cls, coordinate: Any) -> tuple[Any, ...]:
        """One coordinate for each shape parameter: its logarithm, or itself where it may be negative."""
        shown = cls._shape_parameters()
        each = [coordinate] if len(shown) == 1 else [coordinate[..., i] for i in range(len(shown))]
        return tuple(namespace(u).exp(u) if _is_log(p) else u for p, u in zip(shown, each, strict=True))

    @classmethod
    def coordinate_from_shape(cls, shape: tuple[Any, ...]) -> Any:
        """Inverse of `shape_from_coordinate`."""
        xp = namespace(*shape)
        each = [xp.log(v) if _is_log(p) else xp.asarray(v) for p, v in zip(cls._shape_parameters(), shape, strict=True)]
        return each[0] if len(each) == 1 else xp.stack(each, axis=-1)

    @classmethod
    def coordinate_bounds(cls, tau_max: float) -> Any:
        """By the units and the bounds of the parameters."""
        ends = [tuple(math.log(v) if _is_log(p) else v for v in _range(p, tau_max)) for p in cls._shape_parameters()]
        return ends[0] if len(ends) == 1 else tuple(ends)

    @classmethod
    def limit_of(cls, shape: tuple[Any, ...], tau_max: float) -> Limit:
        """That one of the parameters is at an end of where the search looks for it."""
        at = np.atleast_1d(np.asarray(cls.coordinate_from_shape(known(*shape))))
        low, high = np.reshape(cls.coordinate_bounds(tau_max), (-1, 2)).T
        near = _AT_END * (high - low)
        return Limit.END_OF_RANGE if np.any((at < low + near) | (at > high - near)) else Limit.NONE

    @classmethod
    def start_nodes(cls, tau_max: float, num: int) -> tuple[Any, ...]:
        """Evenly between the bounds; of several coordinates points that fill the box evenly (Roberts 2018)."""
        d = len(cls._shape_parameters())
        if d == 1:
            low, high = cls.coordinate_bounds(tau_max)
            return tuple(float(u) for u in np.linspace(low, high, num))
        low, high = np.array(cls.coordinate_bounds(tau_max)).T
        ratio = 2.0
        for _ in range(50):  # the root of x^(d+1) = x + 1
            ratio = (1 + ratio) ** (1 / (d + 1))
        inside = (0.5 + np.arange(1, num + 1)[:, None] * ratio ** -np.arange(1.0, d + 1)) % 1
        return tuple(map(tuple, low + (high - low) * inside))

    @classmethod
    def correlation_time(cls, shape: tuple[Any, ...]) -> Any:
        """The first parameter that is a rate or a time says it; else 0."""
        for p, value in zip(cls._shape_parameters(), shape, strict=True):
            if p.unit in (_PER_SAMPLE, _SAMPLES):
                return 1 / value if p.unit == _PER_SAMPLE else value
        return 0 * shape[0]


def _is_log(p: Parameter) -> bool:
    return p.lower >= 0


def _range(p: Parameter, tau_max: float) -> tuple[float, float]:
    """Where a search looks for a parameter."""
    low, high = {
        _PER_SAMPLE: (1 / (_BEYOND * tau_max), math.pi),
        _SAMPLES: (1 / math.pi, _BEYOND * tau_max),
    }.get(p.unit, (1 / _WIDEST if _is_log(p) else -_WIDEST, _WIDEST))
    width = p.upper - p.lower
    inner = _INSIDE * width if math.isfinite(width) else 0.0
    return max(low, p.lower + inner), min(high, p.upper - inner)
