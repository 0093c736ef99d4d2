"""The bytes of a text file as tokenizers take them, whatever it is packed in: compression, UTF-16, decimal commas."""

import bz2
import codecs
import gzip
import io
import lzma
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

from gmwm_jax._internal.limits import LONGEST_LINE, TooLargeError, require_stream

COMPRESSED = (".gz", ".bz2", ".xz", ".zip")
"""Suffixes of files that are packed."""

_MAGIC = {b"\x1f\x8b": ".gz", b"BZh": ".bz2", b"\xfd7zXZ\x00": ".xz", b"PK\x03\x04": ".zip"}
_CHUNK = 1 << 20

Stage = Callable[[io.BufferedIOBase], Iterator[bytes]]
"""What makes other bytes of those of a stream."""


@contextmanager
def unpacking() -> Iterator[None]:
    """Say that a packed file is bad, whichever error its decompressor raises."""
    try:
        yield
    except (EOFError, gzip.BadGzipFile, zlib.error, lzma.LZMAError, zipfile.BadZipFile) as error:
        raise ValueError(
            f"The compressed file is truncated or corrupt: fetch or save it again. ({type(error).__name__}: {error})"
        ) from error


class _Watched(io.FileIO):
    """A file that tells how many of its bytes were read."""

    def __init__(self, file: Path, told: Callable[[int], object]):
        super().__init__(file)
        self._told = told

    def readinto(self, buffer: Any, /) -> int | None:
        count = super().readinto(buffer)
        self._told(count or 0)
        return count


class _Generated(io.RawIOBase):
    """The bytes that an iterator gives, as a stream."""

    def __init__(self, parts: Iterator[bytes], *sources: Any):
        self._parts, self._sources, self._rest = parts, sources, memoryview(b"")

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any, /) -> int:
        while not self._rest:
            part = next(self._parts, None)
            if part is None:
                return 0
            self._rest = memoryview(part)
        count = min(len(buffer), len(self._rest))
        buffer[:count] = self._rest[:count]
        self._rest = self._rest[count:]
        return count

    def close(self) -> None:
        for source in self._sources:
            source.close()
        super().close()


def packed_as(file: Path) -> str | None:
    """Return the suffix of what a file is packed with, told by its first bytes; None: it is not packed."""
    with file.open("rb") as stream:
        start = stream.read(6)
    return next((suffix for magic, suffix in _MAGIC.items() if start.startswith(magic)), None)


def inner_name(file: Path) -> str:
    """Return the name of the file that is packed in another; its own name where it is not packed.

    Raises
    ------
    ValueError
        A ``.zip`` of several files, or of none.
    """
    if file.suffix.lower() not in COMPRESSED:
        return file.name
    if file.suffix.lower() != ".zip":
        return file.stem
    with unpacking(), zipfile.ZipFile(file) as archive:
        return _member(archive)


def _member(archive: zipfile.ZipFile) -> str:
    names = [n for n in archive.namelist() if not n.endswith("/") and not n.startswith("__MACOSX/")]
    if len(names) != 1:
        listed = ", ".join(names[:5]) + (" ..." if len(names) > 5 else "")
        raise ValueError(f"The archive holds {len(names)} files ({listed}) and not one: unpack the one that is meant.")
    return names[0]


def _open_member(archive: zipfile.ZipFile) -> Any:
    try:
        return archive.open(_member(archive))
    except RuntimeError as error:  # it has a password, or is packed in a way of which Python knows nothing
        raise zipfile.BadZipFile(str(error)) from error


def unpacked(
    file: Path, told: Callable[[int], object] | None = None, max_bytes: int | None = None
) -> io.BufferedIOBase:
    """Open the bytes of a file, decompressed where it is packed, and counted; `told` hears of those read from disk."""
    kind = packed_as(file)
    raw = file.open("rb") if told is None else io.BufferedReader(_Watched(file, told), _CHUNK)
    if kind is None:
        return raw
    streams: list[Any] = [raw]
    try:
        if kind == ".zip":
            streams.insert(0, zipfile.ZipFile(raw))
            streams.insert(0, _open_member(streams[0]))
        else:
            opener: Any = {".gz": gzip.open, ".bz2": bz2.open, ".xz": lzma.open}[kind]
            streams.insert(0, opener(raw))
    except BaseException:
        for stream in streams:
            stream.close()
        raise
    parts = _counted(streams[0], file.stat().st_size, max_bytes)
    return io.BufferedReader(_Generated(parts, *streams), _CHUNK)


def _counted(stream: Any, of: int, max_bytes: int | None) -> Iterator[bytes]:
    """What a decompressor gives, as long as it is no more than a file of this size may become."""
    total = 0
    while part := stream.read(_CHUNK):
        total += len(part)
        require_stream(total, of, max_bytes)
        yield part


