"""Whether the images of two different points of the boundary of a box meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.rod.tip_map import TipMap
from softreach.workspace.faces import box_slopes
from softreach.workspace.regular import RegularWindows

__all__ = ["faces_meet"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_FIRST = 4  # patches along each side of a face to begin with
_HALVINGS = 6
_MOST_PAIRS = 200_000
_MARGIN = 1.25  # on differences of slopes, for those between the vertices


class _Patches(NamedTuple):
    """Squares on the faces of the unit cube, seen from their centers."""

    center: Array
    """Shape (n, 3)."""
    half: Array
    """Half widths along the three axes, one of them 0, shape (n, 3)."""
    tips: Array
    """Images of the centers [m], shape (n, 3)."""
    slopes: Array
    """∂r/∂x there [m], shape (n, 3, 3)."""


def faces_meet(rod: TipMap, slopes: Array) -> bool | None:
    """Whether images of different points of the boundary of the box of three bundles may meet.

    Pairs of patches of the six faces are halved until each is settled: by a plane between both
    images, or because a window of the box that holds both patches is mapped one to one.

    Args:
        rod: The tip map.
        slopes: ∂r/∂x at a grid of the unit cube [m], shape (n + 1, n + 1, n + 1, 3, 3).

    Returns:
        None if the grid is too coarse to tell.
    """
    windows, bend = RegularWindows(slopes), _largest_bend(slopes)
    if windows.any_hopeless():
        return None
    side = _FIRST
    first, second = np.triu_indices(6 * side * side)
    for _ in range(_HALVINGS):
        which, a, b = _each_once(first, second, 6 * side * side)
        patches = _patches(rod, which, side)
        left = ~_parted(patches, a, b, bend)
        first, second, a, b = first[left], second[left], a[left], b[left]
        regular, hopeless = windows.hold(*_hull(patches, a, b))
        if hopeless.any():
            return None
        first, second = _halved(first[~regular], second[~regular], side)
        side *= 2
        if not len(first):
            return False
        if len(first) > _MOST_PAIRS:
            return True
    return True


def _each_once(first: Ints, second: Ints, size: int) -> tuple[Ints, Ints, Ints]:
    """Numbers below `size` that occur in pairs, and where among them the pairs are found."""
    used = np.zeros(size, bool)
    used[first] = used[second] = True
    place = np.cumsum(used) - 1
    return np.flatnonzero(used), place[first], place[second]


def _largest_bend(slopes: Array) -> Array:
    """The largest |∂²r/∂xj∂xk| on the grid [m], shape (3, 3)."""
    n = len(slopes) - 1
    found = [np.linalg.norm(np.diff(slopes, axis=k), axis=-2).max(axis=(0, 1, 2)) for k in range(3)]
    return _MARGIN * n * np.array(found)


def _patches(rod: TipMap, which: Ints, side: int) -> _Patches:
    """Patches by number: face, row and column."""
    face, row, column = which // side**2, which // side % side, which % side
    axis, at, rows = face // 2, (face % 2).astype(float), np.arange(len(which))
    center, half = np.empty((len(which), 3)), np.full((len(which), 3), 0.5 / side)
    center[rows, axis], half[rows, axis] = at, 0.0
    center[rows, (axis + 1) % 3] = (row + 0.5) / side
    center[rows, (axis + 2) % 3] = (column + 0.5) / side
    return _Patches(center, half, *box_slopes(rod, center))


def _parted(patches: _Patches, a: Ints, b: Ints, bend: Array) -> NDArray[np.bool_]:
    """Whether a plane parts the images of two patches, shape (pairs,).

    Tried are planes along either of them, and across the line between their centers.
    """
    sides = patches.slopes * patches.half[:, None, :]  # of parallelograms, halved
    rest = 0.5 * np.einsum("ij,jk,ik->i", patches.half, bend, patches.half)
    radius = np.linalg.norm(sides, axis=1).sum(axis=1) + rest
    between = patches.tips[b] - patches.tips[a]
    found = np.linalg.norm(between, axis=1) > radius[a] + radius[b]
    normal = _normals(patches)
    # Along its own plane a patch reaches no farther than by its bend.
    for direction, tilted in ((between, (a, b)), (normal[a], (b,)), (normal[b], (a,))):
        left = np.flatnonzero(~found)
        unit = direction[left] / np.linalg.norm(direction[left], axis=1).clip(1e-300)[:, None]
        reach = rest[a[left]] + rest[b[left]]
        for each in tilted:
            reach += np.abs(unit[:, None, :] @ sides[each[left]]).sum(axis=(1, 2))
        found[left] = np.abs((unit * between[left]).sum(axis=1)) > reach
    return found


def _normals(patches: _Patches) -> Array:
    rows, axis = np.arange(len(patches.half)), np.argmin(patches.half, axis=1)
    first = patches.slopes[rows, :, (axis + 1) % 3]
    return np.cross(first, patches.slopes[rows, :, (axis + 2) % 3])


def _hull(patches: _Patches, a: Ints, b: Ints) -> tuple[Array, Array]:
    """Lowest and highest corner of the boxes that hold both patches, shape (pairs, 3) each."""
    low, high = patches.center - patches.half, patches.center + patches.half
    return np.minimum(low[a], low[b]), np.maximum(high[a], high[b])


def _halved(first: Ints, second: Ints, side: int) -> tuple[Ints, Ints]:
    """All pairs of the quarters of two patches, each once."""
    a, b = (_quarters(each, side) for each in (first, second))
    pairs = np.stack(np.broadcast_arrays(a[:, :, None], b[:, None, :]), axis=-1).reshape(-1, 2)
    pairs = pairs[pairs[:, 0] <= pairs[:, 1]] if len(pairs) else pairs
    return pairs[:, 0], pairs[:, 1]


def _quarters(which: Ints, side: int) -> Ints:
    face, row, column = which // side**2, which // side % side, which % side
    rows = 2 * row[:, None] + np.array([0, 0, 1, 1])
    columns = 2 * column[:, None] + np.array([0, 1, 0, 1])
    return (face[:, None] * 2 * side + rows) * 2 * side + columns
