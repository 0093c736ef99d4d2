"""Loops that are compiled as a whole: who decides, when it is too late, and that XLA does it."""

import os
import subprocess
import sys

import pytest

from gmwm_jax._internal import xla_loops
from gmwm_jax._internal.xla_loops import fast_loops, fast_loops_if_known, loops_are_fast

OPTION = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=1000000000"


@pytest.fixture
def flags(monkeypatch):
    """The environment's flags, to read and to set; the fast ones are set in no other test."""
    monkeypatch.setenv("XLA_FLAGS", "")
    monkeypatch.setattr(xla_loops, "_has_begun", lambda: False)
    monkeypatch.setattr(xla_loops, "version", lambda name: "0.10.2")
    return lambda: os.environ["XLA_FLAGS"]


def test_other_flags_stay(flags, monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "--xla_cpu_max_isa=AVX2")
    assert not loops_are_fast()
    fast_loops()
    assert flags() == f"--xla_cpu_max_isa=AVX2 {OPTION}"
    assert loops_are_fast()
    fast_loops()  # once is enough
    assert flags().count("threshold") == 1


def test_other_extra_options_stand(flags, monkeypatch):
    theirs = "--xla_backend_extra_options=xla_cpu_fold_all_constants=true"
    monkeypatch.setenv("XLA_FLAGS", theirs)
    fast_loops()
    assert flags() == theirs


@pytest.mark.parametrize("version", ["0.7.0", "0.12.0", "1.0"])
def test_versions_that_are_not_known_are_left_alone(flags, monkeypatch, version):
    monkeypatch.setattr(xla_loops, "version", lambda name: version)
    with pytest.warns(UserWarning, match="not known"):
        fast_loops()
    fast_loops_if_known()
    assert flags() == ""


def test_too_late_is_said(flags, monkeypatch):
    monkeypatch.setattr(xla_loops, "_has_begun", lambda: True)
    with pytest.raises(RuntimeError, match="at the top"):
        fast_loops()
    assert flags() == ""


SCRIPT = """
import os, jax, jax.numpy as jnp
import nav_jax as nj
nj.fast_loops()
loop = jax.jit(lambda x: jax.lax.scan(lambda c, _: (0.5 * c + jnp.sin(c), None), x, None, length=100)[0])
print("small_call" in loop.lower(jnp.ones(1000)).compile().as_text())
os.environ["XLA_FLAGS"] = ""
try:
    nj.fast_loops()
except RuntimeError as error:
    print(error)
"""


@pytest.mark.slow
@pytest.mark.skipif(not xla_loops._is_known(), reason="this jaxlib is not known to have the option")
def test_xla_compiles_a_loop_as_one_function():
    clean = {k: v for k, v in os.environ.items() if k != "XLA_FLAGS"}
    done = subprocess.run([sys.executable, "-c", SCRIPT], env=clean, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[0] == "True"
    assert done.stdout.splitlines()[1].startswith("JAX has computed something already")
