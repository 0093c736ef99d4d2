"""Regressors of a record over time: what explains its mean, as named columns with units.

Each function returns a mapping from names to columns; mappings are merged as usual:

    {**trend(t), **seasonal(t, 86400.0), **step(t, 5000.0), "temperature": Regressor(celsius, "K")}
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from gmwm_jax._internal.checks import integer, unmasked
from gmwm_jax.variance.haar import default_num_levels

INTERCEPT = "intercept"

_COLLINEAR = 1e-10
"""Smallest singular value, of columns of length 1, at which coefficients still have half of their digits."""


class Regressor(NamedTuple):
    """One column of the design matrix."""

    values: Any
    """Shape (N,)."""
    unit: str = "1"


class Design(NamedTuple):
    """Design matrix of the samples that are there, X = Q R."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    columns: Float[np.ndarray, "N p"]
    """X."""
    basis: Float[np.ndarray, "N p"]
    """Q, zero where a sample is missing."""
    triangle: Float[np.ndarray, "p p"]
    """R."""


def trend(time: Any) -> dict[str, Regressor]:
    """Return a straight line, whose coefficient is the change per second.

    Parameters
    ----------
    time
        Time of each sample in seconds, shape (N,). The intercept is then the value at time 0.

    Examples
    --------
    >>> gj.regression.trend(np.arange(3.0))["trend"].values.tolist()
    [0.0, 1.0, 2.0]
    """
    return {"trend": Regressor(_as_column("time", time), "s")}


def seasonal(time: Any, period: float, harmonics: int = 1) -> dict[str, Regressor]:
    """Return the cosine and the sine of a period and of its harmonics.

    Parameters
    ----------
    time
        Time of each sample in seconds, shape (N,).
    period
        In seconds.
    harmonics
        How many: 2 adds half the period, 3 a third of it.

    Raises
    ------
    ValueError
        A period that is not positive, or a number of harmonics below one.

    Examples
    --------
    >>> list(gj.regression.seasonal(np.arange(8.0), period=8.0))
    ['cos 8 s', 'sin 8 s']
    """
    t = _as_column("time", time)
    if not (np.isfinite(period) and period > 0):
        raise ValueError(f"The period must be positive and finite, in seconds, and is {period!r}.")
    columns = {}
    for h in range(1, integer("harmonics", harmonics, 1) + 1):
        phase = 2 * np.pi * h * t / period
        columns[f"cos {period / h:.6g} s"] = Regressor(np.cos(phase))
        columns[f"sin {period / h:.6g} s"] = Regressor(np.sin(phase))
    return columns


def step(time: Any, at: float) -> dict[str, Regressor]:
    """Return a jump, which is 0 before the time `at` and 1 from there on.

    Parameters
    ----------
    time
        Time of each sample in seconds, shape (N,).
    at
        In seconds.

    Raises
    ------
    ValueError
        No sample before, or none after the step.

    Examples
    --------
    >>> gj.regression.step(np.arange(4.0), at=2.0)["step 2 s"].values.tolist()
    [0.0, 0.0, 1.0, 1.0]
    """
    t = _as_column("time", time)
    if not t[0] < at <= t[-1]:
        raise ValueError(f"The record lasts from {t[0]:g} s to {t[-1]:g} s, and the step is at {at!r}, outside of it.")
    return {f"step {at:.9g} s": Regressor((t >= at).astype(np.float64))}


def polynomial(values: Any, degree: int, *, name: str, unit: str) -> dict[str, Regressor]:
    """Return the powers 1 to degree of a variable's deviation from its mean, for example of a temperature.

    Parameters
    ----------
    values
        Shape (N,). NaN where it is unknown: the samples there must be missing in the record, too.
    degree
        Highest power. The intercept is then the value at the mean.
    name, unit
        Of the values: ``temperature`` and ``K`` make the columns ``temperature [K]``, ``temperature^2 [K^2]`` ...

    Raises
    ------
    ValueError
        A degree below one.

    Examples
    --------
    >>> powers = gj.regression.polynomial(np.array([20.0, 21.0, 22.0]), 2, name="temperature", unit="K")
    >>> powers["temperature^2"].values.tolist()
    [1.0, 0.0, 1.0]
    """
    x = _as_column(name, values)
    x = x - np.mean(x[np.isfinite(x)])
    powers = range(1, integer("degree", degree, 1) + 1)
    return {
        name if k == 1 else f"{name}^{k}": Regressor(x**k, unit if k == 1 or unit == "1" else f"{unit}^{k}")
        for k in powers
    }


