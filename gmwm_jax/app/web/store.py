"""What a page knows: its inputs, the recording, wavelet variances; each belongs to the inputs that it is of."""

import shutil
import tempfile
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import jax
import numpy as np
import plotly.graph_objects as go
from shiny import Inputs, reactive, ui
from shiny.session import Session

import gmwm_jax as gj
from gmwm_jax.app.web.computed import Computed, Outcome
from gmwm_jax.app.web.frames import themed
from gmwm_jax.app.web.jobs import Jobs
from gmwm_jax.app.web.library import published, source
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.saved import Fitted, Page, read
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.turns import Turns
from gmwm_jax.app.web.uploads import read_upload
from gmwm_jax.app.web.words import in_words_of_the_page
from gmwm_jax.processes.base import Composite
from gmwm_jax.variance.wavelet import AbstractWaveletVariance, WaveletVariance

PASTED = "pasted.csv"
"""The file that pasted values are."""
NO_SAMPLES = "There are no samples: no series, no robust estimate, no outliers."
OWN = "own"
"""Name of the channel that a model of the user's own is."""


class File(NamedTuple):
    """A file that was sent."""

    path: str
    name: str


class Shown(NamedTuple):
    """A recording, and what was done to it."""

    recording: "gj.Recording | None"
    """None: there is nothing but wavelet variances."""
    remarks: tuple[str, ...] = ()
    published: AbstractWaveletVariance | None = None
    truth: Mapping[str, Composite] = {}
    """Of channels that are simulated: the model that they were drawn from."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Their names."""
        known = self.recording or self.published
        return () if known is None else known.channels

    @property
    def about(self) -> str:
        """Say in a line what it is."""
        if self.recording is not None:
            rec = self.recording
            return f"{rec.name or 'recording'}: {len(rec)} samples at {rec.rate:g} Hz, {rec.duration:g} s"
        wv = self.published
        if wv is None:
            return ""
        rate = f" at {wv.rate:g} Hz" if wv.rate else ""
        return f"{wv.name or 'wavelet variance'}: {wv.num_samples} samples{rate}, of which none are here"


class Part(NamedTuple):
    """What a room adds to all that is taken away."""

    files: Callable[[], Mapping[str, bytes]]
    """Name -> content; made in a thread."""
    program: str = ""
    """In Python, that gives the same numbers; "" where there is none."""
    commands: str = ""
    """Of the shell."""


_OF_SOURCE: dict[str, tuple[str, ...]] = {
    "published": ("source", "published"),
    "simulated": ("source", "sensor", "samples", "seed", "own", "own_rate", "own_unit"),
    "public": ("source", "dataset"),
    "file": ("source", "rate", "units", "time", "columns", "delimiter", "header", "gaps"),
    "saved": ("source",),
}
"""Inputs that a recording depends on."""

Key = tuple[Any, ...]
T = TypeVar("T")


