"""Models from text."""

import pytest
from gmwm.cases import rows

from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.gauss_markov import GM
from gmwm_jax.processes.registry import as_model, parse_model, process_class
from gmwm_jax.processes.white_noise import WN


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("WN", "WN"),
        (" wn ", "WN"),
        ("WN + RW + 3*GM", "WN + RW + GM + GM + GM"),
        ("WN+3GM", "WN + GM + GM + GM"),
        ("3 * gm + qn", "GM + GM + GM + QN"),
        ("GM()", "GM"),
        ("GM(beta=0.01)", "GM(beta=0.01)"),
        ("GM(variance=2, beta=.5)", "GM(beta=0.5, variance=2)"),
        ("GM( beta = 1e-3 fixed , variance = 2E+1 )", "GM(beta=0.001 fixed, variance=20)"),
        ("AR1(phi=-0.5, sigma2=1fixed)", "AR1(phi=-0.5, sigma2=1 fixed)"),
        ("2*GM(beta=0.1) + WN", "GM(beta=0.1) + GM(beta=0.1) + WN"),
        ("WN + QN + RW + DR + 2*AR1", "WN + QN + RW + DR + AR1 + AR1"),
    ],
)
def test_parse(text, meant):
    model = parse_model(text)
    assert repr(model) == meant
    assert repr(parse_model(repr(model))) == meant


@pytest.mark.parametrize("case", rows())
def test_text_of_every_process_reads_back(case):
    kind = case.cls.kind
    assert type(parse_model(kind).processes[0]) is case.cls
    assert process_class(kind) is case.cls
    names = [p.name for p in case.cls.parameters]
    values = [0.25] * len(names)
    model = Composite((case.cls(*values).fix(names[0]),))
    again = parse_model(repr(model))
    assert repr(again) == repr(model)
    assert again.processes[0].fixed == (names[0],)
    assert [float(v) for v in again.processes[0].values] == values


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a process such as WN"),
        ("WN +", r"from '' on: expected a process"),
        ("+ WN", r"from '\+ WN' on"),
        ("WN ++ RW", r"from '\+ RW' on: expected a process"),
        ("WN RW", r"from 'RW' on: expected '\+'"),
        ("WN*2", r"from '\*2' on: expected '\+'"),
        ("WN; RW", "from '; RW' on"),
        ("-1*GM", "expected a process"),
        ("1.5*GM", "expected a process"),
        ("0*GM", "takes GM 0 times: leave it out"),
        ("WN + 00*GM", "takes GM 0 times: leave it out"),
        ("FOO", "Unknown process 'FOO'.* Known: WN, QN, RW, DR, AR1, GM"),
        ("WN + MA1", "Unknown process 'MA1'"),
        ("WN(beta=1)", "WN has no parameter 'beta'.* it has sigma2"),
        ("GM(beta)", "expected name=number"),
        ("GM(beta=big)", "expected name=number, or name=number fixed"),
        ("GM(beta=0.1 free)", "expected name=number, or name=number fixed"),
        ("GM(beta=0.1, beta=0.2)", "beta.*twice"),
        ("GM(beta=-1)", r"GM: beta must be one number in \(0, inf\), and is -1"),
        ("AR1(phi=1)", r"AR1: phi must be one number in \(-1, 1\), and is 1"),
        ("WN(sigma2=1", "expected"),
        ("2*WN", "2 x WN.*cannot be told apart"),
        ("RW + WN + RW", "2 x RW"),
        ("GM + AR1", "one process in two parametrisations"),
    ],
)
def test_what_is_no_model(text, message):
    with pytest.raises(ValueError, match=message):
        parse_model(text)


def test_as_model_takes_text_a_process_or_a_sum():
    assert repr(as_model("WN + GM")) == "WN + GM"
    assert repr(as_model(GM(0.1))) == "GM(beta=0.1)"
    model = WN() + GM()
    assert as_model(model) is model
    assert repr(2 * GM() + WN()) == repr(GM() * 2 + WN()) == "GM + GM + WN"
    with pytest.raises(ValueError, match="not 0 times"):
        GM() * 0
    with pytest.raises(TypeError, match="model"):
        as_model(3)
