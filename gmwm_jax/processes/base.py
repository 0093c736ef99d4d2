"""Processes and their sums: what each offers, and what the estimator asks of it.

A process is *separable*: its covariance is an amplitude (a variance, a squared slope) times a unit covariance that
depends on the remaining *shape* parameters only. The estimator solves for amplitudes exactly and searches over shapes.

One more process is one file that derives from `AbstractProcess`, one entry in `gmwm_jax.processes.registry` and one row
in the table of the tests. Whatever others need to know of a process, it says itself: nobody asks for its name.
"""

import abc
import itertools
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.checks import as_float, concrete, spans
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.processes.continuous_form import ContinuousForm
from gmwm_jax.processes.parameter import Fixed, Limit, Parameter
from gmwm_jax.processes.state_space import StateSpace


class AbstractProcess(eqx.Module):
    """A latent process with its parameters per sample. A parameter that is None is to be estimated.

    Values given are starting values of an estimation, or held if they are wrapped in `Fixed` (or by `fix`).
    """

    kind: ClassVar[str]
    """Name in a model text: ``WN``, ``GM`` ..."""
    parameters: ClassVar[tuple[Parameter, ...]]
    """In the order of the fields; the last one carries the amplitude."""
    repeatable: ClassVar[bool] = False
    """May a model hold several? Only where shapes tell them apart."""
    white_part: ClassVar[int | None] = None
    """Degree, as a polynomial in cos(2 pi f), of the part of the spectrum that has no pole; None if there is none."""
    adjusts_white_part: ClassVar[bool] = False
    """Can its shape imitate every such part up to its degree?"""
    ergodic: ClassVar[bool] = True
    """Does one record tell the law of all? Else its wavelet variance has no covariance of the usual kind."""
    determines_covariance: ClassVar[bool] = True
    """Does what its class defines determine the covariance of its Haar coefficients? A wavelet variance alone does not,
    where the process is not stationary."""
    deterministic: ClassVar[bool] = False
    """Is it a function of time, with nothing random but a sign that no variance shows? Then it is the mean of the Haar
    coefficients, and no noise."""
    driven: ClassVar[bool] = True
    """Does new noise drive it at each sample? Else all that is random in it is how it starts: a filter or a simulation
    whose states start from zero leaves it its start, without which it would not be there."""
    in_filter: ClassVar[bool] = True
    """Does a filter hold it, as states or as white noise? Not where its integral stays bounded, so that a filter loses
    next to nothing without it, see `bounded_integral`."""
    other_form: ClassVar["type[AbstractProcess] | None"] = None
    """The class that is the same process in other parameters: a model has one of the two."""
    continuous: ClassVar[ContinuousForm | None] = None
    """Its continuous-time form, by which tables show it and by which it moves to another sampling rate; None if it has
    no such form."""
    fixed: tuple[str, ...] = eqx.field(static=True)
    """Names of the parameters that estimation holds."""

    def _set(self, **values: Any) -> None:
        """Check and store the parameters, unwrapping `Fixed`: the body of every constructor."""
        held = []
        for p in self.parameters:
            value = values[p.name]
            if isinstance(value, Fixed):
                held.append(p.name)
                value = value.value
            if value is not None:
                value = p.check(value, self.kind, zero_ok=p is self.parameters[-1])
            object.__setattr__(self, p.name, value)
        object.__setattr__(self, "fixed", tuple(held))

    @property
    def values(self) -> tuple[Any, ...]:
        """Parameter values in order; None where not set."""
        return tuple(getattr(self, p.name) for p in self.parameters)

    @property
    def shape(self) -> tuple[Any, ...]:
        """Values of the shape parameters: all but the last."""
        return self.values[:-1]

    @property
    def amplitude(self) -> Any:
        """Amplitude of the covariance."""
        return self.amplitude_of(self.values[-1])

    def fix(self, *names: str) -> "AbstractProcess":
        """Return a copy whose named parameters (all that have values if none is named) are held in estimation."""
        known = [p.name for p in self.parameters]
        for n in names:
            if n not in known:
                raise ValueError(f"{self.kind} has no parameter {n!r}; it has {', '.join(known)}.")
        held = {*self.fixed, *(names or (n for n in known if getattr(self, n) is not None))}
        for n in held:
            if getattr(self, n) is None:
                raise ValueError(f"{self.kind}: {n} cannot be held, it has no value.")
        values = {n: Fixed(getattr(self, n)) if n in held else getattr(self, n) for n in known}
        cls: Any = type(self)
        return cls(**values)

    def require_complete(self) -> None:
        """Raise if a parameter has no value."""
        missing = [p.name for p in self.parameters if getattr(self, p.name) is None]
        if missing:
            raise ValueError(
                f"{self.kind} has no value for {', '.join(missing)}: estimate it with fit(), "
                f"or give it, as in {self.kind}({missing[0]}=...)."
            )

    # -- theory for unit amplitude: what a process file defines ---------------------------------------------------

    @classmethod
    @abc.abstractmethod
    def unit_wavelet_variance(cls, shape: tuple[Any, ...], tau: Float[Array, "*J"]) -> Float[Array, "*J"]:
        """Return the Haar MODWT wavelet variance at spans tau (even numbers of samples) for unit amplitude."""

    @classmethod
    @abc.abstractmethod
    def unit_psd(cls, shape: tuple[Any, ...], frequency: Float[Array, "*F"]) -> Float[Array, "*F"]:
        """Two-sided PSD at frequencies in cycles per sample; its integral over (-1/2, 1/2) is the variance."""

    @classmethod
    def unit_autocovariance(cls, shape: tuple[Any, ...], lag: Float[Array, "*L"]) -> Float[Array, "*L"]:
        """Autocovariance at lags >= 0 (integers); raises ValueError where the process is not stationary."""
        raise ValueError(f"{cls.kind} is not stationary: it has no autocovariance. Use wavelet_variance().")

    @classmethod
    @abc.abstractmethod
    def unit_haar_covariance(
        cls,
        shape: tuple[Any, ...],
        lag: Float[Array, "*P"],
        parity: Float[Array, "*P"],
        n_j: Float[Array, "*P"],
        n_k: Float[Array, "*P"],
    ) -> Float[Array, "*P"]:
        """Cov(W_{j,t+lag}, W_{k,t}) of the Haar MODWT coefficients with half spans n_j, n_k.

        The lag may be real: a smooth extension between the integers of one parity (-1)^lag.
        """

    @classmethod
    def ringing(cls, shape: tuple[Any, ...]) -> float:
        """Radians that the autocovariance turns through while it falls by e; a guess where the shape is traced."""
        return 0.0

    @classmethod
    def unit_haar_mean(cls, n_j: Float[Array, "*P"]) -> Float[Array, "*P"]:
        """E(W_{j,t}) for unit amplitude: zero but for a deterministic process."""
        return jnp.zeros_like(n_j)

    @abc.abstractmethod
    def simulate(self, num_samples: int, key: PRNGKey) -> Float[Array, " N"]:
        """Draw a record; started from stationarity where there is one, else from zero."""

    @abc.abstractmethod
    def state_space(self) -> StateSpace | None:
        """Return the process as samples of a Markov chain plus white noise; None where it has no such form.

        The form has the first two moments of the process, and is the process where that is Gaussian.
        """

    @classmethod
    def state_names(cls, num: int) -> tuple[str, ...]:
        """What follows the name of the process for each of the `num` states of its state-space form; "" for itself."""
        return tuple(f"driver {i}" if i else "" for i in range(num))

    def filter_form(self) -> StateSpace | None:
        """What a filter holds of it: `state_space`, or None where it leaves the process out."""
        return self.state_space() if self.in_filter else None

    def bounded_integral(self) -> Any | None:
        """The variance that the sum of its samples never exceeds; None where it grows with their number."""
        return None

    @staticmethod
    def amplitude_of(value: Any) -> Any:
        """Return the amplitude of the covariance that belongs to a value of the last parameter."""
        return value

    @staticmethod
    def value_of(amplitude: Any) -> Any:
        """Return the last parameter that belongs to an amplitude: the inverse of `amplitude_of`."""
        return amplitude

    # -- the coordinates that estimation searches over: only for processes with a shape parameter ------------------

    num_coordinates: ClassVar[int] = 1
    """Search coordinates of a component with a free shape; where there are several, they are the last axis."""

    @classmethod
    def shape_from_coordinate(cls, coordinate: Any) -> tuple[Any, ...]:
        """The shape parameters from coordinates on the real line."""
        raise NotImplementedError(f"{cls.kind} has no shape parameter.")

    @classmethod
    def coordinate_from_shape(cls, shape: tuple[Any, ...]) -> Any:
        """Inverse of `shape_from_coordinate`."""
        raise NotImplementedError(f"{cls.kind} has no shape parameter.")

    @classmethod
    def coordinate_bounds(cls, tau_max: float) -> tuple[Any, Any]:
        """The interval of the coordinate: beyond its ends the wavelet variance up to tau_max no longer changes.

        Where there are several coordinates, an interval for each.
        """
        raise NotImplementedError(f"{cls.kind} has no shape parameter.")

    @classmethod
    def limit_of(cls, shape: tuple[Any, ...], tau_max: float) -> Limit:
        """Name the process that this shape cannot be told from on spans up to tau_max; "" if it is itself."""
        return Limit.NONE

    @classmethod
    def start_nodes(cls, tau_max: float, num: int) -> tuple[Any, ...]:
        """Coordinates, increasing, at which a search over records with spans up to tau_max starts.

        Where there are several, points that fill their box. The ends of `coordinate_bounds` are among them: a minimum
        at a limit is there at once, where a descent in the logarithm of a correlation time only crawls.
        """
        raise NotImplementedError(f"{cls.kind} has no shape parameter.")

    @classmethod
    def correlation_time(cls, shape: tuple[Any, ...]) -> Any:
        """Correlation time in samples, by which components of one kind are ordered."""
        raise NotImplementedError(f"{cls.kind} has no shape parameter.")

    # -- theory with the amplitude ----------------------------------------------------------------------------------

    def wavelet_variance(self, tau: Any) -> Float[Array, "*J"]:
        """Return the Haar MODWT wavelet variance.

        Parameters
        ----------
        tau
            Filter spans in samples, even: 2, 4, 8, ...

        Returns
        -------
        nu^2(tau) in squared signal units; half the Allan variance at averaging time tau/2 samples.
        """
        self.require_complete()
        return scaled(self.unit_wavelet_variance, self.amplitude, self.shape, spans(tau))

    def psd(self, frequency: Any) -> Float[Array, "*F"]:
        """Return the two-sided power spectral density: u^2 per (cycle per sample), frequency in (0, 1/2]."""
        self.require_complete()
        return scaled(self.unit_psd, self.amplitude, self.shape, as_float(frequency))

    def autocovariance(self, lag: Any) -> Float[Array, "*L"]:
        """Return the autocovariance at integer lags in samples, in squared signal units.

        Raises
        ------
        ValueError
            The process is not stationary.
        """
        self.require_complete()
        return scaled(self.unit_autocovariance, self.amplitude, self.shape, jnp.abs(as_float(lag)))

    def unconstrained(self) -> Float[Array, " P"]:
        """Map the parameters to the real line, in order: by logs, or logits where the interval is bounded."""
        self.require_complete()
        return jnp.stack(self.to_lines(self.values))

    @classmethod
    def to_lines(cls, values: Sequence[Any]) -> list[Any]:
        """`unconstrained` of values, or of arrays of them, without a process.

        One parameter after the other, unless the interval of one depends on the others.
        """
        return [p.to_line(v) for v, p in zip(values, cls.parameters, strict=True)]

    def per_line(self) -> dict[str, Any]:
        """What each number of `unconstrained` alone decides, by name: the parameters, unless they share lines."""
        return {p.name: v for p, v in zip(self.parameters, self.values, strict=True)}

    @classmethod
    def from_unconstrained(cls, vector: Float[Array, " P"]) -> "AbstractProcess":
        """Inverse of `unconstrained`."""
        build: Any = cls
        return build(**{p.name: p.from_line(x) for x, p in zip(vector, cls.parameters, strict=True)})

    def __add__(self, other: "AbstractProcess | Composite") -> "Composite":
        return Composite((self,)) + other

    def __mul__(self, count: int) -> "Composite":
        return Composite((self,)) * count

    __rmul__ = __mul__

    def __repr__(self) -> str:
        """Text form, as `gmwm_jax.parse_model` reads it."""
        parts = []
        for p in self.parameters:
            value = getattr(self, p.name)
            if value is not None:
                seen = concrete(value)
                number = "?" if seen is None else f"{seen:.6g}" if seen.ndim == 0 else f"<{seen.shape}>"
                parts.append(f"{p.name}={number}" + (" fixed" if p.name in self.fixed else ""))
        return f"{self.kind}({', '.join(parts)})"