class Store:
    """The state of one page.

    Parameters
    ----------
    input, session
        Of the framework.
    turns
        Who computes when.
    queue
        Those that do long work.
    limits
        Of the server.
    states
        The class of the inputs of all rooms.
    """

    fit: Computed[Key, Any]
    """Of the channel that is looked at; the room of models makes it."""
    parts: dict[str, Callable[[], Part | None]]
    """Of rooms, by their ids: what each adds to Take away, reactive; None while there is nothing."""

    def __init__(
        self,
        input: Inputs,
        session: Session,
        turns: Turns,
        queue: Executor,
        limits: Limits,
        states: type[State] = State,
    ):
        self._input, self._session, self.limits, self._states = input, session, limits, states
        self._turns = turns.of_page()
        self.parts: dict[str, Callable[[], Part | None]] = {}
        self.jobs = Jobs(session, queue, limits.job_seconds, in_words_of_the_page, lambda: turns.running > 0)
        # named: the framework would read the program's source for the name of each
        self.file: reactive.Value[File | None] = reactive.Value(None, name="file")
        self.saved: reactive.Value[Page | None] = reactive.Value(None, name="saved")
        self.fits: reactive.Value[tuple[Fitted, ...]] = reactive.Value((), name="fits")
        self.records: reactive.Value[tuple[WaveletVariance, ...]] = reactive.Value((), name="records")
        self.state = reactive.calc(self._state)
        self.recording: Computed[Key, Shown] = self.computed(self._recording_key, self._record, "reading ..")
        self.variance: Computed[Key, Any] = self.computed(self._variance_key, self._vary, "computing the variance ..")
        self.robust: Computed[Key, Any] = self.computed(
            self._robust_key, self._vary_robustly, "computing the robust variance .."
        )

    def take_text(self, text: str) -> None:
        """Take pasted values as the file that they would be.

        Raises
        ------
        ValueError
            There are too many characters, or none.
        """
        if not text.strip():
            raise ValueError("There is nothing to take: paste a column of numbers, or several with commas.")
        if len(text) > self.limits.pasted:
            raise ValueError(f"Pasted values have at most {self.limits.pasted} characters: send more as a file.")
        path = self.new_folder("pasted-") / PASTED
        path.write_text(text)
        self.file.set(File(str(path), PASTED))

    def new_folder(self, prefix: str) -> Path:
        """Make a folder that ends with the page."""
        folder = tempfile.mkdtemp(prefix=prefix)
        self._session.on_ended(lambda: shutil.rmtree(folder, ignore_errors=True))
        return Path(folder)

    def restore(self, page: Page) -> None:
        """Set all inputs as a saved page has them; the room stays, from which on one looks around."""
        self.saved.set(page)
        self.fits.set(page.fits)
        with reactive.isolate():
            lists = {n for n in self._states.model_fields if n in self._input and not _is_plain(self._input[n]())}
        for name, value in page.state.model_dump(exclude={"room"}).items():
            if name in lists:
                value = value.split(",")
            if name == "channel":  # it may not be in the list before there is the recording
                with reactive.isolate():
                    shown = self._known()
                names = dict.fromkeys((*(() if shown is None else shown.channels), value))
                ui.update_select(name, choices=list(names), selected=value, session=self._session)
            else:
                self._session.send_input_message(name, {"value": "" if value is None else value})

    def loaded(self, content: bytes, name: str) -> Page:
        """Read a saved page, see `gmwm_jax.app.web.saved.read`."""
        return read(content, name, self.limits, self._states)

    async def in_thread(self, work: Callable[[], T]) -> T:
        """Compute something once, when it is the turn of this page."""
        return await self._turns.run(work)

    def computed(
        self, key: Callable[[], Any], work: Callable[[Any], Any], busy: str, *, later: bool = False, room: str = ""
    ) -> Computed[Any, Any]:
        """Make a value that threads compute for this page.

        Parameters
        ----------
        key, work, busy
            See `Computed`.
        later
            Nobody waits for it.
        room
            Where alone it is shown: nothing is computed while somebody looks at another one.
        """

        def looked_at() -> bool:
            return not room or self._input.room() == room

        words, options = in_words_of_the_page, {"later": later, "looked_at": looked_at}
        return Computed(self._session, self._turns, key, work, busy, words, **options)

    def themed(self, figure: go.Figure) -> go.Figure:
        """Draw a figure for the page as it is, light or dark; reactive."""
        return themed(figure, dark=self._input.theme() == "dark")

    def narrow(self) -> bool:
        """Is the page that of a phone? Reactive."""
        return "narrow" in self._input and bool(self._input.narrow())

    def _state(self) -> State:
        given = {name: self._input[name]() for name in self._states.model_fields if name in self._input}
        for name, value in given.items():
            if isinstance(value, list | tuple):  # boxes
                given[name] = ",".join(value)
        return self._states.checked(given)

    def sent(self) -> File | None:
        """Return the file that is looked at: one of the server's by name, or the one that was sent; reactive.

        Raises
        ------
        ValueError
            The server has no file of that name.
        """
        state = self.state()
        if state.source != "file":
            return None
        if not state.stored:
            return self.file()
        name = state.stored
        found = self.limits.stored().get(name)
        if found is None:
            raise ValueError(f"Recording of the server: there is no {name!r}.")
        return File(str(found), name)

    def _recording_key(self) -> Key | None:
        state = self.state()
        chosen = tuple(getattr(state, name) for name in _OF_SOURCE[state.source])
        if state.source == "file":
            file = self.sent()
            return None if file is None else (*chosen, state.outliers, file)
        if state.source == "saved":
            page = self.saved()
            return None if page is None else (*chosen, Same(page), state.outliers)
        if state.source == "public" and not state.dataset:
            return None
        return (*chosen, state.outliers)

    def _drawn(
        self, own: str, samples: int, seed: int, rate: float, unit: str
    ) -> tuple["gj.Recording", dict[str, Composite]]:
        """A recording of a model of the user's own."""
        model = gj.parse_model(own)
        self.limits.require_model(model)
        drawn = gj.simulate(model, samples, key=jax.random.key(seed))
        options: Any = {"rate": rate, "units": unit, "channels": [OWN], "name": "simulated model of your own"}
        return gj.Recording.from_array(np.asarray(drawn), **options), {OWN: model}

    def _record(self, key: Key) -> Shown:
        truth: Mapping[str, Composite] = {}
        match key:
            case ("published", name, *_):
                wv = published(name)
                return Shown(None, (repr(wv), NO_SAMPLES, source()), wv)
            case ("saved", Same(value=page), *_):
                return Shown(None, (repr(page.variance), NO_SAMPLES, "It is that of a saved page."), page.variance)
            case ("simulated", sensor, samples, seed, own, rate, unit, *_):
                if samples > self.limits.samples:
                    raise ValueError(f"Samples: this server draws at most {self.limits.samples}.")
                if own.strip():
                    recording, truth = self._drawn(own.strip(), samples, seed, rate, unit)
                else:
                    recording = gj.datasets.simulated(sensor, samples, key=jax.random.key(seed))
                    truth = gj.datasets.sensor_models(sensor)
            case ("public", name, *_):
                recording = gj.datasets.load(name)
            case (_, rate, units, time, columns, delimiter, header, gaps, _, File(path, name)):
                options = reading_options(rate, units, time, columns, delimiter, header, gaps)
                recording = read_upload(Path(path), name, options, self.limits)
        remarks = () if recording.understood is None else (str(recording.understood),)
        if (key[-2] if key[0] == "file" else key[-1]) == "mask":
            masked = gj.recordings.mask_outliers(recording)
            return Shown(masked.recording, (*remarks, str(masked)), truth=truth)
        return Shown(recording, remarks, truth=truth)

    def _known(self) -> Shown | None:
        """The recording of the present inputs, if it is there."""
        return self.recording().value

    def _variance_key(self) -> Key | None:
        shown, state = self._known(), self.state()
        if shown is None:
            return None
        return Same(shown), state.efficiency if state.estimator == "robust" else None

    def _vary(self, key: Key) -> Any:
        of, efficiency = key
        if of.value.published is not None:
            if efficiency is not None:
                raise ValueError(f"{NO_SAMPLES} Take the classic estimator.")
            return of.value.published
        return gj.wavelet_variance(of.value.recording, efficiency=efficiency)

    def _robust_key(self) -> Key | None:
        shown, state = self._known(), self.state()
        if shown is None or not state.compare or state.estimator == "robust":
            return None
        return Same(shown), state.efficiency

    def _vary_robustly(self, key: Key) -> Any:
        return self._vary(key)

    def truth(self) -> Composite | None:
        """Return the model that the channel was drawn from, if it was; reactive."""
        shown, channel = self._known(), self.channel()
        return None if shown is None or channel is None else shown.truth.get(channel)

    def channel(self) -> str | None:
        """Return the channel that is looked at; reactive."""
        shown = self._known()
        if shown is None:
            return None
        chosen = self.state().channel
        return chosen if chosen in shown.channels else shown.channels[0]

    def of_recording(self) -> Outcome[Any]:
        """Tell why there is no variance yet: the recording's reason, else its own."""
        first = self.recording()
        return first if first.value is None else self.variance()


