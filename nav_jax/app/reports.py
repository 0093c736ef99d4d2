"""What the commands leave behind: tables as text and JSON, figures, and filters as sections of TOML.

One function for each kind of result makes a `Report`, and the report prints and writes itself.
"""

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomli_w
from matplotlib.figure import Figure

from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax.units import STANDARD_GRAVITY
from nav_jax.campaign.results import Statistics
from nav_jax.filter.layout import JUDGED, QUANTITIES
from nav_jax.imu.channels import CHANNELS
from nav_jax.imu.deterministic import DETERMINISTIC
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.noise_models import NoiseModel
from nav_jax.lincov.analysis import Analysis, Covariances
from nav_jax.lincov.budget import Budget
from nav_jax.lincov.derivatives import Sensitivities
from nav_jax.lincov.filter_design import Candidate, Design, judged
from nav_jax.plotting.campaign import plot_statistics
from nav_jax.plotting.comparison import plot_comparison, plot_consistency, plot_mean_errors, plot_nis
from nav_jax.plotting.navigation import plot_innovations, plot_sensor_estimates, plot_withheld
from nav_jax.plotting.runs import plot_errors, plot_realisations, plot_sensor_states
from nav_jax.plotting.trajectory import plot_trajectory
from nav_jax.recorded.at_rest import StartAtRest
from nav_jax.recorded.inspection import Inspection
from nav_jax.recorded.motion_noise import NoiseInMotion
from nav_jax.recorded.navigation import Navigation
from nav_jax.recorded.on_the_move import StartOnTheMove
from nav_jax.recorded.study import OutageStudy
from nav_jax.recorded.tuning import Tuning
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.levels import STATISTICS, TwoLevel

COMPARISON = "comparison"
"""Stem of the files of a comparison."""


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
    """A filter, or another part of a configuration, as its text."""

    @property
    def json(self) -> str:
        """The content; None where there is no number."""
        return json.dumps(_numbers_or_none(self.content), indent=1, allow_nan=False)

    def write(self, folder: Path, *, plot: bool = True) -> list[str]:
        """Write all of it into a folder, made if it is not there; returns the names of the files."""
        texts = {f"{self.stem}.txt": self.text, f"{self.stem}.json": self.json}
        if self.section is not None:
            texts[f"{self.stem}.toml"] = self.section
        for name, text in texts.items():
            write_atomically(folder / name, lambda file, text=text: file.write(f"{text.rstrip()}\n".encode()))
        figures = self.figures if plot else {}
        for name, draw in figures.items():
            figure = draw()
            write_atomically(folder / name, lambda file, figure=figure: figure.savefig(file, format="png", dpi=120))
        return [*texts, *figures]


def comparison_report(comparison: Comparison, statistics: Mapping[str, Statistics] | None = None) -> Report:
    """The ranking, and of each model its errors beside what the filter says of them.

    There are a ranking and figures where there are two or more runs in which no model failed. Statistics are those that
    a campaign has of every epoch.
    """
    enough = comparison.num_common >= 2
    table = comparison.table() if enough else None
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
    text = "\n\n".join([repr(comparison), *(repr(r) for r in comparison.runs.values())])
    figures = dict(_comparison_figures(comparison)) if enough else {}
    if enough and statistics is not None:
        figures["statistics.png"] = lambda: plot_statistics(statistics)
    return Report(COMPARISON, text, content, figures)


def two_level_report(found: TwoLevel) -> Report:
    """Means of filters with gains of their own, and what the cheap level (linear runs, or shared gains) leaves out.

    There are means where there are two or more runs of both kinds in which no filter failed.
    """
    k, enough = found.shared.epoch(), found.num_common >= 2
    content = {
        "reference": found.shared.reference.name,
        "truth": found.shared.truth,
        "time": float(next(iter(found.shared.runs.values())).time[k]),
        "cheap": found.cheap,
        "num_runs": found.num_runs,
        "num_own": found.num_own,
        "num_common": found.num_common,
        "models": {
            name: {of: {key: float(v[k]) for key, v in found.mean(name, of)._asdict().items()} for of in STATISTICS}
            for name in (found.with_means if enough else ())
        },
    }
    return Report(COMPARISON, repr(found), content, {"two_levels.png": found.plot} if enough else {})


