"""Models in order of what they cost, and which of the differences are more than chance."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from gmwm_jax._internal.text_table import format_table, number
from nav_jax.filter.layout import ATTITUDE
from nav_jax.simulation.runs import Runs
from nav_jax.simulation.stopping import AbstractTest, Stopped, score
from nav_jax.statistics.energy import energy_score
from nav_jax.statistics.sequential import student_score
from nav_jax.statistics.summaries import Paired, coverage, holm, mean_curve, mean_nees, mean_norm, paired, rms

_SIZE = 0.05
"""Of the tests behind the verdicts, all of them together."""


@dataclass(frozen=True)
class Standing:
    """One model at the judged epoch, SI; NaN for a model without two good runs.

    Attributes
    ----------
    model
        Its name.
    num_good, num_failed
        Of its own runs.
    mean_position, mean_position_se
        Mean length of the position error, m.
    rms_position
        Root mean square of it, m.
    mean_orientation, mean_orientation_se
        Mean angle of the attitude error, rad.
    energy_score, energy_score_se
        Of the filter's Gaussian for the position, m; lower is better. It counts both size and honesty of the error.
    nees, nees_inside, nees_share
        NEES of the pose over its dof, whether it is in the band of a consistent filter, and the share of all epochs in
        their band.
    coverage, coverage_inside
        Fraction of runs in the ellipsoid that the filter claims for the pose, and whether it is in its band.
    against
        The best model, None for itself.
    paired
        This model - the best, mean position error in the same runs; None for the best.
    p
        Corrected for all pairs of models.
    verdict
        What may be said.
    """

    model: str
    num_good: int
    num_failed: int
    mean_position: float = np.nan
    mean_position_se: float = np.nan
    rms_position: float = np.nan
    mean_orientation: float = np.nan
    mean_orientation_se: float = np.nan
    energy_score: float = np.nan
    energy_score_se: float = np.nan
    nees: float = np.nan
    nees_inside: bool = False
    nees_share: float = np.nan
    coverage: float = np.nan
    coverage_inside: bool = False
    against: str | None = None
    paired: Paired | None = None
    p: float = np.nan
    verdict: str = ""


@dataclass(frozen=True, repr=False)
class Ranking(Sequence[Standing]):
    """The standings of the filters from the best mean position error on; it prints itself.

    Attributes
    ----------
    standings
        One a model.
    time
        Of the judged epoch, s.
    num_runs
        Runs in which no ranked model failed: the ones compared.
    level
        Of bands and intervals.
    stopped
        By which rule the runs ended, if by one.
    """

    standings: tuple[Standing, ...]
    time: float
    num_runs: int
    level: float
    stopped: Stopped | None = None

    def __len__(self) -> int:
        return len(self.standings)

    def __iter__(self) -> Iterator[Standing]:
        return iter(self.standings)

    def __getitem__(self, which: Any) -> Any:
        if isinstance(which, str):
            for one in self.standings:
                if one.model == which:
                    return one
            raise KeyError(f"No model {which!r}; there are {', '.join(one.model for one in self.standings)}.")
        return self.standings[which]

    def to_list(self) -> list[dict[str, Any]]:
        """Plain numbers and texts of each model, for JSON or a table of pandas."""
        return [
            {key: None if isinstance(value, float) and value != value else value for key, value in asdict(one).items()}
            for one in self.standings
        ]

    def __repr__(self) -> str:
        percent = f"{100 * self.level:g} %"
        head = ["model", "position [m]", "rms [m]", "orientation [deg]", "energy score [m]", "NEES/dof", "in band"]
        head.append(f"coverage {percent}")
        rows = [self._row(one) for one in self.standings]
        lines = [
            f"mean over {self.num_runs} common runs at {self.time:g} s, ± standard error",
            format_table(head, rows),
        ]
        marks = [cell for row in rows for cell in row if cell.endswith("*")]
        if marks:
            lines.append(f"* outside the {percent} band of a consistent filter")
        others = [one for one in self.standings if one.paired is not None]
        if others:
            best = others[0].against
            width = max(len(one.verdict) for one in others)
            head = ["position error in the same runs", "difference [m]", f"{percent} interval", "p"]
            rows = [[*_pair_row(one), one.verdict.ljust(width)] for one in others]
            lines += ["", format_table([*head, "verdict".ljust(width)], rows)]
            pairs = len(others) * (len(others) + 1) // 2
            if pairs > 1:
                by = "Holm" if _test_of(self.stopped, self.time) is None else "Bonferroni"
                lines.append(f"p: {by} over all {pairs} pairs of models, as the best is chosen by these data")
            lines.append(f"{best}: {self[best].verdict}")
        for one in self.standings:
            if one.num_good < 2:
                lines.append(f"{one.model}: {one.verdict}")
        if self.stopped is not None:
            lines.append(self.stopped.said(self.time))
        return "\n".join(lines)

    def _row(self, one: Standing) -> list[str]:
        if one.num_good < 2:
            return [one.model, *"-------"]
        degrees = 180 / np.pi
        return [
            one.model,
            _with_se(one.mean_position, one.mean_position_se),
            number(one.rms_position, 4),
            _with_se(degrees * one.mean_orientation, degrees * one.mean_orientation_se),
            _with_se(one.energy_score, one.energy_score_se),
            _marked(one.nees, f"{one.nees:.2f}", one.nees_inside),
            _marked(one.nees_share, f"{100 * one.nees_share:.0f} %", True),
            _marked(one.coverage, f"{100 * one.coverage:.1f} %", one.coverage_inside),
        ]


def common_runs(runs: Mapping[str, Runs]) -> np.ndarray:
    """Numbers of the runs in which none of the models failed; models with fewer than two good runs do not count."""
    ranked = [r for r in runs.values() if r.num_good >= 2]
    if not ranked:
        return np.array([], np.int64)
    least = min(map(len, ranked))
    return np.flatnonzero(np.logical_and.reduce([r.good[:least] for r in ranked]))


def rank(runs: Mapping[str, Runs], epoch: int, level: float = 0.95, stopped: Stopped | None = None) -> Ranking:
    """Compare models at one epoch.

    Parameters
    ----------
    runs
        By model; run i of each has the same truth and the same noise.
    epoch
        Number of the epoch.
    level
        Of bands, intervals and coverage.
    stopped
        By which rule the runs ended. If that was a test at this epoch, intervals of differences and p values are those
        that hold for all its looks.

    Raises
    ------
    ValueError
        Fewer than two runs that no ranked model failed.
    """
    chosen = common_runs(runs)
    if len(chosen) < 2:
        raise ValueError(
            f"A ranking takes 2 or more runs in which no model failed, and there are {len(chosen)} of "
            f"{max(map(len, runs.values()))}: ask for more runs, or leave out the model that fails."
        )
    distances, standings = {}, []
    for name, r in runs.items():
        if r.num_good < 2:
            verdict = f"finished {r.num_good} of {len(r)} runs: not ranked"
            standings.append(Standing(name, r.num_good, r.num_failed, verdict=verdict))
            continue
        distances[name] = np.linalg.norm(r.error[chosen, epoch, :3], axis=-1)
        standings.append(_standing(name, r, chosen, epoch, level))
    standings.sort(key=lambda one: (np.isnan(one.mean_position), one.mean_position))
    time = float(next(iter(runs.values())).time[epoch])
    judged = _judge(standings, distances, level, None if _test_of(stopped, time) is None else stopped)
    return Ranking(tuple(judged), time, len(chosen), level, stopped)


def _test_of(stopped: Stopped | None, time: float) -> AbstractTest | None:
    """The test that ended the runs, if it was of the errors at that time."""
    rule = None if stopped is None or stopped.time != time else stopped.rule
    return rule if isinstance(rule, AbstractTest) else None


def _standing(name: str, r: Runs, chosen: np.ndarray, epoch: int, level: float) -> Standing:
    """Numbers of one model by itself."""
    one = slice(epoch, epoch + 1)
    position = mean_norm(r.error[chosen, one, :3], level)
    orientation = mean_norm(r.error[chosen, one, ATTITUDE], level)
    score = mean_curve(energy_score(r.error[chosen, one, :3], r.position_covariance[chosen, one]), level)
    found: dict[str, Any] = {}
    known = r.known_epochs("pose") if "pose" in r.nees else np.zeros(len(r.time), bool)
    if known.any():
        all_epochs = mean_nees(r.nees["pose"][np.ix_(chosen, np.flatnonzero(known))], r.dof["pose"], level)
        found["nees_share"] = all_epochs.share_inside
        if known[epoch]:
            squares = r.nees["pose"][chosen, one]
            here, covered = mean_nees(squares, r.dof["pose"], level), coverage(squares, r.dof["pose"], level, level)
            found |= {
                "nees": float(here.value[0]) / here.dof,
                "nees_inside": bool(here.inside[0]),
                "coverage": float(covered.value[0]),
                "coverage_inside": bool(covered.inside[0]),
            }
    return Standing(
        name,
        r.num_good,
        r.num_failed,
        mean_position=float(position.value[0]),
        mean_position_se=float(position.se[0]),
        rms_position=float(rms(r.error[chosen, one, :3], level).value[0]),
        mean_orientation=float(orientation.value[0]),
        mean_orientation_se=float(orientation.se[0]),
        energy_score=float(score.value[0]),
        energy_score_se=float(score.se[0]),
        **found,
    )


def _judge(
    standings: Sequence[Standing], distances: Mapping[str, np.ndarray], level: float, stopped: Stopped | None
) -> list[Standing]:
    """Put the tests in: of all pairs, since the data choose which one is the best."""
    ranked = [one.model for one in standings if one.model in distances]
    pairs = list(combinations(ranked, 2))
    if not pairs:
        return list(standings)
    best, *others = ranked
    if stopped is None:
        size, told = _SIZE, "would need ~{} runs"
        tests = {(a, b): paired(distances[b], distances[a], level) for a, b in pairs}
        corrected = dict(zip(pairs, holm(np.array([tests[pair].p for pair in pairs])), strict=True))
    else:
        size, told = stopped.rule.alpha, "one test would need ~{} runs"  # type: ignore[union-attr]
        tests = {(best, b): _after_looks(distances[b] - distances[best], level, stopped) for b in others}
        corrected = {pair: min(1.0, len(pairs) * test.p) for pair, test in tests.items()}
    beaten = [other for other in others if corrected[best, other] < size]
    judged = []
    for one in standings:
        found: dict[str, Any] = {}
        if one.model == best:
            found["verdict"] = f"better than {', '.join(beaten)}" if beaten else "not distinguishable from any other"
        elif one.model in others:
            p = float(corrected[best, one.model])
            if p < size:
                verdict = f"worse than {best}"
            else:  # at the size that one of so many tests has
                strict = paired(distances[one.model], distances[best], 1 - size / len(pairs))
                needed = strict.num_runs_needed
                more = "no difference at all" if needed is None else told.format(_round(needed))
                verdict = f"not distinguishable from {best} ({more})"
            found |= {"against": best, "paired": tests[best, one.model], "p": p, "verdict": verdict}
        judged.append(replace(one, **found))
    return judged


def _after_looks(difference: np.ndarray, level: float, stopped: Stopped) -> Paired:
    """A difference with the interval and the p value that hold for all looks (Jennison & Turnbull 2000, ch. 9)."""
    rule = stopped.rule
    assert isinstance(rule, AbstractTest)
    fixed = paired(difference, np.zeros(len(difference)), level)
    # the bound is one on normal variables
    t = student_score(rule.bound(1 - level, stopped.looks, stopped.most), len(difference) - 1)
    half = t * fixed.se if fixed.se > 0 else 0.0
    p = rule.p(score(difference), stopped.looks, stopped.most)
    return replace(fixed, low=fixed.difference - half, high=fixed.difference + half, p=p)


def _pair_row(one: Standing) -> list[str]:
    assert one.paired is not None
    test = one.paired
    interval = f"[{number(test.low, 3)}, {number(test.high, 3)}]"
    p = "< 0.0001" if one.p < 1e-4 else number(one.p, 2)
    return [f"{one.model} - {one.against}", _with_se(test.difference, test.se), interval, p]


def _marked(value: float, text: str, inside: bool) -> str:
    return "-" if np.isnan(value) else text + "*" * (not inside)


def _with_se(value: float, se: float) -> str:
    """A number to the second digit of its standard error."""
    if not (np.isfinite(se) and se > 0):
        return number(value, 4)
    decimals = max(0, 1 - int(np.floor(np.log10(se))))
    return f"{value:.{decimals}f} ± {se:.{decimals}f}" if decimals < 9 else f"{value:.4g} ± {se:.2g}"


def _round(n: int) -> str:
    """To two digits, as more are not known."""
    digits = max(0, len(str(n)) - 2)
    return f"{-(-n // 10**digits) * 10**digits:,}".replace(",", "\u2009")
