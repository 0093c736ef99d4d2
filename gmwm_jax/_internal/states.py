"""Results as states: a tree of JSON and named arrays, from which the same result is built again.

A class takes part by a row of the registry: `saved` for a dataclass, whose fields are its state, `register` for
another one. A state holds numbers, texts, names of enumerations and of registered classes, and nothing that could be
executed. It is read by the annotations of the fields: what is there must have the class, the dtype and the shape that
they state (sizes that have one name are one number), and be finite unless the row says that it may be otherwise; then
the class's own constructor checks it as it checks everybody's.
"""

import enum
import types
import typing
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import AbstractArray, jaxtyped

_DTYPES = ("bool", "int32", "int64", "float64")
"""Of arrays in a state."""

_CLASS = "class"
"""Key in a tree under which the name of a registered class stands."""

_ARRAY = "array"
"""Key under which the name of an array stands."""

_NOT_NUMBERS = {"nan": float("nan"), "inf": float("inf"), "-inf": float("-inf")}
"""JSON has no such numbers."""

T = TypeVar("T", bound=type)


class State(NamedTuple):
    """What a file holds of a result."""

    tree: Any
    arrays: Mapping[str, np.ndarray]


class Row:
    """How objects of one class become states and back."""

    def __init__(
        self,
        cls: type,
        parts_as: type,
        parts: Callable[[Any], Mapping[str, Any]],
        build: Callable[[Mapping[str, Any]], Any],
        not_finite: Collection[str],
        added: Collection[str] = (),
    ):
        self.cls, self.parts, self.build, self.not_finite = cls, parts, build, frozenset(not_finite)
        self.added = frozenset(added)
        self._parts_as = parts_as

    @property
    def name(self) -> str:
        """Package and class."""
        return _name(self.cls)

    @cached_property
    def hints(self) -> dict[str, Any]:
        """Part -> its annotation."""
        known = typing.get_type_hints(self._parts_as)
        names = getattr(self._parts_as, "_fields", None) or [f.name for f in fields(self._parts_as)]
        return {name: known[name] for name in names}


_ROWS: dict[str, Row] = {}
_FAMILIES: list[type] = []


def saved(
    *, not_finite: Collection[str] = (), added: Collection[str] = (), check: Callable[[Any], Any] | None = None
) -> Callable[[T], T]:
    """Enter a dataclass into the registry: its fields are its state, and its constructor builds it again.

    Parameters
    ----------
    not_finite
        Fields that may hold NaN or infinity.
    added
        Fields that files of former versions lack: they have their default then.
    check
        Raises a ValueError for a result that nothing could have made, where the constructor does not.
    """

    def enter(cls: T) -> T:
        build: Any = cls

        def to_parts(result: Any) -> dict[str, Any]:
            return {f.name: getattr(result, f.name) for f in fields(cls)}

        def from_parts(parts: Mapping[str, Any]) -> Any:
            result = build(**parts)
            if check is not None:
                check(result)
            return result

        _enter(Row(cls, cls, to_parts, from_parts, not_finite, added))
        return cls

    return enter


def register(
    cls: type,
    parts_as: type,
    to_parts: Callable[[Any], Any],
    from_parts: Callable[[Any], Any],
    *,
    family: bool = False,
    not_finite: Collection[str] = (),
    added: Collection[str] = (),
) -> None:
    """Enter a class into the registry whose state is not its fields.

    Parameters
    ----------
    cls
        The class.
    parts_as
        A NamedTuple with annotations: the state.
    to_parts, from_parts
        From an object to that tuple, and back.
    family
        Whether all classes derived from it are meant; `to_parts` refuses those that `from_parts` cannot build.
    not_finite, added
        As of `saved`; what is added has a default in `parts_as`.
    """
    build: Any = parts_as
    row = Row(cls, parts_as, lambda x: to_parts(x)._asdict(), lambda p: from_parts(build(**p)), not_finite, added)
    _enter(row)
    if family:
        _FAMILIES.append(cls)


def registered() -> tuple[str, ...]:
    """Names of all classes that have a row."""
    return tuple(sorted(_ROWS))


def kind_of(result: Any) -> str:
    """The name by which a file says what it holds.

    Raises
    ------
    ValueError
        The class of the result is not registered.
    """
    return _row_of(result, "it").name


def to_state(result: Any) -> State:
    """The state of a result.

    Raises
    ------
    ValueError
        There is something in it from outside of the packages, or that could not be read back.
    """
    arrays: dict[str, np.ndarray] = {}
    tree = _Writer(arrays).write(result, "")
    state = State(tree, arrays)
    from_state(state)  # what could not be read back must not be written
    return state