class Same:
    """An object as a key: the same if it is the same object."""

    def __init__(self, value: Any):
        self.value = value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and other.value is self.value

    def __hash__(self) -> int:
        return id(self.value)


def reading_options(
    rate: float | None, units: str, time: str, columns: str, delimiter: str, header: int | None, gaps: str
) -> dict[str, Any]:
    """Make the options of `gmwm_jax.read_recording` of the fields of the page; None where a field is empty.

    Examples
    --------
    >>> from gmwm_jax.app.web.store import reading_options
    >>> options = reading_options(100.0, "gyro=deg/s, accel=g", "", "2,3", "", None, "refuse")
    >>> options["units"], options["columns"]
    ({'gyro': 'deg/s', 'accel': 'g'}, [2, 3])
    """
    return {
        "rate": rate,
        "units": _one_or_pairs(units) or None,
        "time": _columns(time) or None,
        "columns": _columns(columns) or None,
        "delimiter": delimiter or None,
        "header": header,
        "gaps": gaps,
    }


def _is_plain(value: Any) -> bool:
    """Is it none of several that are ticked?"""
    return not isinstance(value, list | tuple)


def _one_or_pairs(text: str) -> str | dict[str, str]:
    """A unit, or units by channel or group as ``gyro=deg/s, accel=g``."""
    if "=" not in text:
        return text.strip()
    pairs = [part.partition("=") for part in text.split(",")]
    return {name.strip(): value.strip() for name, _, value in pairs}


def _columns(text: str) -> list[int | str]:
    """Names or numbers of columns, separated by commas."""
    parts = [part.strip() for part in text.split(",") if part.strip()]
    return [int(part) if part.isdigit() else part for part in parts]
