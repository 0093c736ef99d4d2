"""How many threads XLA has on a CPU.

A loop in a program holds threads of XLA's pool while others of the pool do what is in the loop (jaxlib 0.10), and the
pool has one for each core. Two programs that loop, started by two Python threads, may hold all of a small pool and wait
for ever: two fits with their intervals did within seconds with pools of 2 to 4 threads. With 16, eight at a time came
to their ends, as fast as with two.
"""

import os

_NAME = "NPROC"
"""The variable by which XLA takes the size of its pool, in place of the number of cores."""
_ENOUGH = 16


def have_enough_threads() -> None:
    """Let XLA have enough threads, where the machine has fewer cores; what the environment says stands.

    To be called before JAX computes anything, which is when it reads the variable.
    """
    if (os.cpu_count() or 1) < _ENOUGH:
        os.environ.setdefault(_NAME, str(_ENOUGH))
