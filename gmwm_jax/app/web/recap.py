"""The last example of the published text: a known truth, simulated and fitted, beside what is printed."""

from typing import NamedTuple

import jax
import numpy as np

from gmwm_jax.app.web.tables import Table
from gmwm_jax.fitting.estimator import fit
from gmwm_jax.fitting.result import Fit
from gmwm_jax.processes.registry import as_model
from gmwm_jax.processes.simulation import simulate
from gmwm_jax.variance.wavelet import wavelet_variance

NUM_SAMPLES = 100_000
"""The printed example does not say how many it has."""


class Printed(NamedTuple):
    """One parameter as it is printed."""

    truth: float
    estimate: float
    low: float
    high: float


PRINTED = (
    Printed(1.0, 1.00, 0.99, 1.01),
    Printed(0.1, 0.107, 0.099, 0.112),
    Printed(0.6, 0.58, 0.55, 0.61),
    Printed(5e-5, 4.87e-5, 4.67e-5, 5.07e-5),
)
"""In the order of `TRUTH`. They are printed without names, 0.6 before 0.1, here taken for variance and beta: a process
of variance 0.1 in white noise of variance 1 could hardly be known as well as the intervals say."""

TRUTH = "WN(sigma2=1) + GM(beta=0.1, variance=0.6) + DR(omega=5e-5)"


def table(seed: int = 0) -> Table:
    """Simulate the truth, fit its model, and tabulate estimates and intervals beside what is printed.

    Parameters
    ----------
    seed
        Of the draws.

    Examples
    --------
    >>> from gmwm_jax.app.web import recap
    >>> [row[0] for row in recap.table().rows]
    ['WN sigma2', 'GM beta', 'GM variance', 'DR omega']
    """
    record = np.asarray(simulate(as_model(TRUTH), NUM_SAMPLES, key=jax.random.key(seed)))
    found = fit(wavelet_variance(record), "WN + GM + DR")
    assert isinstance(found, Fit)  # of one channel
    rows = []
    for e, p in zip(found.parameters(), PRINTED, strict=True):
        ours = float(e.value), float(e.ci_low), float(e.ci_high)
        inside = "yes" if ours[1] <= p.truth <= ours[2] else "no"
        rows.append((f"{e.component} {e.symbol}", p.truth, *ours, inside, p.estimate, p.low, p.high))
    columns = ("parameter", "truth", "estimate", "95 % low", "high", "truth inside", "printed", "printed low", "high")
    return Table(columns, ("",) * len(columns), tuple(rows), f"{TRUTH}; {NUM_SAMPLES} samples, per sample")
