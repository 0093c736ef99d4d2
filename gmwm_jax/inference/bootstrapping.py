"""Parametric bootstrap: how estimates scatter where the fitted model is the truth (Efron & Tibshirani 1993).

The wavelet variances of the replicates are those of simulated records, or drawn from their distribution, see
`gmwm_jax.variance.replicates`.
"""

import os
import secrets
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float

from gmwm_jax._internal.cached import cached_property
from gmwm_jax._internal.checks import integer, require_x64, typed_key
from gmwm_jax._internal.chunks import (
    key_of_words,
    numbered_keys,
    replicate_p_value,
    replicates_done,
    until_interrupted,
    words_of_key,
)
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.executors import InThisThread, Pool, Workers
from gmwm_jax._internal.labelled import UNIT_OF_PARAMETER, Arrays, Labelled, Values, import_pandas
from gmwm_jax._internal.memory import FLOAT, require_memory
from gmwm_jax._internal.parts import Parts
from gmwm_jax._internal.progress import Progress
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.specification import specification_of
from gmwm_jax._internal.states import from_state, saved, to_state
from gmwm_jax._internal.tasks import SentAsState, carry_out
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.fitting.refit import refit
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.tables import Estimate, EstimateTable
from gmwm_jax.inference.intervals import continuous_intervals, interval, replicates_needed
from gmwm_jax.processes.simulation import bytes_of_draw
from gmwm_jax.variance.replicates import record_draws, theory_draws

if TYPE_CHECKING:
    import pandas

RECORDS, VARIANCES = "records", "variances"
CHUNK = 64
"""Replicates drawn and estimated at once, between two looks at the keyboard."""
NUMBERS = 1
"""Version of the replicates of a key: who draws or estimates them otherwise raises it, and no store has two kinds."""


