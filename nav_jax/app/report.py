"""What a comparison leaves behind: tables as text and JSON, and figures."""

import json
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from gmwm_jax._internal.atomic import write_atomically
from nav_jax.plotting.comparison import plot_comparison, plot_consistency, plot_mean_errors, plot_nis
from nav_jax.plotting.runs import plot_errors, plot_realisations, plot_sensor_states
from nav_jax.plotting.trajectory import plot_trajectory
from nav_jax.simulation.comparison import Comparison

STEM = "comparison"
"""Of the names of the files."""

TEXT, CONTENT = f"{STEM}.txt", f"{STEM}.json"


def as_text(comparison: Comparison) -> str:
    """The ranking, and of each model its errors beside what the filter says of them."""
    return "\n\n".join([repr(comparison), *(repr(r) for r in comparison.runs.values())])


def as_json(comparison: Comparison) -> str:
    """The ranking as JSON; None where there is no number."""
    table = comparison.table() if comparison.num_common >= 2 else None
    content = {
        "reference": comparison.reference.name,
        "truth": comparison.truth,
        "time": None if table is None else table.time,
        "num_common": comparison.num_common,
        "level": None if table is None else table.level,
        "ranking": [] if table is None else table.to_list(),
        "models": {
            name: {
                "num_runs": len(r),
                "num_requested": r.num_requested,
                "num_failed": r.num_failed,
                "outages": {sensor: list(map(list, ends)) for sensor, ends in r.outages.items()},
                "notes": list(r.notes),
            }
            for name, r in comparison.runs.items()
        },
    }
    return json.dumps(content, indent=1, allow_nan=False)


def write_report(comparison: Comparison, folder: Path, *, plot: bool = True) -> list[str]:
    """Write all of it into a folder, made if it is not there; returns the names of the files.

    Figures are drawn where there are two or more runs in which no model failed.
    """
    texts = {TEXT: as_text(comparison), CONTENT: as_json(comparison)}
    return write_files(folder, texts, _figures(comparison) if plot and comparison.num_common >= 2 else ())


def write_files(
    folder: Path, texts: Mapping[str, str], figures: Iterable[tuple[str, Callable[[], Figure]]]
) -> list[str]:
    """Write texts and figures by the names of their files into a folder; returns these names."""
    for name, text in texts.items():
        write_atomically(folder / name, lambda file, text=text: file.write(f"{text.rstrip()}\n".encode()))
    drawn = []
    for name, draw in figures:
        figure = draw()
        write_atomically(folder / name, lambda file, figure=figure: figure.savefig(file, format="png", dpi=120))
        drawn.append(name)
    return [*texts, *drawn]


def _figures(comparison: Comparison) -> Iterable[tuple[str, Callable[[], Figure]]]:
    """File name and how to draw it."""
    reference, runs = comparison.reference, comparison.runs
    yield "comparison.png", lambda: plot_comparison(comparison)
    yield "trajectory.png", lambda: plot_trajectory(reference)
    yield "mean_errors.png", lambda: plot_mean_errors(comparison, log=True)
    yield "consistency.png", lambda: plot_consistency(comparison)
    if any(len(times) for r in runs.values() for times in r.nis_time.values()):
        yield "innovations.png", lambda: plot_nis(comparison)
    for name, r in zip(_plain(runs), runs.values(), strict=True):
        if r.num_good:
            yield f"realisations_{name}.png", lambda r=r: plot_realisations(r, reference)
            yield f"errors_{name}.png", lambda r=r: plot_errors(r, blocks=("position", "attitude"))
            yield f"sensor_states_{name}.png", lambda r=r: plot_sensor_states(r)


def _plain(names: Iterable[Any]) -> list[str]:
    """Names that a file may have, each once."""
    plain: list[str] = []
    for name in names:
        short = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "model"
        plain.append(short if short not in plain else f"{short}_{len(plain) + 1}")
    return plain
