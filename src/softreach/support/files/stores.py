"""Zarr stores that let no damage through: one checksum a chunk, and one digest of all the rest.

Every chunk ends with the checksum of Zarr's crc32c codec. The root lists the digest of what
describes each array, and ends with its own: any change of any file is noticed when it is read.
Chunks that are written only once are listed with their checksums, by what describes their array or
by the root, so that a whole chunk of another store or place is noticed too. Stores of earlier
versions have no such lists.
"""

from __future__ import annotations

import asyncio
import copy
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self

import google_crc32c
from zarr.storage import LocalStore, WrapperStore  # noqa: TID253  (imported where stores are)

from softreach.support.errors import InvalidInput
from softreach.support.files.atomic import sync
from softreach.support.files.damage import (
    DOCUMENT,
    MISPLACED,
    Chunk,
    DamagedStore,
    Watch,
    storage_errors,
)
from softreach.support.files.documents import (
    ARRAYS,
    CHUNKS,
    Broken,
    check_kind,
    described,
    digest_of,
    parsed,
    sealed,
    unsealed,
)

if TYPE_CHECKING:
    import zarr
    from zarr.abc.buffer import Buffer
    from zarr.abc.store import ByteRequest, Store
    from zarr.storage import StoreLike, StorePath

Kind = Literal["cloud", "atlas"]
Mode = Literal["r", "r+"]

REMEDY = {
    "cloud": "compute the cloud again, or bring back a copy",
    "atlas": "the command that built the atlas computes again what is damaged",
}
"""Remedy of damage, by the kind of store."""
READING: Mapping[str, Any] = {
    "consolidated": False,
    "zarr_format": 3,
    "chunks": None,
    "decode_times": False,
}
"""Options with which xarray reads a store: as it was written, and numbers as numbers."""

_ALLOWED = {"cloud": "a Zarr store written by softreach", "atlas": "a new folder, or an atlas"}
_CHECKSUM = 4  # bytes at the end of every chunk, by the crc32c codec


class Opened(NamedTuple):
    """A store that is open."""

    group: zarr.Group
    place: StorePath
    """For xarray."""
    watch: Watch
    durable: bool = False


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
            raise InvalidInput("store", location, _ALLOWED[kind], "it is a file")
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
            raise InvalidInput("store", location, _ALLOWED[kind], str(error)) from None


def checked_place(location: Any, watch: Watch, *, mode: Mode, durable: bool = False) -> StorePath:
    """The place, of which every file is checked when it is read."""
    from zarr.abc.store import Store
    from zarr.storage import StorePath

    at = location if isinstance(location, StorePath) else None
    inner, root = (at.store, at.path) if at else (absolute(location), "")
    store = inner if isinstance(inner, Store) else _store(inner, mode)
    return StorePath(CheckedStore(store, watch, root, durable=durable), root)


def list_arrays(place: StorePath, watch: Watch) -> None:
    """List the chunks that were written with each array, and the arrays in their root."""
    import zarr

    group = zarr.open_group(place, mode="r+", zarr_format=3)
    for name, array in list(group.arrays()):
        array.attrs[CHUNKS] = checksums_by_key(watch, name)
    group.attrs[ARRAYS] = dict(watch.digests)


def checksums_by_key(watch: Watch, *arrays: str) -> dict[str, int]:
    """The checksums of the chunks of arrays that were written."""
    chunks = sorted(chunk for chunk in watch.written if chunk.array in arrays)
    return {chunk.key: watch.written[chunk] for chunk in chunks}


def bound_checksum(watch: Watch, chunk: Chunk, content: int) -> int:
    """The checksum of what a chunk holds, of its place and of the root of its store."""
    return google_crc32c.value(f"{watch.root} {chunk.key} ".encode() + content.to_bytes(4))


def check_arrays(opened: Opened) -> None:
    """Check that the arrays of a store are there, and agree on the sizes of their dimensions.

    Raises:
        DamagedStore: One is missing or foreign, or of another size, or has no dimensions.
    """
    arrays = _arrays(opened)
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


