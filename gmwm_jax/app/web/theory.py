"""What the processes are: definitions and wavelet variances as MathML, which browsers draw by themselves."""

import ast
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from htmltools import HTML, Tag
from shiny import ui

from gmwm_jax.processes.registry import PROCESSES


class Theory(NamedTuple):
    """Of one process; both are written as Python has them, with eps for standard normal noise."""

    definition: str
    moment: str
    """A wavelet variance, of tau samples; where it has no short formula, an autocovariance or a spectrum."""
    remark: str = ""


_FIRST_ORDER = "(n*(1 - phi**2) - phi*(1 - phi**n)*(3 - phi**n)) / (2*n**2*(1 - phi)**2)"

THEORY: Mapping[str, Theory] = MappingProxyType({
    "WN": Theory("x[t] == sigma*eps[t]", "nu(tau)**2 == sigma2/tau", "Angle or velocity random walk."),
    "QN": Theory("x[t] == sqrt(12*q2)*(y[t] - y[t-1])", "nu(tau)**2 == 6*q2/tau**2", "y is uniform between 0 and 1."),
    "RW": Theory("x[t] == x[t-1] + gamma*eps[t]", "nu(tau)**2 == gamma2*(tau**2 + 2)/(12*tau)", "Rate random walk."),
    "DR": Theory("x[t] == omega*t", "nu(tau)**2 == omega**2*tau**2/16", "Rate ramp."),
    "AR1": Theory(
        "x[t] == phi*x[t-1] + sigma*eps[t]",
        f"nu(tau)**2 == sigma2/(1 - phi**2)*{_FIRST_ORDER}",
        "φ is the correlation of neighbours.",
    ),
    "GM": Theory(
        "x[t] == exp(-beta)*x[t-1] + sqrt(variance*(1 - exp(-2*beta)))*eps[t]",
        f"nu(tau)**2 == variance*{_FIRST_ORDER}",
        "Gauss-Markov, an AR1 with φ = exp(-β).",
    ),
    "MAT32": Theory(
        "(D + beta)**2*x == eps", "r(h) == variance*(1 + beta*h)*exp(-beta*h)",
        "Second-order Gauss-Markov; r is its autocovariance, D the derivative by time.",
    ),
    "MAT52": Theory(
        "(D + beta)**3*x == eps", "r(h) == variance*(1 + beta*h + beta**2*h**2/3)*exp(-beta*h)",
        "Third-order Gauss-Markov.",
    ),
    "FGN": Theory(
        "r(h) == sigma2/2*((h + 1)**(2*H) - 2*h**(2*H) + (h - 1)**(2*H))",
        "nu(tau)**2 == sigma2*n**(2*H - 2)*(1 - 2**(2*H - 2))",
        "Fractional Gaussian noise; r is the autocovariance at the lags from 1 on.",
    ),
    "BI": Theory("S(f) == B**2/(2*pi*f)", "nu(tau)**2 == B**2*log(2)/pi", "Flicker noise, the same at every scale."),
    "FLK": Theory("S(f) == B**2/(2*pi*f)", "f < f0", "Flicker noise below its corner."),
    "SIN": Theory(
        "x[t] == sqrt(alpha2)*sin(beta*t + U)",
        "nu(tau)**2 == alpha2*sin(beta*n/2)**4/(2*n**2*sin(beta/2)**2)",
        "Of a phase U that nobody knows.",
    ),
})  # fmt: skip
"""By name; a model is a sum, and its wavelet variance the sum of theirs."""

assert set(THEORY) == set(PROCESSES)

_LETTERS = {
    "sigma2": ("σ", "2"), "gamma2": ("γ", "2"), "alpha2": ("α", "2"), "q2": ("q", "2"), "variance": ("σ", "2"),
    "sigma": "σ", "gamma": "γ", "omega": "ω", "beta": "β", "phi": "φ", "tau": "τ", "nu": "ν", "pi": "π", "f0": "f₀",
    "eps": "ε",
}  # fmt: skip
_SUM, _FIRST, _PRODUCT, _POWER = 1, 2, 3, 4
"""How strongly operations bind; before the first factor a sign needs no brackets."""


def mathml(expression: str) -> HTML:
    """Write a formula as MathML.

    Parameters
    ----------
    expression
        As Python has it; an index is a subscript.

    Raises
    ------
    ValueError
        Something that formulas do not have.

    Examples
    --------
    >>> from gmwm_jax.app.web.theory import mathml
    >>> mathml("6*q2/tau**2")[:49]
    '<math displaystyle="true"><mfrac><mrow><mn>6</mn'
    """
    return HTML(f'<math displaystyle="true">{_written(ast.parse(expression, mode="eval").body)}</math>')


