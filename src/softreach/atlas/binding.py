"""Binding of the chunks of a design: to it, to each other and to their store, by one more chunk.

A chunk is whole by its own checksum, wherever it is. The last but one that is written of a design
holds, for each of the others, a checksum of that one, of its place and of the digest of the root.
So no list is shared by those who write designs, and a chunk of another design or store is noticed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.atlas.layout import CHECKSUM, FILES
from softreach.support.files.damage import MISPLACED, Chunk
from softreach.support.files.stores import bound_checksum

if TYPE_CHECKING:
    from softreach.atlas.store import AtlasStore


def binding_of(store: AtlasStore, place: tuple[int, ...], status: int) -> NDArray[np.uint32]:
    """Checksums that bind the chunks of a design written since; 0 for those that were not."""

    def bound(name: str, inner: int) -> int:
        chunk = Chunk(name, (*place, *(0,) * inner))
        # The status is not written yet, and small.
        checksum = status if name == "status" else store.watch.written.pop(chunk, None)
        return 0 if checksum is None else bound_checksum(store.watch, chunk, checksum)

    return np.array([bound(*file) for file in FILES.items()], np.uint32)


def bind(store: AtlasStore, status: NDArray[np.uint8], known: NDArray[np.bool_]) -> dict[int, str]:
    """Check the status of designs, and from now on every chunk of them that is read.

    Args:
        store: The atlas.
        status: Status of each design, 0 for those that are not done.
        known: Which of them have metrics.

    Returns:
        Number of each design whose status or binding is damaged -> message.
    """
    if not status.any():
        return {}
    with store.watch.noting() as noted:
        bound = np.asarray(store.array(CHECKSUM)[...]).reshape(status.size, len(FILES))
    damaged = {store.number(chunk): line for chunk, line in noted.items()}

    def belongs(chunk: Chunk, checksum: int) -> bool:
        if chunk.array not in FILES or chunk.array == "status":
            return True
        number = store.number(chunk)
        if chunk.array != "message" and not known[number]:
            return True
        expected = bound[number, [*FILES].index(chunk.array)]
        return bool(expected == bound_checksum(store.watch, chunk, checksum))

    store.watch.belongs = belongs
    with store.watch.noting() as noted:
        ended = np.flatnonzero(status)
        places = np.argwhere(status.reshape(store.command.space.shape))
        of_each = zip(
            places.tolist(), status[ended].tolist(), bound[ended, 0].tolist(), strict=True
        )
        for place, value, expected in of_each:
            chunk = Chunk("status", tuple(place))
            if expected != bound_checksum(store.watch, chunk, value):
                store.watch.report(chunk, MISPLACED)
    return {store.number(chunk): line for chunk, line in noted.items()} | damaged
