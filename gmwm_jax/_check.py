"""Input checks: each raises a ValueError that says what was seen and what to change."""

import jax
import jax.core
import jax.numpy as jnp
import numpy as np


def require_x64() -> None:
    """Raise unless JAX computes in 64 bits.

    Raises
    ------
    RuntimeError
        Wavelet variances span 1e-20 to 1 and single precision keeps 7 digits: results would be noise.
    """
    if not jax.config.read("jax_enable_x64"):
        raise RuntimeError(
            "gmwm_jax needs 64-bit floats, and JAX is in its 32-bit default. Put\n"
            '    import jax; jax.config.update("jax_enable_x64", True)\n'
            "before the first JAX computation, or set the environment variable JAX_ENABLE_X64=1."
        )


def concrete(value: object) -> np.ndarray | None:
    """Return the value as a NumPy array, or None while it is only traced (its checks are then skipped)."""
    return None if isinstance(value, jax.core.Tracer) else np.asarray(value)


def finite_record(x: np.ndarray, what: str = "the record") -> None:
    """Raise if a record (time on axis 0) has NaN or inf, naming the first of them."""
    # One pass without a temporary: a sum is finite exactly when (overflow aside) every term is.
    with np.errstate(invalid="ignore", over="ignore"):
        if np.isfinite(np.sum(x)):
            return
    bad = np.argwhere(~np.isfinite(x))
    if not len(bad):
        return
    first = tuple(int(i) for i in bad[0])
    where = f"index {first[0]}" + (f", channel {first[1]}" if len(first) > 1 else "")
    raise ValueError(
        f"{what} holds {len(bad)} values that are NaN or infinite, the first ({x[first]}) at {where}. "
        "Cut the record there or repair the samples: a gap that is closed silently changes every scale."
    )


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


def sampling_rate(rate: object) -> float:
    """Return the sampling rate in Hz as a float, or raise."""
    if rate is None:
        raise ValueError("The sampling rate is missing: give rate=... in Hz. It is never guessed.")
    value = float(rate)  # type: ignore[arg-type]
    if not np.isfinite(value) or value <= 0:
        raise ValueError(f"The sampling rate must be a positive number of Hz, and is {rate!r}.")
    return value


def as_float(value: object) -> jax.Array:
    """Return a float64 JAX array: a Python float in a pytree would retrace for every new value."""
    require_x64()
    return jnp.asarray(value, dtype=jnp.float64)
