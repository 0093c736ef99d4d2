"""A program: two chunks of a bootstrap whose process ends after each file operation; prints how many there are."""

import os
import sys
import warnings
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

from exits import after_each  # noqa: E402
from programs import fitted  # noqa: E402

import gmwm_jax as gj  # noqa: E402
from gmwm_jax._internal.parts import Parts  # noqa: E402
from gmwm_jax._internal.states import to_state  # noqa: E402
from gmwm_jax.inference import bootstrapping  # noqa: E402

FIRSTS = (0, 64)


def found(store):
    """All files; what a killed writer has left is in folders of its own, which the next one of the file removes."""
    return {file.name: file.read_bytes() for file in Path(store).iterdir() if file.is_file()}


def main(step):
    fit, of_source = fitted(), []
    stated = bootstrapping.specification_of

    def specification_of(source, numbers):
        of_source.append((source, stated(source, numbers)))
        return of_source[-1][1]

    bootstrapping.specification_of = specification_of
    gj.bootstrap(fit, 64, key=jax.random.key(3), store="asked")
    source, specification = of_source[0]
    tasks = [(first, first + 64) for first in FIRSTS]
    results = {bootstrapping._name(task): to_state(source.replicates(*task)) for task in tasks}

    def work(store):
        parts = Parts(store, "bootstrap", specification)
        for name, result in results.items():
            if parts.read(name) is None:
                parts.write(name, result)

    def go_on(store):
        before = {file: file.stat().st_mtime_ns for file in Path(store).glob("*.npz")}
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # nothing of it counts as damage
            work(store)
        assert {file: file.stat().st_mtime_ns for file in before} == before, "what was whole was written again"

    sys.stdout.write(str(after_each(work, go_on, step, found)))


if __name__ == "__main__":
    warnings.filterwarnings("ignore", "os.fork", RuntimeWarning)
    os.chdir(sys.argv[1])
    main(int(sys.argv[2]))