def _comparison_figures(comparison: Comparison) -> Iterable[tuple[str, Callable[[], Figure]]]:
    """File name and how to draw it."""
    reference, runs = comparison.reference, comparison.runs
    yield "comparison.png", lambda: plot_comparison(comparison)
    yield "trajectory.png", lambda: plot_trajectory(reference)
    if all(len(r.time) == 1 for r in runs.values()):  # a campaign that keeps no others: there is nothing over time
        return
    yield "mean_errors.png", lambda: plot_mean_errors(comparison, log=True)
    yield "consistency.png", lambda: plot_consistency(comparison)
    if any(len(times) for r in runs.values() for times in r.nis_time.values()):
        yield "innovations.png", lambda: plot_nis(comparison)
    for name, r in zip(_file_names(runs), runs.values(), strict=True):
        if r.num_good:
            yield f"realisations_{name}.png", lambda r=r: plot_realisations(r, reference)
            yield f"errors_{name}.png", lambda r=r: plot_errors(r, blocks=("position", "attitude"))
            yield f"sensor_states_{name}.png", lambda r=r: plot_sensor_states(r)


def _file_names(names: Iterable[Any]) -> list[str]:
    """Names that a file may have, each once."""
    plain: list[str] = []
    for name in names:
        short = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "model"
        plain.append(short if short not in plain else f"{short}_{len(plain) + 1}")
    return plain


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
                "designed": {"loss": c.loss, **_judged(c.covariances), "filter": keys_of(c.errors)},
                "truncated": None
                if c.naive is None
                else {"loss": c.loss_naive, **_judged(c.covariances_naive), "filter": keys_of(c.naive)},
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
        "filter": keys_of(tuning.errors),
    }
    return Report("tuning", f"{tuning!r}\n\n{section}", content, {"tuning.png": tuning.plot}, section)


def vibration_report(name: str, found: NoiseInMotion) -> Report:
    """Whether noise at rest holds in motion, and the factors that a configuration takes."""
    columns = ("factor", "ci_low", "ci_high", "ratio", "p")
    rows = zip(CHANNELS, *(getattr(found, c).tolist() for c in columns), strict=True)
    names = ("ratio_of_all", "p_of_all", "window", "num_innovations", "level", "converged")
    content = {
        "filter": name,
        **{key: getattr(found, key) for key in names},
        "axes": [dict(zip(("name", *columns), row, strict=True)) for row in rows],
    }
    accel, gyro = ([float(f"{x:.3g}") for x in of] for of in found.factor.reshape(2, 3))
    section = f"[run]\nvibration = {{ accel = {accel}, gyro = {gyro} }}\n"
    return Report("vibration", f"{name}: {found!r}\n\n{section}", content, {"vibration.png": found.plot}, section)


def outages_report(name: str, study: OutageStudy, notes: Sequence[str]) -> Report:
    """How far off it was at the ends of simulated outages."""
    columns = {"run": study.schedule, "start": study.start, "end": study.end, "error": study.size,
               "claimed": study.claimed, "nees": study.nees / study.error.shape[1]}  # fmt: skip
    rows = zip(*(x.tolist() for x in columns.values()), strict=True)
    content = {
        "filter": name,
        "sensor": study.sensor,
        "unit": study.unit,
        "median": study.median,
        "rms": study.rms,
        "mean_nees": study.mean_nees,
        "nees_band": study.nees_band,
        "outages": [dict(zip(columns, row, strict=True)) for row in rows],
        "notes": list(notes),
    }
    text = "\n".join([f"{name}: {study!r}", *(["", *notes] if notes else [])])
    return Report("outages", text, content, {"outages.png": study.plot})


def inspection_report(inspection: Inspection) -> Report:
    """What is in a record."""
    return Report("inspection", repr(inspection), inspection.to_dict(), {"inspection.png": inspection.plot})


def alignment_report(start: StartAtRest | StartOnTheMove, notes: Sequence[str]) -> Report:
    """The attitude at a start, and the rest of it."""
    return Report("alignment", "\n".join([*notes, repr(start)]), start.to_dict() | {"notes": list(notes)}, {})


