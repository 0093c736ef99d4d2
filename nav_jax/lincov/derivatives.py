"""Which noise parameter matters: derivatives of the true RMS errors of a filter, over time, by every parameter.

Of the truth, and of what the filter believes, separately. Where the filter believes the truth its gains are optimal:
the derivatives by what it believes vanish, and only those by the truth remain.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Float64, Int

from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.programs import bounded
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from nav_jax.filter.error_model import Motion
from nav_jax.filter.experiment import Experiment, Setup, check_rates
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.joint_covariance import Noise, covariances_along, motion_of, noise_of
from nav_jax.filter.layout import NAVIGATION, QUANTITIES
from nav_jax.filter.parameters import AidingLines, ErrorLines
from nav_jax.filter.scenario import Scenario
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.output import warn_of_range
from nav_jax.kinematics.linalg import root
from nav_jax.lincov.analysis import model_of
from nav_jax.statistics.epochs import Judged


def rms_of(navigation: Float[Array, "*L E nav nav"]) -> Float[Array, "*L Q E"]:
    """RMS of each of `QUANTITIES` from covariances."""
    variance = jnp.diagonal(navigation, axis1=-2, axis2=-1)
    return jnp.stack([root(variance[..., jnp.array(c)].sum(axis=-1)) for c, _, _ in QUANTITIES.values()], axis=-2)


@saved()
@dataclass(frozen=True, eq=False, repr=False)
class Sensitivities(Judged, Drawable, Saved):
    """The result of `sensitivities`: derivatives of RMS errors by parameters.

    Attributes
    ----------
    time
        Epochs in s, shape (E,).
    sides, names
        ``truth`` or ``filter``, and the name, of each of P parameters.
    rms
        Quantity -> true RMS, SI, shape (E,).
    derivative
        Quantity -> derivative of it by the logarithm of each parameter (by the logit of one between two bounds, such
        as phi, or a partial autocorrelation), SI, shape (E, P). A parameter that changes by one per cent changes it by
        a hundredth of that.
    outages, fixes
        Of each sensor, s.
    """

    time: Float64[np.ndarray, " E"]
    sides: tuple[str, ...]
    names: tuple[str, ...]
    rms: Mapping[str, Float64[np.ndarray, " E"]]
    derivative: Mapping[str, Float64[np.ndarray, "E P"]]
    outages: Mapping[str, tuple[tuple[float, float], ...]]
    fixes: Mapping[str, Float64[np.ndarray, " _"]]

    def elasticity(self, quantity: str) -> Float64[np.ndarray, "E P"]:
        """Relative change of an RMS by a relative change of each parameter."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.derivative[quantity] / self.rms[quantity][:, None]

    def table(self, at: float | None = None) -> str:
        """Derivatives at an epoch, the largest by position first."""
        k = self.epoch(at)
        order = np.argsort(-np.abs(self.derivative["position"][k]))
        head = ["parameter", "of", *(f"{q} [{unit}]" for q, (_, unit, _) in QUANTITIES.items())]
        rows = [["RMS itself", "", *(number(f * self.rms[q][k], 4) for q, (_, _, f) in QUANTITIES.items())]]
        for p in order:
            values = [f * self.derivative[q][k, p] for q, (_, _, f) in QUANTITIES.items()]
            rows.append([self.names[p], self.sides[p], *(number(float(v), 3) for v in values)])
        return format_table(head, rows, left=2)

    def plot(
        self,
        *,
        quantities: Sequence[str] = ("position", "tilt", "heading"),
        num: int = 8,
        axes: GivenAxes | None = None,
    ) -> Figure:
        """Draw the derivatives by the parameters that matter most, over time.

        Parameters
        ----------
        quantities
            A row each, of `nav_jax.filter.layout.QUANTITIES`.
        num
            So many parameters.
        axes
            An Axes for each quantity to draw into; a new figure if left out.

        Returns
        -------
        Figure
            See `nav_jax.plotting.plot_sensitivities`.
        """
        return self._draw(quantities=quantities, num=num, axes=axes)

    def __repr__(self) -> str:
        title = f"d RMS / d log parameter at {self.time[self.epoch()]:g} s (logit of phi and of other bounded ones)"
        return f"{title}\n{self.table()}"


