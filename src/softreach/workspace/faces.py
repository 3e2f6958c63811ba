"""The six faces of the box of three free bundles: nodes, tips, and what flows through them."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.rod.stable_tips import stable_tips
from softreach.rod.tip_map import TipMap

__all__ = ["FaceNodes", "box_slopes", "gauss_faces", "grid_faces"]

Array = NDArray[np.float64]


class FaceNodes(NamedTuple):
    """Nodes of a rule of integration on the faces of the unit cube, each face in one block."""

    cube: Array
    """Places, shape (n, 3)."""
    weights: Array
    """Of each node, shape (n,); they add up to 1 on each face."""
    sense: Array
    """1 on faces at 1, -1 on those at 0: where the cross product of sides points, shape (n,)."""
    axis: NDArray[np.int64]
    """Which axis the face is normal to, shape (n,)."""

    def area_vectors(self, slopes: Array) -> Array:
        """∂r/∂a × ∂r/∂b outwards, times the weights [m²], shape (n, 3).

        The map is taken to keep the orientation.

        Args:
            slopes: ∂r/∂x of the unit cube at the nodes [m], shape (n, 3, 3).
        """
        rows = np.arange(len(slopes))
        first = slopes[rows, :, (self.axis + 1) % 3]
        second = slopes[rows, :, (self.axis + 2) % 3]
        return (self.sense * self.weights)[:, None] * np.cross(first, second)


@lru_cache(maxsize=8)
def gauss_faces(nodes: int) -> FaceNodes:
    """Gauss and Legendre's nodes on all six faces, as many along each side."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    return _on_faces((1.0 + x) / 2.0, w / 2.0)


def grid_faces(cells: int) -> Array:
    """Vertices of a grid of cells^3 boxes that lie on the faces of the unit cube, each once."""
    inside = np.indices((cells + 1,) * 3).reshape(3, -1).T
    outer = ((inside == 0) | (inside == cells)).any(axis=1)
    return inside[outer] / cells


def box_slopes(rod: TipMap, cube: Array) -> tuple[Array, Array]:
    """Tips [m] and their derivatives by places in the unit cube of the free bundles.

    Args:
        rod: The tip map.
        cube: Places in [0, 1], shape (n, dimension).

    Returns:
        Shapes (n, 3) and (n, 3, dimension); NaN where there is no stable equilibrium.
    """
    tips, slopes = stable_tips(rod).tips_and_slopes(rod.box.from_free_cube(cube))
    free = rod.box.free
    return tips, slopes[:, :, free] * rod.box.widths[free]


def _on_faces(ticks: Array, weights: Array) -> FaceNodes:
    a, b = (each.ravel() for each in np.meshgrid(ticks, ticks, indexing="ij"))
    both = np.outer(weights, weights).ravel()
    blocks = []
    for axis in range(3):
        for side in (0.0, 1.0):
            cube = np.empty((len(a), 3))
            cube[:, axis], cube[:, (axis + 1) % 3], cube[:, (axis + 2) % 3] = side, a, b
            blocks.append((cube, both, np.full(len(a), 2 * side - 1), np.full(len(a), axis)))
    cube, all_weights, sense, axis = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    return FaceNodes(cube, all_weights, sense, axis)
