"""Results that files can hold: `save` on each of them, and one `load` for all."""

import os
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from gmwm_jax._internal.lazy import open_wide
from gmwm_jax._internal.limits import size_in_bytes
from gmwm_jax._internal.state_files import Content, read_state, require_suffix, state_of_dataset, write_state
from gmwm_jax._internal.states import from_state, kind_of, registered, to_state
from gmwm_jax._internal.stores import SUFFIXES as DATASETS
from gmwm_jax._internal.stores import read_dataset, write_dataset

S = TypeVar("S")

_PACKAGES = ("gmwm_jax", "nav_jax")
"""Whose results are read, of each if it is imported."""

_CAMPAIGN = "nav_jax campaign"
"""What folders of the same format say that have many results in parts."""


class Saved:
    """A result that files can hold. Its class has a row in the registry, see `gmwm_jax._internal.states`."""

    __slots__ = ()

    def save(self, path: str | os.PathLike) -> Path:
        """Write to a file that `load` reads, whole or not at all.

        Parameters
        ----------
        path
            A file ``*.npz`` or ``*.json``, or with the extra ``io`` a file ``*.nc`` or a folder ``*.zarr``. A former
            result there is replaced.

        Returns
        -------
        The path.

        Raises
        ------
        ValueError
            Another ending, or something in the result from outside of the packages, such as a process of your own.
        OSError
            The path cannot be written.
        """
        path = Path(path)
        if require_suffix(path) in DATASETS and isinstance(self, AsDataset):
            return write_dataset(self.to_xarray(), path)
        try:
            content = Content(kind_of(self), to_state(self))
        except ValueError as error:
            raise ValueError(f"A {type(self).__name__} cannot be saved: {error}") from error
        return write_state(path, content)

    @classmethod
    def load(cls: type[S], path: str | os.PathLike) -> S:
        """Read what `save` wrote; a ValueError if it is corrupt or something else, see ``gmwm_jax.load``."""
        result = load(path)
        if not isinstance(result, cls):
            raise ValueError(f"{path} holds a {type(result).__name__}, and a {cls.__name__} is wanted.")
        return result


class AsDataset(Saved):
    """A result whose Dataset is its file, where that is netCDF or Zarr."""

    __slots__ = ()

    dataset_kind: ClassVar[str]
    """Attribute ``kind`` of its Dataset."""
    _of_kind: ClassVar[dict[str, "type[AsDataset]"]] = {}

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        AsDataset._of_kind.setdefault(cls.dataset_kind, cls)

    def to_xarray(self) -> Any:
        """All of it as a Dataset."""
        raise NotImplementedError

    @classmethod
    def from_xarray(cls: type[S], dataset: Any) -> S:
        """The result from that Dataset."""
        raise NotImplementedError


def load(path: str | os.PathLike, *, max_bytes: int | str | None = None) -> Any:
    """Read a result that ``save`` wrote: it prints, draws and serves as the one that was saved.

    Parameters
    ----------
    path
        A file ``*.npz``, ``*.json`` or ``*.nc``, or a folder ``*.zarr``.
    max_bytes
        Bytes to which netCDF and Zarr may unfold, see `gmwm_jax.read_recording`; the others are as large as the file.

    Returns
    -------
    The result, of the class that it had.

    Raises
    ------
    FileNotFoundError
        There is nothing.
    ValueError
        It is corrupt, cut off, of a newer version, or nothing that ``save`` wrote. Nothing in a file is executed.
    ImportError
        netCDF and Zarr need the extra ``io``.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> fit = gj.fit(wv, "WN + RW")
    >>> path = fit.save("accel_x.npz")
    >>> repr(gj.load(path)) == repr(fit)
    True
    """
    path = Path(path)
    for package in _PACKAGES:  # classes register themselves
        open_wide(package)
    if require_suffix(path) in DATASETS:
        dataset = read_dataset(path, size_in_bytes(max_bytes))
        if (known := AsDataset._of_kind.get(dataset.attrs["kind"])) is not None:
            try:
                return known.from_xarray(dataset)
            except ValueError as error:
                raise ValueError(f"{path}: {error}") from error
        if dataset.attrs["kind"] == _CAMPAIGN:
            raise ValueError(f"{path} is the store of a campaign, no single result: nav_jax.Campaign.open reads it.")
        content = state_of_dataset(path, dataset)
    else:
        content = read_state(path)
    if content.kind not in registered():
        package, _, name = content.kind.partition(".")
        other = f": import {package}, and read it with {package}.load" * (package == "nav_jax")
        raise ValueError(f"{path} holds a {name!r:.50} of {package!r:.50}, which is not known here{other}.")
    try:
        result = from_state(content.state)
    except ValueError as error:
        raise ValueError(f"{path} holds no {content.kind}: {error}") from error
    if kind_of(result) != content.kind:
        raise ValueError(f"{path} says that it holds a {content.kind}, and holds a {kind_of(result)}.")
    return result
