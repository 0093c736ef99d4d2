"""Tables of the room: pure functions of results."""

from typing import Any

import numpy as np

from gmwm_jax.app.web.tables import Cell, Table
from nav_jax.filter.layout import QUANTITIES
from nav_jax.lincov.analysis import Analysis
from nav_jax.lincov.budget import Budget
from nav_jax.lincov.derivatives import Sensitivities
from nav_jax.lincov.filter_design import Design, judged
from nav_jax.simulation.comparison import Comparison

_DEGREES = float(np.rad2deg(1.0))
_NOTHING = 1e-6
"""Relative changes of errors below that are none."""


def analysis(found: Analysis) -> Table:
    """Tabulate the filters from the smallest true position error on, at the judged epoch.

    Parameters
    ----------
    found
        Of `nav_jax.analyse`.

    Examples
    --------
    >>> from nav_jax.app.web import tables
    >>> scenario = nj.Scenario(nj.motions.static(duration=5.0, rate=20.0), [nj.Barometer(height=0.5)])
    >>> found = nj.analyse(scenario, nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0))
    >>> tables.analysis(found).columns[:3]
    ('filter', 'position', 'claimed')
    """
    k = next(iter(found.values())).epoch()
    rows = []
    for c in sorted(found.values(), key=lambda c: c.rms("position")[k]):
        values = [c.rms("position")[k], c.rms_claimed("position")[k]]
        values += [_DEGREES * c.rms("attitude")[k], _DEGREES * c.rms_claimed("attitude")[k]]
        values += [c.nees("position")[k] / 3, c.coverage("position")[k]]
        rows.append((c.name, *map(_number, values)))
    time = next(iter(found.values())).time[k]
    notes = dict.fromkeys(f"{c.name}: {note}" for c in found.values() for note in c.notes)
    text = f"Covariance analysis at {time:g} s: RMS errors; NEES and 95 % coverage of the position"
    columns = ("filter", "position", "claimed", "attitude", "claimed", "NEES / 3", "coverage")
    return Table(columns, ("", "m", "m", "deg", "deg", "1", "1"), tuple(rows), "\n".join([text, *notes]))


def comparison(found: Comparison) -> Table:
    """Tabulate the filters from the best mean position error on, with verdicts.

    Parameters
    ----------
    found
        Of `nav_jax.compare`, with two or more common runs.

    Raises
    ------
    ValueError
        Fewer than two runs in which no filter failed.
    """
    ranked = found.table()
    rows = tuple(
        (one.model, one.verdict, one.mean_position, one.mean_position_se, _DEGREES * one.mean_orientation,
         one.energy_score, one.nees, _yes(one.nees_inside), one.coverage, _yes(one.coverage_inside))
        for one in ranked
    )  # fmt: skip
    columns = ("filter", "verdict", "mean position error", "standard error", "mean orientation error", "energy score",
               "NEES / dof", "in band", "coverage", "in band")  # fmt: skip
    units = ("", "", "m", "m", "deg", "m", "1", "", "1", "")
    asked = {r.num_requested for r in found.runs.values()}
    cut = "" if ranked.num_runs >= max(asked) else f" of {max(asked)} that were asked for"
    text = f"Monte Carlo at {ranked.time:g} s: {ranked.num_runs} common runs{cut}; NEES and coverage of the pose"
    stopped = [] if ranked.stopped is None else [ranked.stopped.said(ranked.time)]
    return Table(columns, units, rows, "\n".join([text, *stopped]))


def budget(found: Budget, name: str) -> Table:
    """Tabulate what makes the error of a filter at the judged epoch, the largest source of position error first.

    Parameters
    ----------
    found
        Of `nav_jax.error_budget`.
    name
        Of the filter.
    """
    k = found.epoch()
    squares = found.mean_square("position")[:, k]
    shares = {q: 100 * found.share(q)[:, k] for q in QUANTITIES}
    rows = tuple(
        (found.sources[s], _number(np.sqrt(squares[s])), *(_number(v[s]) for v in shares.values()))
        for s in np.argsort(-squares)
    )
    text = f"Error budget of {name} at {found.time[k]:g} s: RMS of the position error, and parts of the mean squares"
    return Table(("source", "RMS", *QUANTITIES), ("", "m", *("%",) * len(QUANTITIES)), rows, text)


def sensitivities(found: Sensitivities, name: str) -> Table:
    """Tabulate by how much RMS errors change with the logarithm of each parameter, the largest by position first.

    Parameters
    ----------
    found
        Of `nav_jax.sensitivities`.
    name
        Of the filter.
    """
    k = found.epoch()
    effect = np.max([np.abs(np.nan_to_num(found.elasticity(q)[k])) for q in QUANTITIES], axis=0)
    rows: list[tuple[Cell, ...]] = []
    for p in np.argsort(-np.abs(found.derivative["position"][k])):
        if effect[p] < _NOTHING:
            continue
        values = (f * found.derivative[q][k, p] for q, (_, _, f) in QUANTITIES.items())
        rows.append((found.names[p], found.sides[p], *map(_number, values)))
    units = ("", "", *(unit for _, unit, _ in QUANTITIES.values()))
    text = f"Sensitivities of {name} at {found.time[k]:g} s: change of the RMS error by a change of log(parameter)"
    left_out = len(found.names) - len(rows)
    text += f"\n{left_out} parameters change no error by more than a millionth, and are left out" * bool(left_out)
    return Table(("parameter", "of", *QUANTITIES), units, tuple(rows), text)


def design(found: Design) -> Table:
    """Tabulate states against error of the designed filters, at the judged epoch.

    Parameters
    ----------
    found
        Of `nav_jax.design`.
    """
    front = {id(c) for c in found.pareto}
    rows: list[tuple[Cell, ...]] = []
    for c in found.candidates:
        remark = ", ".join(["best for its states"] * (id(c) in front) + ["not converged"] * (not c.converged))
        rows.append((c.name, c.num_states, *map(_number, judged(c.covariances)), remark))
    rows.append(("truth", len(found.truth.states), *map(_number, judged(found.right)), ""))
    cut = "" if found.complete else " Cancelled: the larger structures are missing."
    columns = ("filter", "states", "position", "claimed", "NEES / 9", "remark")
    text = f"Filters designed for this trajectory by their {found.objective}.{cut}"
    return Table(columns, ("", "1", "m", "m", "1", ""), tuple(rows), text)


def _number(value: Any) -> float:
    return float(value)


def _yes(inside: bool) -> str:
    return "yes" if inside else "no"
