"""Seconds of a run of 75 s over a flat Earth and WGS-84, with 24 states and with 60, for bench_earth.py.

Arguments: whether loops are compiled as a whole, runs, and turns. Cases go in turns; of each the best is printed.
"""

import json
import os
import sys
import time
from dataclasses import replace

fast, num_runs, turns = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
if fast == "fast":
    os.environ["XLA_FLAGS"] = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=1000000000"

import jax

jax.config.update("jax_enable_x64", True)

from nav_case import aiding, errors, scenario

import nav_jax as nj
from nav_jax.imu import GSensitivity, Misalignment, ScaleFactor

CALIBRATED = errors(accel_bias_sd=1e-2, gyro_bias_sd=1e-4).adding(
    ScaleFactor(1e-3, 1e-3), Misalignment(1e-3, 1e-3), GSensitivity(1e-6)
)
"""24 states, and of the sensors 6 biases, 6 scale factors, 12 angles and 9 sensitivities: 57; a lever arm makes 60."""
EARTHS = {"flat": None, "WGS-84": nj.Wgs84([0.81, 0.115, 500.0])}
CASES = [(24, "estimate", 1), (24, "estimate", 10), (24, "reference", 1), (60, "estimate", 1)]


def main() -> None:
    best: dict[str, tuple[float, float]] = {}
    for turn in range(turns + 1):  # the first compiles
        for states, gains, every in CASES:
            for name, earth in EARTHS.items():
                where, believed = scenario(75.0, every, earth), errors()
                if states == 60:
                    where = replace(where, aiding=aiding(75.0, lever_arm_sd=0.1))
                    believed = CALIBRATED
                cpu, wall = time.process_time(), time.perf_counter()
                nj.monte_carlo(where, believed, num_runs=num_runs, key=jax.random.key(1), gains=gains, workers=1)
                spans = (time.process_time() - cpu) / num_runs, (time.perf_counter() - wall) / num_runs
                if turn:
                    case = json.dumps([states, gains, every, name])
                    best[case] = min(spans, best.get(case, spans))
    print(json.dumps([[*json.loads(case), *spans] for case, spans in best.items()]))


if __name__ == "__main__":
    main()
