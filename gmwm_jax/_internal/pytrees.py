"""Results as pytrees: their arrays go through `jax.jit`, `vmap` and `grad`, and what names and describes them stays.

What comes out of a transformation was checked when it went in: its constructor is not called again, since its arrays
may be traced, batched or a tree's placeholders then.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, TypeVar

import jax
import numpy as np

T = TypeVar("T")


def pytree(*arrays: str) -> Callable[[type[T]], type[T]]:
    """Make a dataclass a pytree of the fields that are named; the others are static.

    Static arrays and mappings (the scales of a wavelet variance) are compared by value: functions of other ones compile
    again.
    """

    def register(cls: type[T]) -> type[T]:
        every = [f.name for f in fields(cls)]  # pyright: ignore[reportArgumentType]
        static = [name for name in every if name not in arrays]

        def flatten(value: Any) -> tuple[list[tuple[Any, Any]], tuple[Any, ...]]:
            children = [(jax.tree_util.GetAttrKey(name), getattr(value, name)) for name in arrays]
            return children, tuple(_hashable(getattr(value, name)) for name in static)

        def unflatten(aux: tuple[Any, ...], children: Any) -> Any:
            value = object.__new__(cls)
            for name, child in zip(arrays, children, strict=True):
                object.__setattr__(value, name, child)
            for name, kept in zip(static, aux, strict=True):
                object.__setattr__(value, name, kept.value if isinstance(kept, _ByValue) else kept)
            return value

        jax.tree_util.register_pytree_with_keys(cls, flatten, unflatten)
        return cls

    return register


class _ByValue:
    """An array or a mapping that is compared by its contents."""

    def __init__(self, value: Any, contents: tuple[Any, ...]):
        self.value, self.contents = value, contents

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByValue) and self.contents == other.contents

    def __hash__(self) -> int:
        return hash(self.contents)


def _hashable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return _ByValue(value, tuple(value.items()))
    if isinstance(value, np.ndarray):
        return _ByValue(value, (value.shape, str(value.dtype), value.tobytes()))
    return value
