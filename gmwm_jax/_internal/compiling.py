"""Functions as programs of their own, compiled in less time than XLA takes by itself; parts of others as they are."""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import equinox as eqx
import jax
import jax.core
import numpy as np

_P = ParamSpec("_P")
_T = TypeVar("_T")
Options = dict[str, Any]

SOONER: Options = {"xla_cpu_use_fusion_emitters": False}
"""For `jax.jit(compiler_options=)` of a program whose time is that of loops: they run as fast, and a first call takes
three quarters of the processor time."""

_NO_SUCH = "No such compile option"
"""What a version of XLA says that has another name for one: all that options change is time, and it does without."""

_NOTHING = np.zeros(0)


def compiled_quickly(
    static_argnums: tuple[int, ...] = (), level: int = 0
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Compile a function that runs for less than a millisecond, by the first of XLA's levels or by another one.

    Its compilation is what a user waits for. Inside of another program, whose options hold, it is traced as it is.
    """
    options = SOONER | {"xla_backend_optimization_level": level}

    def decorate(f: Callable[..., Any]) -> Callable[..., Any]:
        return _compiled(f, f, lambda **how: jax.jit(f, static_argnums=static_argnums, **how), options)

    return decorate


def compiled_sooner(f: Callable[_P, _T], *, level: int | None = None) -> Callable[_P, _T]:
    """Compile a function as `equinox.filter_jit`, and as `SOONER` says where it is no part of another program.

    By another one of XLA's levels where the time that its last one takes, over hashes of random numbers above all, is
    never earned back.
    """
    options = SOONER if level is None else SOONER | {"xla_backend_optimization_level": level}
    return _compiled(f, eqx.filter_jit(f), lambda **how: eqx.filter_jit(f, **how), options)


def _compiled(f: Any, within: Any, jit: Callable[..., Any], options: Options) -> Any:
    alone = [jit(compiler_options=options)]

    def program() -> Any:
        # equinox has no public way to forget the programs of one function
        return getattr(alone[0], "_cached", alone[0])

    @wraps(f)
    def call(*values: Any, **named: Any) -> Any:
        if is_traced(*values, *named.values()):
            return within(*values, **named)
        try:
            return alone[0](*values, **named)
        except jax.errors.JaxRuntimeError as error:
            if _NO_SUCH not in str(error):
                raise
            alone[0] = jit()
            return alone[0](*values, **named)

    # of the program that it is outside
    more = {"_cache_size": lambda: program()._cache_size(), "clear_cache": lambda: program().clear_cache()}
    call.__dict__.update(more)
    return call


def is_traced(*values: Any) -> bool:
    """Whether what is called with these values belongs to a program: they are traced, or what goes to the device is."""
    return any(isinstance(x, jax.core.Tracer) for x in (*jax.tree.leaves(values), jax.device_put(_NOTHING)))
