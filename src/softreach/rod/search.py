"""How boldly an equilibrium is searched, and what says how it was found."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

__all__ = [
    "CONTINUATION",
    "DIRECT",
    "HELD",
    "NEAR",
    "PATIENT",
    "Rung",
    "Search",
]


class Rung(IntEnum):
    """How an equilibrium was found."""

    DIRECT = 0
    """Newton's method, all load at once."""
    CONTINUATION = 1
    """The load grown in steps along the branch."""
    PATIENT = 2
    """The same in steps an order smaller."""
    NONE = 3
    """Not found: the branch ends before all of the load is on."""


class Search(NamedTuple):
    """How boldly the kernels search."""

    increment: float
    """First share of the load to try."""
    widest: float
    """Longest first Newton step that is trusted [rad]."""
    walks: int
    """Walks allowed."""


# An arm that jumps to another branch on its way lands on an unstable one (design/loaded_rod.md);
# so whatever is not found stable is searched again, more patiently. Where an arm almost buckles to
# either side, only the last search follows it to the side to which it leans.
DIRECT = Search(1.0, 1.2, 7)
CONTINUATION = Search(0.25, 0.1, 400)
PATIENT = Search(1 / 64, 0.03, 2000)
# From a known equilibrium: only the rotation about gravity may be far off.
NEAR = Search(1.0, 4.0, 12)
# One walk from where it is.
HELD = Search(1.0, 4.0, 0)
