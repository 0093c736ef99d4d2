"""What a fresh process compiles for one scenario: most of what a user waits for, and what stays in memory."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import jax

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_enable_compilation_cache", False)
jax.config.update("jax_disable_most_optimizations", True)
key = jax.random.key(0)
compiled = []


def listen(event, duration, **_):
    if event == "/jax/core/compile/backend_compile_duration":
        compiled.append(event)


def count(function, *args, **kwargs):
    compiled.clear()
    function(*args, **kwargs)
    print(len(compiled))


jax.monitoring.register_event_duration_secs_listener(listen)
import nav_jax as nj


def scenario(duration):
    reference = nj.motions.lemniscate(duration=duration, rate=5.0)
    aiding = [nj.GnssPosition(horizontal=0.1, vertical=0.2), nj.Barometer(height=0.5)]
    return nj.Scenario(reference, aiding, nj.InitialUncertainty(position_sd=0.1))


def errors():
    model = "WN(sigma2=1e-4) + GM(beta=0.1, variance=1e-7)"
    return nj.ImuErrors(model, "WN(sigma2=1e-8)", rate=10.0, accel_bias_sd=1e-3).at_rate(5.0)


count(scenario, 2.0)
count(nj.filter.prepare, scenario(2.0), rate=5.0)
count(errors)
count(errors().bank)
count(nj.compare, scenario(2.0), errors(), num_runs=8, key=key)
count(nj.filter.prepare, scenario(3.0), rate=5.0)
"""

MOST = {
    "the motion, and the standard deviation of white noise": 3,
    "perfect sensors, truth at the events, gravity": 3,
    "another rate, for each sensor of the IMU": 2,
    "the states": 1,
    "keys, inputs and the filter": 3,
    "perfect sensors and truth of another length": 2,
}
"""Programs of each line of the program above: what it should compile, and nothing that is one operation."""


@pytest.mark.slow
def test_a_scenario_compiles_few_programs():
    environment = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True, timeout=300
    )
    counted = dict(zip(MOST, map(int, done.stdout.split()), strict=True))
    assert all(counted[what] <= most for what, most in MOST.items()), counted
    assert min(counted.values()) > 0
