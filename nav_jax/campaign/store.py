"""A campaign on disk: one Zarr folder that any number of processes write at once and that no crash can spoil.

A task writes its own chunks of the arrays, which no other task touches, and last a checksum of all of them. What has no
checksum, or not the right one, was not written: a killed writer, a missing file and a flipped bit are one case, and the
task is done again. The checksum begins with the specification and the place of the chunk, so that a chunk of another
campaign, or of another place, is none of this one. Metadata are known beforehand: what differs from them is restored.
"""

import contextlib
import hashlib
import json
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gmwm_jax._internal.atomic import as_sentence, write_atomically
from gmwm_jax._internal.environment import environment
from gmwm_jax._internal.optional import import_optional
from gmwm_jax._internal.outputs import make_folder
from gmwm_jax._internal.specification import Specification, require_same, tables_of

KIND = "nav_jax campaign"
FORMAT = 1

_META = "zarr.json"
_DONE = "done"
_SCENARIOS, _INPUTS, _FAILED = "scenarios", "inputs", "failed"

_PARTS, _ABANDONED = "*.partial", 24 * 3600.0
"""What Zarr writes before it renames it, and s after which nobody is doing that any more."""


class Layout(NamedTuple):
    """What is stored of a scenario.

    Attributes
    ----------
    arrays
        Name -> (dtype, shape of a chunk, names of the axes); the first axis grows with the campaign.
    coordinates
        Name -> (values, name of the axis), the same for all chunks.
    """

    arrays: Mapping[str, tuple[str, tuple[int, ...], tuple[str, ...]]]
    coordinates: Mapping[str, tuple[np.ndarray, str]]


