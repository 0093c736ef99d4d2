"""Formulas of the page are those of the library, and are read by a parser of XML."""

from xml.etree import ElementTree

import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.app.web.theory import THEORY, mathml, theory_of_processes

MODELS = {
    "WN": "WN(sigma2=3)", "QN": "QN(q2=2)", "RW": "RW(gamma2=0.3)", "DR": "DR(omega=0.7)",
    "AR1": "AR1(phi=0.6, sigma2=2)", "GM": "GM(beta=0.4, variance=2)", "MAT32": "MAT32(beta=0.4, variance=2)",
    "MAT52": "MAT52(beta=0.4, variance=2)", "FGN": "FGN(H=0.7, sigma2=2)", "BI": "BI(B=2)",
    "SIN": "SIN(beta=0.4, alpha2=2)",
}  # fmt: skip


def value(written, **names):
    """The right-hand side of a formula."""
    functions = {"sqrt": np.sqrt, "exp": np.exp, "log": np.log, "sin": np.sin, "pi": np.pi}
    return eval(written.partition("==")[2].strip(), functions | names)


def named(process):
    return {q.name: float(v) for q, v in zip(process.parameters, process.values, strict=True)}


@pytest.mark.parametrize("kind", sorted(MODELS))
def test_moments_are_those_of_the_library(kind):
    (process,) = gj.parse_model(MODELS[kind]).processes
    names = named(process)
    if kind.startswith("MAT"):
        lags = np.array([0.0, 1.0, 7.0])
        for h, expected in zip(lags, process.autocovariance(lags), strict=True):
            assert value(THEORY[kind].moment, h=h, **names) == pytest.approx(float(expected), rel=1e-9)
        return
    if kind == "GM":
        names["phi"] = np.exp(-names["beta"])
    for tau in (2.0, 8.0, 64.0):
        expected = float(process.wavelet_variance(np.array([tau]))[0])
        assert value(THEORY[kind].moment, tau=tau, n=tau / 2, **names) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("kind", sorted(THEORY))
def test_formulas_are_well_formed(kind):
    for written in THEORY[kind][:2]:
        tree = ElementTree.fromstring(str(mathml(written)).replace("&#x2062;", "·"))
        assert tree.tag == "math"
        assert "".join(tree.itertext())


def test_brackets_stand_where_they_are_needed():
    def read(written):
        return "".join(ElementTree.fromstring(str(mathml(written)).replace("&#x2062;", "")).itertext())

    assert read("(a + b)*c") == "(a+b)c"
    assert read("a - (b - c)") == "a-(b-c)"
    assert read("(a/b)**2") == "(ab)2"
    assert read("exp(-2*beta)") == "e-2β"
    assert read("sin(a)**4") == "sin4(a)"
    with pytest.raises(ValueError, match="in no formula"):
        mathml("[1]")


def test_every_process_has_a_row():
    assert str(theory_of_processes()).count("<tr>") == len(THEORY) + 1
