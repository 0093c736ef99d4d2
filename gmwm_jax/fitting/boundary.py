"""Intervals at a boundary: of a component at zero, of one at a limit, and of all that depends on what these may be.

Where the data put an amplitude to zero, the truth may still be a little more than zero: the estimate is then not normal,
and standard errors that take the zero for known are those of another problem. Beside white noise that has come out as
zero an autoregression of phi = 0.3 held its truth in 32 of 76 intervals for phi and in none of 76 for sigma^2.

What is known. Let c >= 0 be the amplitude, and let the *signed* estimate c_s, which may be negative, be normal with the
standard deviation a (`parameter_covariance` without the constraint). To first order the estimate is the projection of
the signed one onto the cone c >= 0, and the others move with it, theta = theta_s + K (c_s - c) (Chernoff 1954; Self &
Liang 1987; Andrews 1999). Its distribution depends on the true c, which no estimate at zero tells: the errors under c = 0,
taken off the estimate, lie on the wrong side of it for a c above zero, and no bootstrap is uniformly right (Andrews
2000). What is uniform is to invert a test: all values that data would not reject (Mikusheva 2007, for autoregressions).

Hence, z the normal quantile of the level:

* Zero. The amplitude is less than c_U where the model with c_U, fitted again in all other parameters, would have given
  the estimate with z standard deviations to spare, by the variance that holds *there*: c_U = z sd(c_U). The interval
  [0, c_U] is that of max(c_s, 0), and never empty.
* The others. While c runs from 0 to c_U they run from theta(0) to theta(c_U), by fits again. Their interval is that of
  a known c = 0, and on the side to which they run longer: sqrt((theta(c_U) - theta(0))^2 + (z sd)^2), the shadow of the
  ellipse of both. A component with a shape runs once for each shape that the record can show; several components add
  their squares.
* A limit. A Gauss-Markov process that has come out as a random walk may have a correlation time that is finite and
  long. Its shape runs inwards from the limit, the others fitted again, until the score of the shape (Rao 1948; C(alpha),
  Neyman 1959) is z standard deviations: the hull of all intervals on the way, each reduced to sqrt(z^2 - score^2), is
  the interval of what the limit determines and of the others, and the places themselves are that of the shape.
* Near a limit. A shape that the data know only to a factor has the same interval, by its score, from both sides of the
  estimate; it is open where the limit is not rejected. On the log scale it would exclude the limit always.
* Near zero. An amplitude that is less than four standard deviations from zero is symmetric on neither scale: its error
  is sd(c)^2 = a^2 + b^2 c^2, with a from all the others and b from its own noise. It has the interval of the transformed
  asinh(b c/a)/b, which is that of log c for large c and of c itself for small, ending at zero.

Far from the estimate the score loses sight of it: there half of the root of the objective stands for it. Where the score
falls again on the way, the component has come to play the part of another one, and only its own interval goes on.

Elsewhere nothing changes. To first order the coverage is 95 % in the interior and up to 97.5 % where the truth is at or
near zero; `tests/validation/gmwm/test_interval_coverage.py` has the table. Other candidates: standard errors with the
zero known cover 54 to 84 % over all records of the example above, as 200 wavelet variances drawn from theory have it;
the projected normal has to be told the true c; the covariance of the signed fit around the estimate is the same on
the side to which the others run, and as long on the other side, where nothing can be.

Not covered: what a component with a shape does that it has found by chance. Where its true amplitude is zero, its shape
has no true value, and the largest of many scores is not normal (Davies 1987): `gmwm_jax.inference.select` tells whether
it is there at all.
"""  # noqa: E501

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Int

from gmwm_jax._internal.cached import cached_property
from gmwm_jax._internal.host import known
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax.fitting.outcome import Outcome
from gmwm_jax.fitting.standard_errors import ConditionalFits, conditional_fits
from gmwm_jax.fitting.tables import LogQuantities
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.parameter import Limit

