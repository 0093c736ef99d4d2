"""What the benchmarks share: timers, fresh processes with their peak memory, the record of the machine, tables.

It imports neither JAX nor the package, so that a benchmark of fresh processes stays small itself.
"""

import argparse
import gc
import importlib.metadata
import json
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"
RESULTS = Path(__file__).resolve().parent / "results"
_PACKAGES = ("jax", "jaxlib", "equinox", "optimistix", "numpy", "scipy", "allantools", "matplotlib")


# -- time -------------------------------------------------------------------------------------------------------------


class Timing(NamedTuple):
    """Seconds: the first call (it compiles), and the later ones."""

    first: float
    median: float
    lowest: float
    highest: float

    def __str__(self) -> str:
        return f"{seconds(self.median)} ({seconds(self.lowest)} .. {seconds(self.highest)})"


def timed(function: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds until the result is there, and the result."""
    start = time.perf_counter()
    result = function()
    if "jax" in sys.modules:
        sys.modules["jax"].block_until_ready(result)
    return time.perf_counter() - start, result


def interleaved(functions: Mapping[str, Callable[[], Any]], repeats: int = 5) -> dict[str, Timing]:
    """Time each function once (warm-up), then all of them in turn, A B A B ..., so that other load hits all alike."""
    first = {name: timed(f)[0] for name, f in functions.items()}
    runs: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(repeats):
        for name, f in functions.items():
            gc.collect()
            runs[name].append(timed(f)[0])
    return {name: Timing(first[name], statistics.median(r), min(r), max(r)) for name, r in runs.items()}


def repeated(function: Callable[[], Any], repeats: int = 5) -> Timing:
    """Time one function: the first call, and the median of the later ones."""
    return interleaved({"": function}, repeats)[""]


class Compiled:
    """How often XLA compiled, and for how long: read before and after, or as a context that counts from zero."""

    def __init__(self) -> None:
        self.count, self.seconds = 0, 0.0

    def _listen(self, event: str, duration: float, **_: Any) -> None:
        if event == "/jax/core/compile/backend_compile_duration":
            self.count, self.seconds = self.count + 1, self.seconds + duration


@contextmanager
def compilations() -> Iterator[Compiled]:
    """Count what is compiled inside."""
    import jax

    counter = Compiled()
    jax.monitoring.register_event_duration_secs_listener(counter._listen)
    try:
        yield counter
    finally:
        jax.monitoring.unregister_event_duration_listener(counter._listen)


# -- fresh processes --------------------------------------------------------------------------------------------------


class Process(NamedTuple):
    """A process that ran to its end."""

    wall: float
    cpu: float
    """User + system: what the wall time would be on one core, and hardly depends on what else runs."""
    peak_mib: float
    stdout: str

    @property
    def answer(self) -> Any:
        """The JSON on its last line."""
        return json.loads(self.stdout.strip().splitlines()[-1])


# Linux counts the memory of the parent at the fork into ru_maxrss of the child: a parent of 10 MiB stands between.
_LAUNCHER = """
import json, os, sys, time
start = time.perf_counter()
pid = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ)
_, status, usage = os.wait4(pid, 0)
wall = time.perf_counter() - start
print()
cpu = usage.ru_utime + usage.ru_stime
print(json.dumps([wall, cpu, usage.ru_maxrss / 1024, os.waitstatus_to_exitcode(status)]))
"""


def fresh(*arguments: str | Path) -> Process:
    """Run ``python arguments...`` in the project root as a fresh process without JAX's persistent cache."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")}
    command = [sys.executable, "-S", "-c", _LAUNCHER, sys.executable, *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    stdout, _, last = done.stdout.rstrip().rpartition("\n")
    wall, cpu, peak, code = json.loads(last) if done.returncode == 0 else (0.0, 0.0, 0.0, done.returncode)
    if code != 0:
        raise RuntimeError(f"{' '.join(map(str, arguments))} ended with {code}:\n{done.stderr}")
    return Process(wall, cpu, peak, stdout)


def median_process(processes: Sequence[Process]) -> Process:
    """The one whose wall time is the median."""
    return sorted(processes, key=lambda p: p.wall)[len(processes) // 2]


# -- the report -------------------------------------------------------------------------------------------------------


def seconds(x: float) -> str:
    """A duration with its unit."""
    for size, unit in ((1.0, "s"), (1e-3, "ms")):
        if x >= size:
            return f"{x / size:.3g} {unit}"
    return f"{x / 1e-6:.3g} us"


def markdown(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """An aligned markdown table."""
    cells = [[str(c) for c in row] for row in (head, *rows)]
    width = [max(len(row[i]) for row in cells) for i in range(len(head))]
    lines = ["| " + " | ".join(c.ljust(w) for c, w in zip(row, width, strict=True)) + " |" for row in cells]
    return "\n".join([lines[0], "|" + "|".join("-" * (w + 2) for w in width) + "|", *lines[1:]])


def machine() -> dict[str, Any]:
    """Where and with what this ran."""
    model = "unknown"
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), model)
    git = ["git", "-C", str(ROOT), "describe", "--always", "--dirty=+"]
    commit = subprocess.run(git, capture_output=True, text=True).stdout.strip()
    return {
        "commit": commit or "unknown",
        "cpu": model,
        "cores": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": f"{platform.system()} {platform.release().split('-')[0]}",
        "python": platform.python_version(),
        "packages": {name: importlib.metadata.version(name) for name in _PACKAGES},
        "load_at_start": round(os.getloadavg()[0], 2),
    }


def about(m: Mapping[str, Any]) -> str:
    """The record of the machine as a sentence."""
    packages = ", ".join(f"{k} {v}" for k, v in m["packages"].items())
    return (
        f"Commit {m['commit']} (+: with changes); "
        f"{m['cpu']}, {m['cores']} cores, {m['memory_gib']} GiB, {m['system']}, "
        f"Python {m['python']}, {packages}; load {m['load_at_start']} at the start, {m['load_at_end']} at the end "
        "(over one minute, the benchmark's own included)."
    )


class Report:
    """Prints tables as they are made; `save` writes them as markdown and JSON (a quick run saves nothing)."""

    def __init__(self, name: str, what: str):
        parser = argparse.ArgumentParser(description=what)
        parser.add_argument("--quick", action="store_true", help="small sizes, few repeats, nothing is written")
        self.quick: bool = parser.parse_args().quick
        self.name, self.machine, self.bars, self.tables = name, machine(), [], []
        self.text = [f"# {name}", "", what.strip()]
        print("\n".join(self.text), flush=True)

    def table(self, title: str, head: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
        """Add a table."""
        self.tables.append({"title": title, "head": list(head), "rows": [[str(c) for c in row] for row in rows]})
        self.say(f"## {title}", markdown(head, rows))

    def say(self, *paragraphs: str) -> None:
        """Add text."""
        for paragraph in paragraphs:
            self.text += ["", paragraph]
            print(f"\n{paragraph}", flush=True)

    def bar(self, task: str, bar: str, measured: str, peer: str = "", ratio: str = "") -> None:
        """Add a row to the table of the README."""
        self.bars.append({"task": task, "bar": bar, "measured": measured, "peer": peer, "ratio": ratio})

    def save(self) -> None:
        """Write results/name.md and results/name.json."""
        self.machine["load_at_end"] = round(os.getloadavg()[0], 2)
        self.say("## Against the bars", markdown(list(self.bars[0]), [list(b.values()) for b in self.bars]))
        self.say(about(self.machine))
        if not self.quick:
            RESULTS.mkdir(exist_ok=True)
            (RESULTS / f"{self.name}.md").write_text("\n".join(self.text) + "\n")
            record = {"machine": self.machine, "bars": self.bars, "tables": self.tables}
            (RESULTS / f"{self.name}.json").write_text(json.dumps(record, indent=1) + "\n")


def shared(*parts: str) -> Path | None:
    """A file of the reference data beside the project, or None with a message."""
    path = SHARED.joinpath(*parts)
    if path.exists():
        return path
    print(f"Skipped: no {path} (reference data lie outside of the project)")
    return None
