"""The table of processes, and models from text: ``"WN + RW + 3*GM"``."""

import re
from typing import Any

from gmwm_jax.processes._base import AbstractProcess, Composite
from gmwm_jax.processes._parameter import Fixed
from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.flicker import BI
from gmwm_jax.processes.fractional import FGN
from gmwm_jax.processes.gauss_markov import AR1, GM
from gmwm_jax.processes.matern import MAT32, MAT52
from gmwm_jax.processes.quantisation import QN
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.sinusoid import SIN
from gmwm_jax.processes.white_noise import WN

_ALL: tuple[type[AbstractProcess], ...] = (WN, QN, RW, DR, AR1, GM, MAT32, MAT52, FGN, BI, SIN)

PROCESSES: dict[str, type[AbstractProcess]] = {cls.kind: cls for cls in _ALL}
"""By their name in a model text."""

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_TERM = re.compile(r"\s*(?:(?P<count>\d+)\s*\*?\s*)?(?P<kind>[A-Za-z]\w*)\s*(?:\((?P<arguments>[^()]*)\))?\s*")
_ARGUMENT = re.compile(rf"\s*(?P<name>\w+)\s*=\s*(?P<value>{_NUMBER})\s*(?P<fixed>fixed)?\s*")


def parse_model(text: str) -> Composite:
    """Read a model from text.

    Parameters
    ----------
    text
        Terms joined by ``+``: ``WN``, ``3*GM``, with starting values ``GM(beta=0.01)`` or held ones
        ``GM(beta=0.01 fixed)``; values are per sample.

    Returns
    -------
    Composite

    Raises
    ------
    ValueError
        Unknown process or parameter, or text that is no model; the message shows the place.

    Examples
    --------
    >>> parse_model("WN + 2*GM")
    WN + GM + GM
    """
    processes: list[AbstractProcess] = []
    at = 0
    while True:
        term = _TERM.match(text, at)
        if term is None:
            raise ValueError(
                f"Cannot read the model {text!r} from {text[at:]!r} on: expected a process such as WN or 3*GM."
            )
        kind = term["kind"].upper()
        if kind not in PROCESSES:
            raise ValueError(f"Unknown process {term['kind']!r} in the model {text!r}. Known: {', '.join(PROCESSES)}.")
        cls = PROCESSES[kind]
        arguments = _arguments(term["arguments"] or "", cls, text)
        if term["count"] and int(term["count"]) == 0:
            raise ValueError(f"The model {text!r} takes {kind} 0 times: leave it out.")
        processes += [cls(**arguments) for _ in range(int(term["count"] or 1))]
        at = term.end()
        if at == len(text):
            return Composite(processes)
        if text[at] != "+":
            raise ValueError(f"Cannot read the model {text!r} from {text[at:]!r} on: expected '+'.")
        at += 1


def _arguments(text: str, cls: type[AbstractProcess], model: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for part in filter(str.strip, text.split(",")):
        match = _ARGUMENT.fullmatch(part)
        if match is None:
            raise ValueError(
                f"Cannot read {part.strip()!r} in the model {model!r}: expected name=number, or name=number fixed."
            )
        known = [p.name for p in cls.parameters]
        if match["name"] not in known:
            raise ValueError(
                f"{cls.kind} has no parameter {match['name']!r} (in {model!r}); it has {', '.join(known)}."
            )
        if match["name"] in values:
            raise ValueError(f"{cls.kind}: {match['name']} is given twice in the model {model!r}.")
        value = float(match["value"])
        values[match["name"]] = Fixed(value) if match["fixed"] else value
    return values


def as_model(model: str | AbstractProcess | Composite) -> Composite:
    """A composite from a model text, a single process or a composite."""
    if isinstance(model, str):
        return parse_model(model)
    if isinstance(model, AbstractProcess):
        return Composite((model,))
    if isinstance(model, Composite):
        return model
    raise TypeError(f'A model is a text such as "WN + 2*GM", a process or a sum of processes, not {model!r}.')
