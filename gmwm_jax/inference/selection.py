"""`select`: which model describes a wavelet variance, of all sub-models of a superset?

All candidates are fitted with the same weights in one compiled call (`fitting.sweep`) and ranked by the wavelet
information criterion (`_criterion`) with the covariance of the wavelet variance under the superset: the largest
model is the least wrong one. Differences have standard errors. A model that no other is significantly better than is
equivalent to the best. Such a model may still claim less scatter at long spans than the data have, which the covariance
under the superset forgives: it is tested with its own. The simplest that passes is recommended.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, overload

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.cached import cached_property
from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.checks import confidence, integer, typed_key
from gmwm_jax._internal.chi_square import chi_square
from gmwm_jax._internal.chunks import numbered_keys
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.labelled import Arrays, Labelled, Values
from gmwm_jax._internal.progress import Bar, Progress, progress_bar
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.fitting.estimator import fit
from gmwm_jax.fitting.result import Fit, Status
from gmwm_jax.fitting.sweep import Sweep, sweep
from gmwm_jax.fitting.weights import WeightsLike
from gmwm_jax.inference._criterion import optimism, projection, standard_error
from gmwm_jax.inference._submodels import Subset, common_superset, components, submodels, text_of
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.replicates import theory_draws
from gmwm_jax.variance.wavelet import WaveletVariance, WaveletVariances, as_wavelet_variance

_REJECTED = 0.01


_SHOWN = 12
"""Candidates in a table, at least."""


@saved(not_finite=("optimism", "difference", "standard_error", "p_value"))
@dataclass(frozen=True, repr=False)
class Candidate:
    """One model of a selection.

    Attributes
    ----------
    name
        Its components, as a model text.
    fit
        With the weights that all candidates share.
    num_parameters
        Those that the data determine.
    optimism
        What the objective lacks of its average on other data.
    difference, standard_error
        Of the criterion, to that of the best candidate; see `gmwm_jax.inference._criterion`.
    p_value
        Of the chi-square test of fit: with the covariance under the model itself for those that none is better than,
        under the superset for the others.
    contained_in
        Name of a smaller candidate that is the same, since a component here came out as zero or at a limit; or "".
    worse_than
        Name of the lowest candidate that is significantly better; or "".
    """

    name: str
    fit: Fit
    num_parameters: int
    optimism: float
    difference: float
    standard_error: float
    p_value: float
    contained_in: str = ""
    worse_than: str = ""

    @property
    def objective(self) -> float:
        """Q of the fit."""
        return self.fit.objective

    @property
    def criterion(self) -> float:
        """WVIC = Q + optimism: the average objective on other data of the same sensor. Lower is better."""
        return self.objective + self.optimism

    @property
    def sound(self) -> bool:
        """Whether it is a model of its own, and its minimum was found."""
        return not self.contained_in and self.fit.status is Status.converged

    def to_dict(self) -> dict[str, Any]:
        """Numbers and texts for JSON."""
        names = ("name", "num_parameters", "objective", "optimism", "criterion", "difference", "standard_error")
        p_value = float(self.p_value) if np.isfinite(self.p_value) else None
        rest = {
            "p_value": p_value,
            "contained_in": self.contained_in,
            "worse_than": self.worse_than,
            "status": self.fit.status.value,
        }
        return {name: getattr(self, name) for name in names} | rest


@saved()
@dataclass(frozen=True, repr=False)
class Selection(Mapping[str, Candidate], Drawable, Saved, Labelled):
    """The candidates for one channel, the best first; those contained in smaller ones, and failed fits, come last.

    Attributes
    ----------
    superset
        What all candidates are part of.
    candidates
        In order of the criterion.
    level
        A candidate is significantly better than another if an interval of this confidence for their difference does
        not hold zero.
    num_replicates
        From which the optimism is; 0 for theory.
    """

    superset: Fit
    candidates: tuple[Candidate, ...]
    level: float
    num_replicates: int = 0

    def __getitem__(self, model: str | AbstractProcess | Composite) -> Candidate:
        wanted = components(as_model(model))
        for c in self.candidates:
            if components(as_model(c.name)) == wanted:
                return c
        raise KeyError(f"{model} is no candidate; there are {', '.join(self)}.")

    def __iter__(self) -> Iterator[str]:
        return (c.name for c in self.candidates)

    def __len__(self) -> int:
        return len(self.candidates)

    @property
    def best(self) -> Candidate:
        """The candidate with the lowest criterion."""
        return self.candidates[0]

    @cached_property
    def equivalent(self) -> tuple[Candidate, ...]:
        """The best candidate and all that are not significantly worse, from the fewest parameters on."""
        near = [c for c in self.candidates if c.sound and not c.worse_than]
        return tuple(sorted(near, key=lambda c: (c.num_parameters, c.criterion)))

    @property
    def recommended(self) -> Candidate:
        """The simplest of the equivalent models, if possible of those that their own test does not reject at 1 %.

        Of equally simple ones, that with the lower criterion.
        """
        return next((c for c in self.equivalent if not c.p_value < _REJECTED), self.equivalent[0])

    def __repr__(self) -> str:
        """A row a candidate: those equivalent to the best, and the next after them."""
        wv = self.superset.wv
        equivalent = {c.name for c in self.equivalent}
        own = [c for c in self.candidates if c.sound]
        last = max([_SHOWN, *(i + 1 for i, c in enumerate(own) if c.name in equivalent)])
        rows = []
        for c in own[:last]:
            mark = "recommended" if c is self.recommended else "equivalent" if c.name in equivalent else ""
            numbers = (number(c.objective, 6), number(c.optimism, 3), number(c.criterion, 6))
            spread = ("", "") if c is self.best else (number(c.difference, 4), number(c.standard_error, 2))
            rows.append([c.name, str(c.num_parameters), *numbers, *spread, number(c.p_value, 2), mark])
        head = ["model", "parameters", "objective", "optimism", "WVIC", "difference", "its SE", "p of fit", ""]
        how = f"{self.num_replicates} replicates" if self.num_replicates else "theory"
        lines = [
            f"Model selection for {wv.channels[0]} [{self.superset.unit}]: {len(self)} models within "
            f"{' + '.join(self.superset.model.labels)}, {self.superset.weights.name} weights, optimism by {how}",
            format_table(head, rows),
        ]
        contained = sum(bool(c.contained_in) for c in self.candidates)
        failed = sum(c.fit.status is not Status.converged for c in self.candidates)
        lines += [f"{len(own) - last} more with a higher criterion."] if len(own) > last else []
        lines += [f"{contained} more have a component at zero or at a limit: they are smaller models."] * (
            contained > 0
        )
        lines += [f"{failed} more did not converge."] * (failed > 0)
        if self.recommended.p_value < _REJECTED:
            lines += [f"No model describes every scale: the recommended one has p = {self.recommended.p_value:.2g}."]
            if self.recommended.fit.misfit:
                lines += [f"warning: {self.recommended.fit.misfit}"]
        return "\n".join(lines)

    def _arrays(self) -> Arrays:
        """A row a candidate."""
        names = ("num_parameters", "objective", "optimism", "criterion", "difference", "standard_error", "p_value")
        texts = ("contained_in", "worse_than")
        columns = {name: Values("model", [getattr(c, name) for c in self.candidates]) for name in (*names, *texts)}
        columns["status"] = Values("model", [c.fit.status.name for c in self.candidates])
        equivalent = {c.name for c in self.equivalent}
        columns["equivalent"] = Values("model", [c.name in equivalent for c in self.candidates])
        columns["recommended"] = Values("model", [c is self.recommended for c in self.candidates])
        wv = self.superset.wv._arrays()
        fitted = Values(("model", "scale"), [c.fit.fitted for c in self.candidates], wv.variables["variance"].unit)
        coordinates = {**wv.coordinates, "model": Values("model", list(self))}
        attributes = {**wv.attributes, "level": self.level, "num_replicates": self.num_replicates}
        return Arrays({**columns, **wv.variables, "fitted": fitted}, coordinates, attributes, ("model",))

    @classmethod
    def table_of(cls, selections: Sequence["Selection"], /) -> str:
        """Selections for several channels as text: what is recommended for each, and how it compares."""
        rows = []
        for s in selections:
            r = s.recommended
            numbers = [number(r.objective, 6), number(r.criterion, 6), number(r.p_value, 2), str(len(s.equivalent))]
            channel, unit = s.superset.wv.channels[0], s.superset.unit
            rows.append([channel, unit, r.name, str(r.num_parameters), *numbers, s.best.name])
        head = ["channel", "unit", "recommended", "parameters", "objective", "WVIC", "p of fit", "equivalent", "lowest"]
        return f"Model selections, of {len(selections[0])} models each\n{format_table(head, rows, left=3)}"

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain numbers and texts, for JSON."""
        return {
            "channel": self.superset.wv.channels[0],
            "unit": self.superset.unit,
            "weights": self.superset.weights.name,
            "level": self.level,
            "num_replicates": self.num_replicates,
            "recommended": self.recommended.name,
            "equivalent": [c.name for c in self.equivalent],
            "candidates": [c.to_dict() for c in self.candidates],
            "fit": self.recommended.fit.to_dict(),
        }


