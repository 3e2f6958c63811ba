"""The boundary of what a one-to-one map fills: the image of the six faces of the activation box."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.surface import Surface
from softreach.rod.stable_tips import stable_tips
from softreach.rod.tip_map import TipMap
from softreach.workspace.faces import grid_faces

__all__ = ["face_image"]

_CELLS = 96  # along each edge of the box: an arm that bends by half a turn moves 2 degrees a cell


def face_image(rod: TipMap, cells: int = _CELLS) -> Surface | None:
    """The closed image of the surface of the box of three free bundles, oriented outwards.

    Its vertices lie on the boundary to the tolerance of the tips, and so do its edges where the box
    has edges: sharp rims stay sharp, and parts of any thinness stay whole.

    Args:
        rod: A tip map that is one to one inside the box.
        cells: Of the grid along each edge of the box.

    Returns:
        None if some activation on the faces has no stable equilibrium.
    """
    cube = grid_faces(cells)
    tips = stable_tips(rod).tips(rod.box.from_free_cube(cube))
    if not np.isfinite(tips).all():
        return None
    found = Surface(vertices=tips, faces=_face_triangles(cube, cells))
    if found.volume < 0:  # the map turns the box over
        found = Surface(vertices=tips, faces=found.faces[:, ::-1].copy())
    return found


def _face_triangles(cube: NDArray[np.float64], cells: int) -> NDArray[np.int32]:
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