class Store:
    """The folder of a campaign.

    Parameters
    ----------
    path
        Of the folder.
    specification
        What it is the store of.
    layouts
        Name of each scenario -> what is stored of it.
    num_chunks
        Of each scenario.

    Attributes
    ----------
    environment
        In which it was begun; of `restore` on, that of a former store.
    """

    def __init__(
        self, path: str | os.PathLike, specification: Specification, layouts: Mapping[str, Layout], num_chunks: int
    ):
        self.path, self.specification, self.layouts = Path(path), specification, layouts
        self.num_chunks = num_chunks
        self.environment = environment()

    # -- the frame ------------------------------------------------------------------------------------------------

    def restore(self) -> list[str]:
        """Make the folder, or make it what it should be; returns which former files were not.

        Raises
        ------
        FileExistsError
            There is something else at the path.
        ValueError
            The store is of another campaign; the message names the field.
        OSError
            It cannot be written.
        """
        with as_sentence(self.path):
            former = _former(self.path)
            if former is not None:
                self.environment = former.environment
            whole = (self.path / _META).exists() and (former is None or former.num_chunks == self.num_chunks)
            if former is not None:
                require_same(self.path, "campaign", former.text, self.specification.text)
            make_folder(self.path.absolute().parent)
            self._clear()
            damaged = []
            for name, content in self._frame().items():
                file = self.path / name
                if not file.is_file() or file.read_bytes() != content:
                    if whole:
                        damaged.append(name)
                    self._put(name, content)
            return damaged

    def _clear(self) -> None:
        """Remove what killed writers have left."""
        for part in self.path.rglob(_PARTS):
            with contextlib.suppress(FileNotFoundError):  # another one has removed it, or ended it after all
                if time.time() - part.stat().st_mtime > _ABANDONED:
                    part.unlink()

    def _frame(self) -> dict[str, bytes]:
        """File -> what is in it, of all that does not come from tasks; the root comes last."""
        zarr = import_zarr()
        memory: dict[str, Any] = {}
        store = zarr.storage.MemoryStore(memory)
        zarr.create_group(store)
        for name, array in self.specification.arrays.items():
            zarr.create_array(store, name=f"{_INPUTS}/{name}", data=array, chunks=_chunks(array.shape))
        for scenario, layout in self.layouts.items():
            of = f"{_SCENARIOS}/{scenario}"
            for name, (values, dim) in layout.coordinates.items():
                zarr.create_array(
                    store, name=f"{of}/{name}", data=values, chunks=_chunks(values.shape), dimension_names=(dim,)
                )
            rows = {name: row for name, row in layout.arrays.items()} | {_DONE: ("uint64", (1,), ("chunk",))}
            for name, (dtype, chunk, dims) in rows.items():
                zarr.create_array(
                    store,
                    name=f"{of}/{name}",
                    shape=(self.num_chunks * chunk[0], *chunk[1:]),
                    chunks=_chunks(chunk),
                    dtype=dtype,
                    fill_value=np.nan if dtype.startswith("float") else 0,
                    dimension_names=dims,
                )
        files = {name: buffer.to_bytes() for name, buffer in memory.items()}
        root = json.loads(files.pop(_META))
        root["attributes"] = {
            "kind": KIND,
            "format": FORMAT,
            "num_chunks": self.num_chunks,
            "sha256": _root_digest(self.num_chunks, self.environment, self.specification.text),
            "environment": self.environment,
            "specification": self.specification.text,
        }
        return files | {_META: json.dumps(root).encode()}

    # -- chunks ---------------------------------------------------------------------------------------------------

    def write(self, scenario: str, chunk: int, arrays: Mapping[str, np.ndarray]) -> None:
        """Write what belongs to a chunk, and its checksum when all the rest is there.

        Raises
        ------
        OSError
            It cannot be written.
        """
        with as_sentence(self.path):
            for name in self.layouts[scenario].arrays:
                self._array(scenario, name)[self._rows(scenario, name, chunk)] = arrays[name]
            self._array(scenario, _DONE)[chunk] = self._checksum(scenario, chunk, arrays)
            (self.path / _FAILED / f"{scenario}.{chunk}.json").unlink(missing_ok=True)

    def read(self, scenario: str, chunk: int) -> dict[str, np.ndarray] | None:
        """Read a chunk; None if it is not there as it was written."""
        try:
            mark = int(self._array(scenario, _DONE)[chunk])
            if not mark:
                return None
            names = self.layouts[scenario].arrays
            arrays = {name: self._array(scenario, name)[self._rows(scenario, name, chunk)] for name in names}
        except Exception:  # of a damaged file Zarr and its codecs raise what they like
            return None
        return arrays if self._checksum(scenario, chunk, arrays) == mark else None

    def is_begun(self, scenario: str, chunk: int) -> bool:
        """Whether there is a checksum, be it right or wrong: a chunk that has one and cannot be read is damaged."""
        return (self.path / _SCENARIOS / scenario / _DONE / "c" / str(chunk)).exists()

    def bytes_of(self, scenario: str, name: str) -> int:
        """Bytes on disk of all chunks of an array."""
        of = self.path / _SCENARIOS / scenario / name / "c"
        return sum(file.stat().st_size for file in of.rglob("*") if file.is_file())

    def _array(self, scenario: str, name: str) -> Any:
        return import_zarr().open_array(self.path, path=f"{_SCENARIOS}/{scenario}/{name}", mode="r+")

    def _rows(self, scenario: str, name: str, chunk: int) -> slice:
        rows = self.layouts[scenario].arrays[name][1][0]
        return slice(chunk * rows, (chunk + 1) * rows)

    def _checksum(self, scenario: str, chunk: int, arrays: Mapping[str, np.ndarray]) -> int:
        """64 bits; 0 stands for what is not done."""
        sum_ = hashlib.blake2b(f"{self.specification.digest} {scenario} {chunk}".encode(), digest_size=8)
        for name in self.layouts[scenario].arrays:
            sum_.update(np.ascontiguousarray(arrays[name]).tobytes())
        return int.from_bytes(sum_.digest(), "big") or 1

    def _put(self, name: str, content: bytes) -> None:
        """Write one of the files below the folder, whole or not at all."""
        file = self.path.absolute() / name
        file.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(file, lambda opened: opened.write(content))

    # -- what failed ----------------------------------------------------------------------------------------------

    def note_failure(self, scenario: str, chunk: int, text: str) -> None:
        """Remember why a chunk could not be computed, until it is."""
        with as_sentence(self.path):
            self._put(f"{_FAILED}/{scenario}.{chunk}.json", json.dumps(text).encode())

    def failure(self, scenario: str, chunk: int) -> str | None:
        """Why a chunk could not be computed, if that was tried."""
        try:
            return str(json.loads((self.path / _FAILED / f"{scenario}.{chunk}.json").read_bytes()))
        except FileNotFoundError:
            return None
        except (OSError, ValueError):
            return "why can no longer be read"