def navigation_report(name: str, navigation: Navigation, notes: Sequence[str]) -> Report:
    """Where a drive went and how well: innovations, simulated outages, errors against a reference."""
    ends = {sensor: w.rows() for sensor, w in navigation.withheld.items()}
    errors = navigation.errors
    content = {
        "filter": name,
        "status": navigation.status.name,
        "start": float(navigation.time[0]),
        "end": float(navigation.time[-1]),
        "notes": list(notes),
        "sd_at_end": dict(zip(JUDGED.components, navigation.sd[-1].tolist(), strict=True)),
        "sensor_errors_at_end": dict(zip(CHANNELS, navigation.sensor_errors[-1].tolist(), strict=True)),
        "nis": {
            sensor: {"mean": float(nis.mean()), "num_fixes": len(nis), "dof": navigation.innovation[sensor].shape[1]}
            for sensor, nis in navigation.nis.items()
        },
        "refused": {
            f.sensor.name: f.time[f.given][navigation.refused[f.sensor.name]].tolist()
            for f in navigation.fixes
            if f.sensor.name in navigation.refused
        },
        "outages": ends,
        "reference": None
        if errors is None
        else {
            quantity: {"rms": rms, "claimed": claimed, "unit": unit}
            for quantity, (rms, claimed, unit) in errors.rms().items()
        },
    }
    figures: dict[str, Callable[[], Figure]] = {"track.png": navigation.plot}
    if navigation.fixes:
        figures["innovations.png"] = lambda: plot_innovations(navigation)
    figures["sensors.png"] = lambda: plot_sensor_estimates(navigation)
    if ends:
        figures["outages.png"] = lambda: plot_withheld(navigation)
    text = "\n".join([f"{name}: {navigation!r}", *(["", *notes] if notes else [])])
    return Report("navigation", text, content, figures)


def filter_section(name: str, errors: ImuErrors, comment: str) -> str:
    """A filter as a section of a configuration, with all digits."""
    return f"# {comment}\n{tomli_w.dumps({'filters': {name: keys_of(errors)}})}"


def keys_of(errors: ImuErrors) -> dict[str, Any]:
    """Return the keys of a section of a configuration, with all digits.

    Parameters
    ----------
    errors
        What a filter believes, or the truth.

    Examples
    --------
    >>> from nav_jax.app.reports import keys_of
    >>> keys_of(nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0))
    {'accel': 'WN(sigma2=0.0001)', 'gyro': 'WN(sigma2=1e-08)', 'rate': 20.0}
    """
    keys: dict[str, Any] = {}
    for sensor, first in (("accel", 0), ("gyro", 3)):
        texts = [_model_text(m) for m in errors.linear.models[first : first + 3]]
        keys[sensor] = texts[0] if len(set(texts)) == 1 else dict(zip("xyz", texts, strict=True))
    keys["rate"] = errors.rate
    for sensor, sd in (("accel", errors.bias_sd[:3]), ("gyro", errors.bias_sd[3:])):
        if np.any(np.asarray(sd)):
            keys[f"{sensor}_bias_sd"] = np.asarray(sd).tolist()
    if errors.start != "stationary":
        keys["start"] = errors.start
    names = {kind: name for name, kind in DETERMINISTIC.items()}
    for d in errors.deterministic:
        sd = {"accel_sd": np.asarray(d.sd[:3]).tolist(), "gyro_sd": np.asarray(d.sd[3:]).tolist()}
        keys.setdefault("calibration", {})[names[type(d)]] = {key: sd[key] for key in d.units}
    if errors.gravity is not None:
        sd, distance = (np.asarray(x).tolist() for x in (errors.gravity.sd, errors.gravity.distance))
        deflection = [x / STANDARD_GRAVITY for x in sd[:2]]
        keys["gravity"] = {"deflection": deflection, "anomaly": sd[2], "distance": distance}
    return keys


def _model_text(model: NoiseModel) -> str:
    """As `gmwm_jax.parse_model` reads it; its repr has fewer digits."""
    terms = []
    for process in model.processes:
        names = (p.name for p in process.parameters)
        values = (f"{name}={float(value)!r}" for name, value in zip(names, process.values, strict=True))
        terms.append(f"{process.kind}({', '.join(values)})")
    return " + ".join(terms)


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


def _numbers_or_none(value: Any) -> Any:
    """What JSON can hold: None for what is not finite."""
    if isinstance(value, Mapping):
        return {key: _numbers_or_none(v) for key, v in value.items()}
    if isinstance(value, list):
        return [_numbers_or_none(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