def _arrays(opened: Opened) -> dict[str, Any]:
    """The arrays of a store; on disk, one looks first at what describes each.

    Zarr opens all at once and loses every error but the first; it would be printed in the end.
    """
    watch = opened.watch
    if isinstance(watch.location, str) and "://" not in watch.location:
        for path in sorted(Path(watch.location).glob(f"*/{DOCUMENT}")):
            chunk = Chunk(path.parent.name, None)
            try:
                described(watch, chunk, _bytes_of(path))
            except Broken as broken:
                watch.report(chunk, broken.found, broken.allowed)
    arrays = dict(opened.group.arrays())
    for name in watch.digests:
        if name not in arrays:
            watch.report(Chunk(name, None), "missing")
    return arrays


def _bytes_of(path: Path) -> bytes:
    """Content of a file that describes a store or an array.

    Raises:
        Broken: It is no file.
    """
    if path.is_dir() or _is_endless(path):
        raise Broken("no file")
    return path.read_bytes()


def _is_endless(path: Path) -> bool:
    """True if a pipe or a device is in the place of a file: reading it would never end."""
    return path.exists() and not (path.is_file() or path.is_dir())


def absence(location: StoreLike) -> str:
    """Reason why there is no store at a place: it does not exist, or holds something else."""
    if isinstance(location, str) and "://" not in location and Path(location).exists():
        return "there is none in it"
    return "it does not exist"


def kind_of(path: str | os.PathLike[str]) -> Kind:
    """The kind of a store on disk.

    Raises:
        InvalidInput: No store of softreach.
    """
    return "atlas" if "command" in attributes_of(path) else "cloud"


def attributes_of(path: str | os.PathLike[str]) -> Mapping[str, Any]:
    """Attributes of a store on disk.

    Raises:
        InvalidInput: No store of softreach.
    """
    try:
        return unsealed(_bytes_of(Path(path) / DOCUMENT))["attributes"]
    except (OSError, Broken) as error:
        reason = f"its {DOCUMENT} is {error.found}" if isinstance(error, Broken) else str(error)
        reason = reason if Path(path).exists() else absence(os.fspath(path))
        raise InvalidInput("store", os.fspath(path), _ALLOWED["cloud"], reason) from None


def foreign_entry(path: Path) -> str:
    """The first thing in a folder that is none of a store of softreach; empty if there is none."""
    try:
        arrays = unsealed((path / DOCUMENT).read_bytes())["attributes"].get(ARRAYS)
    except FileNotFoundError:
        return min((entry.name for entry in path.iterdir()), default="")
    except (OSError, Broken):
        return DOCUMENT
    known = {"", *(arrays if isinstance(arrays, dict) else ())}
    for folder, folders, files in os.walk(path):
        inside = Path(folder).relative_to(path)
        for name in sorted([*folders, *files]):
            key = (inside / name).as_posix()
            # A folder is one of an array, or holds its chunks.
            chunk = Chunk.of_key(key if name in files or "/" in key else f"{key}/c")
            if chunk is None or chunk.array not in known:
                return key
    return ""


def absolute(location: StoreLike) -> StoreLike:
    """The same place for a process elsewhere."""
    if isinstance(location, str):
        # A path, so that files are written beside their place and renamed.
        location = location.removeprefix("file://")
    if isinstance(location, os.PathLike) or (isinstance(location, str) and "://" not in location):
        return str(Path(location).absolute())
    return location


