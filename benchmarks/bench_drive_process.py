"""A real drive as a process of its own, for bench_drive.py: seconds of imports, of a first call and of a later one.

Arguments: samples in a covariance step, whether loops are compiled as a whole, and whether outages are studied.
"""

import json
import os
import sys
import time
from pathlib import Path

every, fast, study = sys.argv[1:]
if fast == "fast":
    os.environ["XLA_FLAGS"] = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=1000000000"
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
start = time.perf_counter()

import jax

jax.config.update("jax_enable_x64", True)

from nav import real_drives

import nav_jax as nj


def main() -> None:
    imu, fixes, filter, options = real_drives.roof()
    options["every"] = int(every)
    told = {"read": time.perf_counter() - start, "seconds": imu.epochs[-1] - imu.epochs[0]}
    if study == "study":
        schedules = [[(float(a), a + 15.0) for a in range(b, b + 421, 60)] for b in (60, 90)]
        found = nj.recorded.outage_study(imu, fixes, filter, schedules, **options)
        told |= {"median": found.median, "rms": found.rms, "nees": found.mean_nees, "outages": len(found.start)}
    else:
        spans = []
        for _ in range(4):
            begin = time.perf_counter()
            found = nj.navigate(imu, fixes, filter, **options)
            spans.append(time.perf_counter() - begin)
        told |= {"first": spans[0], "later": min(spans[1:])}
    print(json.dumps(told))


if __name__ == "__main__":
    main()
