"""A Zarr store that lets no damage through: digests of what describes it, checksums of chunks."""

from __future__ import annotations

import asyncio
import copy
import json
from typing import TYPE_CHECKING, Any, Self

import google_crc32c
from zarr.storage import LocalStore, WrapperStore  # noqa: TID253  (imported where stores are)

from softreach.durable import sync_file_in
from softreach.stores.damage import Chunk, Watch
from softreach.stores.seal import Broken, sealed, unsealed

if TYPE_CHECKING:
    from zarr.abc.buffer import Buffer
    from zarr.abc.store import ByteRequest, Store

__all__ = ["CheckedStore"]

_CHECKSUM = 4  # bytes at the end of every chunk, by the crc32c codec


class CheckedStore(WrapperStore[Any]):
    """Another store, of which every file is checked when it is read."""

    def __init__(self, store: Store, watch: Watch, *, durable: bool = False) -> None:
        super().__init__(store)
        self.watch = watch
        self.durable = durable
        """Whether a file is on the disk, not only on its way there, when it counts as written."""

    def _with_store(self, store: Store) -> Self:
        other = copy.copy(self)
        other._store = store
        return other

    async def get(
        self, key: str, prototype: Any, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """The content of a file; None if it is missing and may be.

        Raises:
            DamagedStore: It is not what was written, or it is missing.
        """
        found = await super().get(key, prototype, byte_range)
        chunk = Chunk.of_key(key)
        if chunk is None:
            return found
        if chunk.place is None:
            return None if found is None else self._document(chunk, found)
        if fault := self._fault(chunk, found):
            self.watch.report(chunk, fault)
            return None
        return found

    async def set(self, key: str, value: Buffer) -> None:
        """Write a file, with its digest if it describes an array or the store."""
        await super().set(key, _with_seal(key, value))
        await self._synced(key)

    async def set_if_not_exists(self, key: str, value: Buffer) -> None:
        """Write a file unless it exists."""
        await super().set_if_not_exists(key, _with_seal(key, value))
        await self._synced(key)

    def _document(self, chunk: Chunk, found: Buffer) -> Buffer | None:
        try:
            document = unsealed(found.to_bytes())
        except Broken as broken:
            self.watch.report(chunk, broken.found, broken.allowed)
            return None
        return type(found).from_bytes(json.dumps(document).encode())

    def _fault(self, chunk: Chunk, found: Buffer | None) -> str:
        """What is wrong with a chunk; empty if nothing is."""
        if found is None:
            return "missing" if self.watch.required(chunk) else ""
        content: Any = found.as_numpy_array()
        if len(content) <= _CHECKSUM:
            return f"{len(content)} bytes long"
        said = int.from_bytes(content[-_CHECKSUM:].tobytes(), "little")
        return "of a wrong checksum" if google_crc32c.value(content[:-_CHECKSUM]) != said else ""

    async def _synced(self, key: str) -> None:
        if self.durable and isinstance(self._store, LocalStore):
            await asyncio.to_thread(sync_file_in, self._store.root / key, self._store.root)


def _with_seal(key: str, value: Buffer) -> Buffer:
    chunk = Chunk.of_key(key)
    if chunk is None or chunk.place is not None:
        return value
    return type(value).from_bytes(sealed(value.to_bytes()))
