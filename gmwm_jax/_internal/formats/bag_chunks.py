"""The packed chunks of a bag, unpacked piece by piece and counted before rosbags unpacks each as a whole.

Source: ROS, Bags/Format/2.0 (records of a header and data, op 5 is a chunk); MCAP specification (records of an opcode
and a length, opcode 6 is a chunk).
"""

import bz2
import importlib
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from gmwm_jax._internal.limits import require_size, require_stream

_BAG = b"#ROSBAG V2.0\n"
_MCAP = b"\x89MCAP0\r\n"
_CHUNK_OF_BAG = b"\x05"
_CHUNK_OF_MCAP = 6
_PIECE = 1 << 20
_LONGEST_HEADER = 1 << 16
"""Bytes of the header of a record, which holds a topic and numbers."""


class _Chunk(NamedTuple):
    compression: str
    unpacked: int
    """Bytes that it states."""
    at: int
    packed: int


def require_chunks(file: Path, max_bytes: int | None) -> None:
    """Raise unless each chunk of a bag may be unpacked; other files than bags and mcap have none.

    Raises
    ------
    TooLargeError
        A chunk is larger than allowed, by what it states or by what comes out of it.
    """
    of = file.stat().st_size
    with file.open("rb") as stream:
        start = stream.read(len(_BAG))
        if start == _BAG:
            chunks = _chunks_of_bag(stream, of)
        elif start.startswith(_MCAP):
            stream.seek(len(_MCAP))
            chunks = _chunks_of_mcap(stream, of)
        else:
            return
        for chunk in list(chunks):
            require_size("A chunk of the bag", chunk.unpacked, of, max_bytes)
            _unpack(stream, chunk, of, max_bytes)


def _chunks_of_bag(stream: Any, of: int) -> Iterator[_Chunk]:
    while len(word := stream.read(4)) == 4:
        (length,) = struct.unpack("<I", word)
        fields = _fields(stream.read(min(length, _LONGEST_HEADER)))
        stream.seek(max(0, length - _LONGEST_HEADER), 1)
        (packed,) = struct.unpack("<I", stream.read(4).ljust(4, b"\0"))
        if fields.get(b"op") == _CHUNK_OF_BAG and len(fields.get(b"size", b"")) == 4:
            compression = fields.get(b"compression", b"").decode("latin-1")
            yield _Chunk(compression, struct.unpack("<I", fields[b"size"])[0], stream.tell(), packed)
        stream.seek(packed, 1)


def _fields(header: bytes) -> dict[bytes, bytes]:
    """Of ``name=value``, each after its length."""
    fields, at = {}, 0
    while at + 4 <= len(header):
        (length,) = struct.unpack_from("<I", header, at)
        name, _, value = header[at + 4 : at + 4 + length].partition(b"=")
        fields[name] = value
        at += 4 + length
    return fields


def _chunks_of_mcap(stream: Any, of: int) -> Iterator[_Chunk]:
    while len(head := stream.read(9)) == 9:
        opcode, length = struct.unpack("<BQ", head)
        end = stream.tell() + length
        if end > of:
            return
        if opcode == _CHUNK_OF_MCAP:
            start = stream.read(min(length, 32)).ljust(32, b"\0")
            (unpacked,), (name_length,) = struct.unpack_from("<Q", start, 16), struct.unpack_from("<I", start, 28)
            compression = stream.read(min(name_length, 16)).decode("latin-1")
            yield _Chunk(compression, unpacked, stream.tell() + 8, max(0, end - stream.tell() - 8))
        stream.seek(end)


def _unpack(stream: Any, chunk: _Chunk, of: int, max_bytes: int | None) -> None:
    """Count what comes out of a chunk; LZ4 makes 255 bytes of one at most, and needs no counting."""
    if chunk.compression not in ("bz2", "zstd"):
        return
    stream.seek(chunk.at)
    content = stream.read(chunk.packed)
    unpacker = bz2.BZ2Decompressor() if chunk.compression == "bz2" else _zstd().ZstdDecompressor()
    total = len(unpacker.decompress(content, max_length=_PIECE))
    while not unpacker.eof and not unpacker.needs_input:
        total += len(unpacker.decompress(b"", max_length=_PIECE))
        require_stream(total, of, max_bytes)


def _zstd() -> Any:
    """The module of Python 3.14, or what rosbags brings along for those before."""
    try:
        return importlib.import_module("compression.zstd")
    except ImportError:
        return importlib.import_module("backports.zstd")
