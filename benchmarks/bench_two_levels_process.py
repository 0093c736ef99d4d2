"""Two levels on one example, as a process of its own, for bench_two_levels.py. Arguments: its name, and runs."""

import json
import os
import sys
import time

sys.path[:0] = [os.getcwd(), "benchmarks"]

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np
from level_cases import CASES

import nav_jax as nj
from nav_jax.simulation.levels import STATISTICS

COVERED = ("position", "attitude", "nees")
KEYS, PATIENCE = 40, 1.5


def main() -> None:
    if sys.argv[1] == "names":
        print(json.dumps(list(CASES)))
        return
    (scenario, truth, filters), num_runs = CASES[sys.argv[1]](), int(sys.argv[2])

    def two(seed: int) -> tuple[float, nj.simulation.TwoLevel]:
        start = time.perf_counter()
        found = nj.simulation.two_level(scenario, truth, filters, num_runs=num_runs, key=jax.random.key(seed))
        return time.perf_counter() - start, found

    two(1)
    span, found = two(2)
    spans = []
    for seed in (3, 4):
        start = time.perf_counter()
        own = nj.compare(scenario, truth, filters, num_runs=num_runs // 2, key=jax.random.key(seed))
        spans.append(time.perf_counter() - start)
    k, apart, ratio = found.own.epoch(), [], []
    for name in filters:
        good = own[name].good
        for of in COVERED:
            value, mean = STATISTICS[of](own[name])[:, k], found.mean(name, of)
            value = value if len(value) == np.count_nonzero(good) else value[good]
            se = np.hypot(mean.se[k], value.std(ddof=1) / len(value) ** 0.5)
            apart.append(abs(mean.value[k] - value.mean()) / se)
        ratio += [found.mean(name, of).ratio[k] for of in ("position", "nees")]
    answer = {
        "cheap": "none" if found.cheap == "shared" and found.num_own == found.num_runs else found.cheap,
        "own": found.num_own,
        "ratio": float(np.nanmax(ratio)),
        "two": span,
        "all": 2 * min(spans),
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
