"""One comparison as a whole process: import, compile, 500 runs of each of three filters, table. For bench_nav.py."""

import json
import sys
import time

start = time.perf_counter()

import jax

jax.config.update("jax_enable_x64", True)

from nav_case import FILTERS, errors, options, scenario

from nav_jax import compare


def main() -> None:
    num_runs, gains, every = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
    comparison = compare(scenario(every=every), errors(), FILTERS, **options(num_runs), gains=gains)
    print(comparison)
    print(json.dumps({"seconds": time.perf_counter() - start, "runs": comparison.num_common}))


if __name__ == "__main__":
    main()
