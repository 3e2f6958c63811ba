"""A solid as cells that are reached, and where its boundary cuts the edges between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.rod.tip_map import TipMap
from softreach.workspace.crossings import Crossings
from softreach.workspace.flood import ENOUGH
from softreach.workspace.image import Lattice
from softreach.workspace.projection import nearest_tips

if TYPE_CHECKING:
    from scipy.spatial import KDTree

__all__ = ["ReachedCells"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_STARTS = 4  # crossings nearby from which places are searched
_CORNERS = np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
_CHUNK = 1 << 16


@dataclass(frozen=True, eq=False)
class ReachedCells:
    """What `Image` is for three free bundles, for more of them: asked by search."""

    rod: TipMap
    lattice: Lattice
    reached: NDArray[np.bool_]
    """Whether the centers of the cells are reached."""
    gamma: Array
    """Activations that reach them, meaningless elsewhere, shape (cells, bundles)."""
    crossings: Crossings

    @property
    def counts(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """1 at centers that are reached and 0 elsewhere; no orientation, 0."""
        return self.reached.astype(np.int32), np.zeros(self.reached.shape, np.int32)

    def counts_at(self, points: Array) -> NDArray[np.int64]:
        """1 for points that are reached [m], 0 for others, shape (n,)."""
        return (self.distance(points) <= ENOUGH * self.lattice.cell).astype(np.int64)

    def distance(self, points: Array) -> Array:
        """Distance from points to the nearest tip that searches find [m], shape (n,)."""
        out = np.full(len(points), np.inf)
        if not len(self.crossings.edges.cell):
            return out
        for block in parallel.blocks(len(points), _CHUNK):
            self._search(points[block], out[block])
        return out

    def _search(self, points: Array, out: Array) -> None:
        """Lower distances by what searches find, until they are 0 or there is no other start."""
        enough = ENOUGH * self.lattice.cell
        near = self._tree.query(points, k=_STARTS)[1]
        near = np.minimum(near, len(self.crossings.edges.cell) - 1)  # where there are fewer
        starts = [self.crossings.beyond[near[:, k]] for k in range(_STARTS)]
        for known, start in [*self._starts_inside(points), *((None, start) for start in starts)]:
            left = np.flatnonzero((out > enough) & (True if known is None else known))
            found = nearest_tips(self.rod, start[left], points[left], enough)
            out[left] = np.minimum(out[left], found.distance)

    def _starts_inside(self, points: Array) -> Iterator[tuple[NDArray[np.bool_], Array]]:
        """Which points have a reached center at a corner of their cube, and where to start."""
        at = self.lattice.coordinates(points)
        for corner in (np.rint(at), *(np.floor(at) + corner for corner in _CORNERS)):
            index = corner.astype(np.int64)
            within = ((index >= 0) & (index < self.lattice.shape)).all(axis=1)
            cells = np.ravel_multi_index(
                tuple(np.where(within, i, 0) for i in index.T), self.reached.shape
            )
            yield within & self.reached.ravel()[cells], self.gamma[cells]

    def boundary_crossings(self, axis: int) -> tuple[tuple[Ints, Ints, Ints], Array]:
        """Where the boundary cuts the edges between cell centers along an axis.

        Returns:
            The centers just before the boundary, as an index of arrays of the lattice's shape, and
            how far behind them it lies, in cells, 0 to 1, shape (n,).
        """
        edges = self.crossings.edges
        which = np.flatnonzero(edges.axis == axis)
        place, up = self.crossings.place[which], edges.sense[which] > 0
        index = [np.array(i) for i in np.unravel_index(edges.cell[which], self.lattice.shape)]
        index[axis] = np.where(up, index[axis], index[axis] - 1)
        return (index[0], index[1], index[2]), np.where(up, place, 1.0 - place)

    @cached_property
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        every = np.arange(len(self.crossings.edges.cell))
        return KDTree(self.crossings.points(every, self.crossings.place))
