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
import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self

import google_crc32c
from zarr.storage import LocalStore, WrapperStore  # noqa: TID253  (imported where stores are)

from softreach.support.errors import InvalidInput
from softreach.support.files.atomic import sync_file_in
from softreach.support.files.damage import (
    AS_WRITTEN,
    DOCUMENT,
    MISPLACED,
    Chunk,
    DamagedStore,
    Watch,
    storage_errors,
)
from softreach.support.files.kinds import first_entry

if TYPE_CHECKING:
    import zarr
    from zarr.abc.buffer import Buffer
    from zarr.abc.store import ByteRequest, Store
    from zarr.storage import StoreLike, StorePath

Kind = Literal["cloud", "atlas"]
Mode = Literal["r", "r+"]

ARRAYS = "arrays"
"""Attribute of the root: digest of what describes each array, by its name."""
CHUNKS = "chunks"
"""Attribute of the root or an array: checksum of each chunk that is written once, by its key."""
DIGEST = "sha256"
"""Attribute of the root: digest of all of it but this attribute."""
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
_TYPES = (
    *("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
    *("float32", "float64", "string"),
)
"""Numbers and texts: nothing complex, no dates, no bytes, no objects."""
_CODECS = ("bytes", "vlen-utf8", "blosc", "zstd", "gzip", "crc32c")
"""Those of the Zarr v3 core; none of them can run code."""
_GROUP = {"zarr_format", "node_type", "attributes", "consolidated_metadata"}


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
                _described(watch, chunk, path.read_bytes())
            except _Broken as broken:
                watch.report(chunk, broken.found, broken.allowed)
    arrays = dict(opened.group.arrays())
    for name in watch.digests:
        if name not in arrays:
            watch.report(Chunk(name, None), "missing")
    return arrays


def kind_of(path: str | os.PathLike[str]) -> Kind:
    """The kind of a store on disk.

    Raises:
        InvalidInput: No store of softreach.
    """
    try:
        attributes = _unsealed((Path(path) / DOCUMENT).read_bytes())["attributes"]
    except (OSError, _Broken) as error:
        reason = f"its {DOCUMENT} is {error.found}" if isinstance(error, _Broken) else str(error)
        raise InvalidInput("store", os.fspath(path), _ALLOWED["cloud"], reason) from None
    return "atlas" if "command" in attributes else "cloud"


def foreign_entry(path: Path) -> str:
    """The first thing in a folder that is none of a store of softreach; empty if there is none."""
    try:
        arrays = _unsealed((path / DOCUMENT).read_bytes())["attributes"].get(ARRAYS)
    except FileNotFoundError:
        return first_entry(path)
    except (OSError, _Broken):
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
        content = await super().get(key, prototype, byte_range)
        chunk = self._chunk(key)
        if chunk is None or (chunk.place is None and content is None):
            return content
        try:
            if chunk.place is None:
                return self._document(chunk, content)
            self._check(chunk, content)
        except _Broken as broken:
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
        """What describes the store or one of its arrays, without digests and checksums."""
        text = content.to_bytes()
        if chunk.array:
            document = _described(self.watch, chunk, text)
        else:
            document = _unsealed(text)
            self.watch.root = _digest(document)
            digests = document["attributes"].get(ARRAYS)
            if isinstance(digests, dict):
                self.watch.digests, self.watch.listed = digests, True
        self.watch.listed_checksums |= document["attributes"].pop(CHUNKS, {})
        return type(content).from_bytes(json.dumps(document).encode())

    def _check(self, chunk: Chunk, content: Buffer | None) -> None:
        """Check the checksum of a chunk, and that it is of this store and place."""
        if content is None:
            if self.watch.required(chunk):
                raise _Broken("missing")
            return
        numbers: Any = content.as_numpy_array()
        if len(numbers) <= _CHECKSUM:
            raise _Broken(f"{len(numbers)} bytes long")
        checksum = _checksum(content)
        if google_crc32c.value(numbers[:-_CHECKSUM]) != checksum:
            raise _Broken("of a wrong checksum")
        listed = self.watch.listed_checksums.get(chunk.key, checksum)
        if listed != checksum or not self.watch.belongs(chunk, checksum):
            raise _Broken(MISPLACED)

    def _written(self, key: str, value: Buffer) -> Buffer:
        """What is written for a value: the root with its digest, all else as it is."""
        chunk = self._chunk(key)
        if chunk is None:
            return value
        if chunk.place is not None:
            self.watch.written[chunk] = _checksum(value)
            return value
        if not chunk.array:
            return type(value).from_bytes(sealed(value.to_bytes()))
        _check_kind(document := _parsed(value.to_bytes()))
        digest = _digest(document)
        if self.watch.listed and self.watch.digests.get(chunk.array) != digest:
            allowed = "as the release of Zarr that began the store describes it"
            raise InvalidInput(f"array {chunk.array}", "described otherwise", allowed)
        self.watch.digests[chunk.array] = digest
        return value

    async def _sync(self, key: str) -> None:
        if self.durable and isinstance(self._store, LocalStore):
            await asyncio.to_thread(sync_file_in, self._store.root / key, self._store.root)


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


class _Broken(Exception):
    """A file that cannot be trusted, or is none of softreach: what it is, and what it must be."""

    def __init__(self, found: str, allowed: str = AS_WRITTEN) -> None:
        self.found, self.allowed = found, allowed
        super().__init__(f"{found}: must be {allowed}")


def sealed(text: bytes) -> bytes:
    """The text of a root with its digest."""
    document = _parsed(text)
    attributes = {key: value for key, value in document["attributes"].items() if key != DIGEST}
    document["attributes"] = attributes
    document["attributes"] = {**attributes, DIGEST: _digest(document)}
    return json.dumps(document, indent=2).encode()


def _checksum(content: Buffer) -> int:
    """The checksum at the end of a chunk."""
    numbers: Any = content.as_numpy_array()
    return int.from_bytes(numbers[-_CHECKSUM:].tobytes(), "little")


def _unsealed(text: bytes) -> dict[str, Any]:
    """What a root says, without its digest."""
    document = _parsed(text)
    digest = document["attributes"].pop(DIGEST, None)
    if digest is None:
        allowed = "one that softreach wrote, with checksums (older ones and others have none)"
        raise _Broken("without a checksum", allowed)
    if digest != _digest(document):
        raise _Broken("changed since it was written")
    _check_kind(document)
    return document


def _parsed(text: bytes) -> dict[str, Any]:
    try:
        document = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError):
        document = None
    if not isinstance(document, dict):
        raise _Broken("empty" if not text else "no JSON document")
    if not isinstance(document.setdefault("attributes", {}), dict):
        raise _Broken("without attributes")
    return document


