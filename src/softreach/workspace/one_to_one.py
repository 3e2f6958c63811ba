"""Whether three bundles reach each place by one activation alone: a test that is close to a proof.

A map of a box is one to one if det J keeps its sign in the box and no two points of the boundary
meet. Both are bounded on cells, from samples with a margin for what may lie between them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.rod.tip_map import TipMap
from softreach.workspace.faces import box_slopes
from softreach.workspace.meeting_faces import faces_meet
from softreach.workspace.tears import corner_values

__all__ = ["is_one_to_one"]

Array = NDArray[np.float64]

_CELLS = (4, 8, 16)  # along each axis; the first finds nearly every fold, for next to nothing
_MARGIN = 1.5  # on second differences, for those between the vertices


def is_one_to_one(rod: TipMap) -> bool:
    """Whether the map of a box of three free bundles is found to be one to one.

    False means that it is not or that this is not clear. Arms that may lose their stability are not
    judged: what is stable between samples is not known.
    """
    if rod.supports_unstable or rod.box.dimension != 3:
        return False
    for cells in _CELLS:
        slopes = _grid_slopes(rod, cells)
        stretch = np.linalg.det(slopes)
        if not stretch.min() * stretch.max() > 0.0:
            return False
        if cells == _CELLS[0] or not _keeps_sign(stretch):
            continue
        meet = faces_meet(rod, slopes)
        if meet is not None:
            return not meet
    return False


def _grid_slopes(rod: TipMap, cells: int) -> Array:
    """∂r/∂x at the vertices of a grid of the unit cube, (cells + 1, cells + 1, cells + 1, 3, 3)."""
    cube = np.indices((cells + 1,) * 3).reshape(3, -1).T / cells
    return box_slopes(rod, cube)[1].reshape(*(cells + 1,) * 3, 3, 3)


def _keeps_sign(stretch: Array) -> bool:
    """Whether det J has no zero within the cells either, shape (n + 1, n + 1, n + 1).

    A function differs from its trilinear interpolant by no more than the sum of its second
    differences over 8.
    """
    curved = np.zeros_like(stretch)
    for axis in range(3):
        second = np.abs(np.diff(stretch, 2, axis))
        curved += np.pad(second, [(int(other == axis),) * 2 for other in range(3)], "edge")
    least = np.abs(corner_values(stretch)).min(axis=-1)
    return bool((least > _MARGIN / 8.0 * corner_values(curved).max(axis=-1)).all())
