"""What a fit says of itself: how well the model describes the data, and whether it is wrong.

Every fit with theory prints its test of fit. Where the data are beyond what chance does under the model, a warning
stands before the estimates, for their intervals assume that the model is right: with a million samples they are a few
parts in a thousand, however far off the model is.

What is tested is the model with the amplitudes that weights of its own give it, unless those of the fit are the
inverse of the covariance, as the test has it: default weights trust what came out low by chance, and the covariance
under such a fit is too small. By it p is below 5 % for up to 20 % of right models, in place of 3 to 7 %.
`tests/validation/gmwm/test_misfit.py` has the table.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.checks import spans
from gmwm_jax._internal.chi_square import ChiSquare
from gmwm_jax.processes.base import AbstractProcess, Composite, scaled
from gmwm_jax.processes.parameter import Fixed

_ROUNDS = 8


def unit_variances(model: Composite, tau: Float[np.ndarray, " J"]) -> Float[np.ndarray, "C J"]:
    """The wavelet variance of each component for unit amplitude, by programs that all models share."""
    one: Any = np.float64(1.0)
    at = spans(tau)
    return np.array([np.asarray(scaled(p.unit_wavelet_variance, one, p.shape, at)) for p in model.processes])


def amplitudes_of(model: Composite) -> Float[np.ndarray, " C"]:
    """The amplitudes of the components of a fitted model."""
    return np.array([float(p.amplitude) for p in model.processes])


def with_amplitudes_again(
    model: Composite, variance: Float[np.ndarray, " J"], unit: Float[np.ndarray, "C J"], error: Float[np.ndarray, " J"]
) -> tuple[Composite, Float[np.ndarray, "J J"]]:
    """Fit the amplitudes that are not held anew, with weights of the model itself, and return it with these weights.

    Weights that come from the data trust the small among the variances of few degrees of freedom too much: a random
    walk may come out as zero for one of them, and all the others miss it.

    Parameters
    ----------
    model, variance
        A fitted model, and the wavelet variance.
    unit
        Wavelet variance of each component for unit amplitude.
    error
        Relative standard deviations of the wavelet variance.
    """
    amplitudes = amplitudes_of(model)
    free = [
        i
        for i, p in enumerate(model.processes)
        if p.parameters[-1].name not in p.fixed and np.any(unit[i] > 0) and np.all(np.isfinite(unit[i]))
    ]
    sd = (amplitudes @ unit) * error
    for _ in range(_ROUNDS if free else 0):
        target = (variance - np.delete(amplitudes, free) @ np.delete(unit, free, axis=0)) / sd
        columns = unit[free].T / sd[:, None]
        length = np.linalg.norm(columns, axis=0)
        amplitudes[free] = _none_below_zero(columns / length, target) / length
        sd = np.maximum(amplitudes @ unit, 1e-9 * variance) * error
    return Composite(
        [
            _with_amplitude(p, a) if i in free else p
            for i, (p, a) in enumerate(zip(model.processes, amplitudes, strict=True))
        ]
    ), np.diag(sd**-2.0)


def _none_below_zero(A: Float[np.ndarray, "J P"], b: Float[np.ndarray, " J"]) -> Float[np.ndarray, " P"]:
    """Least squares with x >= 0: the plain solution where that is none, which is most often."""
    x, _, rank, _ = np.linalg.lstsq(A, b, rcond=None)
    if rank == A.shape[1] and np.all(x >= 0):
        return x
    from scipy.optimize import nnls  # 0.15 s to import

    return nnls(A, b)[0]


def _with_amplitude(process: AbstractProcess, amplitude: float) -> AbstractProcess:
    build: Any = type(process)
    names = [p.name for p in process.parameters]
    values = {n: Fixed(v) if n in process.fixed else v for n, v in zip(names, process.values, strict=True)}
    return build(**{**values, names[-1]: process.value_of(amplitude)})


def sentence_of(test: ChiSquare, times: Float[np.ndarray, " J"], unit: str) -> str:
    """Return the test of fit in a line: statistic, degrees of freedom, p and the largest pull.

    Parameters
    ----------
    test
        Of a fit.
    times, unit
        Spans of the scales and their unit.
    """
    if not test.dof:
        return "test of fit: none, every scale is fitted exactly"
    return (
        f"test of fit: chi-square {test.statistic:.4g} with {test.dof} degrees of freedom, {_p(test.p_value)}; "
        f"largest pull {_largest(test, times, unit)}"
    )


def misfit_sentence(test: ChiSquare, times: Float[np.ndarray, " J"], unit: str) -> str:
    """Return what a warning says of a model that misses the data; parameters as of `sentence_of`."""
    return (
        f"the model misses the data: the largest pull is {_largest(test, times, unit)} "
        f"(chi-square {test.statistic:.4g} with {test.dof} degrees of freedom, {_p(test.p_value)}); "
        "its intervals assume that the model is right"
    )


def largest_pull(test: ChiSquare) -> int | None:
    """Return the number of the scale with the largest pull; None where every scale is fitted exactly."""
    return int(np.nanargmax(np.abs(test.pulls))) if np.any(np.isfinite(test.pulls)) else None


def _largest(test: ChiSquare, times: Float[np.ndarray, " J"], unit: str) -> str:
    j = largest_pull(test)
    return "of no scale" if j is None else f"{test.pulls[j]:+.1f} at a span of {times[j]:.4g} {unit}"


def _p(p: float) -> str:
    return f"p = {p:.2g}" if p > 1e-300 else "p < 1e-300"