def design(regressors: Mapping[str, Any], present: Bool[np.ndarray, " N"], *, intercept: bool) -> Design:
    """Check the columns and factorise them.

    Parameters
    ----------
    regressors
        Name -> `Regressor`, or array (N,) of unit 1.
    present
        False where the sample of the record is missing: the columns are not read there.
    intercept
        Put a column of ones first.

    Raises
    ------
    ValueError
        Columns of another length, with NaN or inf, constant beside an intercept, zero, or collinear; none at all; fewer
        samples than columns.
    """
    named = dict(regressors)
    if intercept:
        if INTERCEPT in named:
            raise ValueError(f"There is a regressor {INTERCEPT!r}, and intercept=True adds one: leave one of them out.")
        named = {INTERCEPT: np.ones(len(present)), **named}
    if not named:
        raise ValueError("There is nothing to estimate: give regressors, or intercept=True.")
    units = tuple(c.unit if isinstance(c, Regressor) else "1" for c in named.values())
    X = np.column_stack([_checked(k, c, present, intercept) for k, c in named.items()])
    num = int(np.sum(present))
    if num <= X.shape[1]:
        raise ValueError(f"There are {num} samples for {X.shape[1]} coefficients: take a longer record.")
    there = X[present]
    length = np.max(np.abs(there), axis=0)
    length = length * np.linalg.norm(there / length, axis=0)  # squares of large values would overflow
    Q, R = np.linalg.qr(there / length)
    _, s, Vt = np.linalg.svd(R)
    if s[-1] < _COLLINEAR * s[0]:
        guilty = ", ".join(n for n, v in zip(named, Vt[-1], strict=True) if abs(v) > 1e-3)
        raise ValueError(
            f"The regressors {guilty} are collinear over the {num} samples that are there: one is a combination of the "
            "others, and no data tell their coefficients apart. Leave one out (or subtract a large mean)."
        )
    basis = np.zeros_like(X)
    basis[present] = Q
    return Design(tuple(named), units, X, basis, R * length)


def checked_record(y: Any, present: Any) -> tuple[Float[np.ndarray, " N"], Bool[np.ndarray, " N"]]:
    """The record and where its samples are; raise ValueError where it is none, or infinite, or all of it missing."""
    y = y if isinstance(y, np.ma.MaskedArray) else np.asarray(y)
    if y.ndim != 1 or y.dtype.kind not in "fiu":
        raise ValueError(f"y must be real numbers of shape (N,), and has shape {y.shape} and dtype {y.dtype}.")
    y = np.asarray(unmasked(y), dtype=np.float64)
    there = ~np.isnan(y)
    if present is not None:
        given = np.asarray(present)
        if given.shape != y.shape or given.dtype.kind != "b":
            raise ValueError(
                f"present must be True or False for each of the {len(y)} samples; it has shape {given.shape} and dtype "
                f"{given.dtype}."
            )
        there &= given
    if not np.any(there):
        raise ValueError(f"All {len(y)} samples are missing: NaN, masked, or left out by present=...")
    bad = np.flatnonzero(there & np.isinf(y))
    if len(bad):
        raise ValueError(
            f"y holds {len(bad)} infinite samples, the first at index {bad[0]}. If they are outages, set them to NaN."
        )
    if default_num_levels(int(np.sum(there))) < 1:
        raise ValueError(f"y has {np.sum(there)} samples: the wavelet variance of its noise needs at least 4.")
    return y, there


def checked_time(time: Any, num: int, rate: float) -> Float[np.ndarray, " N"]:
    """Time of each sample in seconds, from 0 if none is given; raise ValueError where it contradicts the rate."""
    if time is None:
        return np.arange(num) / rate
    t = np.asarray(time, dtype=np.float64)
    if t.shape != (num,):
        raise ValueError(f"time has the shape {t.shape}, and the record has {num} samples.")
    off = np.abs(t - t[0] - np.arange(num) / rate)
    if not np.max(off) < 0.5 / rate:  # NaN is off, too
        k = int(np.argmax(~(off < 0.5 / rate)))
        raise ValueError(
            f"Samples at {rate:g} Hz lie {1 / rate:g} s apart, and time is half a step off at index {k} ({t[k]!r} s "
            f"after {t[0]!r} s at the start). Give the right rate, and put NaN into y where samples are missing."
        )
    return t


def _checked(name: str, column: Any, present: np.ndarray, intercept: bool) -> np.ndarray:
    x = _as_column(f"regressor {name!r}", column.values if isinstance(column, Regressor) else column)
    if len(x) != len(present):
        raise ValueError(f"Regressor {name!r} has {len(x)} values, and the record has {len(present)} samples.")
    bad = np.flatnonzero(present & ~np.isfinite(x))
    if len(bad):
        raise ValueError(
            f"Regressor {name!r} holds {len(bad)} values that are NaN or infinite where the record has samples, the "
            f"first at index {bad[0]}. Fill them, or leave these samples out by present=..."
        )
    there = x[present]
    if name != INTERCEPT and np.all(there == there[0]) and (intercept or there[0] == 0):
        reason = "is zero" if there[0] == 0 else "is constant, as the intercept is,"
        raise ValueError(f"Regressor {name!r} {reason} in all samples that are there: leave it out.")
    return x


def _as_column(what: str, values: Any) -> Float[np.ndarray, " N"]:
    x = np.asarray(values)
    if x.ndim != 1 or x.dtype.kind not in "fiub":
        raise ValueError(f"{what} must be real numbers of shape (N,), and has shape {x.shape} and dtype {x.dtype}.")
    return x.astype(np.float64)
