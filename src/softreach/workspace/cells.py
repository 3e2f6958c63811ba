"""What more than three free bundles reach: cell centers, and a surface of tips around them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.rod.tip_map import TipMap
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask
from softreach.support.lazy import lazy
from softreach.workspace.convex import ConvexHull
from softreach.workspace.crossings import Crossings, swept_crossings
from softreach.workspace.image import Lattice, covered_cubes
from softreach.workspace.measure import Estimate, line_volume
from softreach.workspace.search import ENOUGH, Flood, nearest_tips
from softreach.workspace.wrap import Wrap

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_STARTS = 6  # tips nearby from which places are searched
_MORE_STARTS, _NEAR = 24, 0.1  # of places that are nearer than this, in cells, to a tip
_ON = 1e-2  # cells from a tip, where a place counts as reached
_THICK = 3.0  # cells, on average
_CORNERS = np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
_CHUNK = 1 << 16


@dataclass(frozen=True, eq=False)
class ReachedCells:
    """Counterpart of `Image` for more than three free bundles: asked by search."""

    flood: Flood
    cloud: tuple[Array, Array]
    """Activations on faces of the box, and their tips [m]."""
    wrap: Wrap
    coarse: Wrap
    """The same on cells one and a half times as large."""
    hull: ConvexHull | None = None

    @property
    def tip_map(self) -> TipMap:
        """The tip map."""
        return self.flood.tip_map

    @property
    def lattice(self) -> Lattice:
        """The cells."""
        return self.flood.lattice

    @property
    def reached(self) -> Mask:
        """True for cells whose centers are reached."""
        return self.flood.reached

    @property
    def is_thick(self) -> bool:
        """True if lines of sight see enough of the set between its sides."""
        return 2.0 * self.wrap.tight_volume > _THICK * self.lattice.cell * self.wrap.area

    @lazy
    def swept(self) -> tuple[Crossings, float]:
        """Places where edges between centers are cut, and what they may miss [m³]."""
        return swept_crossings(self.flood)

    @lazy
    def volume(self) -> Estimate:
        """By the wrap; by lines of sight if these tell the volume better, and agree [m³]."""
        tight, edge = self.wrap.volume_of_tips, self.lattice.cell
        change = abs(tight.value - self.coarse.volume_of_tips.value)
        volume = Estimate(tight.value, change + tight.error)
        if self.is_thick:
            lines, missed = self.swept
            area = len(lines.cell) * edge**2 / 1.5  # a plane cuts 1.5 edges to a square of a cell
            seen = line_volume(lines)
            error = (
                seen.error
                + missed
                + area * (ENOUGH * edge + self.tip_map.tol * self.tip_map.length)
            )
            if error < volume.error and abs(seen.value - volume.value) <= error + volume.error:
                volume = Estimate(seen.value, error)
        return volume

    @property
    def counts(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """1 at centers that are reached and 0 elsewhere; no orientation, 0."""
        return self.reached.astype(np.int32), np.zeros(self.reached.shape, np.int32)

    def are_deep(self, points: Array) -> Mask:
        """Mask of points [m] with all centers of the cells around reached, beyond neighbors."""
        from scipy.ndimage import binary_erosion

        cubes = covered_cubes(np.asarray(binary_erosion(self.reached), bool))
        index = np.floor(self.lattice.coordinates(points)).astype(np.int64)
        within = ((index >= 0) & (index < cubes.shape)).all(axis=1)
        return within & cubes[tuple(np.where(within, i, 0) for i in index.T)]

    def counts_at(self, points: Array) -> Index:
        """1 for points that are reached [m], 0 for others, shape (n,)."""
        return (self.distance(points) <= _ON * self.lattice.cell).astype(np.int64)

    def distance(self, points: Array) -> Array:
        """Distance from points to the nearest tip that searches find [m], shape (n,)."""
        out = np.full(len(points), np.inf)
        for block in parallel.blocks(len(points), _CHUNK):
            self._search(points[block], out[block])
        return out

    def _search(self, points: Array, out: Array) -> None:
        """Lower distances by what searches find, until they are 0 or there is no other start."""
        enough = _ON * self.lattice.cell

        def search(left: Index, start: Array) -> None:
            nearest = nearest_tips(self.tip_map, start, points[left], enough)
            out[left] = np.minimum(out[left], nearest.distance)

        for known, start in self._starts_inside(points):
            left = np.flatnonzero((out > enough) & known)
            search(left, start[left])
        gamma = np.concatenate([self.wrap.gamma, self.cloud[0]])
        for count, within in ((_STARTS, np.inf), (_MORE_STARTS, _NEAR * self.lattice.cell)):
            left = np.flatnonzero((out > enough) & (out <= within))
            near = np.minimum(self._tree.query(points[left], k=count)[1], len(gamma) - 1)
            for k in range(count):
                rest = np.flatnonzero(out[left] > enough)
                search(left[rest], gamma[near[rest, k]])

    def _starts_inside(self, points: Array) -> Iterator[tuple[Mask, Array]]:
        """Masks of points with a reached center at a corner of their cube, and where to start."""
        at = self.lattice.coordinates(points)
        for corner in (np.rint(at), *(np.floor(at) + corner for corner in _CORNERS)):
            index = corner.astype(np.int64)
            within = ((index >= 0) & (index < self.lattice.shape)).all(axis=1)
            cells = np.ravel_multi_index(
                tuple(np.where(within, i, 0) for i in index.T), self.lattice.shape
            )
            yield within & (self.flood.gap[cells] == 0.0), self.flood.gamma[cells]

    @lazy
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        return KDTree(np.concatenate([self.wrap.vertices, self.cloud[1]]))
