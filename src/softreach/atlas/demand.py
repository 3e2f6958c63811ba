"""What an atlas takes of memory and disk, told before it is begun."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from softreach.memory import check_disk, check_memory

if TYPE_CHECKING:
    from zarr.storage import StoreLike

    from softreach.atlas.space import DesignSpace

__all__ = ["STORED", "check_demand"]

STORED = 6.2
"""What a tip takes in a store [bytes]."""

_ON_DISK = 4096  # bytes that the smallest file takes
_FILES = 4  # of a design without tips: status, message, metrics, curvature
_HELD = 700  # bytes of memory of a sample and its share of the triangulation


def check_demand(
    space: DesignSpace, designs: int, n: int, store: StoreLike, *, keep_clouds: bool
) -> None:
    """Refuse an atlas that cannot fit, and announce one that takes much; no design is made for it.

    Args:
        space: The designs.
        designs: How many of them are to be computed here.
        n: Samples of each design.
        store: Where it goes; of one that exists, nobody knows how much is done.
        keep_clouds: Whether the tips are stored.

    Raises:
        InvalidInput: One design does not fit into memory, or all do not fit on the disk.

    Warns:
        SoftreachWarning: It takes more than half of what is free.
    """
    check_memory("n", n, _HELD * n)
    local = isinstance(store, str | os.PathLike) and "://" not in str(store)
    if local and not Path(str(store)).exists():
        of_each = STORED * n * keep_clouds + _FILES * _ON_DISK
        asked = f"{n} samples of {designs} designs"
        check_disk("n", asked, of_each * designs + 8 * n * space.base.bundles, str(store))