Model = str | AbstractProcess | Composite


@overload
def select(
    data: WaveletVariance,
    models: Model | Sequence[Model],
    *,
    nested: bool = True,
    rate: float | None = None,
    weights: WeightsLike = "covariance",
    num_replicates: int = 0,
    key: PRNGKey | None = None,
    level: float = 0.95,
    progress: Progress = False,
) -> Selection: ...
@overload
def select(
    data: WaveletVariances,
    models: Model | Sequence[Model],
    *,
    nested: bool = True,
    rate: float | None = None,
    weights: WeightsLike = "covariance",
    num_replicates: int = 0,
    key: PRNGKey | None = None,
    level: float = 0.95,
    progress: Progress = False,
) -> Channels[Selection]: ...
@overload
def select(
    data: Recording,
    models: Model | Sequence[Model],
    *,
    nested: bool = True,
    rate: float | None = None,
    weights: WeightsLike = "covariance",
    num_replicates: int = 0,
    key: PRNGKey | None = None,
    level: float = 0.95,
    progress: Progress = False,
) -> Selection | Channels[Selection]: ...
def select(
    data: WaveletVariance | WaveletVariances | Recording,
    models: Model | Sequence[Model],
    *,
    nested: bool = True,
    rate: float | None = None,
    weights: WeightsLike = "covariance",
    num_replicates: int = 0,
    key: PRNGKey | None = None,
    level: float = 0.95,
    progress: Progress = False,
) -> Selection | Channels[Selection]:
    """Rank models by how well they would describe other data of the same sensor, and recommend the simplest good one.

    Parameters
    ----------
    data
        The wavelet variance of one or several channels, or a recording.
    models
        A superset such as ``"WN + QN + RW + DR + 3*GM"``, or several models, whose superset is then the smallest that
        contains all of them.
    nested
        Compare all sub-models of the superset; False compares only the models given. Components that are held
        altogether are in every sub-model.
    rate, level
        As for `fit`.
    weights
        As for `fit` (None for its default), but those of the superset for all models: only then do objectives
        compare. With those of the covariance an objective is chi-square for a right model, and the optimism twice the
        number of parameters; others tell less well what is right.
    num_replicates
        Take the optimism from so many replicates of the superset instead of theory.
    key
        For the replicates.
    progress
        Show a bar of what is fitted (needs the extra ``app``): every model, its replicates, and the test of every
        model, of all channels together; or a function of what is done and the total, which may cancel by raising.

    Returns
    -------
    Selection for one channel, `Channels` of them by name for several.

    Raises
    ------
    ValueError
        No theory of this wavelet variance; a superset with more free parameters than scales, or with components that
        cannot be told apart; a single model with ``nested=False``; replicates without a key or too few of them.
    RuntimeError
        The fit of the superset did not converge.
    TypeError
        Data, model or key of another kind.

    Notes
    -----
    A component that is not there makes no model wrong, it makes it larger than needed: among models that differ by
    such components the criterion varies by chance, and the lowest is not the truth. The recommendation is.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> selection = gj.select(wv, "WN + QN + RW")
    >>> selection.recommended in selection.equivalent
    True
    """
    level = confidence(level)
    num_replicates = integer("num_replicates", num_replicates, 0)
    if num_replicates:
        if num_replicates < 20:
            raise ValueError(f"{num_replicates} replicates are too few for a covariance: take 20 or more, or none.")
        if key is None:
            raise ValueError("Replicates need a key: key=jax.random.key(0).")
        typed_key(key)
    superset, subsets = _candidates(models, nested)
    wv = as_wavelet_variance(data, "select")
    wv.require_theory("Criteria")
    bar = progress_bar(len(wv.channels) * len(subsets) * (2 + num_replicates), "fit", progress)
    try:
        found = fit(wv, superset, rate=rate, weights=weights, level=level)
        fits = (found,) if isinstance(found, Fit) else tuple(found.values())
        selections = tuple(_select(f, superset, subsets, num_replicates, key, bar) for f in fits)
    finally:
        bar.close()
    return selections[0] if isinstance(wv, WaveletVariance) else Channels.of(wv.channels, selections)


