"""Estimators of the wavelet variance: objects that take it from records and know how it scatters.

`Modwt` averages the squares of all coefficients, `Dwt` of every 2^j-th, `Robust` gives outlying ones no weight, and
`Pairs` takes what pairs of samples tell where others are missing. A new estimator is a class (in a file of its own) and
a row in `METHODS`: intervals, standard errors, replicates and joint fits ask the object.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from gmwm_jax._internal.checks import as_float, finite_record
from gmwm_jax._internal.host import known
from gmwm_jax._internal.states import saved
from gmwm_jax.processes.base import Composite
from gmwm_jax.variance._skewness import wv_skewness
from gmwm_jax.variance.blocked import host_wavelet_variance
from gmwm_jax.variance.covariance import require_no_mean, wv_covariance
from gmwm_jax.variance.gap_covariance import gap_covariance
from gmwm_jax.variance.gaps import find_pairs, gap_wavelet_variance, variance_by_pairs
from gmwm_jax.variance.haar import check_num_levels, degrees_of_freedom, haar_dwt_variance
from gmwm_jax.variance.power_law import ALLAN, local_degrees_of_freedom
from gmwm_jax.variance.robust import require_efficiency, robust_wavelet_variance, widening

_PARTS = 16
"""In which simulated records with gaps are worked on: transforms take more memory than the records."""

Scratch = str | os.PathLike | None


class Estimated(NamedTuple):
    """What an estimator says of records."""

    variance: Float[np.ndarray, "J *C"]
    dof: Float[np.ndarray, "J *C"]
    """Degrees of freedom of each; the same for all channels where it has no axis of channels."""
    present: Bool[np.ndarray, "N *C"] | None = None
    """Which samples are there; None for a complete record."""
    classic: Float[np.ndarray, "J *C"] | None = None
    """The classic wavelet variance, beside a robust one."""


class AbstractEstimator(ABC):
    """How a wavelet variance is taken from records."""

    has_theory: ClassVar[bool] = True
    """Is the covariance of its wavelet variances known?"""
    bears_gaps: ClassVar[bool] = False
    """May samples be missing?"""
    overlaps: ClassVar[bool] = True
    """Is it half the overlapping Allan variance at half the span?"""
    replicates_records: ClassVar[bool] = True
    """Are its wavelet variances replicated by simulated records?"""

    @property
    @abstractmethod
    def name(self) -> str:
        """In words. Wavelet variances of estimators with the same name can be taken together."""

    @property
    def efficiency(self) -> float | None:
        """Of a robust estimator on clean data; None for one that is not robust."""
        return None

    @property
    def title(self) -> str:
        """In front of a title, with a blank behind; "" for the usual estimators."""
        return ""

    @property
    def of_complete(self) -> "AbstractEstimator":
        """The estimator that this one is for a record without gaps."""
        return self

    @abstractmethod
    def estimate(
        self, data: Any, names: Sequence[str], num_levels: int | None, *, scratch: Scratch = None
    ) -> Estimated:
        """Take the wavelet variance of channels.

        Parameters
        ----------
        data
            Array or memory map, shape (N,) or (N, C).
        names
            Of the channels, for messages.
        num_levels
            J; None for the default.
        scratch
            Folder for temporary files, see `gmwm_jax.wavelet_variance`.
        """

    def require_fittable(self, model: Composite) -> None:
        """Raise a ValueError for a model that this estimator is biased under."""
        return

    def covariance(
        self, model: Composite, num_samples: int | None, num_levels: int, present: Bool[np.ndarray, " N"] | None
    ) -> Float[np.ndarray, "J J"] | None:
        """Covariance of the wavelet variance of one channel under an ergodic model; None if it is not known.

        Parameters
        ----------
        model
            All parameters given.
        num_samples
            N; None where it is not known or scales are left out.
        num_levels
            J.
        present
            False where a sample is missing; None for a complete record.
        """
        return None

    def local_dof(
        self,
        variance: Float[np.ndarray, "J *C"],
        num_samples: int,
        scales: Float[np.ndarray, " J"],
        present: Bool[np.ndarray, "N *C"] | None,
    ) -> Float[np.ndarray, "J *C"] | None:
        """Degrees of freedom under the power law of each scale and its neighbours; None if they are not known.

        Parameters
        ----------
        variance
            Of one channel or several.
        num_samples
            N.
        scales
            Spans in samples.
        present
            False where a sample is missing; None for a complete record.
        """
        return None

    def skewness(
        self, model: Composite, num_samples: int, V: Float[np.ndarray, "J J"]
    ) -> Float[np.ndarray, " J"] | None:
        """Skewness of the wavelet variances, given their covariance; None if it is not known."""
        return None

    def of_records(
        self, num_levels: int, present: Bool[np.ndarray, " N"] | None
    ) -> Callable[[Float[np.ndarray, "B N"]], Float[np.ndarray, "B J"]]:
        """Return a function that takes the wavelet variances of simulated records, without what is missing."""
        raise ValueError(f"The {self.name} wavelet variance is not replicated by simulated records.")


@saved()
@dataclass(frozen=True)
class Modwt(AbstractEstimator):
    """The mean of the squares of all coefficients of the maximal-overlap transform: the most precise one there is."""

    @property
    def name(self) -> str:
        """``modwt``."""
        return "modwt"

    def estimate(
        self, data: Any, names: Sequence[str], num_levels: int | None, *, scratch: Scratch = None
    ) -> Estimated:
        """Take the wavelet variance of channels, see `AbstractEstimator.estimate`."""
        J = check_num_levels(data.shape[0], num_levels)
        nu = _by_channel(data, names, lambda x, name: host_wavelet_variance(x, J, scratch=scratch, name=name))
        return Estimated(nu, degrees_of_freedom(data.shape[0], J))

    def covariance(self, model: Composite, num_samples: int | None, num_levels: int, present: Any) -> Any:
        """Covariance, exact; see `AbstractEstimator.covariance`."""
        return None if num_samples is None else known(wv_covariance(model, num_samples, num_levels))[0]

    def local_dof(self, variance: Any, num_samples: int, scales: Any, present: Any) -> Any:
        """Degrees of freedom, see `AbstractEstimator.local_dof`."""
        return local_degrees_of_freedom(ALLAN, num_samples, scales / 2, variance)

    def skewness(self, model: Composite, num_samples: int, V: Float[np.ndarray, "J J"]) -> Float[np.ndarray, " J"]:
        """Skewness of the wavelet variances, given their covariance."""
        return wv_skewness(model, num_samples, V)

    def of_records(self, num_levels: int, present: Any) -> Callable[[Any], Float[np.ndarray, "B J"]]:
        """Return a function that takes the wavelet variances of simulated records."""
        return lambda records: np.stack([host_wavelet_variance(x, num_levels) for x in records])


@saved()
@dataclass(frozen=True)
class Dwt(AbstractEstimator):
    """The mean of the squares of every 2^j-th coefficient: less precise, but they hardly correlate."""

    has_theory: ClassVar[bool] = False
    overlaps: ClassVar[bool] = False
    replicates_records: ClassVar[bool] = False

    @property
    def name(self) -> str:
        """``dwt``."""
        return "dwt"

    def estimate(
        self, data: Any, names: Sequence[str], num_levels: int | None, *, scratch: Scratch = None
    ) -> Estimated:
        """Take the wavelet variance of channels, see `AbstractEstimator.estimate`."""
        J = check_num_levels(data.shape[0], num_levels)

        def of_channel(x: Any, name: str) -> Float[np.ndarray, " J"]:
            finite_record(np.asarray(x), name)
            return np.asarray(haar_dwt_variance(as_float(x), J))

        return Estimated(_by_channel(data, names, of_channel), degrees_of_freedom(data.shape[0], J, decimated=True))


@saved()
@dataclass(frozen=True)
class Robust(AbstractEstimator):
    """The M-estimator of scale with Tukey's biweight, which gives outliers no weight; see `gmwm_jax.variance.robust`.

    Attributes
    ----------
    efficiency
        On clean data with independent coefficients, between 0.5 and 0.99.

    Raises
    ------
    ValueError
        An efficiency that is not on offer.
    """

    efficiency: float = 0.6
    replicates_records: ClassVar[bool] = False

    def __post_init__(self) -> None:
        require_efficiency(self.efficiency)

    @property
    def name(self) -> str:
        """``robust (efficiency 0.6)``."""
        return f"robust (efficiency {self.efficiency:g})"

    @property
    def title(self) -> str:
        """In front of a title."""
        return f"Robust (efficiency {self.efficiency:g}) "

    def estimate(
        self, data: Any, names: Sequence[str], num_levels: int | None, *, scratch: Scratch = None
    ) -> Estimated:
        """Take the wavelet variance of channels, see `AbstractEstimator.estimate`."""
        J = check_num_levels(data.shape[0], num_levels)
        options: dict[str, Any] = {"efficiency": self.efficiency, "scratch": scratch}
        nu = _by_channel(data, names, lambda x, name: robust_wavelet_variance(x, J, name=name, **options))
        classic = Modwt().estimate(data, names, J, scratch=scratch).variance
        return Estimated(nu, degrees_of_freedom(data.shape[0], J) / widening(self.efficiency, J), classic=classic)

    def require_fittable(self, model: Composite) -> None:
        """Raise a ValueError for a drift."""
        require_no_mean(model)

    def covariance(self, model: Composite, num_samples: int | None, num_levels: int, present: Any) -> Any:
        """Covariance to first order; see `AbstractEstimator.covariance`."""
        if num_samples is None:
            return None
        return known(wv_covariance(model, num_samples, num_levels, efficiency=self.efficiency))[0]

    def local_dof(self, variance: Any, num_samples: int, scales: Any, present: Any) -> Any:
        """Degrees of freedom, see `AbstractEstimator.local_dof`: the others, less as its intervals are wider."""
        wider = widening(self.efficiency, len(scales)).reshape(-1, *[1] * (variance.ndim - 1))
        return np.maximum(Modwt().local_dof(variance, num_samples, scales, None) / wider, 1.0)


@saved()
@dataclass(frozen=True)
class Pairs(AbstractEstimator):
    """The MODWT's from all pairs of samples that are there, see `gmwm_jax.variance.gaps`."""

    bears_gaps: ClassVar[bool] = True

    @property
    def name(self) -> str:
        """``modwt``: it estimates the same with gaps."""
        return "modwt"

    @property
    def of_complete(self) -> AbstractEstimator:
        """`Modwt`."""
        return Modwt()

    def estimate(
        self, data: Any, names: Sequence[str], num_levels: int | None, *, scratch: Scratch = None
    ) -> Estimated:
        """Take the wavelet variance of channels, see `AbstractEstimator.estimate`."""
        nu, eta = variance_by_pairs(np.asarray(data, dtype=np.float64), names, num_levels)
        return Estimated(nu, eta, ~np.isnan(data))

    def covariance(self, model: Composite, num_samples: int | None, num_levels: int, present: Any) -> Any:
        """Covariance for the missing samples of this record; see `AbstractEstimator.covariance`."""
        if num_samples is None:
            return None
        if present is None or np.all(present):
            return Modwt().covariance(model, num_samples, num_levels, None)
        return gap_covariance(model, find_pairs(present, num_levels))

    def local_dof(self, variance: Any, num_samples: int, scales: Any, present: Any) -> Any:
        """Degrees of freedom of a complete record, see `AbstractEstimator.local_dof`."""
        if present is not None and not np.all(present):
            return None
        return Modwt().local_dof(variance, num_samples, scales, None)

    def of_records(self, num_levels: int, present: Any) -> Callable[[Any], Float[np.ndarray, "B J"]]:
        """Return a function that takes the wavelet variances of simulated records, without what is missing."""
        pairs = find_pairs(present, num_levels)

        def of(records: Float[np.ndarray, "B N"]) -> Float[np.ndarray, "B J"]:
            some = max(1, len(records) // _PARTS)
            return np.concatenate(
                [gap_wavelet_variance(records[i : i + some], pairs) for i in range(0, len(records), some)]
            )

        return of


METHODS: dict[str, AbstractEstimator] = {"modwt": Modwt(), "dwt": Dwt(), "robust": Robust(), "pairs": Pairs()}
"""Estimators that a text can stand for."""


def as_estimator(estimator: AbstractEstimator | str | None) -> AbstractEstimator:
    """Return the estimator that a text or None stands for; raise ValueError for another text."""
    if isinstance(estimator, AbstractEstimator):
        return estimator
    if estimator is None:
        return Modwt()
    if estimator not in METHODS:
        names = ", ".join(repr(name) for name in METHODS)
        raise ValueError(f"estimator is one of {names} or an object such as Robust(0.6), and is {estimator!r}.")
    return METHODS[estimator]


def from_shorthands(method: str, efficiency: float | None, gaps: str | None) -> AbstractEstimator:
    """Return the estimator that the shorthands of `wavelet_variance` mean; raise ValueError where they contradict."""
    if method not in ("modwt", "dwt"):
        raise ValueError(f"method must be 'modwt' or 'dwt', and is {method!r}.")
    if gaps not in (None, "pairs"):
        raise ValueError(f"gaps is None (a missing sample is an error) or 'pairs', and is {gaps!r}.")
    robust = None if efficiency is None else Robust(efficiency)
    if robust and method != "modwt":
        raise ValueError("The robust wavelet variance is that of the MODWT: leave method out, or efficiency.")
    if gaps and method != "modwt":
        raise ValueError("The wavelet variance by pairs is that of the MODWT: leave method out, or gaps.")
    if gaps and robust:
        raise ValueError("The robust wavelet variance needs a complete record: leave efficiency out, or gaps.")
    return robust or (METHODS[gaps] if gaps else METHODS[method])


def _by_channel(
    data: Any, names: Sequence[str], of_channel: Callable[[Any, str], Float[np.ndarray, " J"]]
) -> Float[np.ndarray, "J *C"]:
    """Wavelet variances of complete channels, one after the other, checked."""
    columns = []
    for i, name in enumerate(names):
        nu = of_channel(data if data.ndim == 1 else data[:, i], name)
        _require_noise(nu, name)
        columns.append(nu)
    return columns[0] if data.ndim == 1 else np.column_stack(columns)


def _require_noise(nu: Float[np.ndarray, " J"], channel: str) -> None:
    """Raise if the wavelet variance vanishes at a scale, by chance or because nothing changes."""
    zero = nu <= 0
    if np.all(zero):
        raise ValueError(
            f"{channel} does not change: a constant or stuck channel has no noise to model. Check the column and the "
            "sensor."
        )
    if np.any(zero):
        empty = ", ".join(str(2 ** (j + 1)) for j in np.flatnonzero(zero))
        raise ValueError(
            f"{channel} changes, and yet its wavelet variance is zero at spans of {empty} samples: the samples are "
            "coarsely quantised, or repeat a pattern. Leave these scales out by num_levels=..., or take more samples. "
            "(The robust one is zero already where half of the coefficients are: then use the classic one.)"
        )
