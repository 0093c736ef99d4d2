"""No program has two batched decompositions side by side: a fit would hang now and then on a machine of two cores."""

import os
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from side_by_side import side_by_side

ROOT = Path(__file__).parents[3]

EVERYTHING = """
import jax
jax.config.update("jax_enable_x64", True)
import numpy as np
import gmwm_jax as gj
model, truth = "WN + RW + 2*GM", "WN(sigma2=1) + RW(gamma2=1e-6) + GM(beta=0.01, variance=0.2)"
samples = np.asarray(gj.simulate(truth, 20_000, key=jax.random.key(0)))
wv = gj.wavelet_variance(samples, rate=100.0)
found = gj.fit(wv, model, weights="two-step")
print(found)
print(gj.bootstrap(found, 8, key=jax.random.key(1)))
print(gj.select(wv, model))
print(gj.fit_records([wv, wv], "WN + GM"))
"""


def program(*functions):
    """The text of the program in which all are applied to one batch."""
    batch = jnp.asarray(np.random.default_rng(0).normal(size=(24, 18, 8)))
    return jax.jit(lambda x: [f(x) for f in functions]).lower(batch).compile().as_text()


def test_what_is_looked_for_is_seen():
    def svd(x):
        return jnp.linalg.svd(x, full_matrices=False)

    assert side_by_side(program(svd)) == []
    assert len(side_by_side(program(svd, lambda x: svd(2 * x)))) == 1
    assert side_by_side(program(lambda x: svd(svd(x)[0]))) == []
    assert side_by_side(program(lambda x: svd(x[0]), lambda x: svd(x[1]))) == []
    # in loops, too
    assert len(side_by_side(program(svd, lambda x: jax.lax.fori_loop(0, 9, lambda _, y: svd(y)[0], 2 * x)))) == 1


@pytest.mark.slow
def test_no_program_of_a_fit_and_of_what_follows_has_any(tmp_path):
    flags = f"--xla_dump_to={tmp_path} --xla_dump_hlo_as_text"
    done = subprocess.run(
        [sys.executable, "-c", EVERYTHING], cwd=ROOT, env=os.environ | {"XLA_FLAGS": flags}, timeout=400, check=False,
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    programs = {file.name: file.read_text() for file in tmp_path.glob("*after_optimizations.txt")}
    decomposing = {name: text for name, text in programs.items() if "lapack" in text}
    assert any("conditional_fits" in name for name in decomposing)
    assert any("minimise" in name for name in decomposing)
    assert {name: pairs for name, text in decomposing.items() if (pairs := side_by_side(text))} == {}
