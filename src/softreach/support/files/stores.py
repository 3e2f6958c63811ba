"""Zarr stores that let no damage through: crc32c in each chunk, sha256 of the documents.

The root lists the sha256 of the `zarr.json` of each array, and ends with its own, so that a changed
bit and a missing chunk are noticed; a whole chunk of another place, or an older store, is not.
"""

import copy
import hashlib
import json
import os
import re
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import google_crc32c
import zarr  # noqa: TID253  (imported where stores are)
from zarr.abc.buffer import Buffer  # noqa: TID253
from zarr.abc.store import ByteRequest, Store  # noqa: TID253
from zarr.storage import FsspecStore, LocalStore, MemoryStore, StoreLike, StorePath, WrapperStore  # noqa: TID253

from softreach.support.errors import InvalidInput, SoftreachError

Kind = Literal["cloud", "atlas"]
Mode = Literal["r", "r+"]

ROOT = "zarr.json"
# Attributes of a root: digest of each array's document by the array's name; digest of the root.
ARRAYS, DIGEST = "arrays", "sha256"
BLANK = "0" * 64  # What stands in place of a root's own digest when that is computed
# Options with which xarray reads a store: as it was written, and numbers as numbers.
READING: Any = {"consolidated": False, "zarr_format": 3, "chunks": None, "decode_times": False}

_REMEDY = {"cloud": "compute the cloud again, or bring back a copy"}
_REMEDY["atlas"] = "run the command that built the atlas again, which repairs it"
_ALLOWED = {"cloud": "a Zarr store written by softreach", "atlas": "a new folder, or an atlas"}
_KEY = re.compile(r"([^/]+)/c((?:/\d+)*)", re.ASCII)
_PARTIAL = re.compile(r"\.[0-9a-f]{32}\.partial$")  # what a killed writer of Zarr leaves
_CHECKSUM = 4  # bytes at the end of every chunk, by the crc32c codec


class StoreFailed(SoftreachError):
    """The store cannot be written to, for instance because the disk is full; it can be resumed."""


class Chunk(NamedTuple):
    """A file of a store: a chunk of an array, or what describes an array or the store."""

    array: str  # Empty for the store itself
    place: tuple[int, ...] | None  # None for what describes the array

    @classmethod
    def of_key(cls, key: str) -> Self | None:
        """The file with this key, from the root of the store on; None for any other."""
        if key == ROOT or key.endswith(f"/{ROOT}"):
            return cls(key.removesuffix(ROOT).rstrip("/"), None)
        found = _KEY.fullmatch(key)
        return cls(found[1], tuple(map(int, found[2].split("/")[1:]))) if found else None


class DamagedStore(InvalidInput):
    """A store that holds something else than softreach wrote.

    Attributes:
        location: The store.
        array: Which of its arrays; empty for the store itself.
        chunk: Which chunk of the array, such as (0, 3); None for what describes the array.
    """

    def __init__(self, location: object, chunk: Chunk, found: str, remedy: str) -> None:
        self.location, self.array, self.chunk = str(location), *chunk
        place = "" if chunk.place is None else "/".join(map(str, chunk.place)) or "0"
        what = f"chunk {place} of array {chunk.array}" if place else f"array {chunk.array}"
        where = f"{what} in {location}" if chunk.array else f"{ROOT} of {location}"
        super().__init__(where, found, "as softreach wrote it", remedy)


@dataclass(eq=False)
class Opened:
    """A store that is open, what is known of its files, and what becomes of damaged ones."""

    location: object
    kind: Kind
    required: Callable[[Chunk], bool] = lambda _: False  # Others that are missing hold fill values
    digests: dict[str, str] = field(default_factory=dict)  # Of each array's document, as listed
    place: StorePath = field(init=False)  # For xarray
    group: zarr.Group = field(init=False)
    _noted: dict[Chunk, DamagedStore] | None = None

    def report(self, chunk: Chunk, found: str) -> None:
        """Raise damage, or note it within `noting`."""
        error = DamagedStore(self.location, chunk, found, _REMEDY[self.kind])
        if self._noted is None:
            raise error
        self._noted[chunk] = error

    @contextmanager
    def noting(self, *, raising: bool = False) -> Iterator[dict[Chunk, DamagedStore]]:
        """Read damaged files as missing ones, and collect what is wrong with each.

        With `raising` the first is raised in the end, and not before: Zarr reads chunks at once,
        would lose all errors but the first, and print them at exit.
        """
        before, noted = self._noted, dict[Chunk, DamagedStore]()
        self._noted = noted
        try:
            yield noted
        finally:
            self._noted = before
            if raising and noted:
                raise next(iter(noted.values())) from None

    def check_arrays(self) -> None:
        """Check what describes each array."""
        for name in self.digests:
            _ = self.group[name]

    def check_root(self) -> None:
        """Check that the store is still the one that was opened."""
        again = zarr.open_group(self.place, mode="r", zarr_format=3)
        if again.attrs[DIGEST] != self.group.attrs[DIGEST]:
            raise StoreFailed(f"{self.location} was replaced while it was read: open it again")


def opened_store(location: StoreLike, kind: Kind, mode: Mode = "r") -> Opened | None:
    """A store of softreach, if there is any; `StoreFailed` where it cannot be reached."""
    if isinstance(location, str) and "://" not in location:
        if Path(location).is_file():
            raise InvalidInput("store", location, _ALLOWED[kind], "it is a file")
        if not Path(location).is_dir():
            return None
    opened = Opened(location, kind)
    with storage_errors(f"{location} cannot be opened"):
        try:
            place = place_of(location, mode)
            opened.place = StorePath(CheckedStore(place.store, opened, place.path), place.path)
            opened.group = zarr.open_group(opened.place, mode=mode, zarr_format=3)
            return opened
        except FileNotFoundError:
            return None
        except DamagedStore:
            raise
        except (FileExistsError, ImportError, ValueError) as error:
            raise InvalidInput("store", location, _ALLOWED[kind], str(error)) from None


