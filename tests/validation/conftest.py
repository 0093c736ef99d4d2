"""What is estimated from draws is judged by a band and written down: `make validate` leaves a table of all of it."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from validation.long import left_out

ROOT = Path(__file__).resolve().parents[2]
JUDGED = "judged"


def pytest_addoption(parser):
    parser.addoption("--record", metavar="PATH", help="write every statistic with its band, as JSON")
    parser.addoption("--short", action="store_true", help="leave out what tests/validation/long.py names")


def pytest_collection_modifyitems(config, items):
    """With --short; a file of which single tests were chosen is looked at as it is."""
    if config.getoption("--short"):
        out = left_out([item.nodeid for item in items])
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid in out])
        items[:] = [item for item in items if item.nodeid not in out]


def bound(value):
    """A number that JSON has; none where there is no bound."""
    return None if np.isinf(value) else float(f"{value:.4g}")


@pytest.fixture
def judge(request):
    """Assert that statistics lie in their band, and remember how far they reach, for the record."""

    def in_band(statistic, values, low, high, *, num_draws):
        values = np.asarray(values, dtype=float)
        seen = [float(np.min(values)), float(np.max(values))]
        row = {
            "statistic": statistic,
            "seen": [bound(v) for v in seen],
            "band": [bound(low), bound(high)],
            "draws": int(num_draws),
        }
        request.node.user_properties.append((JUDGED, row))
        assert low <= seen[0], f"{statistic}: {seen[0]:.4g} is below its band {low:.4g} .. {high:.4g}"
        assert seen[1] <= high, f"{statistic}: {seen[1]:.4g} is above its band {low:.4g} .. {high:.4g}"

    return in_band


class Recorder:
    """Gathers the judgements of all workers and writes them, sorted, so that a new table differs where numbers do."""

    def __init__(self, path):
        self.path, self.rows = Path(path), []

    def pytest_runtest_logreport(self, report):
        if report.when == "call":
            judged = [row for name, row in report.user_properties if name == JUDGED]
            self.rows += [{"test": report.nodeid, "outcome": report.outcome, **row} for row in judged]

    def pytest_sessionfinish(self):
        git = ["git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
        commit = subprocess.run(git, cwd=ROOT, capture_output=True, text=True).stdout.strip() or "unknown"
        rows = sorted(self.rows, key=lambda row: (row["test"], row["statistic"]))
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_text(json.dumps({"commit": commit, "statistics": rows}, indent=1, ensure_ascii=False) + "\n")


def pytest_configure(config):
    path = config.getoption("--record")
    if path and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Recorder(path), "recorder")
