"""What a fresh process compiles until a fit is printed: most of what a user waits for."""

import os
import subprocess
import sys

import pytest

MOST = 8
"""The search, the covariance of the wavelet variance, that of the parameters, the tables; the others are single
operations of the library that descends."""

PROGRAM = """
import jax

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_enable_compilation_cache", False)
compiled = []


def listen(event, duration, **_):
    if event == "/jax/core/compile/backend_compile_duration":
        compiled.append(event)


jax.monitoring.register_event_duration_secs_listener(listen)
import numpy as np
import gmwm_jax as gj

rng = np.random.default_rng(1)
x = rng.normal(size=20_000) + np.convolve(rng.normal(size=20_000) * 0.05, 0.99 ** np.arange(1000))[:20_000]
fit = gj.fit(gj.Recording(x[:, None], rate=100.0, channels=("gyro_x",), units=("rad/s",)), "WN + GM")
text = repr(fit)
assert "Datasheet units" in text and "95 % low" in text
print("scipy.optimize" in __import__("sys").modules, len(compiled))
"""


@pytest.mark.slow
def test_a_fit_and_its_tables_compile_few_programs():
    environment = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True, timeout=300
    )
    optimise, programs = done.stdout.split()
    assert optimise == "False"
    assert 3 <= int(programs) <= MOST