def from_state(state: State) -> Any:
    """Build the result again.

    Raises
    ------
    ValueError
        The state is not one that `to_state` has made; the message says where.
    """
    try:
        return _read_object(state.tree, state.arrays, "")
    except RecursionError as error:
        raise ValueError("It is nested too deeply.") from error


# -- to a state -------------------------------------------------------------------------------------------------------


class _Writer:
    def __init__(self, arrays: dict[str, np.ndarray]):
        self.arrays = arrays
        self._seen: dict[int, tuple[Any, str]] = {}

    def write(self, value: Any, where: str) -> Any:
        if isinstance(value, enum.Enum):
            return value.name
        if value is None or isinstance(value, str | bool | np.bool_):
            return bool(value) if isinstance(value, np.bool_) else value
        if isinstance(value, int | np.integer):
            return int(value)
        if isinstance(value, float | np.floating):
            return float(value) if np.isfinite(value) else str(float(value))
        if isinstance(value, np.ndarray | jax.Array):
            return {_ARRAY: self._array(value, where)}
        if isinstance(value, tuple | list) and not hasattr(value, "_fields"):
            return [self.write(v, f"{where}.{i}") for i, v in enumerate(value)]
        if isinstance(value, Mapping) and _name(type(value)) not in _ROWS:
            return {str(k): self.write(v, f"{where}.{k}") for k, v in value.items()}
        row = _row_of(value, where.lstrip(".") or "it")
        parts = {name: self.write(part, f"{where}.{name}") for name, part in row.parts(value).items()}
        return {_CLASS: row.name, **parts}

    def _array(self, value: Any, where: str) -> str:
        if id(value) in self._seen:
            return self._seen[id(value)][1]
        array = np.asarray(value)
        if array.dtype.name not in _DTYPES:
            raise ValueError(f"{where.lstrip('.')} is of dtype {array.dtype}: files hold {', '.join(_DTYPES)}.")
        plain = "".join(c if c.isascii() and (c.isalnum() or c in "._") else "_" for c in where.lstrip(".")) or "it"
        name, number = plain, 1
        while name in self.arrays:
            number += 1
            name = f"{plain}_{number}"
        self.arrays[name] = array
        self._seen[id(value)] = value, name  # the value is kept, and with it its id
        return name


# -- back -------------------------------------------------------------------------------------------------------------


def _read_object(tree: Any, arrays: Mapping[str, np.ndarray], where: str) -> Any:
    shown = where.lstrip(".") or "it"
    if not isinstance(tree, dict) or not isinstance(name := tree.get(_CLASS), str) or name not in _ROWS:
        raise ValueError(f"{shown} is no object of a known class.")
    row = _ROWS[name]
    hints = {part: hint for part, hint in row.hints.items() if part in tree or part not in row.added}
    if set(tree) - {_CLASS} != set(hints):
        missing, unknown = sorted(set(hints) - set(tree)), sorted(set(tree) - set(hints) - {_CLASS})
        raise ValueError(f"{shown} is a {name}, and lacks {missing} or has {unknown} more.")
    parts = {part: _read(tree[part], hint, arrays, f"{where}.{part}") for part, hint in hints.items()}
    found = [a for part, hint in hints.items() for a in _arrays_of(parts[part], hint, f"{where}.{part}".lstrip("."))]
    with jaxtyped("context"):  # sizes of one name are one number in all parts
        for array, hints, at in found:
            if not any(isinstance(array, h) for h in hints):
                wanted = " or ".join(h.__name__ for h in hints)
                raise ValueError(f"{at} has the shape {array.shape} and the dtype {array.dtype}; wanted is {wanted}.")
    for part in set(parts) - row.not_finite:
        if not _is_finite(parts[part]):
            raise ValueError(f"{f'{where}.{part}'.lstrip('.')} must be finite, and is not.")
    try:
        return row.build(parts)
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        raise ValueError(f"{shown} is no {row.cls.__name__}: {error}") from error


