"""The continuous-time form of every process: what a Kalman filter wants, what a datasheet says, and the way back.

Symbols as in IEEE Std 952-1997, annex C. A quantity is computed from the per-sample parameters and the sampling rate f.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import jax.numpy as jnp

from gmwm_jax._internal.checks import as_float, sampling_rate
from gmwm_jax.processes.arma import AbstractArma
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.fractional import density
from gmwm_jax.processes.registry import process_class


def derived_unit(signal: str, suffix: str) -> str:
    """The unit of a noise quantity: the signal's unit times ``suffix`` (for example ``/sqrt(Hz)`` or ``*s``)."""
    known = {
        ("rad/s", "*s"): "rad", ("rad/s", "/s"): "rad/s^2", ("m/s^2", "*s"): "m/s", ("m/s^2", "/s"): "m/s^3",
    }  # fmt: skip
    if suffix.startswith("^2"):
        return f"({signal}){suffix}"
    return known.get((signal, suffix), f"{signal}{suffix}")


class Quantity(NamedTuple):
    """A quantity of a process in continuous time, computed from its per-sample parameters."""

    symbol: str
    meaning: str
    suffix: str | None
    """What follows the signal's unit; None: the unit stands in `unit`."""
    value: Callable[..., Any]
    """(per-sample parameters..., rate) -> value in SI."""
    unit: str = ""
    gyro: tuple[str, ...] = ()
    """Units a gyro datasheet gives it in."""
    accel: tuple[str, ...] = ()
    reads: tuple[int, ...] = (0,)
    """Positions of the parameters that it depends on."""
    determined_at: str = ""
    """The limit of the process (see `AbstractProcess.limit_of`) at which data still determine it."""

    def si_unit(self, signal: str) -> str:
        """Its SI unit for a signal unit."""
        return self.unit if self.suffix is None else derived_unit(signal, self.suffix)

    def datasheet_units(self, signal: str) -> tuple[str, ...]:
        """The units a datasheet gives it in; the SI unit for sensors that are neither gyro nor accelerometer."""
        shown = {"rad/s": self.gyro, "m/s^2": self.accel}.get(signal, ())
        return shown or (self.si_unit(signal),)


class ContinuousForm(NamedTuple):
    """The continuous-time form of a process: what a Kalman filter wants, what a datasheet says, and the way back."""

    filter: tuple[Quantity, ...]
    """Where there is an `inverse`, as many as the process has parameters: a bijection."""
    datasheet: tuple[Quantity, ...]
    inverse: Callable[..., tuple[Any, ...]] | None
    """(filter quantities..., rate) -> per-sample parameters; None for a process that belongs to its sampling rate."""


# GM and AR1 are one process: beta per sample with phi = exp(-beta), and variance = sigma2/(1 - phi^2).
# dx/dt = -beta_c x + w with E[w w'] = q delta has the variance q/(2 beta_c); hence q = 2 beta_c variance. (The online
# platform shows variance * f for q, too large by 1/(2 beta).)
_GM_DATASHEET = (
    Quantity("sigma", "standard deviation", "", lambda beta, variance, f: jnp.sqrt(variance),
             gyro=("deg/h", "deg/s"), accel=("ug", "mg"), reads=(1,), determined_at="white noise"),
    Quantity("tau_c", "correlation time", None, lambda beta, variance, f: 1 / (beta * f), unit="s", gyro=("s", "h"),
             accel=("s", "h")),
    Quantity("sqrt(q)", "driving noise density", "/sqrt(s)",
             lambda beta, variance, f: jnp.sqrt(2 * beta * f * variance),
             gyro=("deg/h/sqrt(h)", "deg/s/sqrt(h)"), accel=("m/s/h/sqrt(h)", "ug/sqrt(s)"), reads=(0, 1),
             determined_at="random walk"),
    # Below its corner the PSD is flat: over times much longer than tau_c the process is white noise. The PSD of the
    # *sampled* process at 0 is variance (1+phi)/(1-phi)/f; in continuous time, or for a slow process, q/beta^2.
    Quantity("N_0", "density as white noise, far beyond tau_c", "/sqrt(Hz)",
             lambda beta, variance, f: jnp.sqrt(variance / (jnp.tanh(beta / 2) * f)),
             gyro=("deg/sqrt(h)", "deg/s/sqrt(Hz)"), accel=("ug/sqrt(Hz)", "m/s/sqrt(h)"), reads=(0, 1),
             determined_at="white noise"),
)  # fmt: skip
_GM_FILTER = (
    Quantity("beta", "inverse correlation time", None, lambda beta, variance, f: beta * f, unit="1/s"),
    Quantity("q", "PSD of the driving noise", "^2/s", lambda beta, variance, f: 2 * beta * f * variance, reads=(0, 1),
             determined_at="random walk"),
)  # fmt: skip


