"""Input checks: each raises an error that says what was seen and what to change."""

import operator
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
import numpy as np


def require_x64() -> None:
    """Raise unless JAX computes in 64 bits.

    Raises
    ------
    RuntimeError
        Wavelet variances span 1e-20 to 1, and positions in km to 1e-6 m need 10 digits; single precision keeps 7.
    """
    if not jax.config.read("jax_enable_x64"):
        raise RuntimeError(
            "gmwm_jax and nav_jax need 64-bit floats, and JAX is in its 32-bit default. Put\n"
            '    import jax; jax.config.update("jax_enable_x64", True)\n'
            "before the first JAX computation, or set the environment variable JAX_ENABLE_X64=1."
        )


def concrete(value: object) -> np.ndarray | None:
    """Return the value as a NumPy array, or None while it is only traced (its checks are then skipped)."""
    return None if isinstance(value, jax.core.Tracer) else np.asarray(value)


_GAPS = (
    'If NaN marks missing samples, say so: gaps="nan" for a file, gaps=True for an array, gaps="pairs" for '
    "wavelet_variance."
)


def finite_record(x: np.ndarray, what: str = "the record", *, advice: str = _GAPS) -> None:
    """Raise if a record (time on axis 0) has NaN or inf, naming the first of them, with advice on NaN."""
    # One pass without a temporary: a sum is finite exactly when (overflow aside) every term is.
    with np.errstate(invalid="ignore", over="ignore"):
        if np.isfinite(np.sum(x)):
            return
    bad = np.argwhere(~np.isfinite(x))
    if not len(bad):
        return
    first = tuple(int(i) for i in bad[0])
    where = f"index {first[0]}" + (f", channel {first[1]}" if len(first) > 1 else "")
    on_nan = advice if np.isnan(x[tuple(bad.T)]).any() else ""
    text = (
        f"{what} holds {len(bad)} values that are NaN or infinite, the first ({x[first]}) at {where}. "
        f"Cut the record there or repair the samples: a gap that is closed silently changes every scale. {on_nan}"
    )
    raise ValueError(text.rstrip())


def present_samples(x: np.ndarray, what: str = "the record") -> np.ndarray:
    """Return where a record of one channel is not NaN, or raise if it is infinite somewhere, or NaN everywhere."""
    present = ~np.isnan(x)
    infinite = np.flatnonzero(np.isinf(x))
    if len(infinite):
        raise ValueError(
            f"{what} is infinite at {len(infinite)} samples, the first at index {infinite[0]}. NaN is missing."
        )
    if not np.any(present):
        raise ValueError(f"All {len(x)} samples of {what} are missing.")
    return present


def time_first(samples: int, channels: int) -> None:
    """Raise if a record of shape (samples, channels) is probably turned."""
    if channels > samples:
        raise ValueError(
            f"The data have {samples} samples of {channels} channels. Time is axis 0: transpose them if it is axis 1."
        )


def unmasked(x: np.ndarray) -> np.ndarray:
    """Return masked samples as NaN, which `finite_record` names; other arrays as they are."""
    return np.ma.filled(x.astype(np.float64), np.nan) if isinstance(x, np.ma.MaskedArray) else x


def integer(name: str, value: object, least: int) -> int:
    """Return an integer that is at least as large as `least`, or raise."""
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        number = None
    if number is None or number < least:
        raise ValueError(f"{name} must be an integer of {least} or more, and is {value!r}.")
    return number


def positive(name: str, value: object, *, zero_ok: bool = False) -> None:
    """Raise unless a scalar or array is positive (or non-negative) and finite; traced values pass."""
    seen = concrete(value)
    if seen is None:
        return
    if not np.all(np.isfinite(seen)) or np.any(seen < 0) or (not zero_ok and np.any(seen == 0)):
        kind = "non-negative" if zero_ok else "positive"
        raise ValueError(f"{name} must be {kind} and finite, and is {seen}.")


def spans(tau: object) -> jax.Array:
    """Return filter spans as floats, or raise unless they are even numbers of samples; traced values pass."""
    seen = concrete(tau)
    if seen is not None and (not np.all(np.isfinite(seen)) or np.any(seen < 2) or np.any(seen % 2 != 0)):
        raise ValueError(
            f"Spans of Haar filters are even numbers of samples (2, 4, 8 ...), and these are {seen}. "
            "Seconds are multiplied by the sampling rate, averaging times of the Allan variance by 2."
        )
    return as_float(tau)


def _number(value: object) -> float:
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return float("nan")


