"""Held values that the data contradict: a search may well converge to the best of impossible models.

A value is contradicted when three things come together, each of which chance brings about now and then:

1. the fitted model misses the intervals of the data by a factor of `_MISS` or more at `_SCALES` scales or more;
2. another value, away by a factor of `_FAR` or more, would describe the data better, the amplitudes that are free
   being fitted anew (a non-negative least-squares problem, as wavelet variances add up; free shapes stay);
3. with it the objective falls to less than `_BETTER` of what it is.

A component that is held and too large misses the data from above, whatever the others do, since none is negative; one
that is held and too small from below, unless others stand in for it: then the data do not contradict it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from gmwm_jax.fitting.weights import root_of
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.variance.wavelet import WaveletVariance

Weights = Float[np.ndarray, "J J"]

_MISS, _SCALES = 3.0, 2
_FAR, _BETTER = 100.0, 0.1
_FACTORS = np.concatenate([1 / (_FAR * 10.0 ** np.arange(0, 10, 0.5)), _FAR * 10.0 ** np.arange(0, 10, 0.5)])
"""That are tried."""


def contradictions(model: Composite, wv: WaveletVariance, omega: Weights, objective: float) -> tuple[str, ...]:
    """Return a sentence for each held value of a fitted model that the data contradict by orders of magnitude.

    Parameters
    ----------
    model
        The estimate.
    wv, omega, objective
        What it was fitted to, by which weights, and how well.
    """
    if not any(p.fixed for p in model.processes):
        return ()
    curves = [np.asarray(p.wavelet_variance(wv.scales)) for p in model.processes]
    missed = _missed(wv, np.sum(curves, axis=0))
    if missed < _SCALES:
        return ()
    found = []
    held = [p.parameters[-1].name in p.fixed for p in model.processes]
    for i, (label, process) in enumerate(zip(model.labels, model.processes, strict=True)):
        for name in process.fixed:
            value, better = float(getattr(process, name)), {}
            for factor in _FACTORS:
                other = _with(process, name, value * factor)
                if other is not None:
                    others = [*curves[:i], np.asarray(other.wavelet_variance(wv.scales)), *curves[i + 1 :]]
                    better[factor] = _objective(wv, omega, others, held)
            factor = min(better, key=lambda f: better[f], default=1.0)
            if better and better[factor] < _BETTER * objective:
                found.append(
                    f"{label} {name} is held at {value:.3g}, and the data contradict it: the model misses their "
                    f"intervals by a factor of {_MISS:g} or more at {missed} scales, and {name} near "
                    f"{value * factor:.1g} would bring the objective from {objective:.2g} to {better[factor]:.2g}. "
                    "Values are per sample: free it, or correct it."
                )
    return tuple(found)


def _missed(wv: WaveletVariance, fitted: np.ndarray) -> int:
    """Number of scales at which the model is far outside of the intervals."""
    low, high = np.ravel(wv.ci_low), np.ravel(wv.ci_high)
    return int(np.count_nonzero((fitted > _MISS * high) | (_MISS * fitted < low)))


def _with(process: AbstractProcess, name: str, value: float) -> AbstractProcess | None:
    """The process with another value, if it can have it."""
    build: Any = type(process)
    try:
        return build(**{p.name: value if p.name == name else getattr(process, p.name) for p in process.parameters})
    except ValueError:
        return None


def _objective(wv: WaveletVariance, omega: Weights, curves: Sequence[np.ndarray], held: Sequence[bool]) -> float:
    """The objective of a model of these components, minimal over the amplitudes that are not held."""
    whitener = root_of(omega)
    fixed = [c for c, h in zip(curves, held, strict=True) if h]
    target = whitener @ (wv.variance.ravel() - np.sum([np.zeros(wv.num_scales), *fixed], axis=0))
    free = [whitener @ c for c, h in zip(curves, held, strict=True) if not h and np.any(c)]
    if not free or not np.all(np.isfinite(free)):
        return float(target @ target)
    from scipy.optimize import nnls  # 0.2 s to import, which only few fits need

    columns = np.stack([c / np.linalg.norm(c) for c in free], axis=1)
    return float(nnls(columns, target)[1] ** 2)
