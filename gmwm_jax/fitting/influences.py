"""Which scales, and which minutes of a recording, an estimate comes from; and what it would be without them.

The influence function of a GMWM estimate (Hampel et al. 1986; Guerrier et al. 2013, sec. 3) goes through the wavelet
variances alone: theta moves with nu_j by d theta/d nu_j, which `estimate` knows by implicit differentiation, and nu_j
is a mean of squared coefficients, of which each sample has its part. The intervals of the wavelet variance, and with
them weights that are made from them, go with it: an estimate that is refitted has them too.

What is left out is computed twice: to first order from the derivative, and by refitting, all refits in one call.
"""

from dataclasses import dataclass, replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.checks import number as checked
from gmwm_jax._internal.checks import require_x64
from gmwm_jax._internal.chunks import chunks
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.labelled import Arrays, Labelled, Values
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax._internal.xla_threads import few_at_a_time
from gmwm_jax.fitting.estimation import Estimates, estimate
from gmwm_jax.fitting.problem import require_fittable
from gmwm_jax.fitting.weights import AbstractWeights, Given, WeightsLike, as_weights
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.contributions import block_sums
from gmwm_jax.variance.estimator import Modwt
from gmwm_jax.variance.haar import haar_wavelet_variance
from gmwm_jax.variance.wavelet import WaveletVariance, wavelet_variance

_AT_ONCE = 32
"""Refits in one vectorised call."""
_BLOCK, _MOST_OF_RECORD = 60.0, 0.05
"""Seconds, but no more than this part of the record."""


