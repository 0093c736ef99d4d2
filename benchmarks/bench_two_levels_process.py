"""Two levels on one example, as a process of its own, for bench_two_levels.py. Arguments: its name, and runs."""

import json
import os
import sys
import time
from collections.abc import Callable
from typing import Any

sys.path[:0] = [os.getcwd(), "benchmarks"]

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np
from level_cases import CASES

import nav_jax as nj
from nav_jax.simulation.levels import STATISTICS

COVERED = ("position", "attitude", "nees")
CHUNK = 64
KEYS, PATIENCE = 40, 1.5


def main() -> None:
    if sys.argv[1] == "names":
        print(json.dumps(list(CASES)))
        return
    (scenario, truth, filters), num_runs = CASES[sys.argv[1]](), int(sys.argv[2])

    def timed(run: Callable[[], Any]) -> tuple[float, Any]:
        start = time.process_time()
        found = run()
        return time.process_time() - start, found

    def two(seed: int) -> tuple[float, nj.simulation.TwoLevel]:
        key = jax.random.key(seed)
        return timed(lambda: nj.simulation.two_level(scenario, truth, filters, num_runs=num_runs, key=key))

    def with_own(seed: int, count: int) -> tuple[float, nj.simulation.Comparison]:
        how = {"num_runs": count, "key": jax.random.key(seed), "chunk_size": CHUNK}
        return timed(lambda: nj.compare(scenario, truth, filters, **how))

    two(1)
    span, found = two(2)
    own = with_own(3, num_runs // 2)[1]
    each = with_own(4, 4 * CHUNK)[0] / (4 * CHUNK)
    k, apart, ratio = found.own.epoch(), [], []
    for name in filters:
        good = own[name].good
        for of in COVERED:
            value, mean = STATISTICS[of](own[name])[good, k], found.mean(name, of)
            se = np.hypot(mean.se[k], value.std(ddof=1) / len(value) ** 0.5)
            apart.append(abs(mean.value[k] - value.mean()) / se)
        ratio += [found.mean(name, of).ratio[k] for of in ("position", "nees")]
    answer = {
        "cheap": "none" if found.cheap == "shared" and found.num_own == found.num_runs else found.cheap,
        "own": found.num_own,
        "ratio": float(np.nanmax(ratio)),
        "two": span,
        "all": num_runs * each,
        "apart": float(np.nanmax(apart)),
        "cover": None,
    }
    if span < PATIENCE:
        many = [two(10 + i)[1] for i in range(KEYS)]
        inside = []
        for name in filters:
            for of in COVERED:
                means = [f.mean(name, of) for f in many]
                value = np.array([float(m.value[k]) for m in means])
                half = np.array([float(f.half_width(m.se[k])) for m, f in zip(means, many, strict=True)])
                # a mean of all has a part of each in it
                inside.append(np.abs(value - value.mean()) < half * (1 - 1 / KEYS) ** 0.5)
        answer["cover"] = float(np.mean(inside))
    print(json.dumps(answer))


if __name__ == "__main__":
    main()
