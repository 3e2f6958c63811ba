"""Reachable sets without a volume: the surface, curve or point of two, one or no free bundle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.hull import convex_hull
from softreach.geometry.surface import Surface, compact_surface
from softreach.kernels.box.simplices import chains
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index, as_points
from softreach.workspace.abstract_set import ReachableSet, Stored
from softreach.workspace.grid import grid_ticks, grid_tips, image_measure
from softreach.workspace.lifted_grid import LiftedGrid
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
    """Length of chords, or area of two triangles each [m or m²]."""
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