def _matern(power: int, factor: float, dimension: str, white: Callable[..., Any]) -> ContinuousForm:
    """Low-pass filters in a row: q = factor beta^power variance drives (d/dt + beta)^p x (Gelb 1974)."""
    return ContinuousForm(
        filter=(
            _GM_FILTER[0],
            Quantity("q", "PSD of the driving noise", f"^2/{dimension}",
                     lambda beta, variance, f: factor * (beta * f) ** power * variance, reads=(0, 1),
                     determined_at="drift"),
        ),
        datasheet=(
            _GM_DATASHEET[0],
            _GM_DATASHEET[1]._replace(meaning="time constant"),
            _GM_DATASHEET[3]._replace(value=lambda beta, variance, f: jnp.sqrt(white(beta) * variance / f)),
        ),
        inverse=lambda beta, q, f: (beta / f, q / (factor * beta**power)),
    )  # fmt: skip


def _ar1_as_gm(quantity: Quantity) -> Quantity:
    def value(phi: Any, sigma2: Any, f: Any) -> Any:
        return quantity.value(-jnp.log(phi), sigma2 / ((1 - phi) * (1 + phi)), f)

    return quantity._replace(value=value, reads=(0,) if quantity.suffix is None else (0, 1))


_HURST = Quantity("H", "Hurst exponent", None, lambda H, sigma2, f: 1.0 * H, unit="1", gyro=("1",), accel=("1",))


def _density_at_1_hz(H: Any, sigma2: Any, f: Any) -> Any:
    # h |f|^(1-2H) in cycles per sample, of which there are f in a second
    return sigma2 * density(H) * f ** (2 * H - 2)


_CORNER = Quantity("f0", "corner frequency", None, lambda f0, B, f: f0 * f, unit="1/s", gyro=("Hz",), accel=("Hz",))