class Former(NamedTuple):
    """What the root of a store says."""

    text: str
    num_chunks: int
    environment: Mapping[str, str]


def read_root(path: str | os.PathLike) -> Former:
    """Read what a store says of itself.

    Raises
    ------
    FileNotFoundError
        There is nothing.
    ValueError
        It is damaged, of a newer version, or something else.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"There is no {path.absolute()}.")
    former = _former(path)
    if former is None:
        raise ValueError(
            f"What {path} says of itself is damaged: run the campaign that it is of with this store again; what is "
            "whole in it is kept."
        )
    return former


def read_specification(path: str | os.PathLike) -> tuple[Specification, int]:
    """Read specification and number of chunks of a store.

    Raises
    ------
    FileNotFoundError, ValueError
        As `read_root`, and an array that is damaged.
    """
    path, former = Path(path), read_root(path)
    arrays = {}
    for name, (dtype, shape) in tables_of(former.text).items():
        try:
            array = np.asarray(import_zarr().open_array(path, path=f"{_INPUTS}/{name}", mode="r")[...])
        except Exception:  # see `Store.read`
            array = np.empty(0)
        if (array.dtype.name, list(array.shape)) != (dtype, shape):
            raise ValueError(
                f"The input {name} of {path} is damaged: run the campaign that it is of with this store again; what is "
                "whole in it is kept."
            )
        arrays[name] = array
    return Specification(former.text, arrays), former.num_chunks


def import_zarr() -> Any:
    """Import Zarr, or raise an ImportError that says how to install it."""
    return import_optional("zarr", "cluster")


def _former(path: Path) -> Former | None:
    """What the root says; None if there is no root, or it is damaged."""
    if not path.exists() or (path.is_dir() and not any(path.iterdir())):
        return None
    ours = path.is_dir() and any((path / name).exists() for name in (_META, _SCENARIOS, _INPUTS))
    if not ours:
        raise FileExistsError(f"{path} is there and is no store of a campaign: it stays. Choose another path.")
    try:
        said = json.loads((path / _META).read_bytes())["attributes"]
        kind, version, text = said["kind"], said["format"], said["specification"]
        if kind != KIND:
            raise FileExistsError(f"{path} holds a {kind!r:.50} and is no store of a campaign: it stays.")
        if version > FORMAT:
            raise ValueError(f"{path} was written by a newer version (format {version}, known is {FORMAT}).")
        former = Former(text, int(said["num_chunks"]), dict(said["environment"]))
        return former if said["sha256"] == _root_digest(former.num_chunks, former.environment, text) else None
    except (KeyError, TypeError, AttributeError, FileNotFoundError, json.JSONDecodeError, UnicodeDecodeError):
        return None


def _root_digest(num_chunks: int, environment: Mapping[str, str], text: str) -> str:
    said = json.dumps([num_chunks, dict(environment), text], sort_keys=True)
    return hashlib.sha256(said.encode()).hexdigest()


def _chunks(shape: tuple[int, ...]) -> tuple[int, ...]:
    """A chunk that is the whole of an array; Zarr wants one even of an empty one."""
    return tuple(max(n, 1) for n in shape)