@saved(not_finite=("without_scale", "without_block"))
@dataclass(frozen=True, repr=False)
class Influence(Drawable, Saved, Labelled):
    """The result of `influence`: P free parameters, J scales, B blocks of time.

    Attributes
    ----------
    wv, model
        What was fitted, and the estimates.
    names, values
        Of the free parameters, such as ``GM beta``, shape (P,).
    by_variance
        d theta/d nu_j^2, shape (P, J).
    by_weights
        d theta/d log w_j, shape (P, J): of the weight of a scale, its row and column of the matrix alike.
    leverage
        d fitted_j/d nu_j^2, shape (J,): how much of its own fitted value each scale decides; they sum to about P.
    without_scale
        By how much the estimate changes where a scale has no weight, shape (P, J); NaN where that search did not
        converge, or too few scales are left.
    block
        Length of a block in s; None of a wavelet variance whose record is not known.
    block_variances
        nu_j^2 without the coefficients of a block, shape (B, J).
    without_block
        By how much the estimate changes then, shape (P, B); NaN where the search did not converge.
    """

    wv: WaveletVariance
    model: Composite
    names: tuple[str, ...]
    values: Float[np.ndarray, " P"]
    by_variance: Float[np.ndarray, "P J"]
    by_weights: Float[np.ndarray, "P J"]
    leverage: Float[np.ndarray, " J"]
    without_scale: Float[np.ndarray, "P J"]
    block: float | None = None
    block_variances: Float[np.ndarray, "B J"] | None = None
    without_block: Float[np.ndarray, "P B"] | None = None

    @property
    def elasticities(self) -> Float[np.ndarray, "P J"]:
        """D log theta/d log nu_j^2, % per %; NaN for an estimate that is zero. Of an amplitude they sum to one."""
        return self._relative(self.by_variance * self.wv.variance)

    @property
    def without_scale_linear(self) -> Float[np.ndarray, "P J"]:
        """`without_scale` from derivatives and leverage: exact for diagonal weights and a model that is linear."""
        return -self.by_weights / (1 - self.leverage)

    @property
    def without_block_linear(self) -> Float[np.ndarray, "P B"]:
        """`without_block` to first order; a ValueError where there are no blocks."""
        return self.by_variance @ (self._blocks()[0] - self.wv.variance).T

    @property
    def block_times(self) -> Float[np.ndarray, " B"]:
        """Where blocks begin, s; a ValueError where there are none."""
        return np.arange(len(self._blocks()[0])) * float(self.block or 0.0)

    def by_sample(self, record: Any) -> Float[np.ndarray, "P N"]:
        """Compute d theta/d x_t, through the MODWT.

        Parameters
        ----------
        record
            The samples that the wavelet variance is of, shape (N,), or their `Recording`.

        Raises
        ------
        ValueError
            Another number of samples, several channels, or another estimator than the MODWT of complete records.
        """
        x = np.asarray(record, dtype=np.float64)
        x = x[:, 0] if x.ndim == 2 and x.shape[1] == 1 else x
        if x.shape != (self.wv.num_samples,):
            raise ValueError(f"A record of {self.wv.num_samples} samples was fitted, and this one has {x.shape}.")
        _require_modwt(self.wv)
        return np.asarray(_by_sample(jnp.asarray(x), jnp.asarray(self.by_variance)))

    def _relative(self, change: Float[np.ndarray, "P _"]) -> Float[np.ndarray, "P _"]:
        """In units of the estimates."""
        return change / np.where(self.values == 0, np.nan, self.values)[:, None]

    def _blocks(self) -> tuple[Float[np.ndarray, "B J"], Float[np.ndarray, "P B"]]:
        if self.block_variances is None or self.without_block is None:
            raise ValueError("A wavelet variance has no blocks of time: give influence() the recording.")
        return self.block_variances, self.without_block

    def _arrays(self) -> Arrays:
        dims = ("parameter", "scale")
        values = {
            "elasticity": Values(dims, self.elasticities, "1"),
            "by_variance": Values(dims, self.by_variance),
            "by_weights": Values(dims, self.by_weights),
            "without_scale": Values(dims, self.without_scale),
            "leverage": Values("scale", self.leverage, "1"),
        }
        coordinates = {
            "parameter": Values("parameter", self.names),
            "estimate": Values("parameter", self.values),
            "time": Values("scale", self.wv.times, "s" if self.wv.rate else "samples"),
        }
        if self.block_variances is not None:
            values["without_block"] = Values(("parameter", "block"), self.without_block)
            values["block_variance"] = Values(("block", "scale"), self.block_variances, f"({self.wv.units[0]})^2")
            coordinates["block_time"] = Values("block", self.block_times, "s")
        return Arrays(values, coordinates, {"model": str(self.model)}, dims)

    def __repr__(self) -> str:
        """Elasticities, a row a scale, and what leaving out changes most."""
        wv = self.wv
        head = ["span [s]" if wv.rate else "span [samples]", "leverage", *self.names]
        rows = [
            [number(t), f"{h:.3f}", *(f"{e:+.3f}" if e == e else "-" for e in of)]
            for t, h, of in zip(wv.times, self.leverage, self.elasticities.T, strict=True)
        ]
        unit = " s" if wv.rate else " samples"
        spans = [f"{number(t)}{unit}" for t in wv.times]
        largest = [["scale", *self._largest(self.without_scale, spans)]]
        if self.without_block is not None:
            begins = [f"from {t:g} s" for t in self.block_times]
            largest.append([f"{self.block:g} s", *self._largest(self.without_block, begins)])
        return (
            f"Influence on {' + '.join(self.model.labels)} of {wv.channels[0]}: % of each estimate per % of the "
            f"wavelet variance at a scale\n{format_table(head, rows, left=0)}\n"
            f"largest change where one is left out\n{format_table(['without', *self.names], largest)}"
        )

    def _largest(self, change: Float[np.ndarray, "P _"], names: list[str]) -> list[str]:
        """The largest relative change of each parameter, and where."""
        found = []
        for row in self._relative(change):
            if np.all(np.isnan(row)):
                found.append("-")
                continue
            at = int(np.nanargmax(np.abs(row)))
            found.append(f"{100 * row[at]:+.3g} % ({names[at]})")
        return found


