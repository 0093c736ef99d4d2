"""Many recordings, each fitted by itself: a task a recording, whoever computes it, and what fails ends nothing."""

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.checks import confidence, require_x64
from gmwm_jax._internal.chunks import until_interrupted
from gmwm_jax._internal.executors import InThisThread, Pool, Workers
from gmwm_jax._internal.labelled import import_pandas
from gmwm_jax._internal.parts import Parts
from gmwm_jax._internal.progress import Progress
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.specification import specification_of
from gmwm_jax._internal.states import from_state, register, saved, to_state
from gmwm_jax._internal.tasks import SentAsState, carry_out, why
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.fitting.estimator import fit
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.weights import AbstractWeights, WeightsLike, as_weights
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recordings.files import read_recording
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.wavelet import wavelet_variance

if TYPE_CHECKING:
    import pandas

NUMBERS = 1
"""Version of the fits: who changes what comes out of a recording raises it, and no store has two kinds."""

Source: TypeAlias = str | os.PathLike[str] | Recording


class EachFit(Mapping[str, Fit | Channels[Fit]], Saved):
    """Fits by name of the recording; they print as one table, a row a channel. The result of `fit_each`.

    Parameters
    ----------
    fits
        Of each recording that could be fitted: a `Fit` if it has one channel, or `Channels` of them.
    failed
        Name -> why it could not be fitted.
    missing
        Names of those that were not tried before an interrupt from the keyboard.
    """

    def __init__(
        self,
        fits: Mapping[str, Fit | Channels[Fit]],
        failed: Mapping[str, str] | None = None,
        missing: Iterable[str] = (),
    ):
        self._fits, self.failed, self.missing = dict(fits), dict(failed or {}), tuple(missing)

    def __getitem__(self, name: str) -> Fit | Channels[Fit]:
        if name in self.failed:
            raise KeyError(f"{name} could not be fitted: {self.failed[name]}")
        if name not in self._fits:
            raise KeyError(f"No fit of {name!r}; there are those of {', '.join(self)}.")
        return self._fits[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._fits)

    def __len__(self) -> int:
        return len(self._fits)

    @property
    def singles(self) -> dict[tuple[str, str], Fit]:
        """Recording and channel -> its fit."""
        found = {}
        for name, of in self.items():
            for one in [of] if isinstance(of, Fit) else of.values():
                found[name, one.wv.channels[0]] = one
        return found

    def to_pandas(self) -> "pandas.DataFrame":
        """The tables of all fits below each other, see `Fit.to_pandas`; needs the extra ``io``."""
        tables = {key: one.to_pandas() for key, one in self.singles.items()}
        pandas = import_pandas()
        return pandas.concat(tables, names=["recording", "channel"]) if tables else pandas.DataFrame()

    def __repr__(self) -> str:
        """One row a channel, what failed, and the warnings of the fits."""
        lines, singles = [], self.singles
        if singles:
            symbols = [f"{e.component}.{e.symbol}" for e in next(iter(singles.values())).parameters()]
            head = ["recording", "channel", "unit", "objective", "search", "p of fit", *symbols]
            rows = [
                [*names, one.unit, number(one.objective, 7), one.status.name]
                + ["-" if one.chi_square is None else number(one.chi_square.p_value, 2)]
                + [number(e.value) + "*" * e.at_boundary for e in one.parameters()]
                for names, one in singles.items()
            ]
            lines += ["GMWM fits, parameters per sample", format_table(head, rows, left=3)]
            lines += ["* at its boundary"] * any(one.at_boundary for one in singles.values())
            for (name, channel), one in singles.items():
                lines += [f"warning: {name} {channel}: {text}" for text in one.warnings]
        lines += [f"{name} failed: {text}" for name, text in self.failed.items()]
        lines += [f"{len(self.missing)} recordings were not tried"] * bool(self.missing)
        return "\n".join(lines)


class _State(NamedTuple):
    fits: Mapping[str, Fit | Channels]
    failed: Mapping[str, str]
    missing: tuple[str, ...]


register(EachFit, _State, lambda of: _State(dict(of), of.failed, of.missing), lambda state: EachFit(*state))