@saved(not_finite=("variances", "values", "objective"))
@dataclass(frozen=True, repr=False)
class Bootstrap(Drawable, Saved, Labelled):
    """The result of `bootstrap`: B replicates of a fit.

    Attributes
    ----------
    fit
        What was replicated: its model is the truth of every replicate.
    route
        ``variances`` or ``records``.
    variances
        Wavelet variances of the replicates, shape (B, J).
    values
        Estimates, shape (B, P), parameters per sample in the order of the model.
    objective
        Of each replicate, shape (B,).
    converged
        Which searches converged; the others count as failures and enter nothing.
    num_requested
        More than B if it was interrupted.
    """

    fit: Fit
    route: str
    variances: Float[np.ndarray, "B J"]
    values: Float[np.ndarray, "B P"]
    objective: Float[np.ndarray, " B"]
    converged: Bool[np.ndarray, " B"]
    num_requested: int

    @property
    def num_failed(self) -> int:
        """Number of replicates whose search did not converge."""
        return int((~self.converged).sum())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the P parameters, such as ``GM_1 beta``."""
        model = self.fit.model
        return tuple(
            f"{label} {q.name}" for label, p in zip(model.labels, model.processes, strict=True) for q in p.parameters
        )

    @property
    def good(self) -> Float[np.ndarray, "G P"]:
        """Estimates of the replicates that converged."""
        return self.values[self.converged]

    @property
    def covariance(self) -> Float[np.ndarray, "P P"]:
        """Covariance of the estimates per sample, over the replicates that converged."""
        return np.atleast_2d(np.cov(self.good, rowvar=False))

    @property
    def correlation(self) -> Float[np.ndarray, "P P"]:
        """Correlation of the estimates; NaN for what does not vary."""
        sd = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.covariance / np.outer(sd, sd)

    @property
    def p_value(self) -> float:
        """Share of replicates, the data counted in, whose objective is at least that of the data.

        Small where the model is wrong: it is the test of goodness of fit by the objective itself.
        """
        return replicate_p_value(self.fit.objective, self.objective[self.converged])

    def interval(
        self, kind: str = "percentile", level: float | None = None
    ) -> tuple[Float[np.ndarray, " P"], Float[np.ndarray, " P"]]:
        """Both ends of the intervals of all parameters per sample, see `gmwm_jax.inference.intervals.interval`.

        Parameters
        ----------
        kind
            ``percentile``, ``basic`` or ``studentised``.
        level
            Confidence, by default that of the fit.
        """
        return interval(self.fit, self.good, kind, self.fit.level if level is None else level)

    def parameters(self, kind: str = "percentile", level: float | None = None) -> EstimateTable:
        """The parameters per sample with intervals from the replicates; arguments as of `interval`."""
        table = self.fit.parameters()
        ends = zip(table, *self.interval(kind, level), strict=True)
        return self._table(table, [replace(e, ci_low=low, ci_high=high) for e, low, high in ends], kind, level)

    def continuous(self, kind: str = "percentile", level: float | None = None) -> EstimateTable:
        """What a Kalman filter wants, see `Fit.continuous`, with intervals from the replicates."""
        return self._continuous(self.fit.continuous(), kind, level)

    def datasheet(self, kind: str = "percentile", level: float | None = None) -> EstimateTable:
        """The units of datasheets, with intervals from the replicates."""
        return self._continuous(self.fit.datasheet(), kind, level)

    def _continuous(self, table: EstimateTable, kind: str, level: float | None) -> EstimateTable:
        at = self.fit.level if level is None else level
        return self._table(table, continuous_intervals(self.fit, self.good, kind, at, table), kind, level)

    def _table(self, table: EstimateTable, shown: list[Estimate], kind: str, level: float | None) -> EstimateTable:
        title = f"{table.title}, {kind} intervals from {len(self.good)} replicates"
        return EstimateTable(title, tuple(shown), self.fit.level if level is None else level)

    def _arrays(self) -> Arrays:
        """A row a replicate and parameter."""
        fit, wv = self.fit, self.fit.wv._arrays()
        units = [q.unit.format(u=fit.unit) for p in fit.model.processes for q in p.parameters]
        variables = {
            "value": Values(("replicate", "parameter"), self.values, UNIT_OF_PARAMETER),
            "objective": Values("replicate", self.objective),
            "converged": Values("replicate", self.converged),
            "variance": Values(("replicate", "scale"), self.variances, wv.variables["variance"].unit),
            "estimate": Values("parameter", [float(v) for p in fit.model.processes for v in p.values]),
        }
        coordinates = {
            **wv.coordinates,
            "replicate": Values("replicate", np.arange(len(self.values))),
            "parameter": Values("parameter", self.names),
            "parameter_unit": Values("parameter", units),
        }
        attributes = {"route": self.route, "num_requested": self.num_requested, "objective_of_data": fit.objective}
        return Arrays(variables, coordinates, attributes, ("replicate", "parameter"))

    def to_pandas(self) -> "pandas.DataFrame":
        """A row a replicate: objective, whether its search converged, and the estimates; needs the extra ``io``."""
        columns = {"objective": self.objective, "converged": self.converged}
        return import_pandas().DataFrame(columns | dict(zip(self.names, self.values.T, strict=True)))

    def __repr__(self) -> str:
        """What was done, the test of fit, and the parameters if there are replicates enough."""
        done = replicates_done(len(self.values), self.num_requested, self.num_failed, self.route)
        lines = [
            f"Bootstrap of {' + '.join(self.fit.model.labels)} on {self.fit.wv.channels[0]}: {done}",
            f"objective {self.fit.objective:.6g}; as large or larger in the replicates: p = {self.p_value:.3g}",
        ]
        if len(self.good) >= replicates_needed(self.fit.level):
            lines += ["", str(self.parameters())]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """What was done and the percentile intervals, for JSON; no table if there are too few replicates."""
        enough = len(self.good) >= replicates_needed(self.fit.level)
        result: dict[str, Any] = {
            "route": self.route,
            "num_replicates": len(self.values),
            "num_failed": self.num_failed,
            "p_value": self.p_value,
            "parameters": self.parameters().to_list() if enough else None,
        }
        if self.fit.rate:
            result["continuous"] = self.continuous().to_list() if enough else None
            result["datasheet"] = self.datasheet().to_list() if enough else None
        return result


def bootstrap(
    fit: Fit,
    num_replicates: int = 500,
    *,
    key: PRNGKey,
    route: str = VARIANCES,
    executor: Workers = None,
    store: str | os.PathLike | None = None,
    progress: Progress = False,
) -> Bootstrap:
    """Replicate a fit with its model as the truth.

    Parameters
    ----------
    fit
        A fit to a wavelet variance whose theory is known (MODWT, all scales, number of samples).
    num_replicates
        B.
    key
        ``jax.random.key(seed)``. Replicate b has a key of its own whatever B is.
    route
        ``variances`` draws wavelet variances from their theoretical distribution, ``records`` simulates records.
    executor
        Who computes: a `concurrent.futures.Executor`, a function that makes one (such as `processes`, whose workers are
        replaced when they die), or what has ``get_executor()``, such as a Dask Client. This thread unless given. The
        replicates are the same, to the last bit, whoever computed them on one kind of processor.
    store
        A folder, new or of this bootstrap, where every chunk of replicates is kept: the same call continues one that
        was killed, and a call for more replicates one that is done.
    progress
        Show a bar (needs the extra ``app``); or a function of what is done and the total, which may cancel by
        raising.

    Returns
    -------
    Bootstrap
        With fewer replicates than asked for if it was interrupted from the keyboard: what was done by then.

    Raises
    ------
    ValueError
        Another route; no theory; a model without any variance; records for a robust wavelet variance. The store is of
        another bootstrap: the message names the field that differs. A model with a process of your own, and a store.
    TypeError
        The key is an integer or of the old kind.
    FileExistsError
        There is something else at the path of the store.
    OSError
        The store cannot be written, as where the disk is full; what is whole in it is kept.
    RuntimeError
        One chunk took three workers with it, or workers died and nobody has said how to make others; a Dask cluster
        ended, or had no worker for two minutes where it is of this machine, for a day where it is not, or for as long
        as Dask's configuration says (``distributed.scheduler.no-workers-timeout``).

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> fit = gj.fit(wv, "WN + RW")
    >>> boot = gj.bootstrap(fit, 20, key=jax.random.key(0))
    >>> boot.names
    ('WN sigma2', 'RW gamma2')
    >>> more = gj.bootstrap(fit, 80, key=jax.random.key(0), store="replicates")
    >>> bool(np.all(more.values[:20] == boot.values))
    True
    """
    require_x64()
    typed_key(key)
    num_replicates = integer("num_replicates", num_replicates, 1)
    if route not in (RECORDS, VARIANCES):
        raise ValueError(f'route is "{VARIANCES}" or "{RECORDS}", and is {route!r}.')
    fit.wv.require_theory("Replicates")
    if route == RECORDS and not fit.wv.estimator.replicates_records:
        raise ValueError(f'A robust wavelet variance is replicated by route="{VARIANCES}", whose theory knows it.')
    if route == VARIANCES and fit.wv_covariance is None:
        raise ValueError(f'There is no theory of the scatter of {fit.model}: take route="{RECORDS}".')
    if np.any(fit.fitted <= 0):
        raise ValueError(f"{fit.model} has no variance at some scale: there is nothing to replicate.")
    num_values = sum(len(p.parameters) for p in fit.model.processes)
    # its key, variances and their copy, parameters, and what became of it
    most = FLOAT * num_replicates * (4 + 2 * fit.wv.num_scales + num_values)
    if route == RECORDS:
        most += min(CHUNK, num_replicates) * bytes_of_draw(fit.model, fit.wv.num_samples or 0)
    require_memory(most, f"{num_replicates} replicates", "ask for fewer (num_replicates)")
    source = BootstrapSource(fit, route, *words_of_key(key), CHUNK)
    parts = None if store is None else Parts(store, "bootstrap", specification_of(source, NUMBERS))
    # of a chunk in a store all replicates are there, for who continues with more
    last = num_replicates if parts is None else -(-num_replicates // CHUNK) * CHUNK
    tasks = [(first, min(first + CHUNK, last)) for first in range(0, num_replicates, CHUNK)]
    done: dict[tuple[int, int], Replicates] = {}
    with until_interrupted(done, num_replicates, "replicate", progress) as bar:

        def take(task: tuple[int, int], found: "Replicates | Exception") -> None:
            if isinstance(found, Exception):
                raise found
            if parts is not None and task not in stored:
                parts.write(_name(task), to_state(found))
            done[task] = found
            bar.update(min(task[1], num_replicates) - task[0])

        stored = {} if parts is None else _stored(parts, tasks)
        for task, found in stored.items():
            take(task, found)
        lacking = [task for task in tasks if task not in stored]
        given = secrets.token_hex(8), source
        carry_out(iter([lacking]), _replicates, given, Pool(executor, InThisThread), take, died=_died(parts))
    leading = list(takewhile(done.__contains__, tasks))  # the number of a replicate is that of its key
    if not leading:
        raise KeyboardInterrupt
    columns = (
        np.concatenate(leaves)[:num_replicates] for leaves in zip(*(done[t].columns for t in leading), strict=True)
    )
    return Bootstrap(fit, route, *columns, num_requested=num_replicates)


# -- a chunk of replicates, wherever it is computed -------------------------------------------------------------------


@saved()
@dataclass(frozen=True, eq=False)
class BootstrapSource(SentAsState):
    """All that replicates depend on, apart from their numbers."""

    fit: Fit
    route: str
    key_kind: str
    key_words: tuple[int, ...]
    chunk_size: int

    @cached_property
    def draw(self) -> Callable[[Any], np.ndarray]:
        """Wavelet variances by keys of replicates."""
        if self.route == VARIANCES:
            return theory_draws(self.fit.model, self.fit.wv, np.asarray(self.fit.wv_covariance))
        return record_draws(self.fit.model, self.fit.wv)

    def replicates(self, first: int, last: int) -> "Replicates":
        """Draw and estimate those of these numbers."""
        # what is drawn in one call is always as much, since last bits depend on it; records are drawn by parts of their
        # own that are, and would take long
        numbers = range(first, first + self.chunk_size if self.route == VARIANCES else last)
        nu = self.draw(numbered_keys(key_of_words(self.key_kind, self.key_words), numbers))[: last - first]
        # by pairs a variance may be negative by chance: such a replicate is a failure
        good = np.all(nu > 0, axis=1)
        found = refit(self.fit, np.where(good[:, None], nu, self.fit.fitted))
        return Replicates(nu, found.values, found.objective, found.converged & good)


@saved(not_finite=("variances", "values", "objective"))
@dataclass(frozen=True, eq=False)
class Replicates:
    """A chunk of those of a `Bootstrap`."""

    variances: Float[np.ndarray, "B J"]
    values: Float[np.ndarray, "B P"]
    objective: Float[np.ndarray, " B"]
    converged: Bool[np.ndarray, " B"]

    @property
    def columns(self) -> tuple[np.ndarray, ...]:
        """As `Bootstrap` has them."""
        return self.variances, self.values, self.objective, self.converged


_sources: dict[str, BootstrapSource] = {}
"""The last one of this process, prepared: every task comes with a copy."""
_opening = threading.Lock()


def _replicates(token: str, source: BootstrapSource, first: int, last: int) -> Replicates:
    with _opening:
        if token not in _sources:
            _sources.clear()
            _sources[token] = source
        source = _sources[token]
    return source.replicates(first, last)


def _name(task: tuple[int, int]) -> str:
    return f"replicates-{task[0]:07d}"


def _stored(parts: Parts, tasks: list[tuple[int, int]]) -> dict[tuple[int, int], Replicates]:
    """Those that are there."""
    states = {task: parts.read(_name(task)) for task in tasks}
    return {task: from_state(state) for task, state in states.items() if state is not None}


def _died(parts: Parts | None) -> Callable[[str, list[tuple[int, int]]], str]:
    kept = "with store=... what is done would be kept" if parts is None else f"what is whole in {parts.path} is kept"

    def died(happened: str, tasks: list[tuple[int, int]]) -> str:
        return (
            f"{happened} while it had one of the chunks of replicates from {tasks[0][0]} on: {kept}. "
            "executor=gj.inference.processes(n) replaces workers that die now and then."
        )

    return died