def influence(
    data: Recording | WaveletVariance,
    model: str | AbstractProcess | Composite,
    *,
    block: float | None = None,
    weights: WeightsLike = None,
) -> Influence:
    """Compute how every estimate depends on each scale, each weight, and each minute of a recording.

    Parameters
    ----------
    data
        A recording of one channel without missing samples, or a wavelet variance, which has no blocks of time.
    model
        As for `gmwm_jax.fit`.
    block
        Length of blocks in s; by default a minute, or a twentieth of the record where that is less.
    weights
        As for `gmwm_jax.fitting.estimate`.

    Returns
    -------
    Influence
        It prints and draws itself; ``.by_sample(recording)`` goes down to the samples.

    Raises
    ------
    ValueError
        Several channels; missing samples; a block for a wavelet variance, or one that leaves nothing of a scale; as of
        `gmwm_jax.fitting.estimate`; the search did not converge.

    Notes
    -----
    A wavelet coefficient belongs to the block in which the newer half of its filter begins. To see an estimate as if a
    stretch had never been recorded, mark it as missing and fit that: ``wavelet_variance(x, gaps="pairs")``.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> found = gj.fitting.influence(rec, "WN + RW", block=2.0)
    >>> found.names, found.without_block.shape
    (('WN sigma2', 'RW gamma2'), (2, 10))
    >>> bool(np.allclose(found.elasticities.sum(axis=1), 1.0))  # both are amplitudes
    True
    """
    require_x64()
    model, weights = as_model(model), as_weights(weights)
    wv, x = _one_channel(data, block)
    require_fittable(model, wv)
    given = jnp.asarray(weights.values, dtype=float) if isinstance(weights, Given) else weights
    nu, J = jnp.asarray(wv.variance), wv.num_scales
    found, values, derivatives = _at_estimate(wv, model, given)
    if not bool(found.converged):
        raise ValueError(f"The search for {model} did not converge: its influence means nothing. Take a smaller model.")
    seconds, left = (None, nu[None][:0]) if x is None else _blocks_of(wv, x, block)
    nus = jnp.concatenate([jnp.broadcast_to(nu, (J, J)), left])
    factors = jnp.concatenate([1 - jnp.eye(J), jnp.ones_like(left)])
    refitted = [
        np.asarray(_refits(wv, model, given, nus[rows], factors[rows]))[:num]
        for rows, num in chunks(len(nus), _AT_ONCE)
    ]
    changes = (np.concatenate(refitted) - np.asarray(values)).T
    if model.num_free == J:  # what is left of the scales determines nothing
        changes[:, :J] = np.nan
    result = Influence(
        wv,
        jax.tree.map(np.asarray, found.model),
        _names(found),
        *map(np.asarray, (values, *derivatives)),
        without_scale=changes[:, :J],
    )
    if x is None:
        return result
    return replace(result, block=seconds, block_variances=np.asarray(left), without_block=changes[:, J:])


class _Scaled(AbstractWeights):
    """Weights of others, with rows and columns of scales times the root of a factor."""

    def __init__(self, weights: AbstractWeights, factors: Float[Array, " J"]):
        self.weights, self.factors = weights, factors
        self.name, self.needs_theory = weights.name, weights.needs_theory  # pyright: ignore[reportAttributeAccessIssue]
        self.num_rounds = weights.num_rounds  # pyright: ignore[reportAttributeAccessIssue]
        self.first = None if weights.first is None else _Scaled(weights.first, factors)

    def omega(self, wv: WaveletVariance, model: Composite | None = None, V: Any = None) -> Float[Array, "J J"]:
        root = jnp.sqrt(self.factors)
        return root[:, None] * jnp.asarray(self.weights.omega(wv, model, V)) * root[None, :]


def _moved(
    wv: WaveletVariance, model: Composite, weights: Any, nu: Float[Array, " J"], factors: Float[Array, " J"]
) -> Estimates:
    """The estimates where the wavelet variance is nu, and weights have these factors."""
    ratio = nu / wv.variance
    there = replace(wv, variance=nu, ci_low=wv.ci_low * ratio, ci_high=wv.ci_high * ratio)
    return estimate(there, model, weights=_Scaled(as_weights(weights), factors))


