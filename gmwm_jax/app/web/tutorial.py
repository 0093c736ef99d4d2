"""The tutorial: a published example step by step, its printed numbers beside those that are computed here.

The example fits the gyro X of an MTi-G. What is printed are objectives at estimates at which a search had stopped: the
objective at these is reproduced to all digits, and the minimum is lower. Nothing here is a stored result but what is
printed: objectives, estimates and units are computed when they are asked for.
"""

from typing import NamedTuple

from gmwm_jax.app.web import formula
from gmwm_jax.app.web.library import published
from gmwm_jax.fitting.estimator import fit, objective
from gmwm_jax.fitting.result import Fit
from gmwm_jax.processes.gauss_markov import GM
from gmwm_jax.processes.registry import as_model
from gmwm_jax.variance.wavelet import WaveletVariance

SENSOR, CHANNEL, RATE = "mti-g", "gyro_x", 100.0


class Chapter(NamedTuple):
    """One step of the example."""

    number: int
    title: str
    room: str
    """Of the page in which it is done."""
    text: str
    model: str = ""
    """What is fitted; "" where nothing is."""
    printed: str = ""
    """The model with the estimates that are printed, per sample."""
    printed_objective: float | None = None


CHAPTERS = (
    Chapter(
        1,
        "Plot the wavelet variance",
        "variance",
        "Take the published MTi-G, gyro X: 2.4 hours at 100 Hz in 18 scales. It falls by a slope of -1 (white noise), "
        "and is nearly flat from 40 seconds on: something slow is in it.",
    ),
    Chapter(
        2,
        "White noise alone",
        "model",
        "One process cannot follow the bend: the objective is the sum of squared residuals over squared widths of the "
        "intervals, and is large.",
        "WN",
        "WN(sigma2=4.926494e-05)",
        540.4236,
    ),
    Chapter(
        3,
        "White noise and a random walk",
        "model",
        "The random walk takes the longest scales and hardly helps.",
        "WN + RW",
        "WN(sigma2=4.926465e-05) + RW(gamma2=4.755070e-13)",
        540.1172,
    ),
    Chapter(
        4,
        "A Gauss-Markov process and white noise",
        "model",
        "A fast Gauss-Markov process takes the bend at the shortest scales, and the white noise comes out as zero.",
        "GM + WN",
        "GM(beta=2.023686, variance=4.896453e-05) + WN(sigma2=2.173694e-06)",
        29.07116,
    ),
    Chapter(5, "Two Gauss-Markov processes", "model", "A second, slow one takes the flat part.", "WN + RW + 2*GM"),
    Chapter(
        6,
        "Three Gauss-Markov processes",
        "model",
        "A third changes little: see in the room of selection whether it is there at all.",
        "WN + RW + 3*GM",
        "GM(beta=1.688923e-03, variance=1.190042e-07) + GM(beta=8.818780e-05, variance=1.153260e-07) + "
        "GM(beta=2.067960, variance=5.069687e-05) + WN(sigma2=3.907852e-07) + RW(gamma2=1.090869e-14)",
        17.37057,
    ),
    Chapter(
        7,
        "Into the units of a filter",
        "units",
        "A filter takes densities of continuous time. Of a Gauss-Markov process two variances are in use: the "
        "stationary one, which is estimated here, and that of its innovation, what each sample adds. One in the place "
        "of the other makes q too large by 1/(1 - exp(-2 beta)): little for a fast process, hundreds of times for a "
        "slow one.",
    ),
)
"""In their order."""


class Comparison(NamedTuple):
    """What is printed, what comes out at the printed estimates, and the minimum."""

    chapter: Chapter
    at_printed: float | None
    """The objective at the printed estimates; None where none are printed."""
    fit: Fit

    @property
    def sentence(self) -> str:
        """The comparison in words."""
        minimum = f"The minimum is {self.fit.objective:.6g}."
        if self.at_printed is None:
            return minimum
        said = f"Printed: {self.chapter.printed_objective:.7g}; at the printed estimates: {self.at_printed:.7g}."
        lower = self.at_printed - self.fit.objective
        same = lower < 1e-6 * self.at_printed
        return f"{said} {'That is the minimum.' if same else f'That is not the minimum. {minimum}'}"


class Conversion(NamedTuple):
    """One printed component in the units of a filter."""

    component: str
    steps: tuple[formula.Step, ...]
    trap: float
    """By how much q is too large where the stationary variance is taken for the innovation's; 1 where there is none."""


def data() -> WaveletVariance:
    """Return the wavelet variance that the example is of.

    Examples
    --------
    >>> from gmwm_jax.app.web import tutorial
    >>> wv = tutorial.data()
    >>> f"{wv.variance[0]:.4e} at {wv.times[0]:g} s, {wv.variance[-1]:.3e} at {wv.times[-1]:.0f} s"
    '2.2128e-05 at 0.02 s, 8.371e-09 at 2621 s'
    """
    return published(SENSOR)[CHANNEL]


def compared(chapter: Chapter) -> Comparison:
    """Fit the model of a step, and evaluate the objective at what is printed.

    Raises
    ------
    ValueError
        Nothing is fitted in this step.

    Examples
    --------
    >>> from gmwm_jax.app.web import tutorial
    >>> print(tutorial.compared(tutorial.CHAPTERS[1]).sentence)
    Printed: 540.4236; at the printed estimates: 540.4236. That is the minimum.
    """
    if not chapter.model:
        raise ValueError(f"In step {chapter.number}, {chapter.title!r}, nothing is fitted.")
    wv = data()
    at_printed = float(objective(wv, chapter.printed)) if chapter.printed else None
    found = fit(wv, chapter.model)
    assert isinstance(found, Fit)  # of one channel
    return Comparison(chapter, at_printed, found)


def conversions(chapter: Chapter) -> tuple[Conversion, ...]:
    """Convert the printed estimates of a step to the units of a filter, with the formulas; none where none are printed.

    Examples
    --------
    >>> from gmwm_jax.app.web import tutorial
    >>> [(c.component, f"{c.trap:.4g}") for c in tutorial.conversions(tutorial.CHAPTERS[3])]
    [('GM', '1.018'), ('WN', '1')]
    """
    if not chapter.printed:
        return ()
    model = as_model(chapter.printed)
    made = []
    for label, p in zip(model.labels, model.processes, strict=True):
        values = [float(v) for v in p.values]
        trap = formula.innovation_to_stationary(values[0], 1.0).value if isinstance(p, GM) else 1.0
        made.append(Conversion(label, formula.to_filter(p.kind, values, RATE, data().units[0]), trap))
    return tuple(made)