def sampling_rate(rate: object) -> float:
    """Return the sampling rate in Hz as a float, or raise."""
    if rate is None:
        raise ValueError("The sampling rate is missing: give rate=... in Hz. It is never guessed.")
    value = _number(rate)
    if not np.isfinite(value) or value <= 0:
        raise ValueError(f"The sampling rate must be a positive number of Hz, and is {rate!r}.")
    return value


def agreed_rate(known: float | None, given: object) -> float | None:
    """Return the rate that the caller gives, else the known one; raise where they contradict each other.

    They may differ by 1e-6, by which a rate from a column of time misses a round number.
    """
    if given is None:
        return known
    rate = sampling_rate(given)
    if known is not None and abs(rate / known - 1) > 1e-6:
        raise ValueError(f"rate={given!r} was given, and the data have {known!r} Hz.")
    return rate


def confidence(level: object) -> float:
    """Return a confidence level as a float, or raise unless it lies between 0 and 1."""
    value = _number(level)
    if not 0 < value < 1:
        raise ValueError(f"A confidence level lies between 0 and 1, and is {level!r}.")
    return value


def typed_key(key: object) -> None:
    """Raise a TypeError unless this is a typed key of random numbers."""
    dtype = getattr(key, "dtype", None)
    if dtype is None or not jnp.issubdtype(dtype, jax.dtypes.prng_key):
        raise TypeError(f"key must be a typed key such as jax.random.key(0), and is {key!r}.")


def as_float(value: object) -> jax.Array:
    """Return a float64 JAX array: a Python float in a pytree would retrace for every new value."""
    require_x64()
    if isinstance(value, int | float | np.ndarray | np.generic):  # a conversion by JAX would be a program
        value = np.asarray(value, dtype=np.float64)
    return jnp.asarray(value, dtype=jnp.float64)


def real_array(what: str, value: object, shape: tuple[int | None, ...]) -> np.ndarray:
    """Return a finite float64 array of a shape (None: any length), or raise.

    A copy that cannot be written to, so that what was checked stays true.
    """
    seen = np.ma.filled(value.astype(np.float64), np.nan) if isinstance(value, np.ma.MaskedArray) else np.asarray(value)
    if seen.dtype.kind not in "iuf":
        raise ValueError(f"{what} must hold real numbers, and is of dtype {seen.dtype}.")
    if seen.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, seen.shape, strict=True)):
        wanted = ", ".join("N" if n is None else str(n) for n in shape)
        raise ValueError(f"{what} has the shape ({wanted}), time on axis 0, and this one {seen.shape}.")
    copy = np.array(seen, dtype=np.float64)
    bad = np.argwhere(~np.isfinite(copy))
    if len(bad):
        first = tuple(int(i) for i in bad[0])
        where = f"index {first[0]}" + (f", component {first[1]}" if len(first) > 1 else "")
        raise ValueError(
            f"{what} holds {len(bad)} values that are NaN or infinite, the first ({copy[first]}) at {where}. Cut the "
            "record there or repair it."
        )
    copy.flags.writeable = False
    return copy


def increasing(what: str, time: np.ndarray) -> None:
    """Raise unless a vector of at least two times increases."""
    if len(time) < 2:
        raise ValueError(f"{what} has {len(time)} epochs, and at least two are needed.")
    steps = np.diff(time)
    if (steps <= 0).any():
        i = int((steps <= 0).argmax()) + 1
        raise ValueError(
            f"{what} does not increase at index {i}: {time[i - 1]} is followed by {time[i]}. The clock was reset, "
            "times were written with too few digits, or this is not the column of time."
        )


def number(name: str, value: object, *, zero_ok: bool = False, negative_ok: bool = False) -> float:
    """Return a finite number as a float, positive unless told otherwise, or raise."""
    try:
        x = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        x = float("nan")
    if not np.isfinite(x) or (x < 0 and not negative_ok) or (x == 0 and not (zero_ok or negative_ok)):
        kind = "finite" if negative_ok else "non-negative and finite" if zero_ok else "positive and finite"
        raise ValueError(f"{name} must be a {kind} number, and is {value!r}.")
    return x


def probability(name: str, value: Any) -> float:
    """Return a number between 0 and 1, both excluded, or raise."""
    if not 0 < value < 1:
        raise ValueError(f"{name} is a probability between 0 and 1, and is {value!r}.")
    return float(value)


def of_kind(name: str, value: object, kind: type) -> None:
    """Raise unless a value is of a class of this package."""
    if not isinstance(value, kind):
        raise ValueError(f"{name} must be of the class {kind.__name__}, and is {value!r}.")
