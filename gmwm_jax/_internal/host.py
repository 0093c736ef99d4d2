"""Single numbers are computed by NumPy: an operation of jax.numpy outside of jit is a program, to be compiled alone."""

from functools import wraps
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
import numpy as np


class _QuietNumpy:
    """The functions of NumPy as JAX has its own: log(0) is -inf and exp(1000) is inf, without a warning."""

    def __getattr__(self, name: str) -> Any:
        function = getattr(np, name)

        @wraps(function)
        def quiet(*args: Any, **kwargs: Any) -> Any:
            with np.errstate(all="ignore"):
                return function(*args, **kwargs)

        return quiet


_NUMPY = _QuietNumpy()


def namespace(*values: Any) -> Any:
    """NumPy for numbers and arrays of NumPy, `jax.numpy` as soon as one of the values is an array of JAX."""
    return jnp if any(isinstance(v, jax.Array) for v in values) else _NUMPY


def known(*values: Any) -> tuple[Any, ...]:
    """The values as NumPy arrays if all of them are known, and as they are as soon as one of them is traced."""
    traced = any(isinstance(v, jax.core.Tracer) for v in values)
    return values if traced else tuple(np.asarray(v) for v in values)
