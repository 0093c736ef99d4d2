"""One way to compute runs, as a process of its own, for bench_scale.py: seconds of a first and of later calls.

Arguments: the package's folder, whether loops are compiled as a whole, gains, samples in a covariance step, runs, and
seed. The folder may be that of another commit: what is used of it has been there since the first.
"""

import json
import os
import sys
import time

folder, fast, gains, every, num_runs, seed = sys.argv[1:]
sys.path[:0] = [folder, f"{folder}/benchmarks"]  # the case of that commit, too
if fast == "fast":
    os.environ["XLA_FLAGS"] = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=1000000000"

import jax

jax.config.update("jax_enable_x64", True)

from nav_case import errors, scenario

import nav_jax as nj


def main() -> None:
    where, truth = scenario(every=int(every)), errors()
    spans, values = [], {}
    for _ in range(3 if int(num_runs) <= 200 else 2):
        start = time.perf_counter()
        options = {"num_runs": int(num_runs), "key": jax.random.key(int(seed)), "gains": gains}
        found = nj.compare(where, truth, {"filter": truth}, **options)
        spans.append(time.perf_counter() - start)
    if gains == "two-level":
        k = found.shared.epoch()
        values = {"num_own": found.num_own}
        for of in ("position", "nees"):
            mean = found.mean("filter", of)
            values[of] = [float(v[k]) for v in (mean.value, mean.se, mean.correction, mean.correction_se)]
    elif int(num_runs) > 200:
        runs = found["filter"]
        k = runs.epoch()
        length = (runs.errors("position")[:, k] ** 2).sum(axis=1) ** 0.5
        for of, x in (("position", length), ("nees", runs.nees["pose"][:, k] / runs.dof["pose"])):
            values[of] = [float(x.mean()), float(x.std(ddof=1) / len(x) ** 0.5)]
    print(json.dumps({"first": spans[0], "later": min(spans[1:]), **values}))


if __name__ == "__main__":
    main()
