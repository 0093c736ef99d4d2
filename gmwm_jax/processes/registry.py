"""The table of processes, and models from text: ``"WN + RW + 3*GM"``."""

import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

from gmwm_jax._internal.states import register as register_state
from gmwm_jax.processes.arma import AR, ARMA, MA
from gmwm_jax.processes.band_flicker import FLK
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.flicker import BI
from gmwm_jax.processes.fractional import FGN
from gmwm_jax.processes.gauss_markov import AR1, GM
from gmwm_jax.processes.matern import MAT32, MAT52
from gmwm_jax.processes.parameter import Fixed
from gmwm_jax.processes.quantisation import QN
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.sinusoid import SIN
from gmwm_jax.processes.white_noise import WN

_ALL: tuple[type[AbstractProcess], ...] = (WN, QN, RW, DR, AR1, GM, MAT32, MAT52, FGN, BI, FLK, SIN)

PROCESSES: dict[str, type[AbstractProcess]] = {cls.kind: cls for cls in _ALL}
"""By their name in a model text; ARMA processes of all orders come from `process_class`."""
_FAMILIES: dict[str, tuple[Callable[..., type[AbstractProcess]], int]] = {
    "AR": (AR, 1),
    "MA": (MA, 1),
    "ARMA": (ARMA, 2),
}
"""With the number of their orders."""
_REGISTERED: dict[str, type[AbstractProcess]] = {}
"""Processes of users, by `register`."""

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_ORDERS = re.compile(r"\s*(?P<family>AR|MA|ARMA)\s*\((?P<orders>[\d\s,]*)\)\s*", re.IGNORECASE)
_TERM = re.compile(
    rf"\s*(?:(?P<count>\d+)\s*\*?\s*)?(?P<kind>{_ORDERS.pattern}|[A-Za-z]\w*)\s*(?:\((?P<arguments>[^()]*)\))?\s*",
    re.IGNORECASE,
)
_ARGUMENT = re.compile(rf"\s*(?P<name>\w+)\s*=\s*(?P<value>{_NUMBER})\s*(?P<fixed>fixed)?\s*")


MAX_PROCESSES = 100
"""Of a model: a fit tells some six apart, and approximations of one process by many take a few dozen."""


