"""What keeps the force of a held tip from growing."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["Stop"]


class Stop(IntEnum):
    """Why a force grows no further."""

    BOUND = 0
    """Bundles are at their bounds."""
    SINGULAR = 1
    """No change of activations lets it grow: the arm has a singular shape."""
    UNSTABLE = 2
    """The arm would lose its stability."""
    NO_START = 3
    """No stable activation that was found puts the tip at the place."""
    UNFINISHED = 4
    """The search took too many steps; the force is reached, and may grow further."""