@saved()
class Composite(eqx.Module):
    """A sum of independent latent processes.

    Parameters
    ----------
    processes
        At most one of each kind whose members could not be told apart (WN, QN, RW, DR), any number of the others.

    Examples
    --------
    >>> model = gj.WN(sigma2=1.0) + gj.RW(gamma2=0.03)
    >>> model.labels
    ('WN', 'RW')
    >>> model.wavelet_variance(np.array([2.0, 4.0])).tolist()
    [0.5075, 0.26125]
    """

    processes: tuple[AbstractProcess, ...]

    def __init__(self, processes: Sequence[AbstractProcess]):
        self.processes = tuple(processes)
        if not self.processes:
            raise ValueError("A model needs at least one process.")
        for p in self.processes:
            if not isinstance(p, AbstractProcess):
                raise TypeError(f"A model is a sum of processes, and {p!r} is none; parse_model reads text.")
        counts = Counter(type(p) for p in self.processes)
        for cls, count in counts.items():
            if count > 1 and not cls.repeatable:
                raise ValueError(
                    f"{count} x {cls.kind}: two {cls.kind} processes add up to one and cannot be told apart. "
                    f"Keep one {cls.kind}."
                )
        for cls in counts:
            other = cls.other_form
            if other is not None and other in counts:
                raise ValueError(
                    f"{other.kind} and {cls.kind} are one process in two parametrisations: use one of them in a model."
                )
        for a, b in itertools.permutations(counts, 2):
            if a.white_part is None or b.white_part is None or not a.adjusts_white_part:
                continue
            if b.white_part <= a.white_part:
                raise ValueError(
                    f"{a.kind} and {b.kind} cannot be told apart: {a.kind} with other coefficients is their sum. "
                    f"Leave {b.kind} out."
                )

    @property
    def labels(self) -> tuple[str, ...]:
        """One name for each component: ``WN``; ``GM_1``, ``GM_2`` where there are several of a kind."""
        counts, seen, labels = Counter(p.kind for p in self.processes), Counter(), []
        for p in self.processes:
            seen[p.kind] += 1
            labels.append(f"{p.kind}_{seen[p.kind]}" if counts[p.kind] > 1 else p.kind)
        return tuple(labels)

    @property
    def num_parameters(self) -> int:
        """Number of parameters, held ones included."""
        return sum(len(p.parameters) for p in self.processes)

    @property
    def num_free(self) -> int:
        """Number of parameters that estimation may move."""
        return sum(len(p.parameters) - len(p.fixed) for p in self.processes)

    def wavelet_variance(self, tau: Any) -> Float[Array, "*J"]:
        """Return the Haar MODWT wavelet variance at spans tau (samples): the sum over the components."""
        return sum_arrays(p.wavelet_variance(tau) for p in self.processes)

    def psd(self, frequency: Any) -> Float[Array, "*F"]:
        """Return the two-sided PSD at frequencies in cycles per sample, 0 < frequency <= 1/2."""
        return sum_arrays(p.psd(frequency) for p in self.processes)

    def autocovariance(self, lag: Any) -> Float[Array, "*L"]:
        """Return the autocovariance at integer lags; ValueError if a component is not stationary."""
        return sum_arrays(p.autocovariance(lag) for p in self.processes)

    def unconstrained(self) -> Float[Array, " P"]:
        """Return all parameters on the real line, in the order of the components."""
        return jnp.concatenate([p.unconstrained() for p in self.processes])

    def parameter_lines(self) -> Float[Array, " P"]:
        """All parameters, each on the real line of its own interval, whatever the others are."""
        return jnp.stack([q.to_line(v) for p in self.processes for q, v in zip(p.parameters, p.values, strict=True)])

    def with_unconstrained(self, vector: Float[Array, " P"]) -> "Composite":
        """A model of the same components with the parameters of `vector`, see `unconstrained`."""
        processes, start = [], 0
        for p in self.processes:
            processes.append(p.from_unconstrained(vector[start : start + len(p.parameters)]))
            start += len(p.parameters)
        return Composite(processes)

    def __add__(self, other: "AbstractProcess | Composite") -> "Composite":
        if isinstance(other, AbstractProcess):
            other = Composite((other,))
        if not isinstance(other, Composite):
            return NotImplemented
        return Composite(self.processes + other.processes)

    def __mul__(self, count: int) -> "Composite":
        if not isinstance(count, int) or count < 1:
            raise ValueError(f"A model can be taken 1, 2, 3, ... times, not {count!r} times.")
        return Composite(self.processes * count)

    __rmul__ = __mul__

    def __repr__(self) -> str:
        """Text form, as `gmwm_jax.parse_model` reads it."""
        return " + ".join(repr(p) if any(v is not None for v in p.values) else p.kind for p in self.processes)


@partial(jax.jit, static_argnums=0)
def scaled(unit: Callable[..., Array], amplitude: Array, shape: tuple[Array, ...], *at: Array) -> Array:
    """Theory for unit amplitude, times the amplitude; traced and compiled once a class of process and length."""
    return amplitude * unit(shape, *at)


def sum_arrays(arrays: Any) -> Array:
    """Sum without the scalar 0 that the builtin starts from (strict dtype promotion)."""
    first, *rest = arrays
    for a in rest:
        first = first + a
    return first