def parse_model(text: str) -> Composite:
    """Read a model from text.

    Parameters
    ----------
    text
        Terms joined by ``+``: ``WN``, ``3*GM``, ``ARMA(2,1)``, with starting values ``GM(beta=0.01)`` or held ones
        ``GM(beta=0.01 fixed)``, ``AR(2)(phi1=0.5, phi2=0.2)``; values are per sample.

    Returns
    -------
    Composite

    Raises
    ------
    ValueError
        Unknown process or parameter, or text that is no model; the message shows the place.

    Examples
    --------
    >>> gj.parse_model("WN + 2*GM")
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
        cls = process_class(term["kind"], f" in the model {text!r}")
        kind = cls.kind
        arguments = _arguments(term["arguments"] or "", cls, text)
        count = _count(term["count"])
        if count == 0:
            raise ValueError(f"The model {text!r} takes {kind} 0 times: leave it out.")
        if len(processes) + count > MAX_PROCESSES:
            raise ValueError(
                f"The model {text!r:.80} has more than {MAX_PROCESSES} processes: the longest record has some 30 "
                "scales, which do not tell half as many apart."
            )
        processes += [cls(**arguments) for _ in range(count)]
        at = term.end()
        if at == len(text):
            return Composite(processes)
        if text[at] != "+":
            raise ValueError(f"Cannot read the model {text!r} from {text[at:]!r} on: expected '+'.")
        at += 1


def _count(written: str | None) -> int:
    """How often a process is taken; a number of a thousand digits is too many, whichever it is."""
    return 1 if not written else int(written) if len(written) < 10 else MAX_PROCESSES + 1


_Class = TypeVar("_Class", bound=type[AbstractProcess])


def register(cls: _Class) -> _Class:
    """Enter a process of your own among those that model texts and saved files know: a decorator of its class.

    Parameters
    ----------
    cls
        A class derived from `OwnProcess` or `AbstractProcess`. Its ``kind``, letters and digits, is its name in texts,
        in letters of any case.

    Returns
    -------
    The class. A class that is defined once more, as when a cell of a notebook runs again, replaces itself.

    Raises
    ------
    TypeError
        It is no class of a process.
    ValueError
        Its name cannot stand in a text, or belongs to another process.

    Notes
    -----
    A file says the name and the values. Whoever reads it needs the class: import the code that registers it first.

    Examples
    --------
    >>> @gj.processes.register
    ... class Reddened(gj.processes.OwnProcess):
    ...     g: jax.Array | None
    ...     kind = "REDDENED"
    ...     parameters = (gj.processes.Parameter("g", "({u})^2", "PSD at 1 cycle per sample"),)
    ...     stationary = False
    ...     @classmethod
    ...     def unit_psd(cls, shape, frequency):
    ...         return frequency**-1.5
    >>> gj.parse_model("WN(sigma2=1.0) + REDDENED(g=1e-3)").labels
    ('WN', 'REDDENED')
    """
    if not (isinstance(cls, type) and issubclass(cls, AbstractProcess)):
        raise TypeError(f"{cls!r} is no class of a process: derive it from gmwm_jax.processes.OwnProcess.")
    name = getattr(cls, "kind", "")
    if not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
        raise ValueError(f"The kind of {cls.__name__} is {name!r}: a model text wants letters and digits, such as MYP.")
    other = PROCESSES.get(name.upper()) or _REGISTERED.get(name.upper())
    again = other is not None and (other.__module__, other.__qualname__) == (cls.__module__, cls.__qualname__)
    if name.upper() in _FAMILIES or (other is not None and not again):
        raise ValueError(f"There is a process {name.upper()} already: give {cls.__name__} another `kind`.")
    _REGISTERED[name.upper()] = cls
    return cls


def process_class(kind: str, where: str = "") -> type[AbstractProcess]:
    """Return the class of a process by its name, such as ``GM`` or ``ARMA(2,1)``.

    Parameters
    ----------
    kind
        The name, in letters of any case.
    where
        What an error adds to the name.

    Raises
    ------
    ValueError
        There is no process of this name, or of these orders.
    """
    match = _ORDERS.fullmatch(kind)
    if match:
        family, num = _FAMILIES[match["family"].upper()]
        orders = [int(n) for n in match["orders"].split(",") if n.strip()]
        if len(orders) == num:
            return family(*orders)
    elif kind.upper() in PROCESSES:
        return PROCESSES[kind.upper()]
    elif kind.upper() in _REGISTERED:
        return _REGISTERED[kind.upper()]
    raise ValueError(
        f"Unknown process {kind.strip()!r}{where}. Known: {', '.join([*PROCESSES, *_REGISTERED])}, AR(p), MA(q), "
        "ARMA(p,q)."
    )


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


class _State(NamedTuple):
    """A process in a file: what its text says, with all digits."""

    kind: str
    values: Mapping[str, float]
    fixed: tuple[str, ...]


def _to_state(p: AbstractProcess) -> _State:
    try:
        known = process_class(p.kind)
    except ValueError:
        known = None
    if known is not type(p):
        raise ValueError(
            f"{p.kind} is a process of your own that is not registered, so that no file can name it: put "
            "gmwm_jax.processes.register before its class. Or keep what is computed from it: tables, arrays, to_dict()."
        )
    values = {q.name: float(v) for q, v in zip(p.parameters, p.values, strict=True) if v is not None}
    return _State(p.kind, values, p.fixed)


def _from_state(state: _State) -> AbstractProcess:
    try:
        build: Any = process_class(state.kind)
    except ValueError as error:
        raise ValueError(f"{error} If it is one of your own, import the code that registers it first.") from error
    if unknown := set(state.fixed) - set(state.values):
        raise ValueError(f"{state.kind} holds {', '.join(sorted(unknown))} at no value.")
    return build(**{name: Fixed(v) if name in state.fixed else v for name, v in state.values.items()})


register_state(AbstractProcess, _State, _to_state, _from_state, family=True)
