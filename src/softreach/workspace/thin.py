"""Reachable sets without a volume: of one bundle or two, and of arms that move in one plane."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.arm.base import Base
from softreach.geometry.flat import Plane, are_inside, convex_edges, enclosed_area, plane_of
from softreach.geometry.hull import convex_hull
from softreach.geometry.surface import Surface, compact_surface, surface_area
from softreach.kernels.image.activation_mesh import chains
from softreach.rod.rods import ArmMap, refined
from softreach.rod.tip_map import TipMap
from softreach.sampling import cube_blocks
from softreach.support.arrays import Array, Index
from softreach.support.errors import check_installed
from softreach.support.progress import Progress
from softreach.workspace import grid as grids
from softreach.workspace.cells import CLIMBERS, drawn_tight, lost_share, shifted_lattice
from softreach.workspace.image import Lattice
from softreach.workspace.measure import Estimate, climbed_hull, named
from softreach.workspace.postures import all_postures
from softreach.workspace.reachable import SIZES, ReachableSet
from softreach.workspace.search import DISTANCE, ENOUGH, ReachedGrid, all_reached, cloud_on_faces

_CELLS = {1: 1024, 2: 128}  # of the grids of a curve and of a surface, for distances and pictures
_NODES = 24, 16  # Gauss nodes along each axis, and those that tell the error
_TOL = 1e-9  # far fewer evaluations than on the grids: their steps may be short
_SAMPLES = 256  # of the box, that tell whether all tips lie in one plane
_FLAT = 4.0  # tolerances of a tip: what is no thicker is flat
_RULE = 2.5  # cells along the mean side, times the root of the accuracy
_FEWEST = 24.0
_MOST = 1024.0  # cells along the longer side
_FINER = 1.5
_SIGNS = 16  # cells of the grid that tells whether two bundles fold


def thin_set(tip_map: TipMap) -> ReachableSet:
    """The reachable set of a tip map with fewer than three free bundles."""
    m = tip_map.box.dimension
    if m == 0:
        point = Surface(vertices=grids.grid_tips(tip_map, 1), faces=np.zeros((1, 3), np.int32))
        return ReachableSet(tip_map=tip_map, cells=1, mesh=point)
    n = _CELLS[m]
    # kinks are on lines of the grid
    ticks = None if tip_map.supports_unstable else grids.grid_ticks(tip_map, n)
    grid = grids.LiftedGrid.of(tip_map, n, ticks=ticks)
    corners = grid.cells[:, chains(m, m)].reshape(-1, m + 1)
    faces = np.pad(corners, [(0, 0), (0, 2 - m)], mode="edge")
    vertices, faces = compact_surface(grid.tips, faces)
    return ReachableSet(
        tip_map=tip_map,
        cells=n,
        lost_share=grid.lost_share,
        hysteresis_share=grid.hysteresis_share,
        mesh=Surface(vertices=vertices, faces=faces),
        **named(**{SIZES[m]: _measure(tip_map, grid)}, convex_volume=_convex_volume(grid)),
    )


def by_nodes(tip_map: TipMap) -> Estimate:
    """Length [m] or area [m²] of the image, ∫ √det(JᵀJ) dγ, and how fewer Gauss nodes change it.

    Places count as often as they are reached; NaN if a node has no stable equilibrium.
    """
    box, tip_map, values = tip_map.box, refined(tip_map, _TOL), list[float]()
    for nodes in _NODES:
        x, w = np.polynomial.legendre.leggauss(nodes)
        places, weights = (grids.product_of([each / 2.0] * box.dimension) for each in (1.0 + x, w))
        slopes = tip_map.tips_and_slopes(box.from_free_cube(places))[1][:, :, box.free]
        with np.errstate(invalid="ignore"):
            sizes = np.sqrt(np.linalg.det(np.swapaxes(slopes, 1, 2) @ slopes).clip(0.0))
        # Not a BLAS product, whose rounding would depend on its threads.
        values.append(float((np.prod(weights, axis=1) * box.volume * sizes).sum()))
    return Estimate(values[0], abs(values[0] - values[1]))


def _measure(tip_map: TipMap, grid: grids.LiftedGrid) -> Estimate:
    """Length or area of the image, by Gauss nodes where it is one smooth sheet, else by cells.

    What these err by, O(1/n²), is removed. Where the map has kinks, or sheets end, it is O(1/n):
    the largest change by a finer grid is stated.
    """
    if tip_map.is_smooth and not grid.is_torn and np.isfinite(smooth := by_nodes(tip_map)).all():
        return smooth
    fine, times = _size(grid), (2, 3) if grid.is_torn else (2,)
    changes = [fine - _size(grid.coarser(k)) for k in times]
    removed = max((c / (k - 1) for k, c in zip(times, changes, strict=True)), key=abs) / 3.0
    return Estimate(fine + removed, max(map(abs, changes)))


def _size(grid: grids.LiftedGrid) -> float:
    if grid.is_lifted.ndim == 2:
        return surface_area(grid.tips, grid.cells[:, chains(2, 2)].reshape(-1, 3))
    return float(np.linalg.norm(np.diff(grid.tips[grid.cells], axis=1), axis=-1).sum())


def _convex_volume(grid: grids.LiftedGrid) -> Estimate:
    """Volume of the convex hull of mapped vertices [m³]."""
    # A grid with a quarter of the cells along each axis differs by 15 times the error O(1/n²).
    tips = (each.tips[np.isfinite(each.tips[:, 0])] for each in (grid, grid.coarser(4)))
    fine, coarse = (convex_hull(points).volume for points in tips)
    return Estimate(fine, abs(fine - coarse) / 10.0)


def plane_of_tips(tip_map: TipMap) -> Plane | None:
    """The plane in which all tips lie to their tolerance; None if there is none."""
    (cube,) = cube_blocks("sobol", _SAMPLES, tip_map.box.dimension, 0, _SAMPLES)
    tips = tip_map.tips(tip_map.box.from_free_cube(np.concatenate([cube, np.rint(cube)])))
    tips = tips[np.isfinite(tips[:, 0])]
    return plane_of(tips, _FLAT * tip_map.tol * tip_map.length) if len(tips) > 2 else None


def planar_set(tip_map: TipMap, plane: Plane, accuracy: float, progress: Progress) -> ReachableSet:
    """The region that two bundles or more reach in a plane, as `searched_set` finds volumes."""
    turned = Base(
        points=tuple(map(tuple, plane.rotation.tolist())),  # pyright: ignore[reportArgumentType]
        position=tuple((-plane.rotation @ plane.origin).tolist()),  # pyright: ignore[reportArgumentType]
    )
    every = all_postures(tip_map)  # the map in the axes of the plane
    flat = ArmMap.of(tip_map, turned) if every is None else every.seen_from(turned)
    cloud = gamma, tips = cloud_on_faces(flat, 0)
    sides = np.ptp(tips[:, :2], axis=0)
    mean = float(np.sqrt(np.prod(sides)))
    edge = max(min(np.sqrt(accuracy) / _RULE, 1.0 / _FEWEST) * mean, float(sides.max()) / _MOST)

    def outline(edge: float) -> _Outline:
        x, y, _ = (lattice := shifted_lattice(tips, edge)).shape
        layers = Lattice(np.array([*lattice.origin[:2], -2.0 * edge]), edge, (x, y, 5))
        return _Outline.of(all_reached(ReachedGrid(flat, layers, progress, is_flat=True), *cloud))

    coarse = outline(_FINER * edge)
    while True:
        fine = outline(edge)
        slack = fine.length * (ENOUGH * edge + tip_map.tol * tip_map.length)
        area = Estimate(fine.area, abs(fine.area - coarse.area) + slack)
        if area.error <= accuracy * area.value or edge / _FINER < sides.max() / _MOST:
            break
        edge, coarse = edge / _FINER, fine
    area = _smooth(tip_map, flat, area)
    cube = flat.box.to_cube(np.concatenate([gamma[:CLIMBERS], fine.gamma]))[:, flat.box.free]
    return ReachableSet(
        tip_map=tip_map,
        lost_share=lost_share(flat),
        hysteresis_share=0.0 if every is None else every.hysteresis_share,
        mesh=_mesh(fine, plane),
        outline=Surface(vertices=plane.places(fine.tips), faces=fine.edges[:, [0, 1, 1]]),
        **named(area=area, convex_area=climbed_hull(flat, cube, accuracy, convex_edges).volume),
    )


class _Outline(NamedTuple):
    tips: Array  # (n, 3)
    gamma: Array  # activations that lead to them, (n, bundles)
    edges: Index  # from each tip to the next of its curve, (e, 2)
    centers: Array  # of cells that are reached [m], (c, 3)

    @classmethod
    def of(cls, grid: ReachedGrid) -> _Outline:
        """The level set of the distances, drawn tight."""
        check_installed("skimage")
        from skimage.measure import find_contours

        curves = find_contours(grid.distances[:, :, 2], DISTANCE, positive_orientation="low")
        at = np.insert(np.concatenate([np.empty((0, 2)), *curves]), 2, 2.0, axis=1)
        first = np.delete(np.arange(len(at)), np.cumsum([len(curve) for curve in curves]) - 1)
        gamma, tips, _ = drawn_tight(grid, at)
        edges = np.stack([first, first + 1], axis=1)
        return cls(tips, gamma, edges, grid.centers(np.flatnonzero(grid.gap == 0.0)))

    @property
    def area(self) -> float:
        return enclosed_area(self.tips, self.edges)

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.diff(self.tips[self.edges], axis=1), axis=2).sum())


def _smooth(tip_map: TipMap, flat: TipMap, area: Estimate) -> Estimate:
    """The area of two bundles that do not fold by Gauss nodes, as far as the outline agrees."""
    if tip_map.box.dimension != 2 or tip_map.supports_unstable or not tip_map.is_smooth:
        return area
    sign = np.linalg.det(grids.box_slopes(flat, grids.cube_grid(_SIGNS, 2))[1][:, :2])
    smooth = by_nodes(tip_map)
    folds = sign.min() * sign.max() <= 0.0 or abs(smooth.value - area.value) > area.error
    return area if folds else smooth


def _mesh(outline: _Outline, plane: Plane) -> Surface:
    from scipy.spatial import Delaunay

    points = np.concatenate([outline.tips, outline.centers])
    if len(points) < 3 or not outline.area > 0.0:
        return Surface(vertices=np.empty((0, 3)), faces=np.empty((0, 3), np.int32))
    points = np.unique(points, axis=0)
    faces = Delaunay(points[:, :2], qhull_options="QJ Pp").simplices
    kept = are_inside(points[faces].mean(axis=1), outline.tips[outline.edges])
    vertices, faces = compact_surface(plane.places(points), faces[kept].astype(np.int32))
    return Surface(vertices=vertices, faces=faces)