@dataclass(frozen=True)
class TextSource:
    """A text file; `open` gives its bytes in an encoding whose first 128 characters are ASCII.

    Attributes
    ----------
    file
        The file.
    stages
        What is done to the bytes, in this order.
    told
        Hears of the bytes read from disk.
    max_bytes
        To which it may unpack.
    """

    file: Path
    stages: tuple[Stage, ...] = ()
    told: Callable[[int], object] | None = None
    max_bytes: int | None = None

    @property
    def as_it_is(self) -> bool:
        """Are the bytes those of the file, but for a byte-order mark of UTF-8?"""
        return not self.stages and packed_as(self.file) is None

    def then(self, stage: Stage) -> "TextSource":
        """The same file, with one more stage."""
        return replace(self, stages=(*self.stages, stage))

    def watched(self, told: Callable[[int], object]) -> "TextSource":
        """The same file, with somebody who hears of the bytes read."""
        return replace(self, told=told)

    def open(self) -> io.BufferedIOBase:
        """Open its bytes."""
        stream = unpacked(self.file, self.told, self.max_bytes)
        for stage in self.stages:
            stream = io.BufferedReader(_Generated(stage(stream), stream), _CHUNK)
        return stream

    def lines(self, newline: str | None = "") -> io.TextIOWrapper:
        """Open it as text; Latin-1 reads any bytes, and numbers are ASCII."""
        return io.TextIOWrapper(self.open(), encoding="latin-1", newline=newline)  # type: ignore[arg-type]

    def head(self, count: int = 200) -> list[str]:
        """Return its first lines, without their ends."""
        with unpacking(), self.lines() as stream:
            found = [decoded(line.rstrip("\r\n")) for _, line in islice(numbered_lines(stream), count)]
        return found


def numbered_lines(stream: io.TextIOBase) -> Iterator[tuple[int, str]]:
    """The lines of a text and their numbers, from 1.

    Raises
    ------
    TooLargeError
        A line is longer than `LONGEST_LINE`; no more of it has been read.
    """
    number = 0
    while line := stream.readline(LONGEST_LINE + 1):
        number += 1
        if len(line) > LONGEST_LINE:
            raise TooLargeError(f"Line {number} is longer than {LONGEST_LINE} characters: this is no table of text.")
        yield number, line


class LongLineError(TooLargeError):
    """A line is longer than `LONGEST_LINE`: `numbered_lines` tells which."""


def short_lines(stream: io.BufferedIOBase) -> Iterator[bytes]:
    """Pass on the bytes of a text as long as its lines are short: a stage in front of tokenizers, which trust them.

    Raises
    ------
    LongLineError
        There is no end of a line for `LONGEST_LINE` bytes. Which line it is, is not counted: that would take longer
        than all else here.
    """
    open_for = 0  # bytes of the line that has begun before this part
    while part := stream.read(_CHUNK):
        start = -open_for
        while start + LONGEST_LINE < len(part):
            end = _last_end(part, start, start + LONGEST_LINE + 1)
            if end < 0:
                raise LongLineError(f"A line is longer than {LONGEST_LINE} characters: this is no table of text.")
            start = end + 1
        start = max(start, _last_end(part, start, len(part)) + 1)
        open_for = len(part) - start
        yield part


def _last_end(text: bytes, start: int, stop: int) -> int:
    """Where the last end of a line is, or -1."""
    return max(text.rfind(end, max(start, 0), stop) for end in (b"\n", b"\r"))


def text_source(file: Path, max_bytes: int | None = None) -> TextSource:
    """Open a text file: gzip, bzip2, xz or zip, UTF-8, UTF-16 (told by its mark or its zeros) or Latin-1."""
    source = TextSource(file, max_bytes=max_bytes)
    with unpacking(), source.open() as stream:
        start = stream.read(4096)
    if start.startswith(codecs.BOM_UTF8):
        return source.then(_without_mark)
    for mark, encoding in ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be")):
        zeros = start[1::2] if encoding == "utf-16-le" else start[::2]
        others = start[::2] if encoding == "utf-16-le" else start[1::2]
        if start.startswith(mark) or (len(zeros) > 1 and zeros.count(0) > 0.9 * len(zeros) and 0 not in others):
            return source.then(lambda stream, encoding=encoding: _recoded(stream, encoding))
    return source


def _without_mark(stream: io.BufferedIOBase) -> Iterator[bytes]:
    stream.read(3)
    while part := stream.read(_CHUNK):
        yield part


def _recoded(stream: io.BufferedIOBase, encoding: str) -> Iterator[bytes]:
    decoder = codecs.getincrementaldecoder(encoding)(errors="replace")
    first = True
    while part := stream.read(_CHUNK):
        text = decoder.decode(part)
        yield (text.removeprefix("\ufeff") if first else text).encode()
        first = False


_POINTS = bytes.maketrans(b",", b".")


def with_points(stream: io.BufferedIOBase) -> Iterator[bytes]:
    """Write decimal commas as points: a stage for text whose fields are not divided by commas."""
    while part := stream.read(_CHUNK):
        yield part.translate(_POINTS)


def decoded(text: str) -> str:
    """Text that was read as Latin-1, and may be UTF-8."""
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeError:
        return text
