"""The error budget: which source of noise makes which part of a filter's error, over time.

With the gains of the filter the error is linear in all that is random, and the sources are independent: their second
moments add up to that of the error, exactly. All sources go through one compiled and vectorised program.
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
from nav_jax.filter.joint_covariance import Noise, covariances_of_many, motion_of, noise_of
from nav_jax.filter.layout import NAVIGATION, QUANTITIES
from nav_jax.filter.parameters import shared_channels
from nav_jax.filter.scenario import Scenario
from nav_jax.imu.bank import SensorBank, alone
from nav_jax.imu.channels import CHANNELS, GRAVITY
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.output import warn_of_range
from nav_jax.lincov.analysis import model_of
from nav_jax.statistics.epochs import Judged


@saved()
@dataclass(frozen=True, eq=False, repr=False)
class Budget(Judged, Drawable, Saved):
    """The result of `error_budget`: mean squares of a filter's errors by source.

    Attributes
    ----------
    time
        Epochs in s, shape (E,).
    sources
        Names of S sources.
    part
        Mean square of each component of position, velocity and attitude that each source makes, SI, shape (S, E, nav);
        the sum over the sources is the whole.
    outages, fixes
        Of each sensor, s.
    """

    time: Float64[np.ndarray, " E"]
    sources: tuple[str, ...]
    part: Float64[np.ndarray, "S E nav"]
    outages: Mapping[str, tuple[tuple[float, float], ...]]
    fixes: Mapping[str, Float64[np.ndarray, " _"]]

    def mean_square(self, quantity: str) -> Float64[np.ndarray, "S E"]:
        """Of one of `nav_jax.filter.layout.QUANTITIES`, by source, SI."""
        return self.part[:, :, list(QUANTITIES[quantity][0])].sum(axis=2)

    def share(self, quantity: str) -> Float64[np.ndarray, "S E"]:
        """Part of the mean square that each source makes; NaN where there is no error."""
        squares = self.mean_square(quantity)
        total = squares.sum(axis=0)
        return np.divide(squares, total, out=np.full(squares.shape, np.nan), where=total > 0)

    def table(self, at: float | None = None) -> str:
        """RMS and shares in per cent at an epoch, the largest source of position error first."""
        k = self.epoch(at)
        head = ["source", "position [m]", *(f"{q} [%]" for q in QUANTITIES)]
        squares = self.mean_square("position")[:, k]
        shares = {q: 100 * self.share(q)[:, k] for q in QUANTITIES}
        rows = [
            [self.sources[s], number(float(np.sqrt(squares[s])), 3), *(_percent(float(v[s])) for v in shares.values())]
            for s in np.argsort(-squares)
        ]
        rms = {q: f * np.sqrt(self.mean_square(q)[:, k].sum()) for q, (_, _, f) in QUANTITIES.items()}
        texts = [f"{number(float(x), 4)} {QUANTITIES[q][1]}" for q, x in rms.items()]
        rows.append(["all: RMS", number(float(rms["position"]), 3), *texts])
        return format_table(head, rows)

    def plot(
        self,
        *,
        quantities: Sequence[str] = ("horizontal", "vertical", "tilt", "heading"),
        num: int = 7,
        axes: GivenAxes | None = None,
    ) -> Figure:
        """Draw the shares of the sources over time, and the errors themselves.

        Parameters
        ----------
        quantities
            A frame each, of `nav_jax.filter.layout.QUANTITIES`.
        num
            At most so many sources have a colour of their own; the others are one.
        axes
            An Axes for each quantity to draw into; a new figure if left out.

        Returns
        -------
        Figure
            See `nav_jax.plotting.plot_budget`.
        """
        return self._draw(quantities=quantities, num=num, axes=axes)

    def __repr__(self) -> str:
        return f"Error budget at {self.time[self.epoch()]:g} s: parts of the mean square\n{self.table()}"


class _Weights(eqx.Module):
    """1 for what belongs to a source."""

    start: Float[Array, " nav"]
    states: Float[Array, " M"]
    white: Float[Array, " ch"]
    aiding: Float[Array, " K"]


def error_budget(scenario: Scenario, truth: ImuErrors, filter: ImuErrors | None = None) -> Budget:
    """Split the mean square error of a filter into what each source of noise makes of it.

    Sources are the processes of accelerometers and gyros (of three axes together where they have one model), turn-on
    biases and other constants, the disturbance of gravity, the uncertainty of the start, and each aiding sensor.

    Parameters
    ----------
    scenario
        Trajectory, aiding, start and Earth; the filter knows of its start what is true.
    truth, filter
        Errors of the IMU, and what the filter believes of them; the truth if not given.

    Raises
    ------
    ValueError
        As of `nav_jax.analyse`; nothing is random.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> budget = nj.error_budget(scenario, truth)
    >>> shares = budget.share("position")
    >>> bool(np.allclose(np.nansum(shares, axis=0), 1.0))  # they add up
    True
    """
    truth = model_of(truth)
    believed = truth if filter is None else filter
    setup = Setup(scenario, check_rates(truth, {"filter": believed}))
    warn_of_range(truth.output, setup.imu)
    experiment, at = setup.experiment, jnp.asarray(setup.output_segments)
    noise, ours, motion = noise_of(experiment, truth), believed.bank(), motion_of(experiment)
    sources = _sources(experiment, truth, noise)
    if not sources:
        raise ValueError("There is no source of error: no sensor noise, no uncertainty of the start, no aiding.")
    weights = jax.tree.map(lambda *a: jnp.stack(a), *sources.values())
    return Budget(
        setup.output_times,
        tuple(sources),
        np.asarray(_parts(experiment, motion, noise, ours, weights, at)),
        setup.outages,
        setup.fixes,
    )


@bounded
@eqx.filter_jit
def _parts(
    experiment: Experiment, motion: Motion, noise: Noise, ours: SensorBank, weights: _Weights, at: Int[Array, " E"]
) -> Float[Array, "S E nav"]:
    """Variances of the navigation error from each source alone, at the segments `at`."""
    noises = jax.vmap(lambda w: _only(noise, w))(weights)
    N = covariances_of_many(experiment, motion, noises, alone(ours), experiment.initial).true.navigation[:, at]
    return jnp.diagonal(N, axis1=2, axis2=3)


def _only(noise: Noise, w: _Weights) -> Noise:
    """What of the noise belongs to a source."""
    forms = tuple(
        f._replace(driving=x * f.driving, initial=x * f.initial, white=x * f.white)
        for f, x in zip(noise.aiding.forms, w.aiding, strict=True)
    )
    # weights are 0 and 1, and states of two sources independent
    imu = eqx.tree_at(
        lambda b: (b.driving, b.initial, b.white),
        noise.imu,
        (w.states[:, None] * noise.imu.driving, w.states[:, None] * noise.imu.initial, w.white * noise.imu.white),
    )
    if imu.travel is not None:
        imu = eqx.tree_at(lambda b: b.travel.variance, imu, w.states * imu.travel.variance)
    aiding = eqx.tree_at(lambda a: a.forms, noise.aiding, forms)
    return Noise(w.start[:, None] * noise.start * w.start[None, :], imu, aiding)


def _sources(experiment: Experiment, truth: ImuErrors, noise: Noise) -> dict[str, _Weights]:
    """Name -> what belongs to it, without what is zero."""
    M, K = len(noise.imu.states), len(noise.aiding.forms)
    known, white = np.diag(np.asarray(noise.start)), np.asarray(noise.imu.white)
    found: dict[str, _Weights] = {}

    def add(name: str, start: Any = (), states: Any = (), channels: Any = (), aiding: Any = ()) -> None:
        w = [np.zeros(n) for n in (NAVIGATION.size, M, len(CHANNELS), K)]
        for array, at in zip(w, (start, states, channels, aiding), strict=True):
            array[list(at)] = 1.0
        found[name] = _Weights(*map(jnp.asarray, w))

    for group in shared_channels(truth):
        if white[list(group.channels)].any():
            add(f"{group.name} white", channels=group.channels)
        mine = [(i, s.label.split(" ")[0]) for i, s in enumerate(noise.imu.states) if s.channel in group.channels]
        for label in dict.fromkeys(label for _, label in mine):
            add(f"{group.name} {label}", states=[i for i, of in mine if of == label])
    for name, channels in (("deflection", GRAVITY[:2]), ("anomaly", GRAVITY[2:])):
        found_at = [i for i, s in enumerate(noise.imu.states) if s.channel in channels]
        if found_at:
            add(f"gravity {name}", states=found_at)
    across = np.array(noise.start)
    starts = {name: NAVIGATION[name] for name in NAVIGATION.names}
    for part in starts.values():
        across[part, part] = 0.0
    if across.any():  # position, velocity and attitude are not independent
        add("start", start=range(NAVIGATION.size))
    else:
        for name, part in starts.items():
            if known[part].any():
                add(f"start {name}", start=NAVIGATION.columns(name))
    own = experiment.timeline.drawn
    at, first = M - own.size, 0
    for sensor, (a, b) in zip(experiment.sensors, own.parts, strict=True):
        for group in dict.fromkeys(own.groups[a:b]):
            add(group, states=[at + i for i in range(a, b) if own.groups[i] == group])
        add(sensor.name, aiding=range(first, first + len(sensor.axes)))
        first += len(sensor.axes)
    return found


def _percent(x: float) -> str:
    return "-" if np.isnan(x) else f"{x:.1f}"
