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
        Positions in km to 1e-6 m need 10 digits, and single precision keeps 7.
    """
    if not jax.config.read("jax_enable_x64"):
        raise RuntimeError(
            "nav_jax needs 64-bit floats, and JAX is in its 32-bit default. Put\n"
            '    import jax; jax.config.update("jax_enable_x64", True)\n'
            "before the first JAX computation, or set the environment variable JAX_ENABLE_X64=1."
        )


def concrete(value: object) -> np.ndarray | None:
    """Return the value as a NumPy array, or None while it is only traced (its checks are then skipped)."""
    return None if isinstance(value, jax.core.Tracer) else np.asarray(value)


def as_float(value: object) -> jax.Array:
    """Return a float64 JAX array: a Python float in a pytree would retrace for every new value."""
    require_x64()
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


def sampling_rate(rate: object) -> float:
    """Return the sampling rate in Hz as a float, or raise."""
    if rate is None:
        raise ValueError("The sampling rate is missing: give rate=... in Hz. It is never guessed.")
    return number("The sampling rate (Hz)", rate)


def typed_key(key: object) -> None:
    """Raise a TypeError unless this is a typed key of random numbers."""
    dtype = getattr(key, "dtype", None)
    if dtype is None or not jnp.issubdtype(dtype, jax.dtypes.prng_key):
        raise TypeError(f"key must be a typed key such as jax.random.key(0), and is {key!r}.")
