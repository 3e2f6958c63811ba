"""The signed volume of the image of three bundles, from what flows through its six faces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.surface import Surface, corner_areas
from softreach.rod.rods import refined
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array
from softreach.workspace.grid import box_slopes, grid_ticks

_TOL = 1e-11  # in L: there are few nodes, so that steps may be short
_ROUGH_TOL = 1e-9  # where a raster decides the error, and under loads, where each tip costs much
_ROUGH_ENOUGH = 1e-4  # of the volume, under loads in triangles
_LOADED_TOL = 1e-8  # both, as always under loads: of many breakpoints all count at 1e-9
_NODES = (8, 12, 16, 24, 32)
_KINKED = (24, 48, 96)  # cells along each edge of the box, for maps with kinks
_KINKED_SHARE = 2.0  # of what is removed, as a kink beside a line of the grid hides the half
_CELLS = 96  # along each edge of the box: an arm that bends by half a turn moves 2 degrees a cell


def signed_volume(tip_map: TipMap, nodes: int | None = None, *, enough: float = 0.0) -> Flux:
    """The signed volume of the image of three free bundles; NaN without a stable equilibrium.

    By Gauss and Legendre's rule on the faces, with nodes added until tips are no more exact than
    the rule; of maps with kinks by mapped triangles. With a number of nodes along each side the
    rule is taken for this and two thirds of it alone, on less exact tips. `enough` is the relative
    change of the volume that ends the adding of nodes, with tips of free arms as those of the map.
    """
    if tip_map.supports_unstable:
        tip_map = refined(tip_map, _LOADED_TOL)
    elif not enough:
        tip_map = refined(tip_map, flux_tol(tip_map) if nodes is None else _ROUGH_TOL)
    if not tip_map.is_smooth:
        return _of_triangles(tip_map, enough)
    counts = _NODES if nodes is None else (2 * nodes // 3, nodes)
    flux, change = _flux(tip_map, counts[0]), np.inf
    for count in counts[1:]:
        rough, flux = flux, _flux(tip_map, count)
        change = abs(flux.value - rough.value)
        if nodes is None and not change > max(flux.error, enough * abs(flux.value)):  # NaN too
            break
    return flux._replace(error=change + flux.error)


class Flux(NamedTuple):
    """∫ det J dγ by the divergence theorem, theory (81), and what it was computed from."""

    value: float  # signed volume [m³]: below zero if the map turns the orientation over
    error: float  # estimated error: from half as many nodes or so, and the error of the tips [m³]
    cube: Array  # nodes on the faces of the unit cube of the free bundles, (n, 3)
    area: Array  # area vectors of the nodes, with their weights [m²], (n, 3)


def _of_triangles(tip_map: TipMap, enough: float) -> Flux:
    """By mapped triangles of two grids on the faces, together nodes of a flux without O(1/n²)."""
    enough = max(enough, _ROUGH_ENOUGH * tip_map.supports_unstable)
    coarse = fine = _triangle_nodes(tip_map, _KINKED[0])
    removed = np.inf
    for cells in _KINKED[1:]:
        coarse, fine = fine, _triangle_nodes(tip_map, cells)
        removed = (fine.value - coarse.value) / 3.0
        if not abs(removed) > enough * abs(fine.value):  # NaN too
            break
    return Flux(
        fine.value + removed,
        _KINKED_SHARE * abs(removed) + fine.error,
        np.concatenate([fine.cube, coarse.cube]),
        np.concatenate([4.0 / 3.0 * fine.area, -1.0 / 3.0 * coarse.area]),
    )


def _triangle_nodes(tip_map: TipMap, cells: int) -> Flux:
    """Vertices of a grid on the faces, with kinks along its lines, and the areas of each."""
    grid, ticks = grid_faces(cells), grid_ticks(tip_map, cells)
    columns = zip(ticks, np.rint(cells * grid).astype(int).T, strict=True)
    cube = np.stack([each[numbers] for each, numbers in columns], axis=1)
    tips = tip_map.tips(tip_map.box.from_free_cube(cube))
    return _flux_of(tip_map, cube, tips, corner_areas(tips, face_triangles(grid, cells)))


def flux_tol(tip_map: TipMap) -> float:
    """Largest tip error on the faces, in L."""
    return min(tip_map.tol, _ROUGH_TOL if tip_map.supports_unstable else _TOL)


def face_image(tip_map: TipMap, cells: int = _CELLS) -> Surface:
    """The closed image of the faces of a box of three bundles, of so many cells along each edge.

    The map is one to one inside. Vertices lie on the boundary to the tolerance of the tips, NaN
    where there is no stable equilibrium, and so do edges of the box: sharp rims stay sharp.
    """
    cube = grid_faces(cells)
    tips, faces = tip_map.tips(tip_map.box.from_free_cube(cube)), face_triangles(cube, cells)
    surface = Surface(vertices=tips, faces=faces)  # which the map may turn over
    return Surface(vertices=tips, faces=faces[:, ::-1].copy()) if surface.volume < 0 else surface


def grid_faces(cells: int) -> Array:
    """Vertices of a grid of cells³ boxes that lie on the faces of the unit cube, each once."""
    outside = np.ones((cells + 1,) * 3, bool)
    outside[1:-1, 1:-1, 1:-1] = False
    return np.argwhere(outside) / cells


def _flux(tip_map: TipMap, nodes: int) -> Flux:
    """By Gauss and Legendre's nodes, as many along each side, all of a face one after the other."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    weights, cube = np.outer(w / 2.0, w / 2.0).reshape(-1, 1), np.empty((3, 2, nodes**2, 3))
    for axis in range(3):
        cube[axis, :, :, axis] = [[0.0], [1.0]]
        cube[axis, :, :, (axis + 1) % 3] = np.repeat((1.0 + x) / 2.0, nodes)
        cube[axis, :, :, (axis + 2) % 3] = np.tile((1.0 + x) / 2.0, nodes)
    tips, slopes = box_slopes(tip_map, cube.reshape(-1, 3))
    area = np.empty(cube.shape)  # ∂r/∂a × ∂r/∂b outwards, times the weights
    for axis, face in enumerate(slopes.reshape(3, 2, -1, 3, 3)):
        across = np.cross(face[..., (axis + 1) % 3], face[..., (axis + 2) % 3])
        area[axis] = [-weights * across[0], weights * across[1]]
    return _flux_of(tip_map, cube.reshape(-1, 3), tips, area.reshape(-1, 3))