CONTINUOUS: dict[str, ContinuousForm] = {
    "WN": ContinuousForm(
        filter=(Quantity("q", "PSD", "^2/Hz", lambda sigma2, f: sigma2 / f),),
        datasheet=(
            Quantity("N", "random walk (ARW, VRW)", "/sqrt(Hz)", lambda sigma2, f: jnp.sqrt(sigma2 / f),
                     gyro=("deg/sqrt(h)", "deg/s/sqrt(Hz)"), accel=("ug/sqrt(Hz)", "m/s/sqrt(h)")),
        ),
        inverse=lambda q, f: (q * f,),
    ),
    "QN": ContinuousForm(
        filter=(Quantity("Q", "quantisation coefficient", "*s", lambda q2, f: jnp.sqrt(q2) / f),),
        datasheet=(
            Quantity("Q", "quantisation coefficient", "*s", lambda q2, f: jnp.sqrt(q2) / f,
                     gyro=("arcsec", "urad"), accel=("m/s", "mm/s")),
            # a rounding error uniform over one step has the variance LSB^2/12 (IEEE 952, C.1.1)
            Quantity("LSB", "increment per bit", "*s", lambda q2, f: jnp.sqrt(12 * q2) / f,
                     gyro=("arcsec", "urad"), accel=("m/s", "mm/s")),
        ),
        inverse=lambda Q, f: ((Q * f) ** 2,),
    ),
    "RW": ContinuousForm(
        filter=(Quantity("q", "PSD of the driving noise", "^2/s", lambda gamma2, f: gamma2 * f),),
        datasheet=(
            Quantity("K", "rate random walk", "/sqrt(s)", lambda gamma2, f: jnp.sqrt(gamma2 * f),
                     gyro=("deg/h/sqrt(h)", "deg/s/sqrt(h)"), accel=("m/s/h/sqrt(h)", "ug/sqrt(s)")),
        ),
        inverse=lambda q, f: (q / f,),
    ),
    "DR": ContinuousForm(
        filter=(Quantity("R", "rate ramp", "/s", lambda omega, f: omega * f),),
        datasheet=(
            Quantity("R", "rate ramp", "/s", lambda omega, f: omega * f,
                     gyro=("deg/h/h", "deg/s/h"), accel=("ug/h", "mg/h")),
        ),
        inverse=lambda R, f: (R / f,),
    ),
    "GM": ContinuousForm(
        filter=_GM_FILTER,
        datasheet=_GM_DATASHEET,
        inverse=lambda beta, q, f: (beta / f, q / (2 * beta)),
    ),
    "AR1": ContinuousForm(
        filter=tuple(_ar1_as_gm(q) for q in _GM_FILTER),
        datasheet=(
            *(_ar1_as_gm(q) for q in _GM_DATASHEET[:-1]),
            # the same without the logarithm, which phi < 0 has not
            _GM_DATASHEET[-1]._replace(value=lambda phi, sigma2, f: jnp.sqrt(sigma2 / f) / (1 - phi)),
        ),
        # sigma2 = variance (1 - phi^2), by expm1 since phi may be 1 - 1e-12
        inverse=lambda beta, q, f: (jnp.exp(-beta / f), -q / (2 * beta) * jnp.expm1(-2 * beta / f)),
    ),
    # the PSD at frequency 0, by differentiating that of GM, coth(beta/2): see `processes.matern`
    "MAT32": _matern(3, 4.0, "s^3", lambda beta: 1 / jnp.tanh(beta / 2) + beta / 2 / jnp.sinh(beta / 2) ** 2),
    "MAT52": _matern(
        5, 16 / 3, "s^5",
        lambda beta: (1 + beta * beta / 6 / jnp.sinh(beta / 2) ** 2) / jnp.tanh(beta / 2)
        + beta / 2 / jnp.sinh(beta / 2) ** 2,
    ),
    "BI": ContinuousForm(
        filter=(Quantity("B", "bias instability", "", lambda B, f: 1.0 * B),),
        datasheet=(
            Quantity("B", "bias instability", "", lambda B, f: 1.0 * B, gyro=("deg/h", "deg/s"), accel=("ug", "mg")),
            Quantity("floor", "flat Allan deviation", "", lambda B, f: jnp.sqrt(2 * jnp.log(2.0) / jnp.pi) * B,
                     gyro=("deg/h", "deg/s"), accel=("ug", "mg")),
        ),
        inverse=lambda B, f: (1.0 * B,),
    ),
    "FLK": ContinuousForm(
        filter=(
            _CORNER,
            Quantity("B", "bias instability", "", lambda f0, B, f: 1.0 * B, reads=(1,),
                     determined_at="flicker noise"),
        ),
        datasheet=(
            _CORNER._replace(symbol="f_0"),
            Quantity("B", "bias instability", "", lambda f0, B, f: 1.0 * B, gyro=("deg/h", "deg/s"),
                     accel=("ug", "mg"), reads=(1,), determined_at="flicker noise"),
        ),
        inverse=lambda f0, B, f: (f0 / f, 1.0 * B),
    ),
    "SIN": ContinuousForm(
        filter=(
            Quantity("omega", "angular frequency", None, lambda beta, alpha2, f: beta * f, unit="rad/s"),
            Quantity("alpha2", "square of the amplitude", "^2", lambda beta, alpha2, f: 1.0 * alpha2, reads=(1,)),
        ),
        datasheet=(
            Quantity("f_0", "frequency", None, lambda beta, alpha2, f: beta * f / (2 * jnp.pi), unit="1/s",
                     gyro=("Hz",), accel=("Hz",)),
            Quantity("alpha", "amplitude", "", lambda beta, alpha2, f: jnp.sqrt(alpha2), reads=(1,),
                     gyro=("deg/h", "deg/s"), accel=("ug", "mg")),
        ),
        inverse=lambda omega, alpha2, f: (omega / f, 1.0 * alpha2),
    ),
    "FGN": ContinuousForm(
        filter=(_HURST, Quantity("S_1", "PSD at 1 Hz", "^2/Hz", _density_at_1_hz, reads=(0, 1))),
        datasheet=(
            _HURST,
            Quantity("N_1", "density at 1 Hz", "/sqrt(Hz)",
                     lambda H, sigma2, f: jnp.sqrt(_density_at_1_hz(H, sigma2, f)),
                     gyro=("deg/sqrt(h)", "deg/s/sqrt(Hz)"), accel=("ug/sqrt(Hz)", "m/s/sqrt(h)"), reads=(0, 1)),
        ),
        inverse=lambda H, S, f: (H, S / _density_at_1_hz(H, 1.0, f)),
    ),
}  # fmt: skip
"""One row a process: its quantities in continuous time and the inverse to per-sample parameters."""


