"""What an atlas takes of memory and disk, told before it is begun."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from softreach.memory import check_disk, check_memory

if TYPE_CHECKING:
    from zarr.storage import StoreLike

    from softreach.atlas.command import Command

__all__ = ["check_demand"]

_STORED = 6.2  # bytes of a tip in a store
_HELD = 700  # bytes of memory of a sample and its share of the triangulation


def check_demand(command: Command, designs: int, store: StoreLike) -> None:
    """Refuse an atlas that cannot fit, and announce one that takes much.

    Args:
        command: What is asked for.
        designs: How many of its designs are to be computed here.
        store: Where it goes; of one that exists, nobody knows how much is done.

    Raises:
        InvalidInput: One design does not fit into memory, or all do not fit on the disk.

    Warns:
        SoftreachWarning: It takes more than half of what is free.
    """
    check_memory("n", command.n, _HELD * command.n)
    local = isinstance(store, str | os.PathLike) and "://" not in str(store)
    if local and command.keep_clouds and not Path(str(store)).exists():
        tips = f"{command.n} samples of {designs} designs"
        check_disk("n", tips, _STORED * command.n * designs, str(store))
