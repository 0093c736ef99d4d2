"""Single numbers are computed by NumPy: an operation of jax.numpy outside of jit is a program, to be compiled alone."""

from collections.abc import Callable
from functools import wraps
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
import numpy as np

QUICKLY: dict[str, Any] = {"xla_backend_optimization_level": 0, "xla_cpu_use_fusion_emitters": False}
"""For `jax.jit(compiler_options=)` of a program that runs for less than a millisecond, and whose compilation is what
a user waits for.
"""


_NOTHING = np.zeros(0)


def compiled_quickly(static_argnums: tuple[int, ...] = ()) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Compile a function as `QUICKLY` says; inside of another program, whose options hold, it is traced as it is."""

    def decorate(f: Callable[..., Any]) -> Callable[..., Any]:
        compiled: Any = jax.jit(f, static_argnums=static_argnums, compiler_options=QUICKLY)

        @wraps(f)
        def call(*values: Any) -> Any:
            return (f if is_traced(*values) else compiled)(*values)

        # of the program that it is outside
        call.__dict__.update(_cache_size=compiled._cache_size, clear_cache=compiled.clear_cache)
        return call

    return decorate


def is_traced(*values: Any) -> bool:
    """Whether what is called with these values belongs to a program: they are traced, or what goes to the device is."""
    return any(isinstance(x, jax.core.Tracer) for x in (*jax.tree.leaves(values), jax.device_put(_NOTHING)))


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
