"""Objects in files of R (``.rda``, ``.rdata``), read by the package rdata under a watch: what they promise is counted.

The bytes are unpacked here, where they are counted, and the start of the file is looked at here, so that no warning of
rdata has to be made an error: filters of warnings are those of the whole process, and other threads feel them.
"""

import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gmwm_jax._internal.limits import MAX_R_NUMBERS, TooLargeError, require_size
from gmwm_jax._internal.optional import import_optional
from gmwm_jax._internal.text_source import unpacked

_PARSERS = {b"X\n": ("_xdr", "ParserXDR"), b"A\n": ("_ascii", "ParserASCII"), b"B\n": ("_binary", "ParserBinary")}
"""Second line of a file -> the parser of rdata."""

_PIECE = 1 << 20

_STARTS = tuple(b"RD%c%d\n" % (kind, version) for kind in b"XAB" for version in (2, 3))


def load_r(file: Path, max_bytes: int | None, classes: Mapping[str, Callable[[Any, Any], Any]]) -> dict[str, Any]:
    """Return the objects of a file by their names.

    Parameters
    ----------
    file
        The file.
    max_bytes
        To which it may unfold.
    classes
        Class of R -> what makes an object of a value and its attributes; others are what they hold.

    Raises
    ------
    TooLargeError
        It unpacks to more than allowed, or has too many objects, or sequences that are too long.
    Exception
        One of a dozen, where it is no such file.
    """
    rdata = import_optional("rdata")
    with unpacked(file, max_bytes=max_bytes) as stream:  # once for its size, before any of it is kept
        while stream.read(_PIECE):
            pass
    with unpacked(file, max_bytes=max_bytes) as stream:
        content = stream.read()
    if not content.startswith(_STARTS):
        raise ValueError("it does not start as the data of R do")
    content = memoryview(content.replace(b"\r\n", b"\n") if content[2:3] == b"A" else content)[5:]
    module, name = _PARSERS[bytes(content[:2])]
    kind = getattr(importlib.import_module(f"rdata.parser.{module}"), name)
    of = file.stat().st_size
    constructors = _bounded(rdata.parser.DEFAULT_ALTREP_MAP, of, max_bytes)
    parser = _counting(kind)(content[2:], expand_altrep=True, altrep_constructor_dict=constructors)
    parsed = parser.parse_all()
    parser.check_complete()
    known = {**rdata.conversion.DEFAULT_CLASS_MAP, **classes}
    encoding = parsed.extra.encoding or "latin-1"
    return rdata.conversion.convert(parsed, constructor_dict=_Classes(known), default_encoding=encoding)


def _counting(kind: type[Any]) -> type[Any]:
    """A parser that counts what it makes objects of, and believes no length."""

    class Counting(kind):
        def __init__(self, data: memoryview, **options: Any):
            super().__init__(data, **options)
            self.left, self.size = MAX_R_NUMBERS, len(data)

        def _parse_array_values(self, dtype: Any, length: int) -> Any:
            self.left -= 1
            if self.left < 0:
                raise TooLargeError(
                    f"The R data have more than {MAX_R_NUMBERS // 2:,} objects or texts, each of which is read by "
                    "itself: save the numbers alone, as a matrix or data frame."
                )
            if not 0 <= length <= self.size:  # the shortest value takes a byte
                raise ValueError(f"a vector of {length} values in {self.size} bytes")
            return super()._parse_array_values(dtype, length)

    return Counting


def _bounded(constructors: Mapping[bytes, Any], of: int, max_bytes: int | None) -> dict[bytes, Any]:
    """What R writes as a rule, such as 1:n, as rdata writes it out, unless it would be too large."""
    total = 0

    def sequence(make: Callable[[Any], Any]) -> Callable[[Any], Any]:
        def bounded(state: Any) -> Any:
            nonlocal total
            total += 8 * int(state.value[0])
            require_size("The sequences of the R data", total, of, max_bytes)
            return make(state)

        return bounded

    def texts(make: Callable[[Any], Any]) -> Callable[[Any], Any]:
        def bounded(state: Any) -> Any:
            if len(state.value[0].value) > MAX_R_NUMBERS // 2:
                raise TooLargeError(f"The R data have more than {MAX_R_NUMBERS // 2:,} texts.")
            return make(state)

        return bounded

    bounds = {b"compact_intseq": sequence, b"compact_realseq": sequence, b"deferred_string": texts}
    return {name: bounds[name](make) if name in bounds else make for name, make in constructors.items()}


class _Classes(dict[str, Callable[[Any, Any], Any]]):
    """Constructors of classes of R: for each class one that tries all of the object's, and takes the value else.

    So rdata finds one for each, and does not warn of those that it does not know.
    """

    def get(self, name: str, default: Any = None) -> Any:
        return self._construct

    def _construct(self, value: Any, attributes: Mapping[str, Any]) -> Any:
        for name in attributes["class"]:
            made = self[name](value, attributes) if name in self else NotImplemented
            if made is not NotImplemented:
                return made
        return value
