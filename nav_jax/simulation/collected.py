"""One chunk of runs of all filters, as a function of their keys, and the arrays in which chunks are gathered."""

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np
from jaxtyping import Key

from gmwm_jax._internal.memory import FLOAT
from nav_jax.filter.experiment import Setup, draw_inputs, run_filter
from nav_jax.filter.layout import GROUPS, JUDGED, ON_CHANNELS
from nav_jax.filter.status import Status
from nav_jax.filter.timeline import Gains
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.recorded import RecordedErrors
from nav_jax.simulation.runs import Runs, Track


def run_chunk(
    setup: Setup,
    truth: ImuErrors | RecordedErrors,
    filters: Mapping[str, ImuErrors],
    keys: Key[jax.Array, " R"],
    shared: Mapping[str, Gains | None],
    *,
    smooth: bool = False,
) -> dict[str, Any]:
    """Run all filters on the same inputs: those of the keys, and of nothing else.

    Parameters
    ----------
    setup
        The prepared scenario.
    truth, filters
        Errors that are emulated, and name -> what a filter believes of them.
    keys
        Of the runs.
    shared
        Name -> gains along the reference; None where each run has its own.
    smooth
        See `nav_jax.compare`.

    Returns
    -------
    Name -> what `Collected.take` takes.
    """
    inputs = draw_inputs(setup.experiment, truth, keys)
    outcomes = {n: run_filter(setup.experiment, f, inputs, shared[n], smooth=smooth) for n, f in filters.items()}
    return {name: _outputs(setup, jax.tree.map(np.asarray, outcome)) for name, outcome in outcomes.items()}


def _outputs(setup: Setup, outcome: Any) -> tuple[Any, ...]:
    """Of all segments those that end with an output, or with a fix."""
    at = setup.output_segments
    judged = jax.tree.map(lambda a: a[at], outcome.judgement)
    return (*judged, outcome.innovation, outcome.variance, outcome.status)


class Collected:
    """The arrays of one filter's runs, filled chunk by chunk: nothing is copied twice."""

    def __init__(self, setup: Setup, num_runs: int):
        E, self.setup, self.num_runs = len(setup.output_times), setup, num_runs
        self.error = np.empty((num_runs, E, JUDGED.size))
        self.sd = np.empty_like(self.error)
        self.position_covariance = np.empty((num_runs, E, 3, 3))
        self.nees = {group: np.empty((num_runs, E)) for group in GROUPS}
        self.status = np.empty(num_runs, dtype=np.int64)
        self.sizes = [len(s.axes) for s in setup.aiding]
        fixes = [len(s) for s in setup.fix_segments]
        self.innovation = [np.empty((num_runs, F, K)) for F, K in zip(fixes, self.sizes, strict=True)]
        self.nis = [np.empty((num_runs, F)) for F in fixes]

    @staticmethod
    def bytes_of(setup: Setup, num_runs: int) -> int:
        """Memory of all arrays: error, sd, covariance and NEES at each epoch; innovation and NIS at each fix."""
        epochs = len(setup.output_times) * (2 * JUDGED.size + 9 + len(GROUPS))
        fixes = sum(len(f) * (len(s.axes) + 1) for s, f in zip(setup.aiding, setup.fix_segments, strict=True))
        return FLOAT * num_runs * (1 + epochs + fixes)

    def take(self, first: int, output: Any) -> None:
        """Put a chunk in its place; runs are its last axis."""
        error, sd, covariance, nees, innovation, variance, status = output
        count = min(error.shape[-1], self.num_runs - first)
        to = slice(first, first + count)
        self.error[to] = np.moveaxis(error, -1, 0)[:count]
        # what all runs share has a last axis of one
        self.sd[to] = np.moveaxis(sd, -1, 0)[:count]
        self.position_covariance[to] = np.moveaxis(covariance, -1, 0)[:count]
        for i, group in enumerate(GROUPS):
            self.nees[group][to] = nees[:, i, :count].T
        self.status[to] = status[:count]
        at = 0
        for i, (K, segments) in enumerate(zip(self.sizes, self.setup.fix_segments, strict=True)):
            nu, s = innovation[segments, at : at + K], variance[segments, at : at + K]
            self.innovation[i][to] = np.moveaxis(nu, -1, 0)[:count]
            self.nis[i][to] = (nu**2 / s).sum(axis=1).T[:count]
            at += K

    def runs(
        self,
        name: str,
        believed: ImuErrors,
        truth: ImuErrors | RecordedErrors,
        count: int,
        num_requested: int,
        tracks: dict[int, Track],
        *,
        smooth: bool,
    ) -> Runs:
        """The result of the first `count` runs."""
        channels = {s.channel for s in believed.states if s.is_of_imu}
        dof = {group: len(JUDGED.columns(*blocks)) for group, blocks in GROUPS.items()} | {"sensors": len(channels)}
        notes = list(believed.notes())
        if smooth:
            notes.append("Errors are those of the smoother, from all measurements of a run; innovations the filter's.")
        error, sd = self.error[:count], self.sd[:count]
        if isinstance(truth, RecordedErrors):
            error[..., ON_CHANNELS], sd[..., ON_CHANNELS] = 0.0, 0.0
            dof["sensors"] = 0
            notes.append("The errors are a recording, whose states nobody knows: nothing is said of the sensor states.")
        groups = [g for g in GROUPS if dof[g]]
        failed = self.status[:count] != Status.ok
        arrays = [error, sd, self.position_covariance, *self.nees.values(), *self.innovation, *self.nis]
        for a in arrays:
            a[:count][failed] = np.nan
        names = [s.name for s in self.setup.aiding]
        return Runs(
            name=name,
            time=self.setup.output_times,
            error=error,
            sd=sd,
            position_covariance=self.position_covariance[:count],
            nees={g: self.nees[g][:count] for g in groups},
            dof={g: dof[g] for g in groups},
            status=self.status[:count],
            nis={n: a[:count] for n, a in zip(names, self.nis, strict=True)},
            nis_time=dict(zip(names, self.setup.fix_times, strict=True)),
            nis_dof=dict(zip(names, self.sizes, strict=True)),
            innovation={n: a[:count] for n, a in zip(names, self.innovation, strict=True)},
            outages=self.setup.outages,
            notes=tuple(notes),
            tracks=tracks,
            num_requested=num_requested,
        )
