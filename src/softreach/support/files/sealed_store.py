"""What describes a store and its arrays, sealed by a digest: any change of it is noticed."""

from __future__ import annotations

import asyncio
import copy
import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import google_crc32c
from zarr.storage import LocalStore, WrapperStore  # noqa: TID253  (imported where stores are)

from softreach.support.errors import InvalidInput, SoftreachError
from softreach.support.files.atomic import sync_file_in
from softreach.support.files.interruption import as_a_whole

if TYPE_CHECKING:
    from zarr.abc.buffer import Buffer
    from zarr.abc.store import ByteRequest, Store

SEAL = "metadata_sha256"
"""Attribute of every zarr.json: digest of all of it but this attribute."""

_TYPES = (
    *("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
    *("float32", "float64", "string"),
)
"""Numbers and texts: nothing complex, no dates, no bytes, no objects."""
_CODECS = ("bytes", "vlen-utf8", "blosc", "zstd", "gzip", "crc32c")
"""Those of the Zarr v3 core; none of them can run code."""
_GROUP = {"zarr_format", "node_type", "attributes", "consolidated_metadata"}


class Broken(Exception):
    """What describes an array cannot be trusted, or is no array of softreach.

    Attributes:
        found: What there is.
        allowed: What there must be.
    """

    def __init__(self, found: str, allowed: str = "as softreach wrote it") -> None:
        self.found, self.allowed = found, allowed
        super().__init__(f"{found}: must be {allowed}")


def sealed(text: bytes) -> bytes:
    """The text of a zarr.json with its digest.

    Raises:
        Broken: It describes an array of a kind that no store of softreach holds.
    """
    document = _parsed(text)
    _check_kind(document)
    attributes = {key: value for key, value in _attributes(document).items() if key != SEAL}
    document["attributes"] = attributes
    document["attributes"] = {**attributes, SEAL: _digest(document)}
    return json.dumps(document, indent=2).encode()


def unsealed(text: bytes) -> dict[str, Any]:
    """What a zarr.json says, without its digest.

    Raises:
        Broken: It is not what `sealed` wrote.
    """
    document = _parsed(text)
    seal = _attributes(document).pop(SEAL, None)
    if seal is None:
        allowed = "one that softreach wrote, with checksums (older ones and others have none)"
        raise Broken("without a checksum", allowed)
    if seal != _digest(document):
        raise Broken("changed since it was written")
    _check_kind(document)
    return document


def _parsed(text: bytes) -> dict[str, Any]:
    try:
        document = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError):
        document = None
    if not isinstance(document, dict):
        raise Broken("empty" if not text else "no JSON document")
    return document


def _attributes(document: dict[str, Any]) -> dict[str, Any]:
    attributes = document.get("attributes", {})
    if not isinstance(attributes, dict):
        raise Broken("without attributes")
    return attributes


def _digest(document: dict[str, Any]) -> str:
    text = json.dumps(document, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _check_kind(document: dict[str, Any]) -> None:
    """Check that it is a group, or an array of a kind that softreach writes."""
    if document.get("node_type") != "array":
        if not _GROUP.issuperset(document):
            raise Broken("of neither a group nor an array")
        return
    if document.get("data_type") not in _TYPES:
        shown = json.dumps(document.get("data_type"))
        raise Broken(f"of type {shown}", "of numbers or of texts")
    codecs = [codec.get("name") for codec in document.get("codecs", [])]
    if not set(codecs) <= set(_CODECS) or codecs[-1:] != ["crc32c"]:
        allowed = f"some of {', '.join(_CODECS)}, the last of them crc32c"
        raise Broken(f"with the codecs {', '.join(map(str, codecs))}", allowed)


# What is wrong with a store: where, and what to do.


class StoreFailed(SoftreachError):
    """The store cannot be written to, for instance because the disk is full; it can be resumed."""


class DamagedStore(InvalidInput):
    """A store that holds something else than softreach wrote.

    Attributes:
        location: The store.
        array: Which of its arrays; empty for the store itself.
        chunk: Which chunk of the array, such as (0, 3); None for what describes the array.
    """

    def __init__(
        self,
        location: object,
        array: str,
        chunk: tuple[int, ...] | None,
        found: str,
        remedy: str,
        allowed: str = "as softreach wrote it",
    ) -> None:
        self.location, self.array, self.chunk = str(location), array, chunk
        what = f"array {array}" if chunk is None else f"chunk {_place(chunk)} of array {array}"
        where = f"{what} in {location}" if array else f"zarr.json of {location}"
        super().__init__(where, found, allowed, remedy)


class Chunk(NamedTuple):
    """A file of a store: a chunk of an array, or what describes an array or the store."""

    array: str
    """Empty for the store itself."""
    place: tuple[int, ...] | None
    """None for what describes the array."""

    @classmethod
    def of_key(cls, key: str) -> Self | None:
        """The file with this key of the store; None for any other."""
        if key == _DOCUMENT or key.endswith(f"/{_DOCUMENT}"):
            return cls(key[: -len(_DOCUMENT)].rstrip("/").rpartition("/")[2], None)
        array, found, numbers = key.rpartition("/c/")
        if key.endswith("/c"):  # the only chunk of a number
            array, found, numbers = key[:-2], "/c", ""
        places = numbers.split("/") if numbers else []
        if not found or not all(text.isascii() and text.isdigit() for text in places):
            return None
        return cls(array.rpartition("/")[2], tuple(map(int, places)))


_DOCUMENT = "zarr.json"


@dataclass(kw_only=True, eq=False)
class Watch:
    """What is asked of the files of a store that are read, and what becomes of damaged ones."""

    location: object
    remedy: str
    """What a person does about damage."""
    required: Callable[[Chunk], bool] = lambda _: False
    """Which chunks must exist; others that are missing hold fill values."""
    _noted: dict[Chunk, str] | None = field(default=None, init=False)

    def report(self, chunk: Chunk, found: str, allowed: str = "as softreach wrote it") -> None:
        """Note damage where that is asked for.

        Raises:
            DamagedStore: It is not.
        """
        error = DamagedStore(self.location, *chunk, found, self.remedy, allowed)
        if self._noted is None:
            raise error
        self._noted[chunk] = str(error)

    @contextmanager
    def noting(self) -> Iterator[dict[Chunk, str]]:
        """Read damaged files as missing ones, and collect what is wrong with each."""
        before, noted = self._noted, {}
        self._noted = noted
        try:
            yield noted
        finally:
            self._noted = before


@contextmanager
def writing(location: object) -> Iterator[None]:
    """Turn errors of the disk or the network into one line that says what to do.

    A process that a signal ends waits for what is being written.
    """
    failed = f"{location} cannot be written"
    then = "; what is done is safe, and the same command continues once that is fixed"
    with as_a_whole(), storage_errors(failed, then):
        yield


@contextmanager
def storage_errors(what: str, then: str = "") -> Iterator[None]:
    """Raise any error of any kind of store as `StoreFailed`, in one line."""
    try:
        yield
    except SoftreachError:
        raise
    except Exception as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise StoreFailed(f"{what}: {' '.join(reason.split())}{then}") from error


def _place(chunk: tuple[int, ...]) -> str:
    return "/".join(map(str, chunk)) or "0"


# A Zarr store that lets no damage through: digests of what describes it, checksums of chunks.


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
