"""From per-sample parameters to continuous time and back; each process states its own form, see `continuous_form`."""

from typing import Any

from gmwm_jax._internal.checks import as_float, sampling_rate
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.continuous_form import ContinuousForm
from gmwm_jax.processes.registry import process_class


def to_continuous(kind: str | type[AbstractProcess], parameters: tuple[Any, ...], rate: float) -> tuple[Any, ...]:
    """Convert the parameters per sample of a process to its continuous-time filter quantities in SI.

    Parameters
    ----------
    kind
        ``WN``, ``GM``, .. or the class of a process.
    parameters
        In the order of the process class: (sigma2,) of WN, (beta, variance) of GM.
    rate
        Sampling rate in Hz.

    Returns
    -------
    WN: q [u^2/Hz]; QN: Q [u s]; RW: q [u^2/s]; DR: R [u/s]; GM and AR1: beta [1/s] and q [u^2/s], NaN for an AR1 with
    phi <= 0, which has no continuous form; MAT32 and MAT52: beta [1/s] and q [u^2/s^3, u^2/s^5]; BI: B [u]; FGN: H and
    the PSD at 1 Hz [u^2/Hz]; SIN: omega [rad/s] and alpha2 [u^2].

    Raises
    ------
    ValueError
        Unknown process, one without such a form (ARMA), another number of parameters, a rate that is not positive.
    RuntimeError
        x64 is off.

    Examples
    --------
    >>> beta, q = gj.processes.to_continuous("GM", (0.01, 2.0), rate=100.0)
    >>> float(beta), float(q)
    (1.0, 4.0)
    """
    form, values = _form(kind, parameters)
    f = sampling_rate(rate)
    return tuple(q.value(*values, f) for q in form.filter)


def from_continuous(kind: str | type[AbstractProcess], quantities: tuple[Any, ...], rate: float) -> tuple[Any, ...]:
    """Convert continuous-time quantities in SI to parameters per sample: the inverse of `to_continuous`.

    Examples
    --------
    >>> gj.processes.from_continuous("WN", (1e-4,), rate=100.0)[0].item()  # q in u^2/Hz to a variance per sample
    0.01
    """
    form, values = _form(kind, quantities)
    assert form.inverse is not None  # `_form` has seen to it
    return form.inverse(*values, sampling_rate(rate))


def _form(kind: str | type[AbstractProcess], values: tuple[Any, ...]) -> tuple[ContinuousForm, tuple[Any, ...]]:
    cls = process_class(kind) if isinstance(kind, str) else kind
    form = cls.continuous
    if form is None:
        raise ValueError(f"{cls.kind} has no continuous-time form: its class does not define `continuous`.")
    if form.inverse is None:
        raise ValueError(f"{cls.kind} has no continuous-time form: its coefficients belong to the sampling rate.")
    if len(values) != len(form.filter):
        raise ValueError(f"{cls.kind} has {len(form.filter)} parameters, and {len(values)} were given.")
    return form, tuple(as_float(v) for v in values)
