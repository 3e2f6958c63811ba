"""Reachable sets without a volume: of one bundle or two, and of arms that move in one plane."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.base import Base
from softreach.geometry.flat import Plane, are_inside, convex_edges, enclosed_area, plane_of
from softreach.geometry.hull import convex_hull
from softreach.geometry.surface import Surface, compact_surface
from softreach.kernels.box.simplices import chains
from softreach.rod.rods import ArmMap
from softreach.rod.tip_map import TipMap
from softreach.sampling import cube_blocks
from softreach.support.arrays import Array, Index, as_points
from softreach.support.errors import MissingExtra
from softreach.support.progress import Progress
from softreach.workspace.cells import CLIMBERS, lost_share, shifted_lattice
from softreach.workspace.flux import box_slopes
from softreach.workspace.grid import LiftedGrid, cube_grid, grid_ticks, grid_tips, image_measure
from softreach.workspace.image import Lattice
from softreach.workspace.measure import Estimate, HullCorners, climbed_hull
from softreach.workspace.postures import all_postures
from softreach.workspace.reachable import ReachableSet, Stored
from softreach.workspace.search import DISTANCE, ENOUGH, ReachedGrid, all_reached, cloud_on_faces
from softreach.workspace.wrap import drawn_tight

_CELLS = {1: 1024, 2: 128}  # of the grids of a curve and of a surface, for distances and pictures
_NODES = 24, 16  # Gauss nodes along each axis, and those that tell the error


_SAMPLES = 256  # of the box, that tell whether all tips lie in one plane
_FLAT = 4.0  # tolerances of a tip: what is no thicker is flat
_RULE = 2.5  # cells along the mean side, times the root of the accuracy
_FEWEST = 24.0
_MOST = 1024.0  # cells along the longer side
_FINER = 1.5
_SIGNS = 16  # cells of the grid that tells whether two bundles fold


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ReachableSurface(ReachableSet):
    """A surface that two free bundles sweep, which has an area and no volume."""

    dimension: ClassVar[int] = 2
    _stored: ClassVar[tuple[str, ...]] = "area", "convex_volume", "unreachability"

    area: float
    """Area [m²]; places count as often as they are reached."""
    area_error: float
    """Error of `area`, estimated from two numbers of Gauss nodes [m²]."""
    mapped_grid: Surface = field(repr=False)
    """The mapped activation grid, without cells that are left out."""

    def surface(self) -> Surface:
        """The surface as triangles."""
        return self.mapped_grid

    def distance(self, points: ArrayLike) -> Array:
        """Distance of points to the triangles of the mapped grid [m], never negative."""
        return self.mapped_grid.distance(as_points("points", points))

    def _repr_html_(self) -> str:
        from softreach.picture import Skin, html_card

        return html_card(repr(self), Skin(self.mapped_grid.vertices, self.mapped_grid.faces))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ReachableCurve(ReachableSet):
    """A curve that one free bundle draws, which has a length and no volume."""

    dimension: ClassVar[int] = 1
    _stored: ClassVar[tuple[str, ...]] = "curve_length", "convex_volume", "unreachability"

    curve_length: float
    """Length [m]; places count as often as they are reached."""
    curve_length_error: float
    """Error of `curve_length`, estimated from two numbers of Gauss nodes [m]."""
    path: Array = field(repr=False)
    """Points along the curve [m], from the lower bound to the upper one, shape (cells + 1, 3); NaN
    where no posture is held, and one of several where it is torn."""
    chords: Surface = field(repr=False)
    """Lines along all of its pieces [m], as triangles that repeat a corner."""

    def distance(self, points: ArrayLike) -> Array:
        """Distance of points to the `chords` [m], never negative."""
        return self.chords.distance(as_points("points", points))

    def _repr_html_(self) -> str:
        from softreach.picture import Dots, html_card

        return html_card(repr(self), Dots(_found(self.path)))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ReachablePoint(ReachableSet):
    """Position of the tip if no bundle is free."""

    dimension: ClassVar[int] = 0

    tip: Array
    """Position [m], shape (3,)."""

    def distance(self, points: ArrayLike) -> Array:
        """Distance of points to the tip [m]."""
        return np.linalg.norm(as_points("points", points) - self.tip, axis=1)

    def _lines(self) -> list[str]:
        x, y, z = self.tip
        return [f"({x:.6g}, {y:.6g}, {z:.6g}) m"]

    def _numbers(self) -> Stored:
        return {
            name: ((), float(value), {"units": "m", "long_name": f"{name} of the tip"})
            for name, value in zip("xyz", self.tip, strict=True)
        }


def thin_set(tip_map: TipMap) -> ReachableSet:
    """The reachable set of a tip map with fewer than three free bundles."""
    m = tip_map.box.dimension
    if m == 0:
        return ReachablePoint(tip_map=tip_map, cells=1, tip=grid_tips(tip_map, 1)[0])
    n = _CELLS[m]
    ticks = (
        None if tip_map.supports_unstable else grid_ticks(tip_map, n)
    )  # on whose lines kinks are
    grid = LiftedGrid.of(tip_map, n, ticks=ticks)
    size, convex = _measure(tip_map, grid), _convex_volume(tip_map, grid)
    common: dict[str, Any] = {
        "tip_map": tip_map,
        "cells": n,
        "convex_volume": convex.value,
        "convex_volume_error": convex.error,
        "lost_share": grid.lost_share,
        "hysteresis_share": grid.hysteresis_share,
    }
    if m == 1:
        length = {"curve_length": size.value, "curve_length_error": size.error}
        chords = threads(np.nan_to_num(grid.tips), grid.cells)
        return ReachableCurve(path=grid.tips[: n + 1], chords=chords, **length, **common)
    faces = grid.cells[:, chains(2, 2)].reshape(-1, 3)
    vertices, faces = compact_surface(grid.tips, faces) if grid.is_torn else (grid.tips, faces)
    mesh = Surface(vertices=vertices, faces=faces)
    return ReachableSurface(area=size.value, area_error=size.error, mapped_grid=mesh, **common)


def threads(points: Array, edges: Index) -> Surface:
    """Lines between pairs of points, as triangles that repeat a corner.

    Args:
        points: [m], shape (n, 3).
        edges: Numbers of their ends, shape (m, 2).
    """
    return Surface(vertices=points, faces=edges[:, [0, 1, 1]])


def by_nodes(tip_map: TipMap) -> Estimate:
    """Length [m] or area [m²] of the image, and by how much fewer Gauss nodes change it."""
    fine, rough = (image_measure(tip_map, nodes) for nodes in _NODES)
    return Estimate(fine, abs(fine - rough))


def _measure(tip_map: TipMap, grid: LiftedGrid) -> Estimate:
    """Length or area of the image, by Gauss nodes where it is one smooth sheet.

    Else it is that of cells, as chords or triangles. What these err by, O(1/n²), is removed. Where
    the map has kinks, or sheets end, it is O(1/n): the largest change by a finer grid is stated.
    """
    if tip_map.is_smooth and not grid.is_torn and np.isfinite(smooth := by_nodes(tip_map)).all():
        return smooth
    fine, times = _size(grid), (2, 3) if grid.is_torn else (2,)
    changes = [fine - _size(grid.coarser(tip_map, k)) for k in times]
    removed = max((c / (k - 1) for k, c in zip(times, changes, strict=True)), key=abs) / 3.0
    return Estimate(fine + removed, max(map(abs, changes)))


def _size(grid: LiftedGrid) -> float:
    corners = grid.tips[grid.cells]
    if corners.shape[1] == 2:
        return float(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=-1).sum())
    first, last, second = (corners[:, k] - corners[:, 0] for k in (1, 3, 2))
    pair = np.stack([np.cross(first, last), np.cross(last, second)])
    return float((np.linalg.norm(pair, axis=-1).sum(axis=0) / 2.0).sum())


def _found(tips: Array) -> Array:
    return tips[np.isfinite(tips[:, 0])]


def _convex_volume(tip_map: TipMap, grid: LiftedGrid) -> Estimate:
    """Volume of the convex hull of mapped vertices [m³].

    It is too small by O(1/n²): a grid with a quarter of the cells along each axis differs by 15
    times the error. A tenth of the difference is stated.
    """
    grids = grid, grid.coarser(tip_map, 4)
    fine, coarse = (convex_hull(_found(each.tips)).volume for each in grids)
    return Estimate(fine, abs(fine - coarse) / 10.0)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ReachableRegion(ReachableSurface):
    """A region of a plane, which has an area, each place counted once, and no volume."""

    _stored: ClassVar[tuple[str, ...]] = "area", "convex_area", "convex_volume", "unreachability"

    convex_area: float
    """Area of the convex hull [m²]."""
    convex_area_error: float
    """Half of what is between two bounds [m²]."""
    outline: Surface = field(repr=False)
    """Closed curves of tips around the region and its holes [m]: lines from tip to tip, as
    triangles that repeat a corner. Parts of them may enclose nothing."""

    def distance(self, points: ArrayLike) -> Array:
        """Distance of points to the region [m], never negative."""
        return np.minimum(
            super().distance(points), self.outline.distance(as_points("points", points))
        )

    def _sizes(self) -> tuple[float, float, float, float]:
        return self.area, self.area_error, self.convex_area, self.convex_area_error

    def _lines(self) -> list[str]:
        size, hull = super()._lines()
        return [f"{size} in one {'plane' if self.convex_area else 'line'}", hull]


class _FlatCorners(HullCorners):
    """Corners of a convex hull in the plane z = 0, with edges for faces and an area for volume."""

    __slots__ = ()
    hull_of = staticmethod(convex_edges)

    @property
    def facets(self) -> Array:
        a, b = np.moveaxis(self.tips[self.faces], 1, 0)
        x, y = (b - a)[:, :2].T
        return np.stack([y, -x, np.zeros_like(x)], axis=1)

    @property
    def volume(self) -> float:
        return enclosed_area(self.tips, self.faces)


def plane_of_tips(tip_map: TipMap) -> Plane | None:
    """The plane in which all tips lie to their tolerance; None if there is none."""
    (cube,) = cube_blocks("sobol", _SAMPLES, tip_map.box.dimension, 0, _SAMPLES)
    tips = tip_map.tips(tip_map.box.from_free_cube(np.concatenate([cube, np.rint(cube)])))
    tips = tips[np.isfinite(tips[:, 0])]
    return plane_of(tips, _FLAT * tip_map.tol * tip_map.length) if len(tips) > 2 else None


def planar_set(
    tip_map: TipMap, plane: Plane, accuracy: float, progress: Progress
) -> ReachableRegion:
    """The region that a tip map reaches in a plane, as `searched_set` finds volumes in space.

    Args:
        tip_map: The tip map, of two free bundles or more.
        plane: The plane in which its tips lie.
        accuracy: Relative error asked of the area.
        progress: Called with the number of centers searched since its last call.

    Raises:
        MissingExtra: scikit-image is not installed.
    """
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
        found = outline(edge)
        slack = found.length * (ENOUGH * edge + tip_map.tol * tip_map.length)
        area = Estimate(found.area, abs(found.area - coarse.area) + slack)
        if area.error <= accuracy * area.value or edge / _FINER < sides.max() / _MOST:
            break
        edge, coarse = edge / _FINER, found
    area = _smooth(tip_map, flat, area)
    cube = flat.box.to_cube(np.concatenate([gamma[:CLIMBERS], found.gamma]))[:, flat.box.free]
    convex = climbed_hull(flat, cube, accuracy, _FlatCorners).volume
    return ReachableRegion(
        tip_map=tip_map,
        area=area.value,
        area_error=area.error,
        convex_area=convex.value,
        convex_area_error=convex.error,
        lost_share=lost_share(flat),
        hysteresis_share=0.0 if every is None else every.hysteresis_share,
        outline=threads(plane.places(found.tips), found.edges),
        mapped_grid=_mesh(found, plane),
    )


class _Outline(NamedTuple):
    tips: Array
    """Shape (n, 3)."""
    gamma: Array
    """Activations that lead to them, shape (n, bundles)."""
    edges: Index
    """From each tip to the next of its curve, shape (e, 2)."""
    centers: Array
    """Of cells that are reached [m], shape (c, 3)."""

    @classmethod
    def of(cls, grid: ReachedGrid) -> _Outline:
        """The level set of the distances, drawn tight."""
        try:
            from skimage.measure import find_contours
        except ImportError as error:
            raise MissingExtra(("scikit-image", "surface")) from error
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
    grid = cube_grid(_SIGNS)[:, :2]
    sign = np.linalg.det(box_slopes(flat, grid)[1][:, :2])
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