def _candidates(models: Model | Sequence[Model], nested: bool) -> tuple[Composite, list[Subset]]:
    if isinstance(models, str | AbstractProcess | Composite):
        superset, given = common_superset([as_model(models)])
    else:
        superset, given = common_superset([as_model(m) for m in models])
        if len(set(given)) < len(given):
            raise ValueError("Two of the models given are the same.")
    subsets = submodels(superset) if nested else given
    if len(subsets) < 2:
        raise ValueError(f"There is nothing to choose from: {superset} alone. Give a superset, or several models.")
    return superset, subsets


def _select(
    whole: Fit, superset: Composite, subsets: list[Subset], num_replicates: int, key: Any, bar: Bar
) -> Selection:
    # the covariance that the weights are the inverse of is that of the fit before
    V = np.linalg.inv(whole.omega) if whole.weights.inverts_covariance else whole.wv_covariance
    if V is None:
        raise ValueError(f"There is no theory of the scatter of {superset}: leave SIN out, or take it off the record.")
    swept = sweep(whole, superset, subsets, advance=bar.update)
    fits = swept.fits
    L = whole.whitener  # L' of the formulas
    S = L @ V @ L.T
    projections = [projection(L @ tangents(f)) for f in fits]
    residuals = [f.whitened_residuals for f in fits]
    if num_replicates:
        lacks = _optimism_of_replicates(whole, V, swept, num_replicates, key, bar)
    else:
        lacks = np.array([optimism(P, S) for P in projections])
    names = [text_of(Composite([superset.processes[i] for i in s])) for s in subsets]
    contained = _contained(fits, names)
    criteria = np.array([f.objective for f in fits]) + lacks
    sound = np.array([f.status is Status.converged and not c for f, c in zip(fits, contained, strict=True)])
    order = [int(m) for m in np.lexsort((criteria, ~sound))]

    def error(a: int, b: int) -> float:
        nested = set(subsets[a]) <= set(subsets[b]) or set(subsets[b]) <= set(subsets[a])
        return standard_error((residuals[a], projections[a]), (residuals[b], projections[b]), S, nested)

    z, best = normal_quantile(whole.level), order[0]
    candidates = []
    for at, m in enumerate(order):
        bar.update(1)
        better = [b for b in order[:at] if sound[b] and criteria[m] - criteria[b] > z * error(m, b)]
        # what a model without a random walk claims of the longest spans, only its own covariance knows
        tested, own = fits[m], V
        if sound[m] and not better:
            own = _own_covariance(whole, fits[m])
            if not fits[m].weighs_covariances:  # see `gmwm_jax.fitting.misfit`
                tested, own = fits[m].with_amplitudes_again(own)
        root = tested.whitener
        M = np.eye(len(V)) - np.linalg.inv(root) @ projection(root @ tangents(tested)) @ root
        candidates.append(
            Candidate(
                names[m],
                fits[m],
                num_parameters=round(np.trace(projections[m])),
                optimism=float(lacks[m]),
                difference=float(criteria[m] - criteria[best]),
                standard_error=error(m, best),
                p_value=chi_square(tested.residuals, M, own).p_value,
                contained_in=contained[m],
                worse_than=names[better[0]] if better else "",
            )
        )
    return Selection(whole, tuple(candidates), whole.level, num_replicates)


