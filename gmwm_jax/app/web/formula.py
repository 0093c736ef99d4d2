"""Parameters per sample and quantities of filters, both ways, with the formula and the numbers put in.

The formulas are text for the reader; the values come from `gmwm_jax.processes.to_continuous` and its inverse.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from gmwm_jax._internal.checks import sampling_rate
from gmwm_jax.processes.continuous import from_continuous, to_continuous
from gmwm_jax.processes.continuous_form import derived_unit
from gmwm_jax.units import convert, require_si, unit


class Step(NamedTuple):
    """One line of a conversion."""

    symbol: str
    formula: str
    numbers: str
    """The formula with the numbers put in."""
    value: float
    unit: str

    @property
    def text(self) -> str:
        """The line as it is read."""
        formula = "" if self.formula == self.symbol else f" = {self.formula}"
        return f"{self.symbol}{formula} = {self.numbers} = {self.value:.7g} {self.unit}"


class _Rule(NamedTuple):
    """A formula in the names of what is given and of f, and the suffix of the unit or, after a colon, the unit."""

    symbol: str
    formula: str
    suffix: str


# kind -> names of its parameters per sample, rules to the quantities of filters, rules back
_RULES: dict[str, tuple[tuple[str, ...], tuple[_Rule, ...], tuple[_Rule, ...]]] = {
    "WN": (("sigma2",), (_Rule("q", "{sigma2} / {f}", "^2/Hz"),), (_Rule("sigma2", "{q} * {f}", "^2"),)),
    "RW": (("gamma2",), (_Rule("q", "{gamma2} * {f}", "^2/s"),), (_Rule("gamma2", "{q} / {f}", "^2"),)),
    "DR": (("omega",), (_Rule("R", "{omega} * {f}", "/s"),), (_Rule("omega", "{R} / {f}", ""),)),
    "QN": (("q2",), (_Rule("Q", "sqrt({q2}) / {f}", "*s"),), (_Rule("q2", "({Q} * {f})^2", "^2"),)),
    "GM": (
        ("beta", "variance"),
        (_Rule("beta_c", "{beta} * {f}", ":1/s"), _Rule("q", "2 * {beta} * {f} * {variance}", "^2/s")),
        (_Rule("beta", "{beta_c} / {f}", ":1/sample"), _Rule("variance", "{q} / (2 * {beta_c})", "^2")),
    ),
}

_ROOTS = {"WN": "/sqrt(Hz)", "RW": "/s/sqrt(Hz)", "GM": "/s/sqrt(Hz)"}
"""Of the processes whose q has a root that filters take, and its unit."""


def kinds() -> tuple[str, ...]:
    """Return the processes that can be converted.

    Examples
    --------
    >>> from gmwm_jax.app.web import formula
    >>> formula.kinds()
    ('WN', 'RW', 'DR', 'QN', 'GM')
    """
    return tuple(_RULES)


def to_filter(kind: str, parameters: Sequence[float], rate: float, signal: str) -> tuple[Step, ...]:
    """Convert parameters per sample to what a filter takes, and say how.

    Parameters
    ----------
    kind
        ``WN``, ``RW``, ``DR``, ``QN`` or ``GM``.
    parameters
        In the order of the process: sigma2 of WN; gamma2 of RW; omega of DR; q2 of QN; beta and the stationary
        variance of GM.
    rate
        Sampling rate in Hz.
    signal
        SI unit of the signal.

    Raises
    ------
    ValueError
        Another process, unit or number of parameters; a rate that is not positive.

    Examples
    --------
    >>> from gmwm_jax.app.web import formula
    >>> formula.to_filter("WN", [4.926494e-05], 100.0, "rad/s")[0].text
    'q = sigma2 / f = 4.926494e-05 / 100 = 4.926494e-07 (rad/s)^2/Hz'
    """
    names, forward, _ = _rules(kind)
    values = [float(v) for v in to_continuous(kind, tuple(parameters), rate)]
    steps = _steps(forward, dict(zip(names, parameters, strict=True)), values, rate, signal)
    if kind == "GM":
        beta_c = steps[0].value
        steps = (steps[0], Step("T", "1 / beta_c", f"1 / {beta_c:.7g}", 1 / beta_c, "s"), *steps[1:])
    if kind in _ROOTS:
        q = steps[-1].value
        steps = (*steps, Step("sqrt(q)", "sqrt(q)", f"sqrt({q:.7g})", q**0.5, f"{signal}{_ROOTS[kind]}"))
    return steps


def to_samples(kind: str, quantities: Sequence[float], rate: float, signal: str) -> tuple[Step, ...]:
    """Convert what a filter takes to parameters per sample, and say how: the inverse of `to_filter`.

    Parameters
    ----------
    kind, rate, signal
        As of `to_filter`.
    quantities
        q of WN and RW; R of DR; Q of QN; beta in 1/s and q of GM; all in SI.

    Examples
    --------
    >>> from gmwm_jax.app.web import formula
    >>> formula.to_samples("RW", [4.75507e-11], 100.0, "rad/s")[0].text
    'gamma2 = q / f = 4.75507e-11 / 100 = 4.75507e-13 (rad/s)^2'
    """
    _, forward, back = _rules(kind)
    values = [float(v) for v in from_continuous(kind, tuple(quantities), rate)]
    names = [rule.symbol for rule in forward]
    return _steps(back, dict(zip(names, quantities, strict=True)), values, rate, signal)


def innovation_to_stationary(beta: float, innovation: float) -> Step:
    """Return the stationary variance of a Gauss-Markov process whose variance per step is known.

    Two variances are called that of a first-order process: that of the sum of all that it remembers (stationary), and
    that of what each sample adds (innovation). One put in the place of the other is wrong by 1/(1 - exp(-2 beta)).

    Parameters
    ----------
    beta
        Per sample.
    innovation
        Variance of what a sample adds.

    Examples
    --------
    >>> from gmwm_jax.app.web import formula
    >>> f"{1 / formula.innovation_to_stationary(1.688923e-03, 1.0).value:.4g}"
    '0.003372'
    """
    numbers = f"{innovation:.7g} / (1 - exp(-2 * {beta:.7g}))"
    return Step("variance", "s2 / (1 - exp(-2 * beta))", numbers, -innovation / math.expm1(-2 * beta), "")


def converted(value: float, source: str, target: str) -> Step:
    """Convert a number between two units, and say by which sizes in SI.

    Raises
    ------
    ValueError
        Unknown unit, or two that measure different things.

    Examples
    --------
    >>> from gmwm_jax.app.web import formula
    >>> f'{formula.converted(2.412920, "deg/sqrt(h)", "rad/s/sqrt(Hz)").value:.6g}'
    '0.00070189'
    """
    a, b = unit(source), unit(target)
    numbers = f"{value:.7g} * {a.factor:.7g} / {b.factor:.7g}"
    return Step("x", f"value * [{source} in SI] / [{target} in SI]", numbers, convert(value, source, target), target)


def _rules(kind: str) -> tuple[tuple[str, ...], tuple[_Rule, ...], tuple[_Rule, ...]]:
    if kind not in _RULES:
        raise ValueError(f"{kind!r} is none of the processes that are converted here: {', '.join(_RULES)}.")
    return _RULES[kind]


def _steps(
    rules: tuple[_Rule, ...], given: dict[str, float], values: Sequence[float], rate: float, signal: str
) -> tuple[Step, ...]:
    require_si(signal)
    names = {name: name for name in (*given, "f")}
    numbers = {name: f"{float(v):.7g}" for name, v in given.items()} | {"f": f"{sampling_rate(rate):.7g}"}
    return tuple(
        Step(rule.symbol, rule.formula.format(**names), rule.formula.format(**numbers), float(v), _unit(rule, signal))
        for rule, v in zip(rules, values, strict=True)
    )


def _unit(rule: _Rule, signal: str) -> str:
    return rule.suffix[1:] if rule.suffix.startswith(":") else derived_unit(signal, rule.suffix)