_PLACES = 24
"""At which a component is held, at once."""
_SMALL = 1e-4
"""An amplitude of which the wavelet variance is nowhere a larger share: zero, with a logarithm."""
_NEAR_ZERO = 0.25
"""Standard error of the log of an amplitude above which its interval may end at zero."""
_HARDLY_KNOWN = 0.5
"""Standard error of the coordinate of a shape above which its interval may end at a limit."""
_FAR = 4.0
"""Standard errors from a limit beyond which it is out of sight."""
_GONE = -700.0
"""The log of an amplitude of zero, for programs."""
_SECANTS = 2
_WIDEST = 30.0
"""Half width, on the log scale, of the widest interval that says anything: a factor of 1e13 either way."""
_STEEPEST = 5.0
"""Of z b: beyond it an amplitude without bound."""
_FALLS = 0.02
"""Of z, by which a score on its way up may fall by rounding."""


class Entry(NamedTuple):
    """Which parameters of which component a quantity reads, and the limit at which it is determined."""

    component: int
    reads: tuple[int, ...]
    determined_at: Limit


@dataclass(frozen=True)
class Quantities:
    """All parameters, each on the line of its own interval, and the logs of all continuous-time quantities."""

    logs: LogQuantities

    def __call__(self, model: Composite) -> Array:
        """One vector of all."""
        return jnp.concatenate([model.parameter_lines(), self.logs(model)])

    def entries(self, model: Composite) -> tuple[Entry, ...]:
        """What each of them reads."""
        parts = enumerate(model.processes)
        parameters = [Entry(i, (k,), q.determined_at) for i, p in parts for k, q in enumerate(p.parameters)]
        logs = [Entry(i, q.reads, q.determined_at) for i, qs in enumerate(self.logs.quantities) for q in qs]
        return (*parameters, *logs)


class Run(NamedTuple):
    """The model fitted again while one component is held at each of N places that the data leave it."""

    component: int
    of_zero: bool
    """It is at zero, and at these places its amplitude is at the end of its interval; else its shape is held."""
    values: Float[np.ndarray, "N Q"]
    covariance: Float[np.ndarray, "N Q Q"]
    """Of the values, the component held."""
    score: Float[np.ndarray, " N"]
    """Of a shape: standard deviations from the estimate to the place."""
    open: tuple[bool, bool]
    """Of a shape: do data leave it the low and the high end of its coordinate? Of zero: and any amplitude (high)?"""
    near: Bool[np.ndarray, " N"]
    """Of a shape: the places on the slope of the estimate. Where the score falls again is another minimum, in which the
    component plays the part of another one."""


