"""Branch and bound: cells of the activation box, halved until a bound on each says enough.

On a cell with center c and half widths h the tip lies within an error of its linearization at c,
`TipMap.linearization_errors`. What that says of a cell is for the caller to bound.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.cell_cover import near_cells
from softreach.rod.tip_map import TipMap

__all__ = ["MOST_BUNDLES", "Cells", "CoarseCells", "Linearized", "least_of_cells", "linearized"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MOST_BUNDLES = 6  # with more, halving cells proves nothing that can be afforded
_COARSE = 70_000  # cells that all targets share
_ROUNDING = 1e-12  # of tips, in L
_BLOCK = 16_384  # cells at once


class Cells(NamedTuple):
    """Cells of equal shape, each of interest for one target."""

    owner: Index
    """Number of the target, ascending, shape (n,)."""
    center: Array
    """Activation [-], shape (n, m)."""

    def where(self, chosen: NDArray[np.bool_] | slice) -> Cells:
        """Some of them."""
        return Cells(self.owner[chosen], self.center[chosen])


class Linearized(NamedTuple):
    """The tip map in cells."""

    half: Array
    """Half widths of all cells [-], shape (m,)."""
    tips: Array
    """At the centers [m], shape (n, 3)."""
    slopes: Array
    """∂r/∂γ there [m], shape (n, 3, m)."""
    errors: Array
    """How far a tip may lie from its linearization [m], shape (n,)."""


Bound = Callable[[Cells, Linearized], Array]
"""A lower bound of what a cell holds for its target, shape (n,)."""


class CoarseCells:
    """The box in even cells with what all targets ask of them."""

    def __init__(self, rod: TipMap) -> None:
        box, m = rod.box, rod.box.dimension
        side = max(1, int(_COARSE ** (1 / max(m, 1)) + 1e-9))
        places = np.indices((side,) * m).reshape(m, side**m).T
        cube = (places + 0.5) / side
        self.center, self.half = box.from_cube(cube), 0.5 * box.widths / side
        self.tips, slopes = rod.tips_and_slopes(self.center)
        self.errors = _errors(rod, self.center, self.half)
        self.slopes = slopes * self.half
        self.radii = np.linalg.norm(self.slopes, axis=1).sum(axis=1)

    def near(self, target: Array, distance: float) -> Index:
        """Numbers of the cells whose tips may come so near to a target."""
        room = np.empty(len(self.center), np.int64)
        count = near_cells(self.tips, self.slopes, self.radii, self.errors, target, distance, room)
        return room[:count]


def least_of_cells(
    rod: TipMap, half: Array, cells: Cells, enough: Array, bound: Bound, most: int
) -> Array:
    """A lower bound for each target over all of its cells.

    Args:
        rod: The tip map.
        half: Half widths of the cells [-], shape (m,).
        cells: Where to begin.
        enough: Bounds at which a cell is done and which the result does not exceed, shape (t,).
        bound: What is bounded.
        most: Cells that one target is worth.

    Returns:
        Shape (t,): `enough` where all cells reach it, else the least bound of those left.
    """
    least, count = enough.copy(), len(enough)
    spent = np.zeros(count, np.int64)
    while len(cells.owner):
        owner = cells.owner
        found = np.concatenate(
            [
                bound(part, linearized(rod, half, part.center))
                for first in range(0, len(owner), _BLOCK)
                for part in (cells.where(slice(first, first + _BLOCK)),)
            ]
        )
        spent += np.bincount(owner, minlength=count)
        open_cells = found < enough[owner]
        left = np.bincount(owner[open_cells], minlength=count)
        hopeless = open_cells & (spent + 2 * left > most)[owner]
        np.minimum.at(least, owner[hopeless], found[hopeless])
        half, cells = _halved(rod, half, cells.where(open_cells & ~hopeless))
    return least


def linearized(rod: TipMap, half: Array, center: Array) -> Linearized:
    """The tip map in cells of equal shape; on the calling thread."""
    tips, slopes = np.empty((len(center), 3)), np.empty((len(center), 3, center.shape[1]))
    rod.fill_slopes(center, tips, slopes)
    return Linearized(half, tips, slopes, _errors(rod, center, half))


def _errors(rod: TipMap, center: Array, half: Array) -> Array:
    return rod.linearization_errors(center, half) + _ROUNDING * rod.length


def _halved(rod: TipMap, half: Array, cells: Cells) -> tuple[Array, Cells]:
    """Both halves of every cell, along the axis that leaves least error."""
    thinner = np.where(np.eye(len(half), dtype=bool), 0.5 * half, half)
    axis = int(np.argmin([rod.linearization_error(widths) for widths in thinner]))
    half = thinner[axis]
    center = np.repeat(cells.center, 2, axis=0)
    center[0::2, axis] -= half[axis]
    center[1::2, axis] += half[axis]
    return half, Cells(np.repeat(cells.owner, 2), center)
