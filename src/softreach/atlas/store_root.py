"""The place of a store: opened, or taken by the first who comes; its errors in one line."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from softreach.errors import InvalidInput, SoftreachError

if TYPE_CHECKING:
    import zarr
    from zarr.abc.store import Store
    from zarr.storage import StoreLike, StorePath

__all__ = ["StoreFailed", "absolute", "claim", "opened_root", "store_errors", "writing"]


class StoreFailed(SoftreachError):
    """The store cannot be written to, because the disk is full for instance; it can be resumed."""


def absolute(location: StoreLike) -> StoreLike:
    """The same place for a process elsewhere."""
    if isinstance(location, str):
        # A path, so that files are written beside their place and renamed.
        location = location.removeprefix("file://")
    if isinstance(location, os.PathLike) or (isinstance(location, str) and "://" not in location):
        return str(Path(location).absolute())
    return location


def writing(location: StoreLike) -> AbstractContextManager[None]:
    """Turn an error of the disk or the network into one line that says what to do."""
    return store_errors(
        f"{location} cannot be written",
        "; what is done is safe, and the same command continues once that is mended",
    )


@contextmanager
def store_errors(what: str, then: str = "") -> Iterator[None]:
    """Raise what a store raises, whatever kind of store it is, as `StoreFailed`."""
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

    with store_errors(f"{location} cannot be opened"):
        try:
            return zarr.open_group(location, mode=mode, zarr_format=3)
        except FileNotFoundError:
            return None
        except (FileExistsError, ImportError, ValueError) as error:
            allowed = "a new folder, or an atlas"
            raise InvalidInput("store", location, allowed, str(error)) from None


def claim(location: StoreLike, attributes: Mapping[str, Any]) -> None:
    """Write the root of a store, whole and never again: of several who try, the first does.

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
    """The same store, to which only what is missing is written, and nothing beside strange files.

    Zarr's groups have no exclusive mode, its stores have: whatever is set is set only if it does
    not exist.
    """
    from zarr.storage import WrapperStore

    class FirstWins(WrapperStore):
        async def set(self, key: str, value: Any) -> None:
            folder = key.rpartition("/")[0]
            names = [name async for name in self.list_dir(folder)]
            # In this order: a claim by somebody else in between makes its files no strangers.
            if any(map(_strange, names)) and not await self.exists(key):
                raise InvalidInput("store", location, "a new folder, or an atlas")
            await self.set_if_not_exists(key, value)

    return FirstWins(store)


def _strange(name: str) -> bool:
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
