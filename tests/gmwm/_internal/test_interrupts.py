"""Ctrl-C ends a process within seconds, whatever XLA is doing; what takes minutes shows that it was not waited for."""

import signal
import subprocess
import sys
import threading
import time

import pytest

from gmwm_jax._internal.interrupts import INTERRUPTED, AbandonableExecutor

MOST = 60.0
"""Seconds that a loaded machine is given; what is interrupted takes many times as long."""

ENDLESS = """
import jax, jax.numpy as jnp
jax.config.update("jax_enable_x64", True)
from gmwm_jax._internal.interrupts import AbandonableExecutor, leave_when_deaf

@jax.jit
def program(x):
    return jax.lax.fori_loop(0, 20_000_000_000, lambda i, x: jnp.sin(x), x)

def running():
    print("begins", flush=True)
    program(jnp.ones(4)).block_until_ready()
"""

HEARS = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
"""A shell has what it starts in the background ignore interrupts, and so has Python then."""

IN_MAIN = ENDLESS + "leave_when_deaf(1.0)\nrunning()\n"
IN_THREAD = (
    ENDLESS
    + """
pool = AbandonableExecutor(2)
future = pool.submit(running)
try:
    future.result()
except KeyboardInterrupt:
    pool.shutdown(wait=False, cancel_futures=True)
    print("results so far")
"""
)
HEARD = """
import time
from gmwm_jax._internal.interrupts import leave_when_deaf
leave_when_deaf(0.5)
print("begins", flush=True)
for _ in range(2):
    try:
        time.sleep(600)
    except KeyboardInterrupt:
        print("heard", flush=True)
        time.sleep(1.5)  # longer than the grace: what follows an interrupt is not cut short
        print("begins", flush=True)
print("done")
"""


def interrupted(script, times=1):
    """Interrupt a script after its line 'begins'; returns its exit code, the rest of its output and the seconds."""
    process = subprocess.Popen(
        [sys.executable, "-c", HEARS + script], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        for _ in range(times):
            while (line := process.stdout.readline()) != "begins\n":
                assert line, "It ended too early."
            time.sleep(2.0)
            start = time.monotonic()
            process.send_signal(signal.SIGINT)
        output = process.communicate(timeout=2 * MOST)[0]
    finally:
        process.kill()
    return process.returncode, output, time.monotonic() - start


@pytest.mark.slow
@pytest.mark.parametrize(("script", "said"), [(IN_MAIN, "Interrupted"), (IN_THREAD, "results so far")])
def test_a_program_that_runs_is_left(script, said):
    code, output, seconds = interrupted(script)
    assert code == INTERRUPTED
    assert said in output
    assert seconds < MOST


@pytest.mark.slow
def test_what_hears_is_not_ended():
    code, output, _ = interrupted(HEARD, times=2)
    assert code == 0
    assert output.splitlines()[-1] == "done"


def test_results_and_errors_of_the_calls():
    with AbandonableExecutor(2) as pool:
        assert sorted(pool.map(lambda x: x * x, range(5))) == [0, 1, 4, 9, 16]
        assert isinstance(pool.submit(int, "x").exception(), ValueError)
        assert pool.submit(threading.get_ident).result() != threading.get_ident()


def test_waiting_calls_are_cancelled():
    begun, go = threading.Event(), threading.Event()
    pool = AbandonableExecutor(1)

    def call():
        begun.set()
        go.wait()

    running, waiting = pool.submit(call), pool.submit(call)
    begun.wait()
    pool.shutdown(wait=False, cancel_futures=True)
    assert waiting.cancelled()
    assert not running.done()
    go.set()
    running.result(timeout=MOST)


@pytest.mark.parametrize("module", ["gmwm_jax", "nav_jax"])
@pytest.mark.parametrize("after", [0.0, 0.4])
def test_a_command_line_is_left_while_it_imports(tmp_path, module, after):
    """Importing JAX and the rest takes more than a second; no traceback of whatever was being imported is shown."""
    arguments = {"gmwm_jax": ["units", "1", "deg/h", "rad/s"], "nav_jax": ["inspect", "none.toml"]}[module]
    program = (
        HEARS
        + "set_handler = signal.signal\n"
        + "signal.signal = lambda *a: (set_handler(*a), print('begins', flush=True))[0]\n"  # from here on it is heard
        + f"import sys, runpy; sys.argv[1:] = {arguments}; runpy.run_module({module!r}, run_name='__main__')"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "begins\n"
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    start = time.monotonic()
    stdout, stderr = process.communicate(timeout=MOST)
    assert time.monotonic() - start < 5
    assert (process.returncode, stdout, stderr) == (INTERRUPTED, "", "Interrupted: nothing was done.\n")