def _own_covariance(whole: Fit, fit: Fit) -> Float[np.ndarray, "J J"]:
    """Covariance of the wavelet variance under a candidate, written as its superset: one program serves all."""
    left, processes = list(fit.model.processes), []
    for p in whole.model.processes:
        own = next((q for q in left if components(Composite([q])) == components(Composite([p]))), None)
        if own is not None:
            left.remove(own)
            processes.append(own)
        else:
            processes.append(eqx.tree_at(lambda q: getattr(q, q.parameters[-1].name), p, jnp.zeros(())))
    V = fit.wv.covariance_under(Composite(processes))
    assert V is not None  # that of the superset is known
    return V


def _optimism_of_replicates(
    whole: Fit, V: np.ndarray, swept: Sweep, num: int, key: Any, bar: Bar
) -> Float[np.ndarray, " M"]:
    """Twice the covariance of measured and fitted wavelet variance, over replicates of the superset."""
    nu = theory_draws(whole.model, whole.wv, V)(numbered_keys(key, range(num)))
    fitted = swept.again(nu, bar.update)
    L = whole.whitener
    z, moved = (nu - nu.mean(axis=0)) @ L.T, (fitted - fitted.mean(axis=1, keepdims=True)) @ L.T
    return 2 * np.sum(z * moved, axis=(1, 2)) / (num - 1)