class Boundary:
    """Intervals of all quantities of a fit by what its boundaries leave open, on the line of each quantity.

    Parameters
    ----------
    fit
        A `gmwm_jax.fitting.Fit` whose covariance is known.
    quantities
        Of which there are Q.
    """

    def __init__(self, fit: Any, quantities: Quantities):
        self._fit, self._quantities, self._z = fit, quantities, normal_quantile(fit.level)
        self._processes, self._tau = fit.model.processes, fit.wv.scales
        self._tau_max = float(self._tau[-1])
        self._entries = quantities.entries(fit.model)
        lines = [x for p in self._processes for x in p.to_lines(known(*p.values))]
        self._lines = np.maximum(np.array(lines, dtype=float), _GONE)
        first = np.cumsum([0, *(len(p.parameters) for p in self._processes)])
        self._own = [slice(int(a), int(b)) for a, b in pairwise(first)]
        at, num = list(fit.active), fit.model.num_parameters
        self._free = np.isin(np.arange(num), at)
        self._C = np.zeros((num, num))
        self._C[np.ix_(at, at)] = fit.covariance
        self._deviation = np.sqrt(np.diag(self._C))

    @property
    def is_near(self) -> bool:
        """Is a component at a boundary, or so near to one that its errors reach it?"""
        near = any(self._runs_zero(i) or self._runs_shape(i) or self._is_faint(i) for i in range(len(self._own)))
        return near and bool(np.all(self._fitted > 0))

    @cached_property
    def ends(self) -> tuple[Float[np.ndarray, " Q"], Float[np.ndarray, " Q"]]:
        """Both ends of all intervals; NaN where there is none."""
        with np.errstate(all="ignore"):
            return self._ends()

    def _ends(self) -> tuple[Float[np.ndarray, " Q"], Float[np.ndarray, " Q"]]:
        x, errors = self._here.values[0], np.sqrt(np.diag(self.covariance))
        none = ~(errors > 0)
        low, high = (np.where(none, np.nan, x + sign * self._z * errors) for sign in (-1, 1))
        for i in range(len(self._own)):
            own = self._entries_of(i)
            if self._is_faint(i):
                self._near_zero(i, own, low, high)
            for run in self.runs:
                if run.component == i and not run.of_zero:
                    down, up = self._of_shape(run, own)
                    low[own], high[own] = (np.fmin(low[own], down) if self._is_faint(i) else down), up
        for run in self.runs:
            reached = self._reached(run, x, errors, low, high, run.values, _errors(run.covariance))
            other = ~np.isin(np.arange(len(x)), self._entries_of(run.component))
            low, high = np.where(other, reached[0], low), np.where(other, reached[1], high)
        for run in self.runs:
            own = self._entries_of(run.component)
            if run.of_zero:
                low[own], high[own] = self._of_zero(run, own)
        # what may be anything has no interval
        inside = np.array([not self._outcome(e.component).at_boundary for e in self._entries])
        none = (low < x - _WIDEST) & (high > x + _WIDEST) & inside | np.isneginf(low) & np.isposinf(high)
        return np.where(none, np.nan, low), np.where(none, np.nan, high)

    def root_sum_of_squares(self, at: list[int]) -> tuple[float, float]:
        """The interval of the root of the sum of squares of quantities of which these are the logs."""
        with np.errstate(all="ignore"):
            low, high = self._root_sum_of_squares(at)
            return float(np.exp(low[0])), float(np.exp(high[0]))

    def _root_sum_of_squares(self, at: list[int]) -> tuple[np.ndarray, np.ndarray]:
        if len(at) == 1:
            low, high = (end[at] for end in self.ends)
        else:
            value, error = root_sum_of_squares(self._here.values[0], self.covariance, at)
            x, errors = np.log([value]), np.array([error])
            low, high = x - self._z * errors, x + self._z * errors
            for run in self.runs:
                own = [root_sum_of_squares(v, C, at) for v, C in zip(run.values, run.covariance, strict=True)]
                values, sd = np.array(own).reshape(-1, 2).T[:, :, None]
                low, high = self._reached(run, x, errors, low, high, np.log(values), sd)
        return low, high

    @cached_property
    def lifted(self) -> Composite:
        """The model with next to no variance for the components at zero that have no shape: they have logarithms."""
        processes = list(self._processes)
        for run in self._runs_to_zero:
            p, last = processes[run.component], self._own[run.component].stop - 1
            build: Any = type(p)
            processes[run.component] = build(**{p.parameters[-1].name: p.parameters[-1].from_line(run.values[0, last])})
        return Composite(processes)

    def moves(self, rng: np.random.Generator, num: int) -> Float[np.ndarray, "D P"]:
        """Parameters on the real line less those of `lifted`, drawn for what the components at zero may be.

        An amplitude is half a normal variable, as far as the estimate at zero leaves it, and the others go along.
        """
        found = np.zeros((num, len(self._lines)))
        for run in self._runs_to_zero:
            last, end = self._own[run.component].stop - 1, run.values[-1, : len(self._lines)]
            size = np.abs(rng.standard_normal(num)) / self._z
            found += size[:, None] * (end - self._here.values[0, : len(self._lines)])
            found[:, last] = end[last] - run.values[0, last] + _power(self._processes[run.component]) * np.log(size)
        return np.where(self._free | np.isin(np.arange(len(self._lines)), self._zero_lines), found, 0.0)

    @property
    def _zero_lines(self) -> list[int]:
        return [self._own[run.component].stop - 1 for run in self._runs_to_zero]

    @property
    def _runs_to_zero(self) -> list[Run]:
        """Of components without a shape, where lines are those of single parameters."""
        if any(p.num_coordinates > 1 for p in self._processes):
            return []
        return [r for r in self.runs if r.of_zero and len(r.values) and not self._processes[r.component].shape]

    @cached_property
    def covariance(self) -> Float[np.ndarray, "Q Q"]:
        """Of all quantities, components at a boundary held there; NaN for those without a standard error."""
        C = self._C
        slopes = np.where(self._free, self._here.slopes[0], 0.0)
        lost = np.any((slopes != 0) & np.isnan(np.diag(C)), axis=1)
        found = slopes @ np.where(np.isnan(C), 0.0, C) @ slopes.T
        return np.where(np.logical_or.outer(lost, lost), np.nan, found)

    # -- which components run -----------------------------------------------------------------------------------------

    def _outcome(self, i: int) -> Outcome:
        return self._fit.at_boundary.get(self._fit.model.labels[i], Outcome.ESTIMATED)

    def _runs_zero(self, i: int) -> bool:
        return self._outcome(i) is Outcome.ZERO

    def _runs_shape(self, i: int) -> bool:
        p, outcome = self._processes[i], self._outcome(i)
        if len(p.parameters) != 2 or p.fixed or outcome is Outcome.ZERO:
            return False  # beside a held variance the data know the shape as they know an amplitude
        error = self._deviation[self._own[i].start]
        if outcome.at_boundary or error > _HARDLY_KNOWN:
            return True
        line, tau_max = self._lines[self._own[i].start], self._tau_max
        return bool(error) and any(p.limit_of(_shape(p, line + k * error), tau_max) for k in (-_FAR, _FAR))

    def _is_faint(self, i: int) -> bool:
        """Is its amplitude near zero?"""
        return bool(self._deviation[self._own[i].stop - 1] > _NEAR_ZERO * _power(self._processes[i]))

    # -- fits again ---------------------------------------------------------------------------------------------------

    def _fits(
        self,
        places: Float[np.ndarray, "N P"],
        free: Bool[np.ndarray, " P"],
        tested: int | None = None,
        target: Float[np.ndarray, " J"] | None = None,
    ) -> ConditionalFits:
        """Of the fitted wavelet variance, at up to `_PLACES` places."""
        num, test = len(places), np.zeros(len(free), dtype=bool)
        if tested is not None:
            test[tested] = True
        filled = np.concatenate([places, np.repeat(places[-1:], _PLACES - num, axis=0)])
        target, model = self._fitted if target is None else target, self._fit.model
        found = conditional_fits(self._quantities, model, filled, free, test, target, self._whitener, self._tau)
        return ConditionalFits(*(np.asarray(leaf)[:num] for leaf in found))

    @cached_property
    def _fitted(self) -> Float[np.ndarray, " J"]:
        """Wavelet variance of the fit, by the program that serves all else."""
        nothing = np.zeros_like(self._free)
        return self._fits(self._lines[None], nothing, target=self._fit.wv.variance).fitted[0]

    @property
    def _V(self) -> Float[np.ndarray, "J J"]:
        return np.asarray(self._fit.wv_covariance)

    @cached_property
    def _whitener(self) -> Float[np.ndarray, "J J"]:
        return np.linalg.cholesky(self._fit.omega).T

    @cached_property
    def _here(self) -> ConditionalFits:
        """At the estimate."""
        return self._fits(self._lines[None], self._free)

    def _units(self, i: int, shapes: list[tuple[float, ...]]) -> Float[np.ndarray, "N J"]:
        """Wavelet variances of a component with an amplitude of 1."""
        places = self._places(i, shapes, np.ones(len(shapes)))
        for j, own in enumerate(self._own):
            if j != i:
                places[:, own.stop - 1] = _GONE
        return self._fits(places, np.zeros_like(self._free)).fitted

    def _places(self, i: int, shapes: list[tuple[float, ...]], amplitudes: Any) -> Float[np.ndarray, "N P"]:
        """The estimate with other parameters of one component."""
        p, places = self._processes[i], np.repeat(self._lines[None], len(shapes), axis=0)
        for place, shape, amplitude in zip(places, shapes, amplitudes, strict=True):
            place[self._own[i]] = [float(x) for x in p.to_lines((*shape, p.value_of(np.float64(amplitude))))]
        return places

    def _shapes(self, i: int) -> list[tuple[float, ...]]:
        """Those that are apart from every limit, from the low end of the coordinate to the high one."""
        p, tau_max = self._processes[i], self._tau_max
        names = [q.name for q in p.parameters[:-1]]
        if not names or set(names) <= set(p.fixed):
            return [tuple(float(s) for s in p.shape)]
        if p.num_coordinates > 1:
            nodes = [np.asarray(n) for n in p.start_nodes(tau_max, _PLACES)][:_PLACES]
            return [tuple(float(s) for s in p.shape_from_coordinate(n)) for n in nodes]
        inside = [
            z for z in np.linspace(*p.coordinate_bounds(tau_max), num=1000) if not p.limit_of(_shape(p, z), tau_max)
        ]
        return [_shape(p, z) for z in np.linspace(inside[0], inside[-1], _PLACES)]

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """One for each component that is at a boundary, or whose shape is hardly known."""
        with np.errstate(all="ignore"):  # what has no bound is infinite
            return self._runs()

    def _runs(self) -> tuple[Run, ...]:
        zero = [self._run_of_zero(i) for i in range(len(self._own)) if self._runs_zero(i)]
        return (*zero, *(self._run_of_shape(i) for i in range(len(self._own)) if self._runs_shape(i)))

    def _run_of_zero(self, i: int) -> Run:
        """The amplitude from zero to the end of its interval, for each shape that the component may have."""
        z, shapes, tested = self._z, self._shapes(i), self._own[i].stop - 1
        alone = np.min(self._fitted / self._units(i, shapes), axis=1)

        def at(shapes: list[tuple[float, ...]], amplitudes: Any) -> tuple[ConditionalFits, np.ndarray, np.ndarray]:
            found = self._fits(self._places(i, shapes, amplitudes), self._free, tested)
            score, error = self._distances(found, tested)
            return found, np.abs(score), error * amplitudes / _power(self._processes[i])

        found, _, a = at(shapes, _SMALL * alone)
        seen = ~found.unseen[:, tested]
        a = np.where(seen, a, alone)
        _, _, sd = at(shapes, z * a)
        # sd^2 = a^2 + b^2 c^2
        b = np.sqrt(np.maximum(sd**2 / a**2 - 1, 1e-12)) / z
        most = a / b * np.sinh(np.minimum(z * b, _STEEPEST))
        if len(shapes) == 1:
            most = self._amplitudes_left(lambda c: at(shapes * _PLACES, c)[1], float(alone[0]), float(most[0]))
            shapes = shapes * len(most)
        else:
            for _ in range(_SECANTS):  # where the others take up its variance its error falls
                _, score, _ = at(shapes, most)
                most = most * np.minimum(1.0, z / np.maximum(score, 1e-300))
        found, score, _ = at(shapes, most)
        seen = ~found.unseen[:, tested]
        return Run(
            i,
            True,
            found.values[seen],
            self._covariances(found)[seen],
            score[seen],
            (False, not seen.all()),
            seen[seen],
        )

    def _amplitudes_left(self, score_of: Any, alone: float, most: float) -> Float[np.ndarray, " N"]:
        """Amplitudes from next to zero to where the score comes to z.

        Own noise that grows with the amplitude may never let it come there: then to `most`.

        Parameters
        ----------
        score_of
            At `_PLACES` amplitudes.
        alone
            Amplitude at which the component alone has all of the variance at some scale.
        most
            By the first order.
        """
        grid = np.geomspace(_SMALL * alone, 2 * max(alone, most), _PLACES)
        above = score_of(grid) > self._z
        if not np.any(above):
            return np.append(grid[grid < most], most)
        k = int(np.argmax(above))
        fine = np.linspace(grid[k - 1], grid[k], _PLACES)
        return np.append(grid[:k], fine[max(int(np.argmax(score_of(fine) > self._z)), 1) - 1])

    def _run_of_shape(self, i: int) -> Run:
        """The shape from the estimate towards both ends of its coordinate, as far as the data leave it."""
        p, tested, tau_max = self._processes[i], self._own[i].start, self._tau_max
        shapes, own = self._shapes(i), tuple(float(s) for s in p.shape)
        units = self._units(i, shapes) @ self._whitener.T
        variance = _amplitude(p) * self._units(i, [own])[0] @ self._whitener.T
        amplitudes = units @ variance / np.sum(units * units, axis=1)
        found = self._fits(self._places(i, shapes, amplitudes), self._free, tested)
        score, _ = self._distances(found, tested)
        score = np.where(found.unseen[:, tested] | ~np.isfinite(score), 0.0, np.abs(score))
        score = np.where(np.isinf(found.values).any(axis=1), np.inf, score)
        line = np.array([self._lines[tested], *(p.to_lines((s, 1.0))[0] for (s,) in shapes)], dtype=float)
        limit = p.limit_of(own, tau_max)
        if limit:  # it lies beyond the places
            line[0] = 2 * line[1] - line[2] if line[0] < line[1] else 2 * line[-1] - line[-2]
        values = np.concatenate([self._here.values, found.values])
        covariance = np.concatenate([self.covariance[None], self._covariances(found)])
        order = np.argsort(line)
        values, covariance, score = values[order], covariance[order], np.array([0.0, *score])[order]
        if limit:  # what is not determined there has no value
            j = 0 if order[0] == 0 else len(order) - 1
            k = 1 if j == 0 else len(order) - 2
            unknown = np.array([e.component == i and e.determined_at is not limit for e in self._entries])
            values[j] = np.where(unknown, values[k], values[j])
            covariance[j] = np.where(unknown[:, None] | unknown, covariance[k], covariance[j])
        start = int(np.flatnonzero(order == 0)[0])
        return self._left(i, values, covariance, score, start)

    def _left(self, i: int, values: Any, covariance: Any, score: Any, start: int) -> Run:
        """The places around the estimate whose score is at most z, in order, and where on either side it comes to z."""
        z = self._z

        def towards(step: int) -> tuple[list[tuple[Any, ...]], bool]:
            found, k, rising = [], start, True
            while 0 <= k + step < len(score) and score[k + step] <= z:
                rising = rising and score[k + step] >= score[k] - _FALLS * z
                k += step
                found.append((values[k], covariance[k], score[k], rising))
            if not 0 <= k + step < len(score):
                return found, True
            if np.isinf(values[k + step]).any():  # it is gone there
                return found, False
            w = (z - score[k]) / (score[k + step] - score[k])
            return [*found, (values[k] + w * (values[k + step] - values[k]), covariance[k], z, rising)], False

        (left, low_open), (right, high_open) = towards(-1), towards(1)
        places = [*left[::-1], (values[start], covariance[start], 0.0, True), *right]
        values, covariance, score, near = (np.array(c) for c in zip(*places, strict=True))
        return Run(i, False, values, covariance, score, (low_open, high_open), near)

    def _distances(
        self, found: ConditionalFits, tested: int
    ) -> tuple[Float[np.ndarray, " N"], Float[np.ndarray, " N"]]:
        """How far the estimate is from each place in standard deviations of the tested parameter, and these.

        By the score of the place. Far away that loses sight of the estimate, where the root of the objective does not:
        the two are equal where all is linear, and the latter, which is never less, counts by half.
        """
        row, off = found.whole[:, tested], self._fitted - found.fitted
        flat = np.linalg.solve(self._whitener.T, row.T)
        error = np.sqrt(np.einsum("nj,njk,nk->n", row, self._V_at(found), row))
        with np.errstate(divide="ignore", invalid="ignore"):
            score = np.abs(np.einsum("nj,nj->n", row, off)) / error
            root = np.linalg.norm(off @ self._whitener.T, axis=1) * np.linalg.norm(flat, axis=0) / error
        return np.maximum(score, root / 2), error

    def _V_at(self, found: ConditionalFits) -> Float[np.ndarray, "N J J"]:
        """Covariance of the wavelet variance: that of the fit, scaled as the variances are; see `intervals`."""
        ratio = found.fitted / self._fitted
        return self._V * ratio[:, :, None] * ratio[:, None, :]

    def _covariances(self, found: ConditionalFits) -> Float[np.ndarray, "N Q Q"]:
        """Of the quantities, the component held."""
        G = np.where(self._free, found.slopes, 0.0) @ found.estimator
        return G @ self._V_at(found) @ np.swapaxes(G, 1, 2)

    # -- intervals ----------------------------------------------------------------------------------------------------

    def _entries_of(self, i: int) -> Int[np.ndarray, " E"]:
        """Positions of the quantities of a component."""
        return np.flatnonzero([e.component == i for e in self._entries])

    def _reached(
        self, run: Run, x: Any, errors: Any, low: Any, high: Any, values: Any, sd: Any
    ) -> tuple[Float[np.ndarray, " Q"], Float[np.ndarray, " Q"]]:
        """Intervals made longer by what quantities become while another component runs: errors add in squares."""
        half, plain = 0.0, 0.0
        if not run.of_zero:
            half = np.sqrt(np.maximum(self._z**2 - run.score[:, None] ** 2, 0)) * sd
            half = np.where(run.near[:, None], half, -np.inf)
            plain = (self._z * errors) ** 2
        with np.errstate(invalid="ignore"):
            more = [
                np.maximum(np.max(sign * (values - x) + half, axis=0, initial=0.0) ** 2 - plain, 0) for sign in (-1, 1)
            ]
            return x - np.sqrt((x - low) ** 2 + more[0]), x + np.sqrt((high - x) ** 2 + more[1])

    def _of_zero(self, run: Run, own: Any) -> tuple[Any, Any]:
        """From zero to the largest amplitude; nothing is known of the shape."""
        last = len(self._processes[run.component].parameters) - 1
        reads = np.array([last in self._entries[k].reads for k in own])
        high = np.inf if run.open[1] else np.max(run.values[:, own], axis=0)
        return np.where(reads, -np.inf, np.nan), np.where(reads, high, np.nan)

    def _of_shape(self, run: Run, own: Any) -> tuple[Any, Any]:
        """The hull over all places, open to a limit that is not rejected and does not determine a quantity."""
        p, tau_max = self._processes[run.component], self._tau_max
        values, sd = run.values[:, own], _errors(run.covariance)[:, own]
        half = np.sqrt(np.maximum(self._z**2 - run.score[:, None] ** 2, 0)) * np.nan_to_num(sd)
        low, high = np.min(values - half, axis=0), np.max(values + half, axis=0)
        for is_open, edge, k, inner in zip(run.open, p.coordinate_bounds(tau_max), (0, -1), (-1, 0), strict=True):
            limit = p.limit_of(_shape(p, edge), tau_max)
            for m, j in enumerate(own):
                if is_open and not (limit and self._entries[j].determined_at is limit):
                    rises = values[k, m] - values[inner, m]
                    low[m], high[m] = (low[m], np.inf) if rises > 0 else (-np.inf, high[m])
        none = ~np.isfinite(values).all(axis=0)
        return np.where(none, np.nan, low), np.where(none, np.nan, high)

    def _near_zero(self, i: int, own: Any, low: Any, high: Any) -> None:
        """Make the intervals of what reads a faint amplitude those of asinh(b c/a)/b."""
        p, z, last = self._processes[i], self._z, self._own[i].stop - 1
        share = _amplitude(p) * self._units(i, [tuple(float(s) for s in p.shape)])[0] / self._fitted
        row = self._here.estimator[0, last] / _power(p)
        whole = row @ self._V @ row
        its = np.clip(row @ (self._V * share[:, None] * share) @ row, 1e-12 * whole, (1 - 1e-12) * whole)
        b, a = np.sqrt(its), np.sqrt(whole - its)
        with np.errstate(divide="ignore", over="ignore"):
            ends = [np.log(np.maximum(a / b * np.sinh(np.arcsinh(b / a) + sign * z * b), 0.0)) for sign in (-1, 1)]
        for k in own:
            if len(p.parameters) - 1 in self._entries[k].reads:
                x = self._here.values[0, k]
                error = np.sqrt(self.covariance[k, k] / whole)
                # no less than on the log scale while that excludes zero: own noise is skew
                low[k], high[k] = x + error * ends[0], x + error * max(ends[1], min(z * np.sqrt(whole), 1.0))


def root_sum_of_squares(logs: np.ndarray, covariance: np.ndarray, at: list[int]) -> tuple[float, float]:
    """The root of the sum of squares of quantities, and the standard error of its log."""
    squares = np.exp(2 * logs[at])
    weights = squares / squares.sum()
    variance = float(weights @ covariance[np.ix_(at, at)] @ weights)
    return float(np.sqrt(squares.sum())), float(np.sqrt(variance)) if variance > 0 else np.nan


def _errors(covariance: Float[np.ndarray, "N Q Q"]) -> Float[np.ndarray, "N Q"]:
    return np.sqrt(np.maximum(np.einsum("nqq->nq", covariance), 0.0))


def _power(p: AbstractProcess) -> float:
    """The last parameter goes with this power of the amplitude."""
    return float(np.log(p.value_of(np.float64(np.e))))


def _amplitude(p: AbstractProcess) -> float:
    return float(p.amplitude_of(*known(p.values[-1])))


def _shape(p: AbstractProcess, coordinate: Any) -> tuple[float, ...]:
    return tuple(float(s) for s in p.shape_from_coordinate(coordinate))