def _flux_of(tip_map: TipMap, cube: Array, tips: Array, area: Array) -> Flux:
    """Flux of nodes with area vectors; the error is that of the tips alone."""
    # From the middle, where products cancel least. Not BLAS, whose rounding depends on threads.
    value = float(((tips - tips.mean(axis=0)) * area).sum()) / 3.0
    moved = tip_map.tol * tip_map.length * float(np.linalg.norm(area, axis=1).sum())
    return Flux(value, moved, cube, area)


def face_triangles(cube: Array, cells: int) -> NDArray[np.int32]:
    """Two triangles for every square of the grid on the faces, oriented outwards."""
    number = np.full((cells + 1,) * 3, -1, np.int32)
    number[tuple(np.rint(cube * cells).astype(int).T)] = np.arange(len(cube))
    parts = []
    for axis in range(3):
        for side in (0, cells):
            # Axes in cyclic order: the square's first side times its second points along the axis.
            face = np.moveaxis(number, [axis, (axis + 1) % 3, (axis + 2) % 3], [0, 1, 2])[side]
            a, b, c, d = face[:-1, :-1], face[1:, :-1], face[1:, 1:], face[:-1, 1:]
            squares = (a, b, c, d) if side else (a, d, c, b)
            p, q, r, s = (corner.ravel() for corner in squares)
            parts += [np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)]
    return np.concatenate(parts)
