"""Reachable sets without a volume: the surface, curve or point of two, one or no free bundle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.hull import convex_hull
from softreach.geometry.surface import Surface, compact_surface
from softreach.kernels.box.simplices import chains, corner_steps
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index, Mask, as_points
from softreach.support.lazy import lazy
from softreach.workspace.abstract_set import ReachableSet, Stored
from softreach.workspace.discontinuities import coarser, corner_values, finer, left_out_cells
from softreach.workspace.grid import every_second, grid_ticks, grid_tips, image_measure
from softreach.workspace.measure import Estimate

_CELLS = {1: 1024, 2: 128}  # of the grids of a curve and of a surface, for distances and pictures
_NODES = 24, 16  # Gauss nodes along each axis, and those that tell the error


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
    where there is no stable equilibrium."""
    left_out: Mask = field(repr=False)
    """Mask of the pieces between neighboring points that are left out, shape (cells,)."""

    def distance(self, points: ArrayLike) -> Array:
        """Distance of points to the chords of `path` [m], never negative."""
        return self._chords.distance(as_points("points", points))

    @lazy
    def _chords(self) -> Surface:
        return threads(np.nan_to_num(self.path), np.flatnonzero(~self.left_out))

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


def thin_set(rod: TipMap) -> ReachableSet:
    """The reachable set of a tip map with fewer than three free bundles."""
    m = rod.box.dimension
    if m == 0:
        return ReachablePoint(tip_map=rod, cells=1, tip=grid_tips(rod, 1)[0])
    cells = _CELLS[m]
    ticks = None if rod.supports_unstable else grid_ticks(rod, cells)  # on whose lines kinks are
    tips = grid_tips(rod, cells, ticks=ticks)
    left_out = left_out_cells(rod, tips, cells)
    size, convex = _measure(rod, tips, left_out), _convex_volume(tips, cells, m)
    common: dict[str, Any] = {
        "tip_map": rod,
        "cells": cells,
        "convex_volume": convex.value,
        "convex_volume_error": convex.error,
        "lost_share": float(left_out.mean()),
    }
    if m == 1:
        length = {"curve_length": size.value, "curve_length_error": size.error}
        return ReachableCurve(path=tips, left_out=left_out, **length, **common)
    base = np.flatnonzero(~left_out)
    base += base // cells  # each row of vertices has one more
    faces = (base[:, None, None] + corner_steps((cells, cells))[chains(2, 2)]).reshape(-1, 3)
    vertices, faces = (tips, faces) if len(base) == cells**2 else compact_surface(tips, faces)
    mesh = Surface(vertices=vertices, faces=faces)
    return ReachableSurface(area=size.value, area_error=size.error, mapped_grid=mesh, **common)


def threads(points: Array, first: Index) -> Surface:
    """Lines from points to those that follow them, as triangles that repeat a corner.

    Args:
        points: [m], shape (n, 3).
        first: Numbers of the points where lines begin, shape (m,).
    """
    return Surface(vertices=points, faces=np.stack([first, first + 1, first + 1], axis=1))


def by_nodes(rod: TipMap) -> Estimate:
    """Length [m] or area [m²] of the image, and by how much fewer Gauss nodes change it."""
    fine, rough = (image_measure(rod, nodes) for nodes in _NODES)
    return Estimate(fine, abs(fine - rough))


def _measure(rod: TipMap, tips: Array, left_out: Mask) -> Estimate:
    """Length or area of the image, by Gauss nodes where it is smooth.

    Where cells are left out, it is that of the others and an estimate of the rest. Where the map
    has kinks it is that of cells, which err by O(1/n) there: three times what is removed is stated.
    """
    if rod.is_smooth and not left_out.any() and np.isfinite(smooth := by_nodes(rod)).all():
        return smooth
    return _of_cells(tips, left_out, 1.0 if rod.is_smooth else 3.0)


def _of_cells(tips: Array, left_out: Mask, share: float) -> Estimate:
    """Length or area of the cells of a grid that are not left out, as chords or triangles.

    What they err by, O(1/n²), is removed as far as the cells tell that a grid of half as many holds
    too, and a share of it is part of the error. A cell that is left out may still reach as much as
    its largest neighbor, and half of it is taken.
    """
    from scipy.ndimage import maximum_filter

    cells, m = len(left_out), left_out.ndim
    sizes = np.where(left_out, 0.0, _sizes(tips, cells, m))
    lost = coarser(left_out)
    rough = np.where(lost, 0.0, _sizes(every_second(tips, cells, m), cells // 2, m))
    removed = (float(sizes[~finer(lost)].sum()) - float(rough.sum())) / 3.0
    around = maximum_filter(sizes, 3, mode="constant")  # of a cell and those that touch it
    unknown = 0.5 * float(around[left_out].sum())
    return Estimate(float(sizes.sum()) + removed + unknown, share * abs(removed) + unknown)


def _sizes(tips: Array, cells: int, m: int) -> Array:
    """Lengths of chords, or areas of two triangles each [m or m²], shape (cells,) * m."""
    corners = np.moveaxis(tips.reshape(*(cells + 1,) * m, 3), -1, 0)
    corners = np.stack([corner_values(axis) for axis in corners], axis=-1)
    if m == 1:
        return np.linalg.norm(corners[:, 1] - corners[:, 0], axis=-1)
    first, second, third = (corners[..., k, :] - corners[..., 0, :] for k in (1, 3, 2))
    pair = np.stack([np.cross(first, second), np.cross(second, third)])
    return np.linalg.norm(pair, axis=-1).sum(axis=0) / 2.0


def _found(tips: Array) -> Array:
    return tips[np.isfinite(tips[:, 0])]


def _convex_volume(tips: Array, cells: int, m: int) -> Estimate:
    """Volume of the convex hull of mapped vertices [m³].

    It is too small by O(1/n²): a grid with a quarter of the cells along each axis differs by 15
    times the error. A tenth of the difference is stated.
    """
    quarter = _found(every_second(every_second(tips, cells, m), cells // 2, m))
    tips = _found(tips)
    fine, coarse = convex_hull(tips).volume, convex_hull(quarter).volume
    return Estimate(fine, abs(fine - coarse) / 10.0)
