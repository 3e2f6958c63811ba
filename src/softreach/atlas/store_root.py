"""The place of a store: opened, or claimed by whoever comes first; its errors in one line."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from softreach.errors import InvalidInput, SoftreachError
from softreach.interruption import as_a_whole

if TYPE_CHECKING:
    import zarr
    from zarr.abc.store import Store
    from zarr.storage import StoreLike, StorePath

__all__ = ["StoreFailed", "absolute", "claim", "opened_root", "storage_errors", "writing"]


class StoreFailed(SoftreachError):
    """The store cannot be written to, for instance because the disk is full; it can be resumed."""


def absolute(location: StoreLike) -> StoreLike:
    """The same place for a process elsewhere."""
    if isinstance(location, str):
        # A path, so that files are written beside their place and renamed.
        location = location.removeprefix("file://")
    if isinstance(location, os.PathLike) or (isinstance(location, str) and "://" not in location):
        return str(Path(location).absolute())
    return location


@contextmanager
def writing(location: StoreLike) -> Iterator[None]:
    """Turn errors of the disk or the network into one line that says what to do.

    A process that a signal ends waits for what is being written.
    """
    failed = f"{location} cannot be written"
    then = "; what is done is safe, and the same command continues once that is fixed"
    with as_a_whole(), storage_errors(failed, then):
        yield


@contextmanager
def storage_errors(what: str, then: str = "") -> Iterator[None]:
    """Raise any error of any kind of store as `StoreFailed`."""
    try:
        yield
    except SoftreachError:
        raise
    except Exception as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise StoreFailed(f"{what}: {reason}{then}") from error


def opened_root(location: StoreLike, mode: Literal["r", "r+"] = "r+") -> zarr.Group | None:
    """The root group of a store, if there is one."""
    import zarr

    with storage_errors(f"{location} cannot be opened"):
        try:
            return zarr.open_group(location, mode=mode, zarr_format=3)
        except FileNotFoundError:
            return None
        except (FileExistsError, ImportError, ValueError) as error:
            allowed = "a new folder, or an atlas"
            raise InvalidInput("store", location, allowed, str(error)) from None


def claim(location: StoreLike, attributes: Mapping[str, Any]) -> None:
    """Write the root of a store, whole and only once: of several who try, the first succeeds.

    Raises:
        InvalidInput: The place holds something else.
    """
    import zarr
    from zarr.errors import ContainsGroupError

    place = _store_path(location)
    store = _first_wins(place.store, location)
    with suppress(ContainsGroupError):
        zarr.create_group(store, path=place.path, zarr_format=3, attributes=dict(attributes))


def _first_wins(store: Store, location: StoreLike) -> Store:
    """The same store, to which only what is missing is written, and nothing beside other files.

    Zarr's groups have no exclusive mode, but its stores do: a key is set only if it is missing.
    """
    from zarr.storage import WrapperStore

    class FirstWins(WrapperStore):
        async def set(self, key: str, value: Any) -> None:
            folder = key.rpartition("/")[0]
            names = [name async for name in self.list_dir(folder)]
            # In this order: files of a claim made in between are not foreign.
            if any(map(_is_foreign, names)) and not await self.exists(key):
                raise InvalidInput("store", location, "a new folder, or an atlas")
            await self.set_if_not_exists(key, value)

    return FirstWins(store)


def _is_foreign(name: str) -> bool:
    """Whether a file is anything but what a killed writer leaves behind."""
    return not name.endswith(".partial")


def _store_path(location: Any) -> StorePath:
    from zarr.abc.store import Store
    from zarr.storage import StorePath

    if isinstance(location, StorePath):
        return location
    return StorePath(location if isinstance(location, Store) else _store(location))


def _store(location: Any) -> Store:
    """The store behind a path, a URL or a mapping."""
    from zarr.storage import FsspecStore, LocalStore, MemoryStore

    if isinstance(location, dict):
        return MemoryStore(location)
    if not isinstance(location, str):
        return FsspecStore.from_mapper(location)
    return FsspecStore.from_url(location) if "://" in location else LocalStore(location)