class _Problem(eqx.Module):
    """Everything that has a derivative, as one vector."""

    experiment: Experiment
    truth: ErrorLines
    believed: ErrorLines
    aiding: AidingLines
    start: Float[Array, " P"]
    starts: tuple[str, ...] = eqx.field(static=True)
    """Parts of the navigation state that are uncertain at the start."""
    names: tuple[str, ...] = eqx.field(static=True)
    sides: tuple[str, ...] = eqx.field(static=True)
    cuts: tuple[int, ...] = eqx.field(static=True)

    def __init__(self, experiment: Experiment, truth: ImuErrors, believed: ImuErrors):
        self.experiment, self.aiding = experiment, AidingLines(experiment.sensors)
        self.truth, self.believed = ErrorLines(truth), ErrorLines(believed)
        known = np.diag(np.asarray(experiment.initial.covariance))
        self.starts = tuple(name for name in NAVIGATION.names if known[NAVIGATION[name]].any())
        starts = tuple(f"start {name} sd" for name in self.starts)
        names, sides, start, sizes = [], [], [], []
        for side, lines, own in (
            ("truth", self.truth, experiment.timeline.drawn),
            ("filter", self.believed, experiment.timeline.own),
        ):
            factors = (self.aiding.names, tuple(f"{name} sd" for name in own.names), starts)
            sizes += [len(part) for part in (lines.names, *factors)]
            names += [*lines.names, *(name for part in factors for name in part)]
            start += [lines.start, jnp.zeros(sum(map(len, factors)))]
            sides += [side] * (len(names) - len(sides))
        self.names, self.sides, self.start = tuple(names), tuple(sides), jnp.concatenate(start)
        self.cuts = tuple(np.cumsum(sizes)[:-1].tolist())

    def parts(self, vector: Float[Array, " P"]) -> tuple[Experiment, Noise, ImuErrors, InitialUncertainty]:
        """Arguments of `covariances_along`."""
        true, true_aiding, true_own, true_start, believed, aiding, own, start = jnp.split(vector, self.cuts)
        covariance, timeline = self.experiment.initial.covariance, self.experiment.timeline
        experiment = eqx.tree_at(
            lambda e: (e.timeline.drawn, e.timeline.own),
            self.experiment,
            (timeline.drawn.scaled(jnp.exp(true_own)), timeline.own.scaled(jnp.exp(own))),
        )
        noise = noise_of(experiment, self.truth.build(true))
        noise = eqx.tree_at(
            lambda n: (n.start, n.aiding),
            noise,
            (self._scaled(covariance, true_start), self._louder(noise, true_aiding)),
        )
        ours = eqx.tree_at(lambda i: i.covariance, experiment.initial, self._scaled(covariance, start))
        heard = eqx.tree_at(lambda e: e.sensors, experiment, self.aiding.believe(aiding))
        return heard, noise, self.believed.build(believed), ours

    def _scaled(self, covariance: Array, x: Array) -> Array:
        factor = jnp.ones(NAVIGATION.size)
        for name, value in zip(self.starts, x, strict=True):
            factor = factor.at[NAVIGATION[name]].set(jnp.exp(value))
        return covariance * factor[:, None] * factor[None, :]

    def _louder(self, noise: Noise, x: Array) -> Any:
        first = np.cumsum([0, *(len(s.axes) for s in self.experiment.sensors)])
        forms = list(noise.aiding.forms)
        for value, (i, at) in zip(x, self.aiding.parts, strict=True):
            for k in (int(first[i]) + k for k in at):
                f, power = forms[k], jnp.exp(2 * value)
                forms[k] = f._replace(driving=power * f.driving, initial=power * f.initial, white=power * f.white)
        return eqx.tree_at(lambda a: a.forms, noise.aiding, tuple(forms))


def sensitivities(scenario: Scenario, truth: ImuErrors, filter: ImuErrors | None = None) -> Sensitivities:
    """Differentiate the true RMS errors of a filter by every parameter of the truth and of the filter.

    Parameters
    ----------
    scenario
        Trajectory, aiding, start and Earth; the filter knows of its start what is true.
    truth, filter
        Errors of the IMU, and what the filter believes of them; the truth if not given.

    Raises
    ------
    ValueError
        As of `nav_jax.analyse`.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> slopes = nj.sensitivities(scenario, truth)
    >>> len(slopes.names) == len(slopes.sides)
    True
    """
    truth = model_of(truth)
    believed = truth if filter is None else filter
    setup = Setup(scenario, check_rates(truth, {"filter": believed}))
    warn_of_range(truth.output, setup.imu)
    experiment, at = setup.experiment, jnp.asarray(setup.output_segments)
    motion, problem = motion_of(experiment), _Problem(experiment, truth, believed)
    derivative, rms = _derivatives(problem, motion, at)
    return Sensitivities(
        setup.output_times,
        problem.sides,
        problem.names,
        dict(zip(QUANTITIES, np.asarray(rms), strict=True)),
        dict(zip(QUANTITIES, np.asarray(derivative), strict=True)),
        setup.outages,
        setup.fixes,
    )


@bounded
@eqx.filter_jit
def _derivatives(
    problem: _Problem, motion: Motion, at: Int[Array, " E"]
) -> tuple[Float[Array, "Q E P"], Float[Array, "Q E"]]:
    """Of the RMS of each quantity at the segments `at`, and the RMS."""

    def errors(vector: Array) -> tuple[Array, Array]:
        experiment, noise, filter, start = problem.parts(vector)
        N = covariances_along(experiment, motion, noise, filter.bank(), start).true.navigation[at]
        rms = rms_of(N)
        return rms, rms

    return jax.jacfwd(errors, has_aux=True)(problem.start)
