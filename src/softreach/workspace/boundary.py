"""The boundary of a solid reachable set as triangles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.surface import Surface, compact_surface
from softreach.rod.tip_map import TipMap
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask
from softreach.support.errors import MissingExtra
from softreach.support.lazy import lazy
from softreach.workspace.crossings import Crossings, Edges, boundary_edges
from softreach.workspace.image import Image, Lattice
from softreach.workspace.search import ENOUGH, nearest_tips

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_STARTS = 4  # crossings nearby from which places are searched
_CORNERS = np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
_CHUNK = 1 << 16
_BAND = 2.5  # cells from the boundary beyond which the field is constant
_CRUMB = 8  # cells: two along each edge
_CLOSEST = 1e-3  # cells: a center on the boundary itself would make triangles without area


def boundary_surface(image: Image | ReachedCells, field: Array, volume: float) -> Surface:
    """The closed surface around a volume where the field is constant, by marching cubes.

    The image of a grid is a little small where it is convex: a small offset, the same everywhere,
    gives the surface the extrapolated volume.

    Raises:
        MissingExtra: scikit-image is not installed.
    """
    surface = _level_set(image, field, 0.0)
    if surface.area == 0.0:
        return surface
    offset = (volume - surface.volume) / (surface.area * image.lattice.cell)
    return _level_set(image, field, float(np.clip(offset, -0.5, 0.5)))


def critical_surface(image: Image) -> Surface:
    """All critical triangles: the boundary of the image, and folds and walls inside it."""
    vertices, faces = compact_surface(image.vertices, image.triangles[:, :3])
    lattice = image.lattice
    placed = lattice.origin + vertices * (lattice.cell / image.unit)
    return Surface(vertices=placed, faces=faces)


def signed_field(image: Image | ReachedCells) -> Array:
    """Distance of the cell centers to the boundary in cells, negative inside, up to 2.5.

    Along each axis the boundary is located to rounding between two centers. A plane that cuts the
    axes at distances a, b, c is 1/√(1/a² + 1/b² + 1/c²) away: linear interpolation between centers
    gives the crossings back, to second order in the cell on a curved boundary.

    Returns:
        Of the lattice's shape.
    """
    inverse_square = np.zeros(image.lattice.shape)
    for axis in range(3):
        inverse_square += _axis_distances(image, axis) ** -2
    with np.errstate(divide="ignore"):
        distance = np.clip(inverse_square**-0.5, _CLOSEST, _BAND)
    inside = image.counts[0] > 0 if isinstance(image, Image) else image.resolved
    return np.where(inside, -distance, distance)


@dataclass(frozen=True, eq=False)
class ReachedCells:
    """Counterpart of `Image` for more than three free bundles: asked by search."""

    rod: TipMap
    lattice: Lattice
    reached: Mask
    """True for cells whose centers are reached."""
    gamma: Array
    """Activations that reach them, meaningless elsewhere, shape (cells, bundles)."""
    crossings: Crossings

    @property
    def counts(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """1 at centers that are reached and 0 elsewhere; no orientation, 0."""
        return self.reached.astype(np.int32), np.zeros(self.reached.shape, np.int32)

    @lazy
    def resolved(self) -> Mask:
        """Cells inside of a surface that can be drawn and printed.

        Thin rims are met by one center and missed by the next: without what is thinner along an
        axis than a cell, the teeth that they leave are gone, and so are crumbs: what touches at
        sides in a part of fewer than eight cells.
        """
        from scipy.ndimage import label

        edges = self.crossings.edges
        thickness, sides = np.zeros((3, self.reached.size)), np.zeros((3, self.reached.size))
        np.add.at(thickness, (edges.axis, edges.cell), self.crossings.place)
        np.add.at(sides, (edges.axis, edges.cell), 1.0)
        thin = ((sides == 2.0) & (thickness < 1.0)).any(axis=0).reshape(self.reached.shape)
        number = np.zeros(self.reached.shape, np.int32)
        label(self.reached & ~thin, output=number)
        return (np.bincount(number.ravel()) >= _CRUMB)[number] & (number > 0)

    def counts_at(self, points: Array) -> Index:
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
            nearest = nearest_tips(self.rod, start[left], points[left], enough)
            out[left] = np.minimum(out[left], nearest.distance)

    def _starts_inside(self, points: Array) -> Iterator[tuple[Mask, Array]]:
        """Masks of points with a reached center at a corner of their cube, and where to start."""
        at = self.lattice.coordinates(points)
        for corner in (np.rint(at), *(np.floor(at) + corner for corner in _CORNERS)):
            index = corner.astype(np.int64)
            within = ((index >= 0) & (index < self.lattice.shape)).all(axis=1)
            cells = np.ravel_multi_index(
                tuple(np.where(within, i, 0) for i in index.T), self.reached.shape
            )
            yield within & self.reached.ravel()[cells], self.gamma[cells]

    def boundary_crossings(self, axis: int) -> tuple[tuple[Index, Index, Index], Array]:
        """Places where the boundary of `resolved` cuts the edges between centers along an axis.

        Returns:
            The centers just before the boundary, as an index of arrays of the lattice's shape, and
            how far behind them it lies, in cells, 0 to 1, shape (n,).
        """
        edges, places = self._resolved_edges
        which = np.flatnonzero(edges.axis == axis)
        place, up = places[which], edges.sense[which] > 0
        index = [np.array(i) for i in np.unravel_index(edges.cell[which], self.lattice.shape)]
        index[axis] = np.where(up, index[axis], index[axis] - 1)
        return (index[0], index[1], index[2]), np.where(up, place, 1.0 - place)

    @lazy
    def _resolved_edges(self) -> tuple[Edges, Array]:
        """Edges around what is resolved, and where each is cut, in cells from the center inside.

        Beside a center that is reached but not resolved it is cut as far before that as the center
        is deep, so that a smooth surface which just touches a center has no dent there.
        """
        edges = boundary_edges(self.resolved)
        keys, known = (
            2 * (3 * some.cell + some.axis) + (some.sense > 0)
            for some in (edges, self.crossings.edges)
        )
        order = np.argsort(known)
        at = order[np.minimum(np.searchsorted(known, keys, sorter=order), len(known) - 1)]
        depth = np.full(self.reached.size, 0.5)
        np.minimum.at(depth, self.crossings.edges.cell, self.crossings.place)
        beside = edges.cell + edges.sense * np.array(self._steps)[edges.axis]
        return edges, np.where(known[at] == keys, self.crossings.place[at], 1.0 - depth[beside])

    @property
    def _steps(self) -> tuple[int, int, int]:
        """Of flat indices along the axes."""
        _, rows, columns = self.reached.shape
        return rows * columns, columns, 1

    @lazy
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        every = np.arange(len(self.crossings.edges.cell))
        return KDTree(self.crossings.points(every, self.crossings.place))


def _axis_distances(image: Image | ReachedCells, axis: int) -> Array:
    """Distance to the boundary along an axis, in cells; infinite beyond two of them."""
    distance = np.full(image.lattice.shape, np.inf)
    index, behind = image.boundary_crossings(axis)
    for step in (-1, 0, 1, 2):
        shifted = list(index)
        shifted[axis] = index[axis] + step
        away = np.abs(behind - step).clip(_CLOSEST)
        np.minimum.at(distance, tuple(shifted), away)
    return distance


def _level_set(image: Image | ReachedCells, field: Array, level: float) -> Surface:
    """Surface where the field, in cells, has a value."""
    try:
        from skimage.measure import marching_cubes
    except ImportError as error:
        raise MissingExtra(("scikit-image", "surface")) from error
    if not (field < level).any():
        return Surface(vertices=np.empty((0, 3)), faces=np.empty((0, 3), np.int32))
    vertices, faces, _, _ = marching_cubes(
        field, level, gradient_direction="descent", allow_degenerate=False
    )
    lattice = image.lattice
    return Surface(vertices=lattice.origin + lattice.cell * vertices.astype(float), faces=faces)
