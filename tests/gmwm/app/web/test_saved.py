"""A page as a file: what is loaded is what was saved, and everything else is refused by a sentence."""

import json

import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.app.web import saved
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.saved import Fitted
from gmwm_jax.app.web.state import State

STATE = State(room="model", source="file", rate=100.0, channel="x", boxes="WN,RW", level=0.9, units="deg/s")
FITS = (Fitted("WN", "x", 12.5, None), Fitted("WN + RW", "x", 3.25, 0.4))


@pytest.fixture(scope="module")
def wv():
    x = np.random.default_rng(0).normal(size=(600, 2))
    return gj.wavelet_variance(gj.Recording.from_array(x, rate=100.0, units="rad/s", channels=["x", "<i>"]))


@pytest.fixture(scope="module")
def content(wv):
    return saved.write(STATE, wv, FITS)


def test_what_is_loaded_is_what_was_saved(wv, content):
    page = saved.read(content, "page.json")
    assert page.state == STATE.model_copy(update={"source": "saved"})
    assert repr(page.variance) == repr(wv)
    assert page.fits == FITS
    alone = saved.read(saved.write(State(seed=4), None, (Fitted("WN", "x", float("nan"), None),)), "page.json")
    assert (alone.state, alone.variance, alone.fits) == (State(seed=4), None, ())


def changed(content, change):
    tree = json.loads(content)
    change(tree)
    return json.dumps(tree).encode()


def damage(tree):
    tree["variance"]["arrays"]["variance"]["values"][0] *= 2


def other_kind(tree):
    tree["variance"]["kind"] = "gmwm_jax.Fit"


def unknown_class(tree):
    tree["variance"]["state"]["class"] = "os.system"


HOSTILE = {
    "nothing": lambda c: b"",
    "words": lambda c: b"hello",
    "a list": lambda c: b"[1, 2]",
    "bytes": lambda c: b"\x80\x04\x95" * 9,
    "deep": lambda c: b"[" * 100_000,
    "deep inside": lambda c: c.replace(b'"variance": {', b'"variance": {"x": ' + b"[" * 5000 + b"]" * 5000 + b", ", 1),
    "foreign": lambda c: b'{"name": "my-app", "version": "1.0"}',
    "a fit": lambda c: json.dumps(json.loads(c)["variance"]).encode(),
    "another version": lambda c: changed(c, lambda t: t.update(gmwm_jax_page=2)),
    "more": lambda c: changed(c, lambda t: t.update(run="import os")),
    "an input of another kind": lambda c: changed(c, lambda t: t["inputs"].update(model=["x"])),
    "not a number": lambda c: c.replace(b'"level": 0.9', b'"level": NaN'),
    "out of range": lambda c: changed(c, lambda t: t["inputs"].update(level=7.0)),
    "too long": lambda c: changed(c, lambda t: t["inputs"].update(model="WN + " * 500)),
    "an unknown source": lambda c: changed(c, lambda t: t["inputs"].update(source="/etc/passwd")),
    "no variance": lambda c: changed(c, lambda t: t.update(variance=None)),
    "two sources": lambda c: changed(c, lambda t: t["inputs"].update(source="file")),
    "many fits": lambda c: changed(c, lambda t: t.update(fits=t["fits"] * 100)),
    "damaged": lambda c: changed(c, damage),
    "of another kind": lambda c: changed(c, other_kind),
    "of an unknown class": lambda c: changed(c, unknown_class),
}


@pytest.mark.parametrize("how", HOSTILE)
def test_others_are_refused_by_a_sentence(content, how):
    with pytest.raises(ValueError, match=r"^p\.json") as refused:
        saved.read(HOSTILE[how](content), "p.json")
    assert len(str(refused.value)) < 400
    assert "/tmp" not in str(refused.value)
    assert "\n" not in str(refused.value)


def test_limits_hold(content):
    with pytest.raises(ValueError, match="larger than"):
        saved.read(content, "p.json", Limits(saved=100))
    with pytest.raises(ValueError, match="2 channels, and this server takes 1"):
        saved.read(content, "p.json", Limits(channels=1))
    with pytest.raises(ValueError, match="as a file"):
        saved.write(STATE, None, (), Limits(saved=100))
