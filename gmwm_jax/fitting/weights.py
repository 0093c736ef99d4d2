"""Weights of the GMWM objective: objects that make the matrix Omega of one wavelet variance.

`Default` is 1/(width of the interval)^2 on the diagonal, the choice of R's simts, so that objectives compare.
`TwoStep` is the same with the variance of a first fit in place of the measured one, which takes out a bias.
`Covariance` is the inverse of the whole covariance of the wavelet variance under a first fit, which for long records
gives the smallest variances there are from these moments (Hansen 1982; Guerrier et al. 2013).
`Iterated` is that again under the fit that comes out, until nothing changes.
`Given` is a vector or a matrix of the user.

Weights that need a fit hold the weights of that fit as their `first`: ``Covariance(first=Default())`` leaves out the
two-step fit. New weights are a class here and a row in `NAMED`: `fit`, `fit_records`, replicates and the command line
take them from there.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Float64
from numpy.typing import ArrayLike

from gmwm_jax._internal.checks import as_float, concrete
from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.states import register, saved
from gmwm_jax._internal.typing import Numbers
from gmwm_jax.processes.base import Composite
from gmwm_jax.variance.wavelet import WaveletVariance

_BEYOND = "beyond floating point: take other units, or scale the data."
_SINGULAR = 1e-12
"""Smallest eigenvalue of a correlation matrix of which an inverse keeps four digits."""


Width: TypeAlias = Callable[[Any, Any], Any]
"""From the measured and the fitted variances of replicates to those that stand for the widths of their intervals."""


def _measured(measured: Any, fitted: Any) -> Any:
    return measured


def _fitted(measured: Any, fitted: Any) -> Any:
    return fitted


class AbstractWeights(ABC):
    """How scales are weighted in a fit."""

    name: ClassVar[str]
    """As texts call them."""
    needs_theory: ClassVar[bool] = False
    """Do they need the covariance of the wavelet variance?"""
    inverts_covariance: ClassVar[bool] = False
    """Are they the inverse of that covariance, so that the objective of a right model is chi-square?"""
    num_rounds: ClassVar[int] = 1
    """How often at most the fit is repeated with the weights under the last one, until it no longer changes."""
    of_any_length: ClassVar[bool] = True
    """Can records with different numbers of scales have them?"""
    first: "AbstractWeights | None" = None
    """Weights of the fit that these are made from; None if they need none."""

    @abstractmethod
    def omega(
        self, wv: WaveletVariance, model: Composite | None = None, V: Float[Numbers, "J J"] | None = None
    ) -> Float[Numbers, "J J"]:
        """Omega for a wavelet variance of one channel.

        Parameters
        ----------
        wv
            One channel.
        model
            Of the fit with the weights `first`, for weights that need one.
        V
            Covariance of the wavelet variance under that model, for weights that need theory.
        """

    @property
    def of_replicates(self) -> tuple[Width, ...]:
        """What the weights of a replicate are made from, a fit after the other; none if it takes those of the data.

        Weights from a covariance are those of the data: to first order that makes no difference.
        """
        return ()


@saved()
@dataclass(frozen=True)
class Default(AbstractWeights):
    """1/(ci_high - ci_low)^2 on the diagonal."""

    name: ClassVar[str] = "default"

    def omega(self, wv: WaveletVariance, model: Composite | None = None, V: Any = None) -> Float[Numbers, "J J"]:
        """Omega, see `AbstractWeights.omega`; ValueError if it is beyond floating point."""
        xp = namespace(wv.ci_low, wv.ci_high)
        with np.errstate(divide="ignore", over="ignore"):
            weights = 1 / (wv.ci_high - wv.ci_low) ** 2
        seen = concrete(weights)
        if seen is not None and not np.all(np.isfinite(seen) & (seen > 0)):
            raise ValueError(
                f"The intervals are {wv.ci_high[0] - wv.ci_low[0]:g} wide, and the squares of widths are {_BEYOND}"
            )
        return xp.diag(weights)

    @property
    def of_replicates(self) -> tuple[Width, ...]:
        """A replicate has the weights of its own intervals."""
        return (_measured,)


@saved()
@dataclass(frozen=True)
class TwoStep(AbstractWeights):
    """The default weights with the variance of a first fit in place of the measured one."""

    name: ClassVar[str] = "two-step"
    first: AbstractWeights = Default()

    def omega(self, wv: WaveletVariance, model: Composite | None = None, V: Any = None) -> Float[Numbers, "J J"]:
        """Omega, see `AbstractWeights.omega`; ValueError if the model has no variance at some scale."""
        (fitted,) = known(_known(model, self).wavelet_variance(wv.scales))
        seen = concrete(fitted)
        if seen is not None and np.any(seen <= 0):
            raise ValueError(f"{self.name} weights need a model with a variance, and {model} has none at some scale.")
        weights = (wv.variance / (fitted * (wv.ci_high - wv.ci_low))) ** 2
        return namespace(weights).diag(weights)

    @property
    def of_replicates(self) -> tuple[Width, ...]:
        """A replicate has the weights under its own first fit."""
        return (*self.first.of_replicates, _fitted)


@saved()
@dataclass(frozen=True)
class Covariance(AbstractWeights):
    """The inverse of the covariance of the wavelet variance under a first fit."""

    name: ClassVar[str] = "covariance"
    needs_theory: ClassVar[bool] = True
    inverts_covariance: ClassVar[bool] = True
    first: AbstractWeights = TwoStep()

    def omega(self, wv: WaveletVariance, model: Composite | None = None, V: Any = None) -> Float[Numbers, "J J"]:
        """Omega, see `AbstractWeights.omega`.

        Raises
        ------
        ValueError
            There is no theory, or V is singular to rounding, as that of a model with no noise but a drift, or without
            any variance at some scale.
        """
        model = _known(model, self)
        if V is None:
            raise ValueError(f"There is no theory of the scatter of {model}: take other weights.")
        xp = namespace(V)
        sd = xp.sqrt(xp.diag(V))
        with np.errstate(divide="ignore", invalid="ignore"):
            correlation = V / xp.outer(sd, sd)
        if (seen := concrete(correlation)) is not None and (lowest := _lowest(seen)) < _SINGULAR:
            raise ValueError(
                f"The covariance of the wavelet variance under {model} is singular (smallest eigenvalue of the "
                f"correlation {lowest:.1e}): its inverse cannot be weights. Take "
                f'weights="{TwoStep.name}" or fewer scales.'
            )
        omega = xp.linalg.inv(correlation) / xp.outer(sd, sd)
        return (omega + omega.T) / 2


@saved()
@dataclass(frozen=True)
class Iterated(AbstractWeights):
    """The inverse covariance under the fit that it gives itself."""

    name: ClassVar[str] = "iterated"
    needs_theory: ClassVar[bool] = True
    inverts_covariance: ClassVar[bool] = True
    num_rounds: ClassVar[int] = 20
    first: AbstractWeights = Covariance()

    def omega(self, wv: WaveletVariance, model: Composite | None = None, V: Any = None) -> Float[Numbers, "J J"]:
        """Omega, see `Covariance.omega`."""
        return Covariance().omega(wv, model, V)


@dataclass(frozen=True, eq=False)
class Given(AbstractWeights):
    """Weights of the user: the diagonal (J,), or a positive definite matrix (J, J)."""

    name: ClassVar[str] = "given"
    of_any_length: ClassVar[bool] = False
    values: ArrayLike

    def omega(self, wv: WaveletVariance, model: Composite | None = None, V: Any = None) -> Float[Numbers, "J J"]:
        """Omega, see `AbstractWeights.omega`; ValueError if the values are no positive definite matrix of its size."""
        J = wv.num_scales
        traced = concrete(self.values) is None
        omega: Any = as_float(self.values) if traced else np.asarray(self.values, dtype=np.float64)
        if omega.shape == (J,):
            omega = jnp.diag(omega) if traced else np.diag(omega)
        if omega.shape != (J, J):
            raise ValueError(
                f"weights must have the shape ({J},) or ({J}, {J}), one entry a scale; they have {omega.shape}."
            )
        if traced:
            return omega
        if not np.all(np.isfinite(omega)) or not np.allclose(omega, omega.T, rtol=1e-10, atol=0):
            raise ValueError("weights must be finite and symmetric.")
        kept = np.any(omega != 0, axis=1)  # a scale of weight zero is left out
        if not np.any(kept):
            raise ValueError("weights are zero at all scales.")
        some = omega[np.ix_(kept, kept)]
        scale = np.sqrt(np.abs(np.diag(some)))
        if np.any(scale == 0) or np.linalg.eigvalsh(some / np.outer(scale, scale))[0] <= 0:
            raise ValueError(
                "weights must be positive definite, but for the rows and columns of scales that are left out, which "
                "are zero."
            )
        return omega


@saved()
@dataclass(frozen=True)
class Within(AbstractWeights):
    """Other weights, at the scales within a range of time; the others are left out.

    The objective and the estimates are those of the scales within; intervals and the test of fit know that the others
    were not used.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> short = gj.fit(wv, "WN", weights=gj.fitting.weights.Within(longest=0.2))
    >>> int((np.diag(short.omega) > 0).sum())
    4
    """

    name: ClassVar[str] = "within"
    shortest: float = 0.0
    """Of the spans of the filters, in seconds; in samples where the rate is not known."""
    longest: float = np.inf
    of: AbstractWeights = Default()

    def __post_init__(self) -> None:
        if not 0 <= self.shortest < self.longest:
            raise ValueError(f"The range of spans is empty: {self.shortest} to {self.longest}.")

    # what they ask for is what the others ask for, and a first fit is within the same range

    @property
    def needs_theory(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """See `AbstractWeights`."""
        return self.of.needs_theory

    @property
    def inverts_covariance(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """See `AbstractWeights`."""
        return self.of.inverts_covariance

    @property
    def num_rounds(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """See `AbstractWeights`."""
        return self.of.num_rounds

    @property
    def first(self) -> AbstractWeights | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """See `AbstractWeights`."""
        return None if self.of.first is None else replace(self, of=self.of.first)

    def omega(self, wv: WaveletVariance, model: Composite | None = None, V: Any = None) -> Float[Numbers, "J J"]:
        """Omega, see `AbstractWeights.omega`; ValueError if there is no scale within the range."""
        kept = (wv.times >= self.shortest) & (wv.times <= self.longest)
        if not np.any(kept):
            raise ValueError(
                f"There is no scale between {self.shortest:g} and {self.longest:g}; they are {wv.times[0]:g} to "
                f"{wv.times[-1]:g}."
            )
        # the covariance without the others, so that its inverse is that of the scales within
        both = kept[:, None] & kept[None, :]
        alone = None if V is None else namespace(V).where(both | np.eye(len(kept), dtype=bool), V, 0.0)
        return self.of.omega(wv, model, alone) * both


class _Given(NamedTuple):
    values: Float64[np.ndarray, "..."]


register(Given, _Given, lambda g: _Given(np.asarray(g.values, dtype=np.float64)), lambda state: Given(state.values))

WeightsLike: TypeAlias = AbstractWeights | str | ArrayLike | None
"""What functions take as weights: an object, the name of one, an array for `Given`, or None for `Default`."""

NAMED: dict[str, AbstractWeights] = {w.name: w for w in (Default(), TwoStep(), Covariance(), Iterated())}
"""Weights that a text can stand for."""


def as_weights(weights: WeightsLike) -> AbstractWeights:
    """Return the weights that a text, an array or None stands for; raise ValueError for another text.

    Examples
    --------
    >>> gj.fitting.weights.as_weights("two-step").name
    'two-step'
    """
    if isinstance(weights, AbstractWeights):
        return weights
    if weights is None:
        return Default()
    if not isinstance(weights, str):
        return Given(weights)
    if weights not in NAMED:
        names = ", ".join(f'"{name}"' for name in NAMED)
        raise ValueError(f"weights are {names} or an array, and not {weights!r}.")
    return NAMED[weights]


def root_of(omega: Any) -> Any:
    """L' with Omega = L L'; rows and columns of zeros, of scales that are left out, stay zeros. Pure.

    Examples
    --------
    >>> gj.fitting.weights.root_of(np.diag([4.0, 0.0, 9.0])).tolist()
    [[2.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 3.0]]
    """
    xp = namespace(omega)
    kept = (xp.diagonal(omega) != 0).astype(omega.dtype)
    return xp.linalg.cholesky(omega + xp.diag(1 - kept)).T * kept[None, :] * kept[:, None]


def _lowest(correlation: Float[np.ndarray, "J J"]) -> float:
    """The smallest eigenvalue; zero where it is not finite."""
    return float(np.linalg.eigvalsh(correlation)[0]) if np.all(np.isfinite(correlation)) else 0.0


def _known(model: Composite | None, weights: AbstractWeights) -> Composite:
    if model is None:
        raise ValueError(f"{weights.name} weights need a first fit: take default weights, or an array.")
    return model
