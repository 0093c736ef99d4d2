"""What defines a piece of work, as text: two stores with the same text hold the same numbers, part by part.

The text is the state of an object of a registered class (see `gmwm_jax._internal.states`) as JSON, in the order of the
fields and of the mappings; arrays stand in it with their SHA-256. Beside the definition it has the version of the
numbers that the packages make of it, which whoever changes those raises: a store that was begun with others is read,
and not continued.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gmwm_jax._internal.states import State, from_state, to_state


@dataclass(frozen=True, eq=False)
class Specification:
    """A definition as it stands in a store.

    Attributes
    ----------
    text
        Canonical JSON.
    arrays
        Those that the text names.
    """

    text: str
    arrays: Mapping[str, np.ndarray]

    @property
    def digest(self) -> str:
        """SHA-256 of the text, and so of the arrays too."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def tables(self) -> dict[str, tuple[str, list[int]]]:
        """Name of an array -> its dtype and shape."""
        return tables_of(self.text)


def tables_of(text: str) -> dict[str, tuple[str, list[int]]]:
    """Name of an array that a text of a specification names -> its dtype and shape."""
    return {name: (dtype, shape) for name, (dtype, shape, _) in json.loads(text)["arrays"].items()}


def specification_of(definition: Any, numbers: int) -> Specification:
    """Write a definition as text and arrays.

    Parameters
    ----------
    definition
        An object of a registered class.
    numbers
        Version of the numbers that are made of it.

    Raises
    ------
    ValueError
        There is something in it from outside of the packages, which no other process could build.
    """
    state = to_state(definition)
    arrays = {name: np.asarray(array, order="C") for name, array in state.arrays.items()}
    stated = {name: [a.dtype.name, list(a.shape), _sha256(a)] for name, a in arrays.items()}
    return Specification(_canonical({"numbers": numbers, "definition": state.tree, "arrays": stated}), arrays)


def definition_of(specification: Specification) -> Any:
    """Build the definition again.

    Raises
    ------
    ValueError
        An array is not the one that the text names.
    """
    stated = json.loads(specification.text)
    for name, (_, _, digest) in stated["arrays"].items():
        if _sha256(specification.arrays[name]) != digest:
            raise ValueError(f"the array {name} is damaged")
    return from_state(State(stated["definition"], specification.arrays))


def require_same(path: str | os.PathLike, work: str, stored: str, asked: str) -> None:
    """Raise a ValueError that names the field in which the text of a store is another one than that of the work.

    Parameters
    ----------
    path
        Of the store.
    work
        What it is, as messages call it.
    stored, asked
        The texts.
    """
    if stored == asked:
        return
    require_numbers(path, stored, json.loads(asked)["numbers"])
    differs = difference(stored, asked, f"this {work}")
    raise ValueError(f"{path} is the store of another {work}: {differs}. Take another store for it.")


def require_numbers(path: str | os.PathLike, stored: str, numbers: int) -> None:
    """Raise a ValueError where the text of a store has another version of the numbers than this one, or none.

    Examples
    --------
    >>> from gmwm_jax._internal.specification import require_numbers
    >>> require_numbers("a.zarr", '{"definition":{},"arrays":{}}', 2)
    Traceback (most recent call last):
    ValueError: a.zarr was begun with other numbers than those of this version of gmwm-jax (numbers is not stated in ...
    """
    former = json.loads(stored).get("numbers")
    if former != numbers:
        raise ValueError(
            f"{path} was begun with other numbers than those of this version of gmwm-jax (numbers is "
            f"{'not stated' if former is None else former} in the store, and {numbers} here): begin anew in another "
            "store, or go on with the version that began this one."
        )


def difference(stored: str, asked: str, of: str) -> str:
    """Name the first field in which two texts differ, and say what is in both, the second being `of` something.

    Examples
    --------
    >>> from gmwm_jax._internal.specification import difference
    >>> a, b = ('{"definition":{"chunk_size":%d},"arrays":{}}' % size for size in (64, 32))
    >>> difference(a, b, "this campaign")
    'chunk_size is 64 in the store, and 32 in this campaign'
    """
    there, here = json.loads(stored), json.loads(asked)
    found = _differing(there["definition"], here["definition"], "")
    if found is not None:
        where, a, b = found
        where = "key" if where.startswith("key_") else where
        return f"{where} is {_shown(a)} in the store, and {_shown(b)} in {of}"
    name = next(name for name in here["arrays"] if there["arrays"].get(name) != here["arrays"][name])
    return f"{name} has other numbers in the store than in {of}"


def _differing(a: Any, b: Any, where: str) -> tuple[str, Any, Any] | None:
    if isinstance(a, dict) and isinstance(b, dict) and list(a) == list(b):
        pairs = [(key, a[key], b[key]) for key in a]
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        pairs = [(str(i), x, y) for i, (x, y) in enumerate(zip(a, b, strict=True))]
    else:
        return None if a == b else (where or "it", a, b)
    nested = (_differing(x, y, f"{where}.{key}".lstrip(".")) for key, x, y in pairs)
    return next((found for found in nested if found is not None), None)


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return f"made of {', '.join(k for k in value if k != 'class')}"
    text = json.dumps(value)
    return text if len(text) < 60 else f"{text[:57]}..."


def _canonical(tree: Any) -> str:
    return json.dumps(tree, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def _sha256(array: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()
