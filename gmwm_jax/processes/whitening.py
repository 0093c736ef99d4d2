"""Composite noise as one Markov chain: whitening and likelihood with missing samples, covariance times a vector.

For a record e with covariance Sigma of the model, both in O(N):

- *whitening*, L^-1 v with Sigma = L L', is a Kalman filter with a scalar observation: the innovations of v over their
  standard deviations (Durbin & Koopman 2012, ch. 4). A missing sample is an update that is skipped, so Sigma is then
  that of the samples which are there. Several columns share the gains.
- *covariance times a vector*, Sigma v, is a pass backward, which sums what each state will add to the samples, and one
  forward, which spreads its covariance.

Random walks start from zero before the first sample, as `gmwm_jax.simulate` draws them. A regression with an intercept
does not see where they start: the start only adds to the variance of the intercept.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array, lax
from jax.scipy.linalg import solve_triangular
from jaxtyping import Bool, Float

from gmwm_jax._internal.checks import as_float, require_x64
from gmwm_jax.processes.base import AbstractProcess, Composite, sum_arrays
from gmwm_jax.processes.registry import as_model
from gmwm_jax.processes.state_space import StateSpace


class Whitened(NamedTuple):
    """The columns after whitening: their noise is white with variance 1."""

    columns: Float[Array, "N C"]
    """L^-1 v; zero where a sample is missing."""
    log_determinant: Float[Array, ""]
    """log det Sigma of the samples that are there."""


class GeneralisedLeastSquares(NamedTuple):
    """The coefficients b of y = X b + e, where the errors e have the covariance Sigma."""

    estimates: Float[Array, " p"]
    """b = C X' Sigma^-1 y."""
    covariance: Float[Array, "p p"]
    """C = (X' Sigma^-1 X)^-1."""
    log_likelihood: Float[Array, ""]
    """Of y at b, Gaussian."""


def state_space(model: str | AbstractProcess | Composite) -> StateSpace:
    """A composite as one state-space form: the states of its components in their order, their white parts added.

    Only the first two moments of quantisation noise, which is not Gaussian, enter here.

    Parameters
    ----------
    model
        All parameters given.

    Raises
    ------
    ValueError
        A parameter without value, or a process that has no state-space form.
    """
    forms = [_form(p) for p in as_model(model).processes]
    return StateSpace(
        transition=_block_diagonal([f.transition for f in forms]),
        driving=_block_diagonal([f.driving for f in forms]),
        readout=jnp.concatenate([f.readout for f in forms]),
        initial=_block_diagonal([f.initial for f in forms]),
        white=sum_arrays(f.white for f in forms),
    )


def whiten(model: str | AbstractProcess | Composite, columns: Any, present: Any = None) -> Whitened:
    """Whiten columns by the covariance of a model, as a pure and differentiable function in O(N).

    Parameters
    ----------
    model
        All parameters given, with a variance.
    columns
        Records or regressors, shape (N, C).
    present
        False where a sample is missing, shape (N,); what stands there is not read. By default none is.

    Returns
    -------
    Whitened
        Inner products of its columns are v' Sigma^-1 w; with the log determinant they make the Gaussian likelihood.

    Raises
    ------
    ValueError
        A parameter without value, a process without a state-space form, shapes that do not fit.

    Examples
    --------
    >>> x = np.array([[2.0], [4.0]])
    >>> gj.processes.whiten("WN(sigma2=4.0)", x).columns.tolist()
    [[1.0], [2.0]]
    """
    return _whiten(as_model(model), *_columns(columns, present))


def generalised_least_squares(
    model: str | AbstractProcess | Composite, y: Any, X: Any, present: Any = None
) -> GeneralisedLeastSquares:
    """Regress columns with errors of a known model, as a pure and differentiable function in O(N).

    Parameters
    ----------
    model
        All parameters given, with a variance.
    y
        Record, shape (N,).
    X
        Regressors, shape (N, p), linearly independent over the samples that are there.
    present
        False where a sample is missing, shape (N,); what stands there is not read.

    Raises
    ------
    ValueError
        As `whiten`.

    Examples
    --------
    >>> X = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]])
    >>> fit = gj.processes.generalised_least_squares("WN(sigma2=1.0)", np.array([1.0, 3.0, 5.0]), X)
    >>> fit.estimates.round(9).tolist()
    [1.0, 2.0]
    """
    columns = jnp.concatenate([as_float(y)[:, None], as_float(X)], axis=1)
    return _least_squares(as_model(model), *_columns(columns, present))


