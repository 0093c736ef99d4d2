"""All of a page as one JSON file: its inputs, the wavelet variance where samples came from a file, the list of fits.

A colleague who loads it sees the same without the samples. The inputs of a file are checked as those of a link are.
"""

import json
import math
import tempfile
from pathlib import Path
from typing import Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gmwm_jax._internal.limits import as_bytes
from gmwm_jax._internal.saved import load
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.state import State
from gmwm_jax.variance.wavelet import AbstractWaveletVariance

_FOREIGN = "{name} is no saved page: save one in the room Take away."
_MAX_FITS = 30


class Fitted(NamedTuple):
    """One line of the table of fits."""

    model: str
    channel: str
    objective: float
    chance: float | None
    """p of the test of fit."""


class _File(BaseModel):
    """What a file holds."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    gmwm_jax_page: Literal[1]
    """The version of this form."""
    inputs: dict[str, bool | int | float | str | None] = Field(max_length=1000)
    variance: dict[str, Any] | None = None
    fits: list["_Fitted"] = Field(default=[], max_length=_MAX_FITS)


class _Fitted(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    model: str = Field(max_length=500)
    channel: str = Field(max_length=200)
    objective: float
    chance: float | None = None


class Page(NamedTuple):
    """What a file gives back."""

    state: State
    variance: AbstractWaveletVariance | None
    fits: tuple[Fitted, ...]


def write(
    state: State, variance: AbstractWaveletVariance | None, fits: tuple[Fitted, ...], limits: Limits | None = None
) -> bytes:
    """Write a page; with a wavelet variance, that is what is loaded in the place of the samples.

    Parameters
    ----------
    state
        Its inputs.
    variance
        Where the inputs alone do not give it.
    fits
        Those that its table lists.
    limits
        Of the server that reads it.

    Raises
    ------
    ValueError
        The file would be larger than is read again.

    Examples
    --------
    >>> from gmwm_jax.app.web import saved
    >>> from gmwm_jax.app.web.state import State
    >>> content = saved.write(State(seed=3), None, ())
    >>> saved.read(content, "page.json").state.seed
    3
    """
    inputs = state.model_dump() | ({} if variance is None else {"source": "saved"})
    known = None if variance is None else _stored(variance)
    fitted = [_Fitted(**fit._asdict()) for fit in fits[:_MAX_FITS] if math.isfinite(fit.objective)]
    content = _File(gmwm_jax_page=1, inputs=inputs, variance=known, fits=fitted).model_dump_json(indent=1).encode()
    most = (limits or Limits()).saved
    if len(content) > most:
        raise ValueError(f"The page is {as_bytes(len(content))} as a file, and at most {as_bytes(most)} are read.")
    return content


def read(content: bytes, name: str, limits: Limits | None = None, states: type[State] = State) -> Page:
    """Read what `write` wrote; nothing in it is executed, and no size in it is believed.

    Parameters
    ----------
    content
        Of the file.
    name
        The file's, for messages.
    limits
        Of sizes and channels.
    states
        The class of the inputs of all rooms.

    Raises
    ------
    ValueError
        One sentence: it is too large, something else, or an input in it is out of range.
    """
    limits = limits or Limits()
    if len(content) > limits.saved:
        raise ValueError(f"{name} is larger than {as_bytes(limits.saved)}, the most of a saved page.")
    try:
        given = _File.model_validate_json(content)
    except ValidationError:
        raise ValueError(_FOREIGN.format(name=name)) from None
    try:
        state = states.checked(dict(given.inputs))
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    variance = None if given.variance is None else _loaded(given.variance, name, limits)
    if (variance is None) != (state.source != "saved"):
        raise ValueError(_FOREIGN.format(name=name))
    return Page(state, variance, tuple(Fitted(f.model, f.channel, f.objective, f.chance) for f in given.fits))


def _stored(variance: AbstractWaveletVariance) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        return json.loads(variance.save(Path(folder) / "variance.json").read_text())


def _loaded(stored: dict[str, Any], name: str, limits: Limits) -> AbstractWaveletVariance:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "variance.json"
        path.write_text(json.dumps(stored))
        try:
            found = load(path)
        except ValueError as error:
            raise ValueError(f"{name}: its wavelet variance is damaged ({_reason(error, path)}).") from None
    if not isinstance(found, AbstractWaveletVariance):
        raise ValueError(_FOREIGN.format(name=name))
    if len(found.channels) > limits.channels:
        raise ValueError(f"{name} has {len(found.channels)} channels, and this server takes {limits.channels}.")
    return found


def _reason(error: Exception, path: Path) -> str:
    """What is wrong, without the place of this server where it was found."""
    return str(error).replace(str(path), "it").strip(". ")[:200]
