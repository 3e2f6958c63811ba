"""What an atlas holds of its designs, and which of them are damaged."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softreach.atlas.store import DAMAGED, FAILED, GAP, KNOWN, PER_DESIGN, UNSTABLE, AtlasStore
from softreach.errors import counted
from softreach.stores.damage import Chunk

__all__ = ["TOLD", "Contents", "contents"]

TOLD = (FAILED, GAP, UNSTABLE)
"""The status of designs that have a message."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Contents:
    """What is stored of all designs but their tips, each of them checked."""

    status: NDArray[np.uint8]
    """DAMAGED for designs of which a chunk is, shape (designs,)."""
    messages: dict[int, str]
    """Why designs failed, cannot exist, are nowhere stable or are damaged: number -> message."""
    tables: dict[str, Any]
    """What is stored as `metrics` and `curvature`; fill values where it is damaged."""

    @property
    def damage(self) -> str:
        """How many designs are damaged, and the first of them; empty if none is."""
        damaged = np.flatnonzero(self.status == DAMAGED).tolist()
        if not damaged:
            return ""
        verb = "is" if len(damaged) == 1 else "are"
        first = damaged[0]
        return (
            f"{counted(len(damaged), 'design')} {verb} damaged, "
            f"first number {first}: {self.messages[first]}"
        )


def contents(store: AtlasStore, *, metrics: bool = True, tips_of: Iterable[int] = ()) -> Contents:
    """Read and check what an atlas holds of its designs.

    Args:
        store: The atlas; from now on it misses the chunks that its designs must have.
        metrics: Whether to read the metrics; without, only the status and messages are checked.
        tips_of: Numbers of designs whose tips are checked too; these are read but not kept.

    Raises:
        DamagedStore: What describes an array is damaged, so that no design can be read.
    """
    reader = _Reader(store)
    status = reader.read("status").ravel()
    store.watch.required = _required(store, status)
    names = ("metrics", "curvature") if store.command.profiles else ("metrics",)
    tables = {name: reader.table(name, status) for name in names if metrics}
    for index in tips_of if store.command.keep_clouds else ():
        if status[index] in KNOWN:
            reader.read("tip", store.command.space.place(index))
    texts = {
        index: str(reader.read("message", store.command.space.place(index)).item())
        for index in np.flatnonzero(np.isin(status, TOLD)).tolist()
    }
    status[[*reader.damaged]] = DAMAGED
    messages = dict(sorted((texts | reader.damaged).items()))
    return Contents(status=status, messages=messages, tables=tables)


class _Reader:
    """Reads arrays of an atlas, and notes which designs are damaged."""

    def __init__(self, store: AtlasStore) -> None:
        self._store = store
        self.damaged: dict[int, str] = {}
        """What is damaged of each: number -> message."""

    def read(self, name: str, place: Any = ...) -> NDArray[Any]:
        """Values of an array; fill values where it is damaged."""
        array = self._store.array(name)
        with self._store.watch.noting() as noted:
            values = np.array(array[place])
        for chunk, line in noted.items():
            self.damaged.setdefault(self._store.number(chunk), line)
        return values

    def table(self, name: str, status: NDArray[np.uint8]) -> NDArray[np.float64]:
        """All metrics of an array; nothing is read where there are none yet."""
        if np.isin(status, KNOWN).any():
            return self.read(name)
        return np.full(self._store.array(name).shape, np.nan)


def _required(store: AtlasStore, status: NDArray[np.uint8]) -> Callable[[Chunk], bool]:
    """Which chunks must be there, by the status of their designs."""
    known, told = np.isin(status, KNOWN), np.isin(status, TOLD)

    def required(chunk: Chunk) -> bool:
        if chunk.array not in PER_DESIGN:
            return True
        if chunk.array == "status":
            return False
        return bool((told if chunk.array == "message" else known)[store.number(chunk)])

    return required