def _read(tree: Any, hint: Any, arrays: Mapping[str, np.ndarray], where: str) -> Any:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return _read_union(tree, arguments, arrays, where)
    if origin in (tuple, Sequence):
        return _read_list(tree, arguments, arrays, where)
    if origin is Mapping:
        return _read_mapping(tree, arguments, arrays, where)
    if _is_array(hint):
        name = tree.get(_ARRAY) if isinstance(tree, dict) else None
        if not isinstance(name, str) or name not in arrays:
            raise ValueError(f"{where.lstrip('.')} is no array of the file.")
        return jnp.asarray(arrays[name]) if hint.array_type is jax.Array else arrays[name]
    if hint in (str, bool, int, float):
        value = _NOT_NUMBERS.get(tree, tree) if hint is float and isinstance(tree, str) else tree
        kinds: Any = (int, float) if hint is float else hint
        if isinstance(value, kinds) and isinstance(value, bool) == (hint is bool):
            return value
        raise ValueError(f"{where.lstrip('.')} must be of type {hint.__name__}, and is {tree!r:.50}.")
    if issubclass(hint, enum.Enum):
        if isinstance(tree, str) and tree in hint.__members__:
            return hint[tree]
        raise ValueError(f"{where.lstrip('.')} is one of {', '.join(hint.__members__)}, and is {tree!r:.50}.")
    value = _read_object(tree, arrays, where)
    if not isinstance(value, hint):
        raise ValueError(f"{where.lstrip('.')} must be a {hint.__name__}, and is a {type(value).__name__}.")
    return value


def _read_union(tree: Any, choices: Sequence[Any], arrays: Mapping[str, np.ndarray], where: str) -> Any:
    if tree is None and types.NoneType in choices:
        return None
    failed: list[ValueError] = []
    for choice in choices:
        if choice is not types.NoneType:
            try:
                return _read(tree, choice, arrays, where)
            except ValueError as error:
                failed.append(error)
    raise failed[0]


def _read_list(tree: Any, kinds: Sequence[Any], arrays: Mapping[str, np.ndarray], where: str) -> tuple[Any, ...]:
    any_length = len(kinds) == 1 or kinds[-1] is Ellipsis
    if not isinstance(tree, list) or (not any_length and len(tree) != len(kinds)):
        raise ValueError(f"{where.lstrip('.')} must be a list{'' if any_length else f' of {len(kinds)}'}.")
    each = [kinds[0]] * len(tree) if any_length else kinds
    return tuple(_read(v, k, arrays, f"{where}.{i}") for i, (v, k) in enumerate(zip(tree, each, strict=True)))


def _read_mapping(tree: Any, kinds: Sequence[Any], arrays: Mapping[str, np.ndarray], where: str) -> dict[Any, Any]:
    key, kind = kinds
    if not isinstance(tree, dict):
        raise ValueError(f"{where.lstrip('.')} must be a mapping.")
    if key is int and not all(k.isascii() and k.isdigit() for k in tree):
        raise ValueError(f"{where.lstrip('.')} must be a mapping of numbers.")
    return {key(k): _read(v, kind, arrays, f"{where}.{k}") for k, v in tree.items()}


def _arrays_of(value: Any, hint: Any, where: str) -> Iterator[tuple[Any, list[Any], str]]:
    """The arrays among the parts of an object, what they may be, and where they are."""
    kinds = typing.get_args(hint)
    if isinstance(value, np.ndarray | jax.Array):
        yield value, [h for h in kinds or [hint] if _is_array(h)], where
    elif isinstance(value, tuple) and kinds:
        for i, v in enumerate(value):
            kind = kinds[0] if kinds[-1] is Ellipsis or len(kinds) == 1 else kinds[i]
            yield from _arrays_of(v, kind, f"{where}.{i}")
    elif isinstance(value, dict):
        for k, v in value.items():
            yield from _arrays_of(v, kinds[1], f"{where}.{k}")


def _is_finite(value: Any) -> bool:
    if isinstance(value, np.ndarray | jax.Array | float):
        return bool(np.all(np.isfinite(value)))
    if isinstance(value, tuple | dict):
        return all(map(_is_finite, value.values() if isinstance(value, dict) else value))
    return True


def _is_array(hint: Any) -> bool:
    return isinstance(hint, type) and issubclass(hint, AbstractArray)


# -- the registry -----------------------------------------------------------------------------------------------------


def _enter(row: Row) -> None:
    if row.name in _ROWS:
        raise RuntimeError(f"Two classes are called {row.name}: files could not tell them apart.")
    _ROWS[row.name] = row


def _row_of(value: Any, where: str) -> Row:
    cls = type(value)
    own = cls if _name(cls) in _ROWS else next((f for f in _FAMILIES if isinstance(value, f)), None)
    if own is None or (own is cls and _ROWS[_name(cls)].cls is not cls):
        raise ValueError(
            f"{where} is a {cls.__name__} of {cls.__module__}, which no file holds: only what is of gmwm_jax and "
            "nav_jax can be built again by whoever reads it."
        )
    return _ROWS[_name(own)]


def _name(cls: type) -> str:
    return f"{cls.__module__.partition('.')[0]}.{cls.__name__}"