class CheckedStore(WrapperStore[Any]):
    """Another store, of which every file is checked when it is read.

    Args:
        store: The store.
        watch: What becomes of damage.
        root: Where in it the root of the arrays is.
        durable: Whether a file is on the disk, not only on its way there, when it counts as
            written.
    """

    def __init__(self, store: Store, watch: Watch, root: str, *, durable: bool = False) -> None:
        super().__init__(store)
        self.watch, self.durable = watch, durable
        self._root = f"{root}/" if root else ""

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
        chunk = self._chunk(key)
        if isinstance(self._store, LocalStore) and _is_endless(self._store.root / key):
            if chunk is not None:
                self.watch.report(chunk, "no file")
            return None
        content = await super().get(key, prototype, byte_range)
        if chunk is None or (chunk.place is None and content is None):
            return content
        try:
            if chunk.place is None:
                return self._document(chunk, content)
            self._check(chunk, content)
        except Broken as broken:
            self.watch.report(chunk, broken.found, broken.allowed)
            return None
        return content

    async def set(self, key: str, value: Buffer) -> None:
        """Write a file, with its digest if it describes the store."""
        await super().set(key, self._written(key, value))
        await self._sync(key)

    async def set_if_not_exists(self, key: str, value: Buffer) -> None:
        """Write a file unless it exists."""
        await super().set_if_not_exists(key, self._written(key, value))
        await self._sync(key)

    def _chunk(self, key: str) -> Chunk | None:
        return Chunk.of_key(key.removeprefix(self._root)) if key.startswith(self._root) else None

    def _document(self, chunk: Chunk, content: Any) -> Buffer:
        """Description of the store or one of its arrays, without digests and checksums."""
        text = content.to_bytes()
        if chunk.array:
            document = described(self.watch, chunk, text)
        else:
            document = unsealed(text)
            self.watch.root = digest_of(document)
            digests = document["attributes"].get(ARRAYS)
            if isinstance(digests, dict):
                self.watch.digests, self.watch.listed = digests, True
        self.watch.listed_checksums |= document["attributes"].pop(CHUNKS, {})
        return type(content).from_bytes(json.dumps(document).encode())

    def _check(self, chunk: Chunk, content: Buffer | None) -> None:
        """Check the checksum of a chunk, and that it is of this store and place."""
        if content is None:
            if self.watch.required(chunk):
                raise Broken("missing")
            return
        numbers: Any = content.as_numpy_array()
        if len(numbers) <= _CHECKSUM:
            raise Broken(f"{len(numbers)} bytes long")
        checksum = _checksum(content)
        if google_crc32c.value(numbers[:-_CHECKSUM]) != checksum:
            raise Broken("of a wrong checksum")
        listed = self.watch.listed_checksums.get(chunk.key, checksum)
        if listed != checksum or not self.watch.belongs(chunk, checksum):
            raise Broken(MISPLACED)

    def _written(self, key: str, value: Buffer) -> Buffer:
        """Bytes that are written for a value: the root with its digest, all else as it is."""
        chunk = self._chunk(key)
        if chunk is None:
            return value
        if chunk.place is not None:
            self.watch.written[chunk] = _checksum(value)
            return value
        if not chunk.array:
            return type(value).from_bytes(sealed(value.to_bytes()))
        check_kind(document := parsed(value.to_bytes()))
        digest = digest_of(document)
        if self.watch.listed and self.watch.digests.get(chunk.array) != digest:
            allowed = "as the release of Zarr that began the store describes it"
            raise InvalidInput(f"array {chunk.array}", "described otherwise", allowed)
        self.watch.digests[chunk.array] = digest
        return value

    async def _sync(self, key: str) -> None:
        if self.durable and isinstance(self._store, LocalStore):
            await asyncio.to_thread(_sync_in, self._store.root / key, self._store.root)


def _sync_in(path: Path, root: Path) -> None:
    """Wait until a file is on the disk, with its name and those of its folders up to `root`."""
    sync(path)
    for folder in path.parents:
        sync(folder)
        if folder == root:
            return


def _store(location: Any, mode: Mode) -> Store:
    """The store behind a path, a URL or a mapping."""
    from zarr.storage import FsspecStore, MemoryStore

    if isinstance(location, dict):
        return MemoryStore(location)
    if not isinstance(location, str):
        return FsspecStore.from_mapper(location)
    if "://" in location:
        return FsspecStore.from_url(location)
    return LocalStore(location, read_only=mode == "r")


def _checksum(content: Buffer) -> int:
    """The checksum at the end of a chunk."""
    numbers: Any = content.as_numpy_array()
    return int.from_bytes(numbers[-_CHECKSUM:].tobytes(), "little")
