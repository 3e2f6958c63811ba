"""Corners of the convex hull of an image, and what moving them does to its volume."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.hull import convex_hull
from softreach.rod.stable_tips import stable_tips
from softreach.rod.tip_map import TipMap
from softreach.workspace.faces import grid_faces
from softreach.workspace.solid import ReachableSolid

__all__ = ["HullCorners", "hull_corners"]

Array = NDArray[np.float64]

_MOST_CELLS = 48  # of a grid of which all vertices are looked at
_MOST_FACE_CELLS = 84  # of one of which those on the faces are


class HullCorners(NamedTuple):
    """Activations whose tips are the corners of a convex hull."""

    cube: Array
    """In the unit cube of the free bundles, shape (n, 3)."""
    area: Array
    """∂V_convex/∂r of each corner [m²], shape (n, 3)."""


def hull_corners(solid: ReachableSolid) -> dict[int, HullCorners]:
    """Corners of the hulls of images of some grids, by their number of cells along each axis.

    Where the image folds, vertices inside the box may be corners as well as those on its faces.
    """
    folds = solid.route != "flux"
    most = _MOST_CELLS if folds else _MOST_FACE_CELLS
    grids = (most // 2, 3 * most // 4, most)
    return {n: _corners(solid.tip_map, _grid(n) if folds else grid_faces(n)) for n in grids}


def _grid(cells: int) -> Array:
    return np.indices((cells + 1,) * 3).reshape(3, -1).T / cells


def _corners(rod: TipMap, cube: Array) -> HullCorners:
    tips = stable_tips(rod).tips(rod.box.from_free_cube(cube))
    hull = convex_hull(tips)
    area = np.zeros_like(hull.vertices)
    corners = (hull.vertices - hull.vertices.mean(axis=0))[hull.faces]
    for k in range(3):
        # The volume is a sum of triple products over 6: linear in each corner.
        share = np.cross(corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]) / 6.0
        np.add.at(area, hull.faces[:, k], share)
    return HullCorners(cube[_rows_of(hull.vertices, tips)], area)


def _rows_of(some: Array, every: Array) -> NDArray[np.int64]:
    """Where in a list of points some of them are; one place for those that come twice."""
    from scipy.spatial import KDTree  # lazily

    return np.asarray(KDTree(every).query(some)[1], np.int64)