def _written(node: ast.expr, around: int = 0) -> str:
    """A part of a formula, in brackets where what is around it binds more strongly."""
    match node:
        case ast.Name(id=name):
            known = _LETTERS.get(name, name)
            if isinstance(known, tuple):
                return f"<msup><mi>{known[0]}</mi><mn>{known[1]}</mn></msup>"
            return f"<mi>{known}</mi>"
        case ast.Constant(value=value):
            return f"<mn>{value}</mn>"
        case ast.Subscript(value=of, slice=index):
            return f"<msub>{_written(of)}<mrow>{_written(index)}</mrow></msub>"
        case ast.Call(func=ast.Name(id="sqrt"), args=[inside]):
            return f"<msqrt>{_written(inside)}</msqrt>"
        case ast.Call(func=ast.Name(id="exp"), args=[inside]):
            return f"<msup><mi>e</mi><mrow>{_written(inside)}</mrow></msup>"
        case ast.Call(func=ast.Name(id=name), args=[inside]):
            return f"<mrow><mi>{_LETTERS.get(name, name)}</mi>{_bracketed(_written(inside))}</mrow>"
        case ast.Compare(left=left, ops=[sign], comparators=[right]):
            return f"<mrow>{_written(left)}<mo>{_SIGNS[type(sign)]}</mo>{_written(right)}</mrow>"
        case ast.UnaryOp(op=ast.USub(), operand=of):
            return _around(f"<mo>-</mo>{_written(of, _PRODUCT)}", around > _FIRST)
        case ast.BinOp(left=left, op=ast.Pow(), right=exponent):
            return _power(left, exponent)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            made = f"<mfrac><mrow>{_written(left)}</mrow><mrow>{_written(right)}</mrow></mfrac>"
            return _around(made, around >= _POWER)
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            made = f"{_written(left, _FIRST)}<mo>&#x2062;</mo>{_written(right, _PRODUCT)}"
            return _around(made, around > _PRODUCT)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return _around(f"{_written(left, _SUM)}<mo>+</mo>{_written(right, _SUM)}", around > _SUM)
        case ast.BinOp(left=left, op=ast.Sub(), right=right):
            return _around(f"{_written(left, _SUM)}<mo>-</mo>{_written(right, _PRODUCT)}", around > _SUM)
    raise ValueError(f"{ast.unparse(node)} is in no formula.")


_SIGNS: Mapping[type[ast.cmpop], str] = {ast.Eq: "=", ast.Lt: "&lt;"}


def _power(base: ast.expr, exponent: ast.expr) -> str:
    """A power; that of a function stands at its name."""
    raised = f"<mrow>{_written(exponent)}</mrow>"
    if isinstance(base, ast.Call) and isinstance(base.func, ast.Name) and base.func.id not in ("sqrt", "exp"):
        name = _LETTERS.get(base.func.id, base.func.id)
        return f"<mrow><msup><mi>{name}</mi>{raised}</msup>{_bracketed(_written(base.args[0]))}</mrow>"
    return f"<msup>{_written(base, _POWER)}{raised}</msup>"


def _bracketed(inside: str) -> str:
    return f"<mrow><mo>(</mo>{inside}<mo>)</mo></mrow>"


def _around(inside: str, brackets: bool) -> str:
    return _bracketed(inside) if brackets else f"<mrow>{inside}</mrow>"


def theory_of_processes() -> Tag:
    """Make the table of the page."""
    head = ui.tags.tr(
        *(
            ui.tags.th(name, scope="col")
            for name in ("process", "definition", "wavelet variance, or autocovariance r", "")
        )
    )
    rows = [
        ui.tags.tr(
            ui.tags.th(kind, scope="row"), ui.tags.td(mathml(of.definition)), ui.tags.td(mathml(of.moment)),
            ui.tags.td(of.remark, style="white-space: normal; min-width: 12rem"),
        )
        for kind, of in THEORY.items()
    ]  # fmt: skip
    return ui.tags.details(
        ui.tags.summary("What the processes are"),
        ui.p(
            "A model is a sum of processes, and its wavelet variance the sum of theirs. Parameters are per sample; "
            "ν² is the Haar wavelet variance at a scale of τ samples, half of the Allan variance at τ/2; ε is standard "
            "normal noise, and n is τ/2."
        ),
        ui.div(ui.tags.table(ui.tags.thead(head), ui.tags.tbody(*rows), class_="table"), class_="gmwm-table"),
        id="theory",
    )
