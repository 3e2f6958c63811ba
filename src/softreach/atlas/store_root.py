"""The root of a store, claimed by whoever comes first."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from softreach.errors import InvalidInput
from softreach.stores.damage import Watch
from softreach.stores.place import REMEDY, checked_place

if TYPE_CHECKING:
    from zarr.abc.store import Store
    from zarr.storage import StoreLike

__all__ = ["claim"]


def claim(location: StoreLike, attributes: Mapping[str, Any], *, durable: bool = False) -> None:
    """Write the root of a store, whole and only once: of several who try, the first succeeds.

    Raises:
        InvalidInput: The place holds something else.
    """
    import zarr
    from zarr.errors import ContainsGroupError

    watch = Watch(location=location, remedy=REMEDY["atlas"])
    place = checked_place(location, watch, mode="r+", durable=durable)
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
