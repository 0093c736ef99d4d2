"""What is taken away of the room: the configuration, a Python file, and results as tables, JSON and figures."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from gmwm_jax.app.web.report import FORMATS, drawn
from gmwm_jax.app.web.tables import Table, to_csv
from nav_jax.app.reports import Report, budget_report, comparison_report, design_report
from nav_jax.app.web import tables
from nav_jax.lincov.analysis import Analysis
from nav_jax.lincov.budget import Budget
from nav_jax.lincov.derivatives import Sensitivities
from nav_jax.lincov.filter_design import Design
from nav_jax.simulation.comparison import Comparison

CONFIGURATION = "comparison.toml"


class Parts(NamedTuple):
    """What there is of one configuration."""

    text: str
    """The configuration."""
    analysis: Analysis
    runs: Comparison | None = None
    budget: tuple[str, Budget, Sensitivities] | None = None
    """Of one filter, with its name."""
    design: Design | None = None
    trajectory: Path | None = None
    """The file of the trajectory, if it was sent."""


def python(text: str, *, runs: bool) -> str:
    """Write a Python file that gives the same numbers.

    Parameters
    ----------
    text
        The configuration.
    runs
        Is there a Monte Carlo?

    Examples
    --------
    >>> from nav_jax.app.web import files
    >>> print(files.python("[run]", runs=False).splitlines()[-1])
    print(nj.analyse(config.scenario, config.truth, config.filters))
    """
    lines = [
        "from pathlib import Path",
        "",
        "import jax",
        "",
        "import nav_jax as nj",
        "from nav_jax.app.comparison_file import read_config",
        "",
        'jax.config.update("jax_enable_x64", True)',
        f"Path({CONFIGURATION!r}).write_text({text!r})",
        f"config = read_config({CONFIGURATION!r})",
        "print(nj.analyse(config.scenario, config.truth, config.filters))",
    ]
    return "\n".join([*lines, *["print(config.compare())"] * runs, ""])


def commands(*, several: bool) -> str:
    """Write the commands of the shell.

    Parameters
    ----------
    several
        Are there two filters or more?

    Examples
    --------
    >>> from nav_jax.app.web import files
    >>> print(files.commands(several=True).splitlines()[0])
    nav-jax compare comparison.toml --out results
    """
    first = "compare" if several else "run"
    asked = (first, "budget", "design")
    return "\n".join(f"nav-jax {command} {CONFIGURATION} --out results" for command in asked)


def downloads(parts: Parts) -> dict[str, bytes]:
    """Make all files.

    Parameters
    ----------
    parts
        Of one configuration.

    Returns
    -------
    Name -> content.
    """
    made = {
        CONFIGURATION: parts.text.encode(),
        "navigation.py": python(parts.text, runs=parts.runs is not None).encode(),
        "analysis.csv": to_csv(tables.analysis(parts.analysis)).encode(),
        **_figures({"analysis": parts.analysis.plot}),
    }
    if parts.trajectory is not None:
        made[parts.trajectory.name] = parts.trajectory.read_bytes()
    if parts.runs is not None:
        made |= _of_report(comparison_report(parts.runs), {})
        if parts.runs.num_common >= 2:
            made |= {"comparison.csv": to_csv(tables.comparison(parts.runs)).encode()}
    if parts.budget is not None:
        name, budget, sensitivities = parts.budget
        of = {"budget": tables.budget(budget, name), "sensitivities": tables.sensitivities(sensitivities, name)}
        made |= _of_report(budget_report(parts.analysis, name, budget, sensitivities), of)
    if parts.design is not None:
        report = design_report(parts.design, parts.design.best(), None)
        made |= _of_report(report, {"design": tables.design(parts.design)})
    return made


def _of_report(report: Report, of: Mapping[str, Table]) -> dict[str, bytes]:
    made = {f"{report.stem}.json": report.json.encode(), f"{report.stem}.txt": report.text.encode()}
    made |= {f"{name}.csv": to_csv(table).encode() for name, table in of.items()}
    made |= {} if report.section is None else {f"{report.stem}.toml": report.section.encode()}
    return made | _figures({name.removesuffix(".png"): draw for name, draw in report.figures.items()})


def _figures(of: Mapping[str, Callable[[], Figure]]) -> dict[str, bytes]:
    made: dict[str, Any] = {}
    for name, draw in of.items():
        figure = draw()
        made |= {f"{name}.{kind}": drawn(figure, kind) for kind in FORMATS}
    return made
