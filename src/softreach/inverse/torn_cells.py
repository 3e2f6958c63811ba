"""Searches for roots near the edge of what has an equilibrium, where cells have no image.

A cell of which some corner has no tip, or is on another branch than the rest, cannot be mapped. Its
corners begin searches for the targets that their linearization sees within about a cell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["TornCells"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_REACH = 1.5  # widths of a cell within which a root is looked for
_MOST = 16  # searches for one target
_AT_ONCE = 1 << 20  # pairs of a target and a vertex


class TornCells(NamedTuple):
    """Vertices of cells without an image, those that have a tip."""

    gamma: Array
    """Activations [-], shape (n, 3)."""
    tip: Array
    """Their tips [m], shape (n, 3)."""
    inverse: Array
    """Inverses of ∂r/∂γ there, in widths of a cell [1/m], shape (n, 3, 3)."""

    @classmethod
    def at(cls, gamma: Array, tip: Array, slope: Array, widths: Array) -> TornCells:
        """Vertices (n, 3) with ∂r/∂γ [m], of cells of these widths, shape (3,)."""
        inverse = np.empty_like(slope)
        if len(slope):
            inverse[:] = np.linalg.pinv(slope * widths)
        return cls(gamma, tip, inverse)

    def starts(self, targets: Array) -> tuple[Index, Array]:
        """Number of the target and activation of each start, sorted by target."""
        owners, starts = [np.empty(0, np.int64)], [np.empty((0, 3))]
        size = max(1, _AT_ONCE // max(len(self.tip), 1))
        for first in range(0, len(targets) if len(self.tip) else 0, size):
            owner, vertex = self._nearest(targets[first : first + size])
            owners.append(owner + first)
            starts.append(self.gamma[vertex])
        return np.concatenate(owners), np.concatenate(starts)

    def _nearest(self, targets: Array) -> tuple[Index, Index]:
        """Pairs of a target and a vertex that sees it near, the nearest few of each target."""
        away = targets[:, None] - self.tip
        step = np.abs(np.einsum("nij,tnj->tni", self.inverse, away)).max(axis=2)
        count = min(_MOST, step.shape[1])
        vertex = np.argpartition(step, count - 1, axis=1)[:, :count]
        near = np.take_along_axis(step, vertex, axis=1) <= _REACH
        return np.nonzero(near)[0], vertex[near]
