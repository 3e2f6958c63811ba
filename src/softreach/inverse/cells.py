"""The activation box of three bundles in cells, and an octree over their images."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.branches.candidates import SpaceTree, sort_into_children
from softreach.kernels.image.activation_mesh import (
    ActivationMesh,
    face_planes,
    interpolation_errors,
)
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index, rows
from softreach.workspace.grid import cell_corners, cube_grid

_REACH = 1.5  # widths of a cell within which a root is looked for
_MOST, _MOST_OF_SHEET = 16, 4  # searches for one target
_AT_ONCE = 1 << 20  # pairs of a target and a vertex
_TORN = 0.05  # interpolation error in L beyond which corners are taken to be on different branches
_LEAF = 24  # a node with no more tetrahedra is not divided
_MOST_LEVELS = 10
_MOST_ITEMS = 8_000_000
Items = NDArray[np.int32]
_OCTANTS = np.array([[o >> 2 & 1, o >> 1 & 1, o & 1] for o in range(8)])


def activation_cells(tip_map: TipMap, cells: int) -> tuple[ActivationMesh, TornCells]:
    """Cells of the box of three free bundles, as many along each axis; those without tips apart."""
    gamma = tip_map.box.from_cube(cube_grid(cells))
    vertices, corner = _Vertices(gamma, *tip_map.tips_and_slopes(gamma)), cell_corners(cells, 3)
    mesh = _mesh(tip_map, vertices, corner)
    torn = np.zeros(len(corner), bool)
    if tip_map.supports_unstable:
        torn = np.isnan(vertices.tip[corner, 0]).any(axis=1)
        torn |= mesh.interpolation_error > _TORN * tip_map.length
    if torn.any():
        mesh = _mesh(tip_map, vertices, corner[~torn])
    vertex = np.unique(corner[torn])
    known = rows(vertices, vertex[np.isfinite(vertices.tip[vertex, 0])])
    return mesh, TornCells.at(known, tip_map.box.widths / cells)


class _Vertices(NamedTuple):
    gamma: Array
    tip: Array
    slope: Array


def image_tree(mesh: ActivationMesh) -> SpaceTree:
    """Divide space, one depth after the other, until few tetrahedra remain in each place."""
    planes, boxes = np.empty((6 * len(mesh.corner), 4, 4)), _image_boxes(mesh)
    face_planes(mesh, _rounding(mesh), planes)
    low, size = _root(boxes)
    corner, edge, nodes, listed = low[None], size, 1, 0
    first, count = np.zeros(1, np.int64), np.array([len(planes)])
    item, parts = np.arange(len(planes), dtype=np.int32), list[tuple[Index, Index, Index, Items]]()
    for depth in range(_MOST_LEVELS + 1):
        # The fullest nodes, as many as leave room for the lists, which are four times as long.
        counts = np.sort(count)[::-1]
        affordable = listed + 3 * np.cumsum(counts) + counts.sum() <= _MOST_ITEMS
        largest = 0 if affordable.all() else int(counts[np.argmin(affordable)])
        many = (count > max(_LEAF, largest)) & (depth < _MOST_LEVELS)
        child, kept = np.zeros(len(many), np.int64), np.where(many, 0, count)
        child[many] = nodes + 8 * np.arange(np.count_nonzero(many))
        nodes += 8 * np.count_nonzero(many)
        parts.append((child, listed + np.cumsum(kept) - kept, kept, item[np.repeat(~many, count)]))
        listed += int(kept.sum())
        if not many.any():
            break
        edge /= 2
        places = corner[many], edge, first[many], count[many], item
        first, count, item = _divided(planes, boxes, *places)
        corner = (corner[many][:, None] + edge * _OCTANTS).reshape(-1, 3)
    return SpaceTree(planes, boxes, low, size, *map(np.concatenate, zip(*parts, strict=True)))


def _divided(
    planes: Array, boxes: Array, corner: Array, edge: float, first: Index, count: Index, item: Items
) -> tuple[Index, Index, Items]:
    """Where lists of the eight children of each node begin, their lengths, and all lists."""
    counts, meets = np.zeros((len(first), 8), np.int64), np.empty(len(item), np.uint8)
    arguments = planes, boxes, corner, edge, first, count, item, meets
    sort_into_children(*arguments, counts, counts, np.empty(0, np.int32))
    starts = (np.cumsum(counts) - counts.ravel()).reshape(counts.shape)
    items = np.empty(int(counts.sum()) + 1, np.int32)
    sort_into_children(*arguments, np.empty_like(counts), starts, items)
    return starts.ravel(), counts.ravel(), items[:-1]


class ImageLeaves:
    """Trees that are not divided: for few targets, of no more than what may cover them."""

    def __init__(self, mesh: ActivationMesh) -> None:
        self._mesh, self._boxes, self._rounding = mesh, _image_boxes(mesh), _rounding(mesh)
        self._low, self._high = np.ascontiguousarray(np.moveaxis(self._boxes, 0, 2))
        self._root = _root(self._boxes)

    def around(self, targets: Array) -> SpaceTree:
        """The tetrahedra of cells in whose boxes some targets (t, 3) lie; planes of no others."""
        mesh, near = self._mesh, np.zeros(len(self._boxes), bool)
        for place in targets[:, :, None]:
            near |= ((self._low <= place) & (place <= self._high)).all(axis=0)
        cells = np.flatnonzero(near)
        of_cells = ActivationMesh(*mesh[:3], *(values[cells] for values in mesh[3:]))
        some, planes = np.empty((len(cells), 6, 4, 4)), np.empty((len(near), 6, 4, 4))
        face_planes(of_cells, self._rounding, some.reshape(-1, 4, 4))
        planes[cells] = some
        item = (6 * cells[:, None] + np.arange(6)).astype(np.int32).ravel()
        node, planes = np.zeros(1, np.int64), planes.reshape(-1, 4, 4)
        return SpaceTree(planes, self._boxes, *self._root, node, node, node + len(item), item)


class TornCells(NamedTuple):
    """Vertices with tips of cells without an image: a corner has no tip or is on another branch.

    They begin searches for the targets that their linearization sees within about a cell.
    """

    gamma: Array  # activations [-], (n, 3)
    tip: Array  # their tips [m], (n, 3)
    inverse: Array  # inverses of ∂r/∂γ there, in widths of a cell [1/m], (n, 3, 3)
    most: int = _MOST  # searches for one target

    @classmethod
    def at(cls, vertices: _Vertices, widths: Array) -> TornCells:
        """Vertices of cells of these widths, shape (3,)."""
        inverse = np.empty_like(vertices.slope)
        if len(inverse):
            inverse[:] = np.linalg.pinv(vertices.slope * widths)
        return cls(vertices.gamma, vertices.tip, inverse)

    @classmethod
    def of_sheet(cls, tip_map: TipMap, gamma: Array, widths: Array) -> TornCells:
        """Places (n, 3) on a sheet in cells of these widths; its steep edges are seen from afar."""
        vertices = _Vertices(gamma, *tip_map.tips_and_slopes(gamma))
        known = rows(vertices, np.isfinite(vertices.tip[:, 0]))
        return cls.at(known, 2.0 * widths)._replace(most=_MOST_OF_SHEET)

    def starts(self, targets: Array) -> tuple[Index, Array]:
        """Number of the target and activation of each start, sorted by target."""
        owners, starts = [np.empty(0, np.int64)], [np.empty((0, 3))]
        size = max(1, _AT_ONCE // max(len(self.tip), 1))
        for first in range(0, len(targets) if len(self.tip) else 0, size):
            away = targets[first : first + size, None] - self.tip
            step = np.abs(np.einsum("nij,tnj->tni", self.inverse, away)).max(axis=2)
            count = min(self.most, step.shape[1])
            vertex = np.argpartition(step, count - 1, axis=1)[:, :count]
            near = np.take_along_axis(step, vertex, axis=1) <= _REACH
            owners.append(np.nonzero(near)[0] + first)
            starts.append(self.gamma[vertex[near]])
        return np.concatenate(owners), np.concatenate(starts)


def _mesh(tip_map: TipMap, vertices: _Vertices, corner: Index) -> ActivationMesh:
    error, remainder = np.empty(len(corner)), np.empty(len(corner))
    interpolation_errors(*vertices, corner, error, remainder)
    error += 1e-9 * tip_map.length  # rounding must not put a target between two tetrahedra
    first, *others = (vertices.slope[corner[:, k]] for k in (0, 7, 1, 2, 4))
    change = np.sum([np.sqrt(((each - first) ** 2).sum((1, 2))) for each in others], axis=0)
    return ActivationMesh(*vertices, corner, error, remainder, change)


def _image_boxes(mesh: ActivationMesh) -> Array:
    images = mesh.tip[mesh.corner]
    error = mesh.interpolation_error[:, None]
    return np.stack([images.min(axis=1) - error, images.max(axis=1) + error], 1)


def _root(boxes: Array) -> tuple[Array, float]:
    """Lowest corner and edge of a cube round all boxes [m]."""
    low = boxes[:, 0].min(axis=0)
    return low, float((boxes[:, 1].max(axis=0) - low).max())


def _rounding(mesh: ActivationMesh) -> float:
    """Distance beyond its faces at which a tetrahedron may still cover a place [m]."""
    return 1e-9 * float(np.nanmax(mesh.tip) - np.nanmin(mesh.tip))