def covariance_times(model: str | AbstractProcess | Composite, columns: Any) -> Float[Array, "N C"]:
    """Multiply the covariance of a model with each column v in O(N); v is 0 at samples without weight.

    Parameters
    ----------
    model
        All parameters given.
    columns
        Shape (N, C).

    Raises
    ------
    ValueError
        A parameter without value, or a process that has no state-space form.

    Examples
    --------
    >>> gj.processes.covariance_times("WN(sigma2=2.0)", np.array([[1.0], [3.0]])).tolist()
    [[2.0], [6.0]]
    """
    return _covariance_times(as_model(model), _columns(columns, None)[0])


def _columns(columns: Any, present: Any) -> tuple[Float[Array, "N C"], Bool[Array, " N"]]:
    require_x64()
    columns = as_float(columns)
    present = jnp.ones(columns.shape[:1], dtype=bool) if present is None else jnp.asarray(present)
    if columns.ndim != 2 or present.shape != columns.shape[:1]:
        raise ValueError(
            f"Columns have the shape (N, C) and present (N,); they have {columns.shape} and {present.shape}."
        )
    return columns, present


@eqx.filter_jit
def _whiten(model: Composite, columns: Float[Array, "N C"], present: Bool[Array, " N"]) -> Whitened:
    Phi, Q, h, P_0, r = state_space(model)

    def step(carry: Any, sample: Any) -> Any:
        M, P = carry
        v, there = sample
        Ph = _times(P, h)
        S = jnp.sum(h * Ph) + r
        gain = jnp.where(there, Ph / S, 0.0)
        innovation = v - _times(M.T, h)
        M = M + gain[:, None] * innovation[None, :]
        P = P - gain[:, None] * Ph[None, :]
        white = jnp.where(there, innovation / jnp.sqrt(S), 0.0)
        return (_product(Phi, M), _product(_product(Phi, P), Phi.T) + Q), (white, jnp.where(there, jnp.log(S), 0.0))

    columns = jnp.where(present[:, None], columns, 0.0)
    start = (jnp.zeros((h.shape[0], columns.shape[1])), P_0)
    _, (white, logs) = lax.scan(step, start, (columns, present))
    return Whitened(white, jnp.sum(logs))


@eqx.filter_jit
def _least_squares(
    model: Composite, columns: Float[Array, "N C"], present: Bool[Array, " N"]
) -> GeneralisedLeastSquares:
    white, log_determinant = _whiten(model, columns, present)
    y, X = white[:, 0], white[:, 1:]
    Q, R = jnp.linalg.qr(X)
    inverse = solve_triangular(R, jnp.eye(R.shape[0]))
    b = inverse @ (Q.T @ y)
    error = y - X @ b
    log_2pi = jnp.sum(jnp.where(present, math.log(2 * math.pi), 0.0))
    log_likelihood = -(log_2pi + log_determinant + error @ error) / 2
    return GeneralisedLeastSquares(b, inverse @ inverse.T, log_likelihood)


@eqx.filter_jit
def _covariance_times(model: Composite, columns: Float[Array, "N C"]) -> Float[Array, "N C"]:
    Phi, Q, h, P_0, r = state_space(model)

    def backward(later: Array, v: Array) -> Any:
        now = _product(Phi.T, later) + h[:, None] * v[None, :]
        return now, later

    # what the states at k + 1 weigh in all samples from there on
    none = jnp.zeros((h.shape[0], columns.shape[1]))
    first, later = lax.scan(backward, none, columns, reverse=True)

    def forward(M: Array, sample: Any) -> Any:
        v, weight = sample
        return _product(Phi, M) + _product(Q, weight), _times(M.T, h) + r * v

    return lax.scan(forward, _product(P_0, first), (columns, later))[1]


def _form(process: AbstractProcess) -> StateSpace:
    form = process.state_space()
    if form is None:
        raise ValueError(f"{process.kind} has no state-space form, by which records are whitened. Leave it out.")
    return form


def _block_diagonal(blocks: list[Any]) -> Float[Array, "d d"]:
    size = sum(b.shape[0] for b in blocks)
    matrix, at = jnp.zeros((size, size)), 0
    for b in blocks:
        matrix = matrix.at[at : at + b.shape[0], at : at + b.shape[0]].set(b)
        at += b.shape[0]
    return matrix


# XLA calls a library for each matrix product inside a loop, which takes longer than products of a few numbers.
def _product(A: Array, B: Array) -> Array:
    return jnp.sum(A[:, :, None] * B[None, :, :], axis=1)


def _times(A: Array, x: Array) -> Array:
    return jnp.sum(A * x[None, :], axis=1)