def _described(watch: Watch, chunk: Chunk, text: bytes) -> dict[str, Any]:
    """What describes an array, as its store lists it."""
    document = _parsed(text)
    if chunk.array not in watch.digests:
        allowed = "one of those that softreach wrote, or moved away"
        raise _Broken("not listed in the root", allowed)
    if _digest(document) != watch.digests[chunk.array]:
        raise _Broken("changed since it was written")
    _check_kind(document)
    return document


def _digest(document: dict[str, Any]) -> str:
    text = json.dumps(document, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _check_kind(document: dict[str, Any]) -> None:
    """Check that it is a group, or an array of a kind that softreach writes."""
    if document.get("node_type") != "array":
        if not _GROUP.issuperset(document):
            raise _Broken("of neither a group nor an array")
        return
    if document.get("data_type") not in _TYPES:
        shown = json.dumps(document.get("data_type"))
        raise _Broken(f"of type {shown}", "of numbers or of texts")
    codecs = [codec.get("name") for codec in document.get("codecs", [])]
    if not set(codecs) <= set(_CODECS) or codecs[-1:] != ["crc32c"]:
        allowed = f"some of {', '.join(_CODECS)}, the last of them crc32c"
        raise _Broken(f"with the codecs {', '.join(map(str, codecs))}", allowed)
