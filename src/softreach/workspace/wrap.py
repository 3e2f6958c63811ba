"""A closed surface of tips around what is reached, of whatever thinness: wrapped and drawn tight.

Distances from the centers of a lattice to the nearest tips have a level set that goes around both
sides of a sheet and its rim. Each of its vertices is drawn to the nearest tip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softreach.geometry.surface import Surface, corner_areas, level_set
from softreach.kernels.box.box_projection import project
from softreach.rod.rods import refined
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array
from softreach.support.lazy import lazy
from softreach.workspace.measure import Estimate
from softreach.workspace.search import DISTANCE, ENOUGH, Nearest, ReachedGrid, nearest_tips

_ASIDE = 1e-4  # cells by which both sides of a sheet are kept apart
_SHEET = 2e-3  # of its width, the root of its area, that a sheet is thinner than
_SHEET_TOL = 1e-9  # in L, as a sheet may be no thicker than tips are exact otherwise
_WIDEST = 0.99  # of all thicknesses are below the one that the next pushes go beyond
_STRETCH = 30.0  # times as much as one to the side, a miss along the normal counts
_PUSHES, _PASSES = 12, 4
_DAMPING = 1e-8  # of the mean square of the slopes


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Wrap(Surface):
    """The surface, closed and outwards, a ten-thousandth of a cell outside of its tips."""

    tip_map: TipMap
    gamma: Array
    """Activations that lead to the vertices, shape (v, bundles)."""
    cell: float
    """Edge of the cells that it was found with [m]."""
    tight_volume: float
    """Volume inside of the tips themselves [m³]."""

    @lazy
    def volume_of_tips(self) -> Estimate:
        """The same; of a sheet that is far thinner than cells, its thickness over its area [m³].

        No search for the nearest tip sees so small a change; so from each vertex the tip is pushed
        along its normal, to which all columns of ∂r/∂γ are nearly square, to both sides. It errs by
        where tips count as found and by their own errors.
        """
        half = 0.5 * self.area
        thickness = self.tight_volume / half if half > 0.0 else np.inf
        if self.tip_map.supports_unstable or thickness > _SHEET * np.sqrt(half):
            off = ENOUGH * self.cell + self.tip_map.tol * self.tip_map.length
            return Estimate(self.tight_volume, self.area * off)
        tip_map, areas = (
            refined(self.tip_map, _SHEET_TOL),
            np.linalg.norm(self.corner_areas, axis=1),
        )
        tips, slopes = tip_map.tips_and_slopes(self.gamma)
        normals = np.linalg.svd(slopes * tip_map.box.scales)[0][:, :, 2]
        found = np.zeros(len(tips))
        for _ in range(_PASSES):
            ways = (2.0 * thickness * normals, -2.0 * thickness * normals)
            found = sum(_pushed(tip_map, self.gamma, tips, way) for way in ways)
            thickness = float(np.quantile(found, _WIDEST))
        return Estimate(0.5 * float(areas @ found), self.area * _SHEET_TOL * tip_map.length)

    @lazy
    def cube(self) -> Array:
        """Places of the vertices in the unit cube of the free bundles, shape (v, dimension)."""
        box = self.tip_map.box
        return box.to_cube(self.gamma)[:, box.free].clip(0.0, 1.0)

    @lazy
    def corner_areas(self) -> Array:
        """Outward area that each vertex stands for [m²], shape (v, 3)."""
        return corner_areas(self.vertices, self.faces)


def _pushed(tip_map: TipMap, gamma: Array, tips: Array, way: Array) -> Array:
    """How far tips go along a way that is too far, with little to the side [m], shape (n,)."""
    size, box = np.linalg.norm(way, axis=1), tip_map.box
    unit, target = way / size[:, None], tips + way
    scale = np.eye(3) + (_STRETCH - 1.0) * unit[:, :, None] * unit[:, None, :]
    center, multiplier, step = np.zeros_like(gamma), np.empty_like(tips), np.empty_like(gamma)
    for _ in range(_PUSHES):
        # Least |miss - J d|² + μ |d|² inside the bounds, with d measured in ranges (Levenberg).
        at, slopes = tip_map.tips_and_slopes(gamma)
        miss, stretched = scale @ (target - at)[:, :, None], scale @ slopes * box.scales
        damping = _DAMPING * ((stretched**2).sum(axis=(1, 2)) / 3.0)
        low, high = (box.low - gamma) / box.scales, (box.high - gamma) / box.scales
        multiplier[:] = 0.0
        project(center, stretched, miss[:, :, 0], damping, low, high, step, multiplier)
        gamma = box.clip(gamma + step * box.scales)
    return ((tip_map.tips(gamma) - tips) * unit).sum(axis=1)


def drawn_tight(grid: ReachedGrid, at: Array) -> Nearest:
    """The nearest tips of places on edges of the lattice, from the tips at both ends.

    Args:
        grid: What was found.
        at: Coordinates of the places in cells, shape (n, 3).
    """
    lattice, n = grid.lattice, len(at)
    places = lattice.origin + lattice.cell * at
    best = Nearest(np.zeros((n, grid.gamma.shape[1])), np.full((n, 3), np.nan), np.full(n, np.inf))
    for end in (np.floor(at), np.ceil(at)):
        cells = end.astype(np.int64) @ grid.steps
        found = nearest_tips(grid.tip_map, grid.gamma[cells], places, ENOUGH * lattice.cell)
        closer = found.distance < best.distance
        for kept, new in zip(best, found, strict=True):
            kept[closer] = new[closer]
    return best


def wrapped(grid: ReachedGrid) -> Wrap:
    """The surface around what was found.

    Raises:
        MissingExtra: scikit-image is not installed.
    """
    at, faces = level_set(grid.distances, DISTANCE)
    gamma, tips, _ = drawn_tight(grid, at)
    cell, away = grid.lattice.cell, grid.lattice.origin + grid.lattice.cell * at - tips
    away /= np.linalg.norm(away, axis=1).clip(1e-9 * cell)[:, None]
    return Wrap(
        vertices=tips + _ASIDE * cell * away,
        faces=faces,
        tip_map=grid.tip_map,
        cell=cell,
        gamma=gamma,
        tight_volume=Surface(vertices=tips, faces=faces).volume,
    )
