"""The convex hull of the reach of many bundles, enclosed between what is attained and what is not.

Each facet of the hull of tips is climbed: how far does the tip go along its normal? What it attains
makes the hull larger, and no tip is beyond the planes moved out by what it may attain.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from softreach.geometry.hull import convex_faces
from softreach.geometry.surface import compact_surface, corner_areas, enclosed_volume
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Faces
from softreach.workspace.measure import Estimate

_ROUNDS = 8
_LESS = 0.5  # of the error before, that another round must leave
_CLIMBS = 25  # steps of a climb
_FIRST = 0.3  # of the box, that the first step goes
_ENOUGH = 0.05  # of the accuracy, of the size: slope that ends a climb
_FARTHEST = 0.02  # of the size, that a climb is taken to leave at most
_TOGETHER = 512  # facets


class HullCorners(NamedTuple):
    """Activations whose tips are the corners of a convex hull."""

    cube: Array
    """In the unit cube of the free bundles, shape (n, dimension)."""
    tips: Array
    """[m], shape (n, 3)."""
    faces: Faces
    """Outwards, shape (f, 3)."""

    hull_of = staticmethod(convex_faces)

    @classmethod
    def of(cls, tips: Array, cube: Array) -> Self:
        """Corners of the hull of some tips at places of the cube; tips that are NaN are none."""
        known = np.isfinite(tips[:, 0])
        tips, cube = tips[known], cube[known]
        every = cls.hull_of(tips)
        vertices, faces = compact_surface(tips, every)
        return cls(cube[np.unique(every)], vertices, faces)

    @property
    def area(self) -> Array:
        """∂V_convex/∂r of each corner [m²], shape (n, 3)."""
        return corner_areas(self.tips, self.faces)

    @property
    def facets(self) -> Array:
        """Outward area vectors of the faces [m²], shape (f, 3)."""
        a, b, c = np.moveaxis(self.tips[self.faces], 1, 0)
        return 0.5 * np.cross(b - a, c - a)

    @property
    def volume(self) -> float:
        """Of the hull [m³]."""
        return enclosed_volume(self.tips, self.faces)


class ConvexHull(NamedTuple):
    """A hull of tips, the one that it was climbed from, and the volume of the image's own."""

    volume: Estimate
    """The middle between two bounds, and half of what is between them [m³]."""
    corners: HullCorners
    before: HullCorners


def climbed_hull(
    tip_map: TipMap, cube: Array, accuracy: float, kind: type[HullCorners] = HullCorners
) -> ConvexHull:
    """The convex hull of the image of a box.

    Args:
        tip_map: The tip map.
        cube: Places of the box to begin with, in the unit cube, shape (n, dimension).
        accuracy: Relative error of the volume that ends the climbing.
        kind: Of corners, with edges for faces in a plane.
    """
    corners = kind.of(tip_map.tips(tip_map.box.from_free_cube(cube)), cube)
    before = corners
    if not len(corners.faces):
        return ConvexHull(Estimate(0.0, 0.0), corners, corners)
    size, error = float(np.ptp(corners.tips, axis=0).max()), np.inf
    for _ in range(_ROUNDS):
        before, low = corners, corners.volume
        vectors = corners.facets
        area = np.linalg.norm(vectors, axis=1)
        normals = vectors / np.maximum(area, np.finfo(float).tiny)[:, None]
        start = corners.cube[corners.faces[:, 0]]
        found, tips, top = _climbed(tip_map, start, normals, _ENOUGH * accuracy * size, size)
        every = np.concatenate([corners.tips, tips])
        for rows in range(0, len(top), _TOGETHER):
            block = slice(rows, rows + _TOGETHER)
            attained = np.nanmax(every @ normals[block].T, axis=0)
            top[block] = np.fmax(top[block], attained)
        offset = np.einsum("fi,fi->f", corners.tips[corners.faces[:, 0]], normals)
        high = low + float(area @ (top - offset).clip(0.0))
        corners = kind.of(every, np.concatenate([corners.cube, found]))
        last, error = error, 0.5 * (high - corners.volume)
        if error <= accuracy * high or error > _LESS * last:
            break
    return ConvexHull(Estimate(corners.volume + error, error), corners, before)


def _climbed(
    tip_map: TipMap, cube: Array, normals: Array, enough: float, size: float
) -> tuple[Array, Array, Array]:
    """Climb along a normal each, by projected gradients [BarzilaiBorwein1988].

    Returns:
        Places (n, dimension), their tips (n, 3), and how far tips go along the normals at most
        (n,), by the slope that is left.
    """
    box, free, n = tip_map.box, tip_map.box.free, len(cube)
    best, tips, top, value = cube.copy(), np.full((n, 3), np.nan), np.empty(n), np.full(n, -np.inf)
    rows, at, step = np.arange(n), cube, np.zeros(n)
    last, last_slope = at, np.zeros_like(at)
    for number in range(_CLIMBS):
        moved, slopes = tip_map.tips_and_slopes(box.from_free_cube(at))
        slope = np.einsum("ni,nij->nj", normals[rows], slopes[:, :, free]) * box.widths[free]
        height = np.einsum("ni,ni->n", moved, normals[rows])
        left = np.maximum(slope * (1.0 - at), -slope * at).sum(axis=1)
        up = height > value[rows]  # not of NaN
        which = rows[up]
        value[which], best[which], tips[which] = height[up], at[up], moved[up]
        top[which] = height[up] + np.minimum(left[up], _FARTHEST * size)
        lengths = np.linalg.norm(slope, axis=1).clip(1e-300)
        if number == 0:
            step = _FIRST / lengths
        else:
            way, turn = at - last, last_slope - slope
            both = (way * turn).sum(axis=1)
            bent = both > 1e-12 * (way**2).sum(axis=1)
            size_of = (way**2 if number % 2 else turn * way).sum(axis=1)
            over = (turn * way if number % 2 else turn**2).sum(axis=1)
            step = np.where(bent, size_of / np.where(bent, over, 1.0).clip(1e-300), 4.0 * step)
            step = np.clip(step, 1e-3 / lengths, 1e3 / lengths)
        ahead = (at + step[:, None] * slope).clip(0.0, 1.0)
        go = (left > enough) & (np.abs(ahead - at).max(axis=1) > 1e-9)  # not of NaN
        rows, last, last_slope, step = rows[go], at[go], slope[go], step[go]
        at = ahead[go]
        if not len(rows):
            break
    return best, tips, np.where(np.isfinite(value), top, -np.inf)
