"""Where a store is: a path, a URL or a Zarr store, opened so that damage is noticed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from softreach.support.errors import InvalidInput
from softreach.support.files.sealed_store import (
    Broken,
    Chunk,
    DamagedStore,
    Watch,
    storage_errors,
    unsealed,
)

if TYPE_CHECKING:
    import zarr
    from zarr.abc.store import Store
    from zarr.storage import StoreLike, StorePath

__all__ = [
    "ARRAYS",
    "READING",
    "REMEDY",
    "Kind",
    "Opened",
    "absolute",
    "check_arrays",
    "checked_place",
    "kind_of",
    "opened_root",
]

Kind = Literal["cloud", "atlas"]
Mode = Literal["r", "r+"]

REMEDY = {
    "cloud": "compute the cloud again, or bring back a copy",
    "atlas": "the command that built the atlas computes again what is damaged",
}
"""What a person does about damage."""


class Opened(NamedTuple):
    """A store that is open."""

    group: zarr.Group
    place: StorePath
    """For xarray."""
    watch: Watch
    durable: bool = False


def absolute(location: StoreLike) -> StoreLike:
    """The same place for a process elsewhere."""
    if isinstance(location, str):
        # A path, so that files are written beside their place and renamed.
        location = location.removeprefix("file://")
    if isinstance(location, os.PathLike) or (isinstance(location, str) and "://" not in location):
        return str(Path(location).absolute())
    return location


def checked_place(location: Any, watch: Watch, *, mode: Mode, durable: bool = False) -> StorePath:
    """The place, of which every file is checked when it is read."""
    from zarr.abc.store import Store
    from zarr.storage import StorePath

    from softreach.support.files.sealed_store import CheckedStore

    at = location if isinstance(location, StorePath) else None
    inner = at.store if at else absolute(location)
    store = inner if isinstance(inner, Store) else _store(inner, mode)
    return StorePath(CheckedStore(store, watch, durable=durable), at.path if at else "")


def opened_root(
    location: StoreLike, kind: Kind, mode: Mode = "r", *, durable: bool = False
) -> Opened | None:
    """The root of a store of softreach, if there is any.

    Raises:
        InvalidInput: No place of a store, or something else is there.
        DamagedStore: What describes the store is not as softreach wrote it.
        StoreFailed: It cannot be reached.
    """
    import zarr

    watch = Watch(location=location, remedy=REMEDY[kind])
    if isinstance(location, str) and "://" not in location:
        if Path(location).is_file():
            raise InvalidInput("store", location, _SAID[kind], "it is a file")
        if not Path(location).is_dir():
            return None
    with storage_errors(f"{location} cannot be opened"):
        try:
            place = checked_place(location, watch, mode=mode, durable=durable)
            group = zarr.open_group(place, mode=mode, zarr_format=3)
            return Opened(group, place, watch, durable)
        except FileNotFoundError:
            return None
        except DamagedStore:
            raise
        except (FileExistsError, ImportError, ValueError) as error:
            raise InvalidInput("store", location, _SAID[kind], str(error)) from None


_SAID = {"cloud": "a Zarr store written by softreach", "atlas": "a new folder, or an atlas"}


ARRAYS = "arrays"
"""Attribute of a cloud's store: the names of all of its arrays."""

READING: Mapping[str, Any] = {
    "consolidated": False,
    "zarr_format": 3,
    "chunks": None,
    "decode_times": False,
}
"""How xarray reads a store: as it was written, and numbers as numbers."""


def check_arrays(opened: Opened) -> None:
    """Check that the arrays of a store are there, and agree on the sizes of their dimensions.

    Raises:
        DamagedStore: One is missing, or of another size, or has no dimensions.
    """
    arrays: dict[str, Any] = dict(opened.group.arrays())
    names: Any = opened.group.attrs.get(ARRAYS)
    for name in map(str, names if isinstance(names, list) else ()):
        if name not in arrays:
            opened.watch.report(Chunk(name, None), "missing")
    sizes: dict[str, tuple[int, str]] = {}
    for name, array in arrays.items():
        dims = array.metadata.dimension_names or ()
        if len(dims) != array.ndim or None in dims:
            opened.watch.report(Chunk(name, None), f"over {dims}", f"over {array.ndim} dimensions")
        for dim, size in zip(map(str, dims), array.shape, strict=False):
            known, other = sizes.setdefault(dim, (size, name))
            if known != size:
                allowed = f"of {known} as {other} is"
                opened.watch.report(Chunk(name, None), f"of {size} along {dim}", allowed)


def kind_of(path: str | os.PathLike[str]) -> Kind:
    """What a store on disk holds.

    Raises:
        InvalidInput: No store of softreach.
    """
    try:
        attributes = unsealed((Path(path) / "zarr.json").read_bytes())["attributes"]
    except (OSError, Broken) as error:
        allowed = "a Zarr store written by softreach"
        raise InvalidInput("store", os.fspath(path), allowed, _reason(error)) from None
    return "atlas" if "command" in attributes else "cloud"


def _reason(error: OSError | Broken) -> str:
    return f"its zarr.json is {error.found}" if isinstance(error, Broken) else str(error.strerror)


def _store(location: Any, mode: Mode) -> Store:
    """The store behind a path, a URL or a mapping."""
    from zarr.storage import FsspecStore, LocalStore, MemoryStore

    if isinstance(location, dict):
        return MemoryStore(location)
    if not isinstance(location, str):
        return FsspecStore.from_mapper(location)
    if "://" in location:
        return FsspecStore.from_url(location)
    return LocalStore(location, read_only=mode == "r")