@few_at_a_time
@eqx.filter_jit
def _at_estimate(
    wv: WaveletVariance, model: Composite, weights: Any
) -> tuple[Estimates, Float[Array, " P"], tuple[Float[Array, "P J"], Float[Array, "P J"], Float[Array, " J"]]]:
    """The estimates, those that are free, their derivatives by wavelet variances and weights, and leverages."""

    def at(nu: Array, factors: Array) -> Any:
        found = _moved(wv, model, weights, nu, factors)
        values = _free(found)
        return (values, found.model.wavelet_variance(wv.scales)), (values, found)

    nu, ones = jnp.asarray(wv.variance), jnp.ones(wv.num_scales)
    ((by_nu, by_factors), (fitted, _)), (values, found) = jax.jacfwd(at, argnums=(0, 1), has_aux=True)(nu, ones)
    return found, values, (by_nu, by_factors, jnp.diagonal(fitted))


@few_at_a_time
@eqx.filter_jit
def _refits(
    wv: WaveletVariance, model: Composite, weights: Any, nus: Float[Array, "B J"], factors: Float[Array, "B J"]
) -> Float[Array, "B P"]:
    """Free parameters of many refits; NaN where one did not converge."""

    def at(nu: Array, factors: Array) -> Array:
        found = _moved(wv, model, weights, nu, factors)
        return jnp.where(found.converged, _free(found), jnp.nan)

    return jax.vmap(at)(nus, factors)


def _free(found: Estimates) -> Float[Array, " P"]:
    free = [q.name not in p.fixed for p in found.model.processes for q in p.parameters]
    return jnp.stack([jnp.asarray(v) for v, on in zip(found.parameters.values(), free, strict=True) if on])


def _names(found: Estimates) -> tuple[str, ...]:
    free = [q.name not in p.fixed for p in found.model.processes for q in p.parameters]
    return tuple(name for name, on in zip(found.parameters, free, strict=True) if on)


@jax.jit
def _by_sample(x: Float[Array, " N"], by_variance: Float[Array, "P J"]) -> Float[Array, "P N"]:
    _, backward = jax.vjp(lambda x: haar_wavelet_variance(x, by_variance.shape[1]), x)
    return jax.lax.map(lambda slope: backward(slope)[0], by_variance)


def _one_channel(data: Any, block: float | None) -> tuple[WaveletVariance, np.ndarray | None]:
    """The wavelet variance, and the samples if they are known."""
    if isinstance(data, Recording):
        if data.num_channels > 1:
            raise ValueError(f"influence() takes one channel, and this has {data.num_channels}: take data[[name]].")
        wv = wavelet_variance(data)
        assert isinstance(wv, WaveletVariance)
        _require_modwt(wv)
        return wv, data.data[:, 0]
    if not isinstance(data, WaveletVariance):
        raise TypeError(
            f"influence() takes a Recording or the WaveletVariance of one channel, not {type(data).__name__}."
        )
    if block is not None:
        raise ValueError("A wavelet variance has no blocks of time: give the recording, or leave out block.")
    return data, None


def _require_modwt(wv: WaveletVariance) -> None:
    if not isinstance(wv.estimator, Modwt) or wv.present is not None:
        raise ValueError(
            "Samples and blocks of time have an influence through the MODWT of a complete record, and this is a "
            f"{wv.estimator.name}: cut the record, or give its wavelet variance for the influence of scales."
        )


def _blocks_of(wv: WaveletVariance, x: np.ndarray, block: float | None) -> tuple[float, Float[Array, "B J"]]:
    """Length of blocks in s, and the wavelet variance without each."""
    rate, N = float(wv.rate or 1.0), len(x)
    wanted = min(_BLOCK, _MOST_OF_RECORD * N / rate) if block is None else checked("block", block)
    samples = max(1, round(wanted * rate))
    left = block_sums(x, samples, wv.num_scales).left_out
    if bool(jnp.any(jnp.isnan(left))):
        raise ValueError(f"A block of {samples / rate:g} s of {N / rate:g} s leaves nothing of the longest scales.")
    return samples / rate, left
