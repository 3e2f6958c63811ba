"""What is wrong with a store: where, and what to do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple, Self

from softreach.errors import InvalidInput, SoftreachError
from softreach.interruption import as_a_whole

__all__ = ["Chunk", "DamagedStore", "StoreFailed", "Watch", "storage_errors", "writing"]


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