def place_of(location: Any, mode: Mode) -> StorePath:
    """The place behind a path, a URL, a mapping or a Zarr store."""
    if isinstance(location, StorePath):
        return location
    if isinstance(location, dict):
        location = MemoryStore(location)
    elif isinstance(location, str) and "://" in location:
        location = FsspecStore.from_url(location)
    elif isinstance(location, str | os.PathLike):
        location = LocalStore(Path(location), read_only=mode == "r")
    elif not isinstance(location, Store):
        location = FsspecStore.from_mapper(location)
    return StorePath(location)


def absolute(location: StoreLike) -> StoreLike:
    """The same place for a process elsewhere."""
    if isinstance(location, str):  # a path, so that files are written beside their place
        location = location.removeprefix("file://")
    if isinstance(location, os.PathLike) or (isinstance(location, str) and "://" not in location):
        return str(Path(location).absolute())
    return location


class CheckedStore(WrapperStore[Any]):
    """Another store, whose arrays lie at `root`, of which every file is checked when it is read."""

    def __init__(self, store: Store, opened: Opened, root: str) -> None:
        super().__init__(store)
        self._opened = opened
        self._root = f"{root}/" if root else ""

    def _with_store(self, store: Store) -> Self:
        other = copy.copy(self)
        other._store = store
        return other

    async def get(
        self, key: str, prototype: Any, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """The content of a file; None if it is missing and may be."""
        content, chunk = await super().get(key, prototype, byte_range), self._chunk(key)
        if chunk and (fault := self._fault(chunk, content)):
            return self._opened.report(chunk, fault)
        return content

    async def set(self, key: str, value: Buffer) -> None:
        """Write a file, unless it describes an array otherwise than the root lists."""
        chunk, opened = self._chunk(key), self._opened
        listed = opened.digests.get(chunk.array) if chunk and chunk.place is None else None
        if listed and listed != sha256(value.to_bytes()):
            raise StoreFailed(f"{key} of {opened.location} was written by another Zarr release")
        await super().set(key, value)

    async def list_dir(self, prefix: str) -> AsyncIterator[str]:
        """The arrays of the root, without what killed writers or others left beside them."""
        async for name in super().list_dir(prefix):
            if name in self._opened.digests:
                yield name

    def _chunk(self, key: str) -> Chunk | None:
        return Chunk.of_key(key.removeprefix(self._root)) if key.startswith(self._root) else None

    def _fault(self, chunk: Chunk, content: Buffer | None) -> str:
        opened, described = self._opened, chunk.place is None
        if content is None:
            needed = chunk.array in opened.digests if described else opened.required(chunk)
            return "missing" if needed else ""
        if described and chunk.array:
            same = opened.digests.get(chunk.array) == sha256(content.to_bytes())
            return "" if same else "changed since it was written"
        if described:
            try:
                opened.digests = unsealed(content.to_bytes())[ARRAYS]
            except ValueError as error:
                return str(error)
            return ""
        numbers: Any = content.as_numpy_array()
        checksum = google_crc32c.value(numbers[:-_CHECKSUM]).to_bytes(_CHECKSUM, "little")
        whole = len(numbers) > _CHECKSUM and numbers[-_CHECKSUM:].tobytes() == checksum
        return "" if whole else "of a wrong checksum"


def sha256(text: bytes) -> str:
    """The digest of a text, as hexadecimal digits."""
    return hashlib.sha256(text).hexdigest()


def sealed(text: bytes) -> bytes:
    """A root with its digest instead of `BLANK`."""
    return text.replace(BLANK.encode(), sha256(text).encode())


def unsealed(text: bytes) -> dict[str, Any]:
    """Attributes of a root; `ValueError` if it was changed, or is not of softreach."""
    try:
        attributes = json.loads(text)["attributes"]
        if sealed(text.replace(attributes[DIGEST].encode(), BLANK.encode())) == text:
            return {ARRAYS: {}, **attributes}
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        pass
    raise ValueError("changed since it was written, or not of softreach")


def seal(folder: Path) -> None:
    """List what describes the arrays of a new store on disk in its root."""
    paths = sorted(folder.glob(f"*/{ROOT}"))
    digests = {path.parent.name: sha256(path.read_bytes()) for path in paths}
    root = json.loads((folder / ROOT).read_bytes())
    root["attributes"] |= {ARRAYS: digests, DIGEST: BLANK}
    (folder / ROOT).write_bytes(sealed(json.dumps(root, indent=2).encode()))


def foreign_entry(folder: Path) -> str:
    """The first thing in a folder that is none of a store of softreach; empty if there is none."""
    try:
        arrays = unsealed((folder / ROOT).read_bytes())[ARRAYS]
    except (OSError, ValueError):
        return ROOT if (folder / ROOT).exists() else min(os.listdir(folder), default="")
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() or not path.is_dir():
            key = path.relative_to(folder).as_posix()
            chunk = Chunk.of_key(key)
            if (chunk is None or chunk.array not in {"", *arrays}) and not _PARTIAL.search(key):
                return key
    return ""


def writing(location: object) -> AbstractContextManager[None]:
    """Raise any error of writing as `StoreFailed`, with what to do."""
    then = "; what is done is safe, and the same command continues once that is fixed"
    return storage_errors(f"{location} cannot be written", then)


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