def tangents(fit: Fit) -> Float[np.ndarray, "J p"]:
    """Derivatives of the fitted wavelet variance in the active parameters, on the real line."""
    tau, at, columns = jnp.asarray(fit.wv.scales), 0, [np.zeros((fit.wv.num_scales, 0))]
    for p in fit.model.processes:
        own = [i - at for i in fit.active if at <= i < at + len(p.parameters)]
        if own:
            columns.append(np.asarray(_derivatives(p, tau))[:, own])
        at += len(p.parameters)
    return np.concatenate(columns, axis=1)


@jax.jit
def _derivatives(process: AbstractProcess, tau: Array) -> Array:
    # a class of process at a time: few programs, whatever the number of models
    return jax.jacfwd(lambda eta: process.from_unconstrained(eta).wavelet_variance(tau))(process.unconstrained())


def _contained(fits: Sequence[Fit], names: Sequence[str]) -> list[str]:
    """For each fit with a component at zero or at a limit, the candidate that it is; else ""."""
    known = {frozenset(components(as_model(name)).items()): name for name in names}
    found = []
    for f, name in zip(fits, names, strict=True):
        same = ""
        if f.at_boundary:
            same = known.get(frozenset(components(f.reduced).items()), "")
        found.append("" if same == name else same)
    return found
