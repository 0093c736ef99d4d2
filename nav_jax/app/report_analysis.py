"""What the commands budget, design and tune leave behind: tables, JSON, figures, and filters as sections of TOML."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from nav_jax.app.report import write_files
from nav_jax.filter.layout import QUANTITIES
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.noise_models import NoiseModel
from nav_jax.lincov.analysis import Analysis, Covariances
from nav_jax.lincov.budget import Budget
from nav_jax.lincov.derivatives import Sensitivities
from nav_jax.lincov.filter_design import Candidate, Design, judged
from nav_jax.plotting.comparison import plot_comparison
from nav_jax.recorded.tuning import Tuning
from nav_jax.simulation.comparison import Comparison


class Report(NamedTuple):
    """A result in the forms in which it is given away."""

    stem: str
    """Of the names of files."""
    text: str
    content: Mapping[str, Any]
    """What becomes JSON."""
    figures: Mapping[str, Callable[[], Figure]]
    """File name -> how to draw it."""
    section: str | None = None
    """A filter, as text of a configuration."""

    @property
    def json(self) -> str:
        """The content; None where there is no number."""
        return json.dumps(_plain(self.content), indent=1, allow_nan=False)

    def write(self, folder: Path, *, plot: bool) -> list[str]:
        """Write all of it into a folder, made if it is not there; returns the names of the files."""
        texts = {f"{self.stem}.txt": self.text, f"{self.stem}.json": self.json}
        if self.section is not None:
            texts[f"{self.stem}.toml"] = self.section
        return write_files(folder, texts, self.figures.items() if plot else ())


def budget_report(analysis: Analysis, name: str, budget: Budget, sensitivities: Sensitivities) -> Report:
    """All filters, and of one of them what makes its error and which parameter matters."""
    k = budget.epoch()
    content = {
        "reference": analysis.reference,
        "truth": analysis.truth,
        "time": float(budget.time[k]),
        "filters": {n: _errors_at(c) for n, c in analysis.items()},
        "filter": name,
        "rms": {q: float(x[k]) for q, x in sensitivities.rms.items()},
        "shares": {s: {q: float(budget.share(q)[i, k]) for q in QUANTITIES} for i, s in enumerate(budget.sources)},
        "derivatives": [
            {"parameter": p, "of": side, **{q: float(sensitivities.derivative[q][k, i]) for q in QUANTITIES}}
            for i, (p, side) in enumerate(zip(sensitivities.names, sensitivities.sides, strict=True))
        ],
    }
    text = f"{analysis!r}\n\n{name}: {budget!r}\n\n{name}: {sensitivities!r}"
    figures = {"analysis.png": analysis.plot, "budget.png": budget.plot, "sensitivities.png": sensitivities.plot}
    return Report("budget", text, content, figures)


def design_report(design: Design, best: Candidate, confirmed: Comparison | None) -> Report:
    """All structures, the best filter, and its Monte Carlo if there is one."""
    section = filter_section("designed", best.errors, f"{best.name}: {best.num_states} sensor states")
    on_front = {id(c) for c in design.pareto}
    content = {
        "objective": design.objective,
        "truth": repr(design.truth),
        "right": _judged(design.right),
        "best": best.name,
        "candidates": [
            {
                "name": c.name,
                "num_accel": c.num_accel,
                "num_gyro": c.num_gyro,
                "num_states": c.num_states,
                "pareto": id(c) in on_front,
                "converged": c.converged,
                "designed": {"loss": c.loss, **_judged(c.covariances), "filter": _keys(c.errors)},
                "truncated": None
                if c.naive is None
                else {"loss": c.loss_naive, **_judged(c.covariances_naive), "filter": _keys(c.naive)},
            }
            for c in design.candidates
        ],
    }
    text = f"{design!r}\n\n{section}"
    figures: dict[str, Callable[[], Figure]] = {"design.png": design.plot}
    if confirmed is not None:
        text = f"{text}\n\nMonte Carlo of the best filter\n{confirmed!r}"
        if confirmed.num_common >= 2:
            content["confirmed"] = confirmed.table().to_list()
            figures["confirmed.png"] = lambda: plot_comparison(confirmed)
    return Report("design", text, content, figures, section)


def tuning_report(tuning: Tuning) -> Report:
    """The parameters before and after, and the tuned filter."""
    section = filter_section("tuned", tuning.errors, "by the innovations of a record")
    columns = ("start", "value", "se", "ci_low", "ci_high", "sought", "lost", "observable")
    rows = zip(tuning.names, *(getattr(tuning, c).tolist() for c in columns), strict=True)
    content = {
        "converged": tuning.converged,
        "level": tuning.level,
        "num_innovations": tuning.num_innovations,
        "log_likelihood_gain": tuning.loss_start - tuning.loss,
        "parameters": [dict(zip(("name", *columns), row, strict=True), held=row[0] in tuning.held) for row in rows],
        "aiding": {s.name: dict(zip(s.axes, np.asarray(s.believed).tolist(), strict=True)) for s in tuning.aiding},
        "filter": _keys(tuning.errors),
    }
    return Report("tuning", f"{tuning!r}\n\n{section}", content, {"tuning.png": tuning.plot}, section)


def filter_section(name: str, errors: ImuErrors, comment: str) -> str:
    """A filter as a section of a configuration, with all digits."""
    lines = [f"{key} = {_toml(value)}" for key, value in _keys(errors).items()]
    return "\n".join([f"[filters.{name}]  # {comment}", *lines])


def _keys(errors: ImuErrors) -> dict[str, Any]:
    """Keys of a section of a configuration."""
    keys: dict[str, Any] = {}
    for sensor, first in (("accel", 0), ("gyro", 3)):
        texts = [_model_text(m) for m in errors.models[first : first + 3]]
        keys[sensor] = texts[0] if len(set(texts)) == 1 else dict(zip("xyz", texts, strict=True))
    keys["rate"] = errors.rate
    for sensor, sd in (("accel", errors.bias_sd[:3]), ("gyro", errors.bias_sd[3:])):
        if np.any(np.asarray(sd)):
            keys[f"{sensor}_bias_sd"] = np.asarray(sd).tolist()
    if errors.start != "stationary":
        keys["start"] = errors.start
    return keys


def _model_text(model: NoiseModel) -> str:
    """As `gmwm_jax.parse_model` reads it; its repr has fewer digits."""
    terms = []
    for process in model.processes:
        names = (p.name for p in process.parameters)
        values = (f"{name}={float(value)!r}" for name, value in zip(names, process.values, strict=True))
        terms.append(f"{process.kind}({', '.join(values)})")
    return " + ".join(terms)


def _toml(value: Any) -> str:
    """A text, a number, a list or a table in one line."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {_toml(v)}' for key, v in value.items())} }}"
    return json.dumps(value)


def _errors_at(c: Covariances) -> dict[str, float]:
    """True and claimed errors of a filter at the judged epoch, and how consistent they are."""
    k = c.epoch()
    errors = {}
    for block in ("position", "velocity", "attitude"):
        errors |= {f"{block}_rms": float(c.rms(block)[k]), f"{block}_claimed": float(c.rms_claimed(block)[k])}
        errors |= {
            f"{block}_nees_over_dof": float(c.nees(block)[k] / 3),
            f"{block}_coverage": float(c.coverage(block)[k]),
        }
    return errors


def _judged(covariances: tuple[Covariances, ...]) -> dict[str, float]:
    return dict(zip(("position_rms", "position_claimed", "nees_over_dof"), judged(covariances), strict=True))


def _plain(value: Any) -> Any:
    """None for what is no number."""
    if isinstance(value, Mapping):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
