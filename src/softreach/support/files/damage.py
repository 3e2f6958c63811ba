"""Damage of a store: which of its files it is in, and what becomes of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple, Self

from softreach.support.errors import InvalidInput, SoftreachError

DOCUMENT = "zarr.json"
"""The file that describes an array, or a store."""
AS_WRITTEN = "as softreach wrote it"
MISPLACED = "of another store or place"


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
        self, location: object, chunk: Chunk, found: str, remedy: str, allowed: str = AS_WRITTEN
    ) -> None:
        self.location, self.array, self.chunk = str(location), *chunk
        place = "" if chunk.place is None else "/".join(map(str, chunk.place)) or "0"
        what = f"chunk {place} of array {chunk.array}" if place else f"array {chunk.array}"
        where = f"{what} in {location}" if chunk.array else f"{DOCUMENT} of {location}"
        super().__init__(where, found, allowed, remedy)


class Chunk(NamedTuple):
    """A file of a store: a chunk of an array, or what describes an array or the store."""

    array: str
    """Empty for the store itself."""
    place: tuple[int, ...] | None
    """None for what describes the array."""

    @classmethod
    def of_key(cls, key: str) -> Self | None:
        """The file with this key, from the root of the store on; None for any other."""
        if key == DOCUMENT or key.endswith(f"/{DOCUMENT}"):
            return cls(key.removesuffix(DOCUMENT).rstrip("/"), None)
        array, separator, numbers = key.rpartition("/c/")
        if key.endswith("/c"):  # the only chunk of a number
            array, separator, numbers = key[:-2], "/c", ""
        places = numbers.split("/") if numbers else []
        if not separator or not all(text.isascii() and text.isdigit() for text in places):
            return None
        return cls(array, tuple(map(int, places)))

    @property
    def key(self) -> str:
        """The key of a chunk."""
        return "/".join((self.array, "c", *map(str, self.place or ())))


@dataclass(kw_only=True, eq=False)
class Watch:
    """Checks of the files of a store that are read, and what becomes of damaged ones."""

    location: object
    remedy: str
    """Advice on what a person does about damage."""
    required: Callable[[Chunk], bool] = lambda _: False
    """True for chunks that must exist; others that are missing hold fill values."""
    digests: dict[str, str] = field(default_factory=dict)
    """Digest of what describes each array, as the root lists it or as it was written."""
    listed: bool = False
    """True if the digests are those of the root."""
    root: str = ""
    """Digest of the root that was read."""
    listed_checksums: dict[str, int] = field(default_factory=dict)
    """Checksum of each chunk of what is written only once, by its key."""
    belongs: Callable[[Chunk, int], bool] = lambda *_: True
    """True if a chunk with this checksum is of this store and place, where that is not listed."""
    written: dict[Chunk, int] = field(default_factory=dict)
    """Checksums of the chunks that were written."""
    _noted: dict[Chunk, str] | None = field(default=None, init=False)
    _late: list[DamagedStore] | None = field(default=None, init=False)

    def report(self, chunk: Chunk, found: str, allowed: str = AS_WRITTEN) -> None:
        """Note damage where that is asked for.

        Raises:
            DamagedStore: It is not.
        """
        error = DamagedStore(self.location, chunk, found, self.remedy, allowed)
        if self._noted is not None:
            self._noted[chunk] = str(error)
        elif self._late is not None:
            self._late.append(error)
        else:
            raise error

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
def raised_at_the_end(watch: Watch) -> Iterator[None]:
    """Read a block to its end before its first damage is raised.

    Zarr reads chunks at once: it would lose all errors but the first, and print them at the exit.
    """
    watch._late = late = []
    try:
        yield
    finally:
        watch._late = None
        if late:
            raise late[0]


@contextmanager
def writing(location: object) -> Iterator[None]:
    """Turn errors of the disk or the network into one line that says what to do."""
    failed = f"{location} cannot be written"
    then = "; what is done is safe, and the same command continues once that is fixed"
    with storage_errors(failed, then):
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
