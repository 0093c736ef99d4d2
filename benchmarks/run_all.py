"""Run every benchmark in a process of its own, rewrite results/ and the table in README.md.

``.venv/bin/python benchmarks/run_all.py [--quick]``: a quick run writes nothing. About ten minutes on two idle cores.
"""

import json
import subprocess
import sys
from pathlib import Path

from common import RESULTS, about, markdown

HERE = Path(__file__).resolve().parent
NAMES = (
    "wavelet",
    "robust",
    "fit",
    "first",
    "process",
    "bmx055",
    "coverage",
    "bootstrap",
    "intervals",
    "selection",
    "records",
    "regression",
    "nav",
    "scale",
    "two_levels",
    "earth",
    "drive",
    "lincov",
    "design",
    "tuning",
    "app",
)
BEGIN, END = "<!-- table: run_all.py -->", "<!-- end -->"


def main() -> None:
    for name in NAMES:
        subprocess.run([sys.executable, HERE / f"bench_{name}.py", *sys.argv[1:]], check=True)
    if "--quick" not in sys.argv:
        write_table()


def write_table() -> None:
    """Put the rows of all results into the README."""
    files = [RESULTS / f"{name}.json" for name in NAMES]
    records = {file.stem: json.loads(file.read_text()) for file in files if file.exists()}
    rows = [list(bar.values()) for record in records.values() for bar in record["bars"]]
    machines = "\n".join(f"- `{name}`: {about(record['machine'])}" for name, record in records.items())
    readme = HERE / "README.md"
    text = readme.read_text()
    before, after = text[: text.index(BEGIN)], text[text.index(END) :]
    table = markdown(["task", "bar", "measured", "peer", "ratio"], rows)
    readme.write_text(f"{before}{BEGIN}\n{table}\n\n{machines}\n{after}")


if __name__ == "__main__":
    main()
