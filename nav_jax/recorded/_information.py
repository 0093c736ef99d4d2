"""What an information matrix shows of parameters: standard errors, which of them it determines, and coordinates.

Parameters are on the real line, so that a standard error of one is a factor of e either way.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float64

UNOBSERVABLE = 1.0
"""Standard error of a logarithm above which a record says nothing of a parameter."""

ADMITTED = 0.5
"""The same for what is to be added to parameters that are known already: what is barely in sight is seen where its
estimate happens to be high, and would be taken up and given up again."""

_WEAKEST = 1e-12
"""Of the eigenvalues of a matrix of correlations: less is rounding."""
_SHARE = 1e-6
"""Of the square of a parameter's direction that lies where nothing is known: with more, its error is infinite."""


def standard_errors(info: Float64[np.ndarray, "P P"], active: Sequence[int]) -> Float64[np.ndarray, " P"]:
    """Of the active parameters, from their information; inf for others and for what is singular."""
    errors, lost = _errors(info, active)
    out = np.full(len(info), np.inf)
    out[list(active)] = np.where(lost, np.inf, errors)
    return out


def observable_parameters(
    info: Float64[np.ndarray, "P P"], candidates: Sequence[int], keep: Sequence[int] = ()
) -> list[int]:
    """Parameters that all have a standard error below a limit: the least sure is given up first.

    The limit is `UNOBSERVABLE`, or `ADMITTED` of what is to join others.

    Parameters
    ----------
    info
        The information.
    candidates
        Positions of parameters.
    keep
        Those of them that are not given up.
    """
    left, limit = list(candidates), ADMITTED if keep else UNOBSERVABLE
    while True:
        errors, lost = _errors(info, left)
        spare = [k for k, i in enumerate(left) if i not in keep]
        limits = np.where(np.isin(left, keep), UNOBSERVABLE, limit)
        if not spare or np.all(~lost & (errors < limits)):
            return left
        del left[max(spare, key=lambda k: (lost[k], errors[k]))]


def _errors(
    info: Float64[np.ndarray, "P P"], active: Sequence[int]
) -> tuple[Float64[np.ndarray, " k"], Bool[np.ndarray, " k"]]:
    """Standard errors, those where nothing is known large but finite, and which these are."""
    roots, vectors, scale = _correlations(info, active)
    return np.sqrt(vectors**2 @ (1 / np.maximum(roots, _WEAKEST))) / scale, vectors**2 @ (roots <= _WEAKEST) > _SHARE


def whitening(info: Float64[np.ndarray, "P P"], sought: Sequence[int]) -> Float64[np.ndarray, "P k"]:
    """B with B' I B = 1 over the sought parameters, zero rows for the others."""
    roots, vectors, scale = _correlations(info, sought)
    basis = np.zeros((len(info), len(sought)))
    basis[list(sought)] = vectors / np.sqrt(np.maximum(roots, _WEAKEST)) / scale[:, None]
    return basis


def _correlations(
    info: Float64[np.ndarray, "P P"], active: Sequence[int]
) -> tuple[Float64[np.ndarray, " k"], Float64[np.ndarray, "k k"], Float64[np.ndarray, " k"]]:
    """Eigenvalues and vectors of the information of parameters in units of their own."""
    part = info[np.ix_(active, active)]
    scale = np.sqrt(np.maximum(np.abs(np.diag(part)), np.finfo(float).tiny))
    roots, vectors = np.linalg.eigh(part / np.outer(scale, scale))
    return roots, vectors, scale