@lru_cache
def _arma(cls: type[AbstractArma]) -> ContinuousForm:
    """Coefficients belong to a sampling rate: what is left is the standard deviation, and white noise far beyond."""
    reads = tuple(range(len(cls.parameters)))

    def density(*values: Any) -> Any:
        *shape, sigma2, f = values
        return sigma2 * cls.unit_psd(tuple(shape), jnp.zeros(())) / f

    def sigma(*values: Any) -> Any:
        *shape, sigma2, _ = values
        return jnp.sqrt(sigma2 * cls.unit_autocovariance(tuple(shape), jnp.zeros(())))

    return ContinuousForm(
        filter=(Quantity("q_0", "PSD at frequency 0", "^2/Hz", density, reads=reads),),
        datasheet=(
            _GM_DATASHEET[0]._replace(value=sigma, reads=reads, determined_at=""),
            _GM_DATASHEET[3]._replace(
                meaning="density as white noise, at long times", value=lambda *v: jnp.sqrt(density(*v)), reads=reads,
                determined_at="",
            ),
        ),
        inverse=None,
    )  # fmt: skip


def continuous_form(cls: type[AbstractProcess]) -> ContinuousForm:
    """Return the continuous-time form of a class of processes."""
    return _arma(cls) if issubclass(cls, AbstractArma) else CONTINUOUS[cls.kind]


def to_continuous(kind: str, parameters: tuple[Any, ...], rate: float) -> tuple[Any, ...]:
    """Per-sample parameters of a process to its continuous-time filter quantities, in SI.

    Parameters
    ----------
    kind
        ``WN``, ``GM``, ..
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
    """
    form, values = _form(kind, parameters)
    f = sampling_rate(rate)
    return tuple(q.value(*values, f) for q in form.filter)


def from_continuous(kind: str, quantities: tuple[Any, ...], rate: float) -> tuple[Any, ...]:
    """Inverse of `to_continuous`: continuous-time filter quantities in SI to per-sample parameters."""
    form, values = _form(kind, quantities)
    assert form.inverse is not None  # `_form` has seen to it
    return form.inverse(*values, sampling_rate(rate))


def _form(kind: str, values: tuple[Any, ...]) -> tuple[ContinuousForm, tuple[Any, ...]]:
    form = continuous_form(process_class(kind))
    if form.inverse is None:
        raise ValueError(f"{kind} has no continuous-time form: its coefficients belong to the sampling rate.")
    if len(values) != len(form.filter):
        raise ValueError(f"{kind} has {len(form.filter)} parameters, and {len(values)} were given.")
    return form, tuple(as_float(v) for v in values)
