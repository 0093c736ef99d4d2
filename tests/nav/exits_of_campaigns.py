"""A program: two chunks of a campaign whose process ends after each file operation; prints how many there are."""

import os
import sys
import warnings
from pathlib import Path

from exits import after_each
from nav.campaigns import campaign, files_of

from gmwm_jax._internal.executors import InThisThread
from nav_jax.campaign import tasks
from nav_jax.campaign.store import Store

NUM_CHUNKS = 2


def whole(store):
    """Chunks that have a checksum."""
    return {int(file.name) for file in store.glob("scenarios/drive/done/c/*[0-9]") if file.name.isdigit()}


def found(store):
    """All files but those of writers that have ended before these had their name, or before they had tidied up."""
    left = (".part", ".partial")
    return {
        name: content
        for name, content in files_of(store).items()
        if not any(part.endswith(left) for part in Path(name).parts)
    }


def main(step):
    study = campaign(4 * NUM_CHUNKS, keep="judged")  # fewer arrays, written as all are
    bench = tasks.bench_of(study._specification, "drive")
    arrays, computed = [bench.compute(chunk) for chunk in range(NUM_CHUNKS)], []

    def known(self, chunk):
        computed.append(chunk)
        return arrays[chunk]

    tasks.Bench.compute = known
    frame = Store(Path("none"), study._specification, {"drive": bench.layout}, NUM_CHUNKS)._frame()
    Store._frame = lambda self: frame  # takes most of the time

    def work(store):
        assert study.run(store, executor=InThisThread()).complete

    def go_on(store):
        before = whole(store)
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # nothing of it counts as damage
            work(store)
        assert computed == sorted(set(range(NUM_CHUNKS)) - before), "what was whole was computed again"

    sys.stdout.write(str(after_each(work, go_on, step, found)))


if __name__ == "__main__":
    warnings.filterwarnings("ignore", "os.fork", RuntimeWarning)
    os.chdir(sys.argv[1])
    main(int(sys.argv[2]))
