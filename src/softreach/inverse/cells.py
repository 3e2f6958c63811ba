"""The activation box of three bundles in cells, finer where the tip map folds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.inverse.torn_cells import TornCells
from softreach.kernels.activation_mesh import ActivationMesh, interpolation_errors
from softreach.kernels.simplices import corner_bits
from softreach.rod.tip_map import TipMap

__all__ = ["activation_cells"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_CORNERS = corner_bits(3)
_EVEN = 0.3  # ratio of det J at a cell's corners below which the cell is cut in eight
_TORN = 0.05  # interpolation error in L beyond which corners are taken to be on different branches
_MOST_CELLS = 300_000


def activation_cells(rod: TipMap, cells: int, depth: int = 0) -> tuple[ActivationMesh, TornCells]:
    """Cells of the activation box with tips and Jacobians at their corners; those without apart.

    Args:
        rod: A tip map of three bundles, each free to move.
        cells: Cells along each axis of the box.
        depth: How often a cell may be halved where det J is uneven or changes sign.
    """
    lattice = _Lattice(rod, cells << depth)
    low, width = _even_cells(cells, depth)
    kept: list[Index] = []
    total = len(low)
    for level in range(depth + 1):
        corner = lattice.vertices(low[:, None] + width * _CORNERS)
        uneven = _uneven(lattice.det[corner]) if level < depth else np.zeros(len(low), bool)
        if total + 7 * int(uneven.sum()) > _MOST_CELLS:
            uneven[:] = False
        kept.append(corner[~uneven])
        total += 7 * int(uneven.sum())
        width //= 2
        low = (low[uneven, None] + width * _CORNERS).reshape(-1, 3)
    corner = np.concatenate(kept)
    mesh, torn = _mesh(lattice, corner), np.zeros(len(corner), bool)
    if rod.supports_unstable:
        torn = ~np.isfinite(lattice.det[corner]).all(axis=1)
        torn |= mesh.interpolation_error > _TORN * rod.length
    if torn.any():
        mesh = _mesh(lattice, corner[~torn])
    return mesh, _torn(lattice, corner[torn], cells)


def _even_cells(cells: int, depth: int) -> tuple[Index, int]:
    """First corners of the coarsest cells, in steps of the finest lattice, and their width."""
    axis = np.arange(cells) << depth
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3), 1 << depth


def _uneven(det: Array) -> NDArray[np.bool_]:
    """Cells in which det J changes sign or nearly so: there the map folds or is about to."""
    small, large = np.abs(det).min(axis=1), np.abs(det).max(axis=1)
    return (det.min(axis=1) * det.max(axis=1) <= 0) | (small < _EVEN * large)


class _Lattice:
    """Vertices asked for so far, each computed once, found by their place on the finest lattice."""

    def __init__(self, rod: TipMap, cells: int) -> None:
        self.rod, self.side = rod, cells + 1
        self.key = np.empty(0, np.int64)
        self.gamma, self.tip = np.empty((0, 3)), np.empty((0, 3))
        self.slope, self.det = np.empty((0, 3, 3)), np.empty(0)

    def vertices(self, place: Index) -> Index:
        """Numbers of the vertices at lattice places (..., 3), computing those that are new."""
        key = (place[..., 0] * self.side + place[..., 1]) * self.side + place[..., 2]
        unique, inverse = np.unique(key, return_inverse=True)
        known = np.isin(unique, self.key, assume_unique=True)
        self._compute(unique[~known])
        order = np.argsort(self.key)
        number = order[np.searchsorted(self.key, unique, sorter=order)]
        return number[inverse].reshape(key.shape)

    def _compute(self, key: Index) -> None:
        place = np.stack(np.unravel_index(key, (self.side,) * 3), -1)
        gamma = self.rod.box.from_cube(place / (self.side - 1))
        tip, slope = self.rod.tips_and_slopes(gamma)
        self.key = np.concatenate([self.key, key])
        self.gamma = np.concatenate([self.gamma, gamma])
        self.tip = np.concatenate([self.tip, tip])
        self.slope = np.concatenate([self.slope, slope])
        with np.errstate(invalid="ignore"):  # where there is no equilibrium
            self.det = np.concatenate([self.det, np.linalg.det(slope)])


def _torn(lattice: _Lattice, corner: Index, cells: int) -> TornCells:
    """The corners that have a tip, of cells of which some have none or are on another branch."""
    vertex = np.unique(corner)
    vertex = vertex[np.isfinite(lattice.det[vertex])]
    widths = lattice.rod.box.widths / cells
    return TornCells.at(lattice.gamma[vertex], lattice.tip[vertex], lattice.slope[vertex], widths)


def _mesh(lattice: _Lattice, corner: Index) -> ActivationMesh:
    error, remainder = np.empty(len(corner)), np.empty(len(corner))
    interpolation_errors(lattice.gamma, lattice.tip, lattice.slope, corner, error, remainder)
    error += 1e-9 * lattice.rod.length  # rounding must not put a target between two tetrahedra
    change = np.sqrt(((lattice.slope[corner[:, 7]] - lattice.slope[corner[:, 0]]) ** 2).sum((1, 2)))
    for bit in (1, 2, 4):
        step = lattice.slope[corner[:, bit]] - lattice.slope[corner[:, 0]]
        change += np.sqrt((step**2).sum((1, 2)))
    vertices = lattice.gamma, lattice.tip, lattice.slope
    return ActivationMesh(*vertices, corner, error, remainder, change)
