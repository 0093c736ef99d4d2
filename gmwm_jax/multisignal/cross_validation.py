"""Which model predicts records that it has not seen? Cross-validation over records.

For every split of R records into s to estimate from and the rest, each model is fitted jointly to the former and its
objective evaluated on the latter; the mean over splits is its CV-WVIC (Bakalli et al. 2023). A model too small misses
the records left out, one too large follows the scatter of those it saw.

Splits share records, so they are no independent evidence; records are. With e_i the mean objective of record i over the
splits that leave it out, CV-WVIC = (R - s) mean(e_i), and its standard error is (R - s) sd(e_i)/sqrt(R). Differences of
two models are taken record by record, and are compared with Student's distribution with R - 1 degrees of freedom.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, overload

import jax
import numpy as np
from jaxtyping import Bool, Float
from scipy.special import stdtrit

from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.checks import confidence, integer, typed_key
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.multisignal._pool import as_records
from gmwm_jax.multisignal._refit import joint_refit
from gmwm_jax.multisignal.joint import JointFit, fit_records
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.wavelet import WaveletVariance, WaveletVariances


@saved(not_finite=("error", "difference_error"))
@dataclass(frozen=True)
class ModelScore:
    """How well one model predicts records left out.

    Attributes
    ----------
    model
        Its text, ``WN + 2*GM``.
    num_parameters
        Free parameters.
    score, error
        CV-WVIC and its standard error over records.
    difference, difference_error
        To the model with the lowest score, record by record, and the standard error of that.
    equivalent
        May it be as good as the best? The interval of the difference holds zero.
    num_failed
        Splits whose search did not converge (they count as they are).
    """

    model: str
    num_parameters: int
    score: float
    error: float
    difference: float
    difference_error: float
    equivalent: bool
    num_failed: int


@saved()
@dataclass(frozen=True, repr=False)
class CrossValidation(Mapping[str, ModelScore], Drawable, Saved):
    """The result of `cross_validate`, the best model first; ``cv["WN + GM"]`` is the row of a model.

    Attributes
    ----------
    scores
        A row a model, by score.
    fits
        Joint fits to all records, in the same order.
    left_out
        Mean objective of each record when it was left out, models by records, shape (M, R), in the same order.
    splits
        Which records each split was estimated from, shape (B, R).
    exact
        All splits that there are, not a random choice?
    level
        Confidence of "equivalent".
    """

    scores: tuple[ModelScore, ...]
    fits: tuple[JointFit, ...]
    left_out: Float[np.ndarray, "M R"]
    splits: Bool[np.ndarray, "B R"]
    exact: bool
    level: float

    @property
    def recommended(self) -> ModelScore:
        """The equivalent model with the fewest parameters, the better one of two."""
        return min((p for p in self.scores if p.equivalent), key=lambda p: (p.num_parameters, p.score))

    def __getitem__(self, model: str) -> ModelScore:
        for p in self.scores:
            if p.model == model:
                return p
        raise KeyError(f"No model {model!r}; there are {', '.join(self)}.")

    def __iter__(self):
        return (p.model for p in self.scores)

    def __len__(self) -> int:
        return len(self.scores)

    @classmethod
    def table_of(cls, validations: Sequence["CrossValidation"], /) -> str:
        """Cross-validations of several channels as text: what is recommended for each, and how it compares."""
        rows = []
        for cv in validations:
            r = cv.recommended
            numbers = [number(r.score), *(number(x, 3) for x in (r.error, r.difference, r.difference_error))]
            equivalent = str(sum(p.equivalent for p in cv.scores))
            rows.append(
                [cv.fits[0].wv.channels[0], r.model, str(r.num_parameters), *numbers, equivalent, next(iter(cv))]
            )
        head = ["channel", "recommended", "parameters", "CV-WVIC", "se", "to best", "se", "equivalent", "lowest"]
        first = validations[0]
        return (
            f"Cross-validations over {first.splits.shape[1]} records, of {len(first)} models each\n"
            f"{format_table(head, rows, left=2)}"
        )

    def __repr__(self) -> str:
        """A row a model, the best first."""
        head = ["model", "parameters", "CV-WVIC", "se", "to best", "se", ""]
        chosen = self.recommended
        rows = [
            [
                p.model,
                str(p.num_parameters),
                number(p.score),
                *(number(x, 3) for x in (p.error, p.difference, p.difference_error)),
                "recommended" if p is chosen else "equivalent" if p.equivalent else "",
            ]
            for p in self.scores
        ]
        B, R = self.splits.shape
        sets = f"all {B}" if self.exact else f"{B} random"
        failed = sum(p.num_failed for p in self.scores)
        note = f"; {failed} searches did not converge" if failed else ""
        return (
            f"Cross-validation over {R} records of {self.fits[0].wv.channels[0]}, {sets} splits: estimated from "
            f"{int(self.splits[0].sum())}, compared on the rest{note}\n{format_table(head, rows)}\n"
            f"equivalent: the {100 * self.level:g} % interval of the difference to the best holds zero"
        )


@overload
def cross_validate(
    data: Sequence[WaveletVariance],
    models: Sequence[str | AbstractProcess | Composite],
    *,
    num_estimation: int | None = None,
    max_splits: int = 200,
    key: PRNGKey | None = None,
    level: float = 0.95,
) -> CrossValidation: ...
@overload
def cross_validate(
    data: Sequence[WaveletVariances],
    models: Sequence[str | AbstractProcess | Composite],
    *,
    num_estimation: int | None = None,
    max_splits: int = 200,
    key: PRNGKey | None = None,
    level: float = 0.95,
) -> Channels[CrossValidation]: ...
@overload
def cross_validate(
    data: Sequence[WaveletVariance | WaveletVariances] | Sequence[Recording],
    models: Sequence[str | AbstractProcess | Composite],
    *,
    num_estimation: int | None = None,
    max_splits: int = 200,
    key: PRNGKey | None = None,
    level: float = 0.95,
) -> CrossValidation | Channels[CrossValidation]: ...
def cross_validate(
    data: Any,
    models: Sequence[str | AbstractProcess | Composite],
    *,
    num_estimation: int | None = None,
    max_splits: int = 200,
    key: PRNGKey | None = None,
    level: float = 0.95,
) -> CrossValidation | Channels[CrossValidation]:
    """Compare models by how well they predict records that they have not seen.

    Parameters
    ----------
    data
        Three or more wavelet variances or recordings of one sensor type, see `fit_records`. Weights are those of the
        intervals, the same for all models.
    models
        Texts or sums of processes; values in them mean what they mean to `fit`.
    num_estimation
        s, records that each split estimates from, by default half of them, rounded up.
    max_splits
        If there are more splits, a random choice of about this many, every record left out equally often.
    key
        ``jax.random.key(seed)``, needed for a random choice.
    level
        Confidence at which a difference tells two models apart.

    Returns
    -------
    CrossValidation for one channel, `Channels` of them for several.

    Raises
    ------
    ValueError
        Fewer than three records; no model, or one twice; s below one, or that leaves less than one record; a record
        with fewer scales than a model has free parameters; no key where splits are chosen; what `fit_records` raises.
    TypeError, RuntimeError
        As `fit_records`.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> models = gj.multisignal.cross_validate(units, ["WN", "WN + RW"])
    >>> sorted(models)
    ['WN', 'WN + RW']
    """
    level = confidence(level)
    records = as_records(data, "cross_validate")
    R = len(records)
    if R < 3:
        raise ValueError("cross_validate() takes three records or more: of two, one alone would judge the other.")
    if isinstance(models, (str, AbstractProcess, Composite)) or not models:
        raise ValueError("models is a list of models to compare, and not empty.")
    posed = {_text(model): model for model in map(as_model, models)}
    if len(posed) < len(models):
        raise ValueError(f"A model is there twice: {', '.join(_text(as_model(m)) for m in models)}.")
    fewest = min(wv.num_scales for wv in records)
    for text, model in posed.items():
        if model.num_free > fewest:
            raise ValueError(
                f"{text} has {model.num_free} free parameters and the shortest record {fewest} scales: leave out the "
                "model or the record."
            )
    s = -(-R // 2) if num_estimation is None else integer("num_estimation", num_estimation, 1)
    if s >= R:
        raise ValueError(f"num_estimation={s} leaves none of {R} records to compare on.")
    splits, exact = _splits(R, s, integer("max_splits", max_splits, R), key)
    fits: dict[str, Any] = {text: fit_records(records, model) for text, model in posed.items()}
    if isinstance(records[0], WaveletVariance):
        return _compare(fits, splits, exact, level)
    return Channels(
        {c: _compare({t: f[c] for t, f in fits.items()}, splits, exact, level) for c in records[0].channels}
    )


def _splits(R: int, s: int, max_splits: int, key: PRNGKey | None) -> tuple[Bool[np.ndarray, "B R"], bool]:
    """Which records each split is estimated from, and whether these are all splits."""
    there_are = math.comb(R, s)
    if there_are <= max_splits:
        members = np.array(list(combinations(range(R), s)))
    else:
        if key is None:
            raise ValueError(
                f"{R} records have {there_are} splits: give key=... to choose about {max_splits}, or raise max_splits."
            )
        typed_key(key)
        orders = [np.asarray(jax.random.permutation(k, R)) for k in jax.random.split(key, max_splits // R)]
        # all rotations of an order leave every record out equally often
        members = np.array([np.roll(order, shift)[:s] for order in orders for shift in range(R)])
    splits = np.zeros((len(members), R), dtype=bool)
    np.put_along_axis(splits, members, True, axis=1)
    return splits, there_are <= max_splits


def _compare(
    fits: Mapping[str, JointFit], splits: Bool[np.ndarray, "B R"], exact: bool, level: float
) -> CrossValidation:
    """One channel."""
    num_left = int((~splits[0]).sum())
    R = splits.shape[1]
    scores, failed = {}, {}
    for text, joint in fits.items():
        omega = np.einsum("br,rjk->bjk", splits.astype(np.float64), joint.pool.omegas)
        found = joint_refit(joint, omega, splits.astype(np.float64) @ joint.pool.moments)
        objectives = np.where(splits, 0.0, joint.pool.objectives(found.fitted))
        scores[text] = objectives.sum(axis=0) / (~splits).sum(axis=0)
        failed[text] = int((~found.converged).sum())
    order = sorted(scores, key=lambda text: scores[text].mean())
    best = scores[order[0]]
    t = stdtrit(R - 1, (1 + level) / 2)

    def error(of_records: Float[np.ndarray, " R"]) -> float:
        return num_left * float(of_records.std(ddof=1) / np.sqrt(R))

    rows = []
    for text in order:
        difference = scores[text] - best
        to_best, its_error = num_left * float(difference.mean()), error(difference)
        rows.append(
            ModelScore(
                model=text,
                num_parameters=fits[text].model.num_free,
                score=num_left * float(scores[text].mean()),
                error=error(scores[text]),
                difference=to_best,
                difference_error=its_error,
                equivalent=bool(to_best <= t * its_error),
                num_failed=failed[text],
            )
        )
    ordered = tuple(fits[text] for text in order)
    return CrossValidation(tuple(rows), ordered, np.stack([scores[text] for text in order]), splits, exact, level)


def _text(model: Composite) -> str:
    """``WN + 2*GM``; with its values where some are given."""
    if any(v is not None for p in model.processes for v in p.values):
        return str(model)
    kinds = list(dict.fromkeys(p.kind for p in model.processes))
    counts = {kind: sum(p.kind == kind for p in model.processes) for kind in kinds}
    return " + ".join(kind if count == 1 else f"{count}*{kind}" for kind, count in counts.items())