def fit_each(
    recordings: Mapping[str, Source] | Iterable[Source],
    model: str | AbstractProcess | Composite,
    *,
    weights: WeightsLike = None,
    efficiency: float | None = None,
    level: float = 0.95,
    reading: Mapping[str, Any] | None = None,
    executor: Workers = None,
    store: str | os.PathLike | None = None,
    progress: Progress = False,
) -> EachFit:
    """Fit a model to each of many recordings by itself.

    One that cannot be read or fitted is named in the result, and the others go on. A search that did not converge
    stands in the table.

    Parameters
    ----------
    recordings
        Files or recordings, by name; unless given, names are paths as they stand, and those of the recordings.
    model, weights, level
        As of `gmwm_jax.fit`.
    efficiency
        Of a robust wavelet variance, see `gmwm_jax.wavelet_variance`.
    reading
        What `gmwm_jax.read_recording` is to know of the files: ``{"rate": 100.0, "units": {"gyro": "deg/s"}}``.
    executor
        Who computes: a `concurrent.futures.Executor`, a function that makes one (such as `processes`, whose workers are
        replaced when they die), or what has ``get_executor()``, such as a Dask Client, whose workers see the files.
        This thread unless given.
    store
        A folder, new or of the same fits, where each result is kept: the same call continues one that was killed, and
        one with more recordings fits those alone. A file that has changed since (size or time), and a recording with
        other samples, is fitted again.
    progress
        Show a bar; or a function of what is done and the total, which may cancel by raising.

    Returns
    -------
    EachFit
        In the order of the recordings. Interrupted from the keyboard, with what was done by then.

    Raises
    ------
    ValueError
        No recording, two of one name, one without; an unknown process or bad weights. The store is of other fits: the
        message names the field that differs. A process of your own that is not registered, and a store.
    FileExistsError
        There is something else at the path of the store.
    OSError
        The store cannot be written, as where the disk is full; what is whole in it is kept.
    RuntimeError
        Workers died, and nobody has said how to make others; a Dask cluster ended or had no worker for too long, see
        `gmwm_jax.bootstrap`; x64 is off.

    Examples
    --------
    >>> units = {f"unit {i}": gj.datasets.simulated("mti-g", 2000, key=jax.random.key(i)) for i in range(3)}
    >>> fits = gj.fit_each({**units, "lost": "lost.npz"}, "WN + RW", store="fits")
    >>> fits["unit 1"]["accel_x"].status.name
    'converged'
    >>> list(fits.failed)
    ['lost']
    """
    require_x64()
    sources = _named(recordings)
    how = EachBatch(as_model(model), as_weights(weights), efficiency, confidence(level), _as_json(reading or {}))
    parts = None if store is None else Parts(store, "batch of fits", specification_of(how, NUMBERS))
    tasks = list(sources.items())
    places = {name: _place(name, source) for name, source in tasks} if parts else {}
    done: dict[str, Fit | Channels[Fit]] = {}
    failed: dict[str, str] = {}
    tried: list[str] = []
    with until_interrupted(tried, len(tasks), "recording", progress) as bar:

        def take(task: tuple[str, Source], found: Fit | Channels[Fit] | Exception, *, new: bool = True) -> None:
            name = task[0]
            if isinstance(found, Exception):
                failed[name] = why(found)
            else:
                if parts is not None and new:
                    parts.write(places[name], to_state(found))
                done[name] = found
            tried.append(name)
            bar.update(1)

        for task in tasks:
            if parts is not None and (state := parts.read(places[task[0]])) is not None:
                take(task, from_state(state), new=False)
        lacking = [task for task in tasks if task[0] not in done]

        def died(happened: str, tasks: list[tuple[str, Source]]) -> str:
            kept = "with store=... what is done would be kept" if parts is None else f"what is whole in {store} is kept"
            return (
                f"{happened} while it had {tasks[0][0]} or another one: {kept}. "
                "executor=gj.multisignal.processes(n) replaces workers that die now and then."
            )

        carry_out(iter([lacking]), _fit_one, (how,), Pool(executor, InThisThread), take, died=died)
    return EachFit(
        {name: done[name] for name in sources if name in done},
        {name: failed[name] for name in sources if name in failed},
        [name for name in sources if name not in tried],
    )


@saved()
@dataclass(frozen=True, eq=False)
class EachBatch(SentAsState):
    """How each recording is fitted; `reading` as JSON."""

    model: Composite
    weights: AbstractWeights
    efficiency: float | None
    level: float
    reading: str


def _as_json(reading: Mapping[str, Any]) -> str:
    """Numbers of NumPy and sequences of any kind as those of JSON."""
    return json.dumps(dict(reading), default=lambda x: x.tolist() if hasattr(x, "tolist") else list(x))


def _fit_one(how: EachBatch, name: str, source: Source) -> Fit | Channels[Fit]:
    rec = source if isinstance(source, Recording) else read_recording(source, **json.loads(how.reading))
    wv = wavelet_variance(rec, efficiency=how.efficiency)
    return fit(wv, how.model, weights=how.weights, level=how.level, throw=False)


def _named(recordings: Mapping[str, Source] | Iterable[Source]) -> dict[str, Source]:
    if isinstance(recordings, str | os.PathLike | Recording):
        raise ValueError("One recording is fitted by gj.fit(): give a list of them, or {name: recording}.")
    if isinstance(recordings, Mapping):
        named: dict[Any, Any] = dict(recordings)
    else:
        named = {}
        for source in recordings:
            name = source.name if isinstance(source, Recording) else os.fspath(source)
            if not name or name in named:
                raise ValueError(f"Two recordings are called {name!r}, or one has no name: give {{name: recording}}.")
            named[name] = source
    if not named:
        raise ValueError("Give at least one recording.")
    for name, source in named.items():
        if not isinstance(name, str):
            raise ValueError(f"Names of recordings are texts, and one is {name!r}.")
        if not isinstance(source, str | os.PathLike | Recording):
            raise ValueError(f"{name} is a file or a Recording, and is a {type(source).__name__}.")
    # workers may be at work elsewhere
    return {name: s if isinstance(s, Recording) else Path(s).absolute() for name, s in named.items()}


def _place(name: str, source: Source) -> str:
    """Where the fit of a recording lies: a name for a file, another one if the recording is another one."""
    seen = hashlib.sha256(name.encode())
    if isinstance(source, Recording):
        seen.update(repr((source.rate, source.channels, source.units, source.gaps)).encode())
        seen.update(np.ascontiguousarray(source.data.T).data)
    else:
        path = Path(source)
        files = sorted(path.rglob("*")) if path.is_dir() else [path]
        for file in files:
            state = file.stat() if file.exists() else None
            seen.update(repr((str(file), state and (state.st_size, state.st_mtime_ns))).encode())
    plain = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)[-40:]
    return f"{plain}-{seen.hexdigest()[:16]}"
