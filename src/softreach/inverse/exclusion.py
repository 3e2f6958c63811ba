"""Proof that a target is out of reach: a lower bound of its distance from the reachable set.

On a cell of the activation box with center c and half widths h the tip lies within E(h) of its
linearization, `TipMap.linearization_error`. The distance of a target from the linear image is
n·(p - r(c)) - Σ hj |n·Jj| at least, for any unit vector n. Cells that this bound keeps far enough
away are done; the others are halved. What is left when the effort is spent still has a bound.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.box_projection import project
from softreach.kernels.cell_cover import near_cells
from softreach.rod.tip_map import TipMap

__all__ = ["CoarseCells", "gap_bounds"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_COARSE = 70_000  # cells that all targets share
_ENOUGH = 0.2  # of the gap of the best place: a bound that large ends the search
_MOST_CELLS = 20_000  # examined for one target
_MOST_OF_THREE = 4_000  # the same with three bundles or fewer, where a proof needs far fewer
_MOST_BUNDLES = 6  # with more, halving cells proves nothing that can be afforded
_BLOCK = 200_000  # cells at once
_ROUNDING = 1e-12  # of tips, in L
_SOFTNESS = 1e-6  # of the linear problem that says in which direction the target lies


class CoarseCells:
    """The box in even cells with what all targets ask of them."""

    def __init__(self, rod: TipMap) -> None:
        box, m = rod.box, rod.box.dimension
        side = max(1, int(_COARSE ** (1 / max(m, 1)) + 1e-9))
        places = np.indices((side,) * m).reshape(m, side**m).T
        cube = (places + 0.5) / side
        self.center, self.half = box.from_cube(cube), 0.5 * box.widths / side
        self.tips, slopes = rod.tips_and_slopes(self.center)
        self.slopes = slopes * self.half
        self.radii = np.linalg.norm(self.slopes, axis=1).sum(axis=1)
        self.error = rod.linearization_error(self.half) + _ROUNDING * rod.length

    def near(self, target: Array, distance: float) -> Index:
        """Numbers of the cells whose tips may come so near to a target."""
        room = np.empty(len(self.center), np.int64)
        count = near_cells(self.tips, self.slopes, self.radii, self.error, target, distance, room)
        return room[:count]


class _Cells(NamedTuple):
    """Cells of equal shape that may hold what is nearest to their target."""

    owner: Index
    """Number of the target, ascending, shape (n,)."""
    center: Array
    """Activation [-], shape (n, m)."""


def gap_bounds(rod: TipMap, coarse: CoarseCells, targets: Array, gap: Array) -> Array:
    """A lower bound of the distance of each target from everything that the box reaches.

    Args:
        rod: The tip map.
        coarse: Its cells.
        targets: Shape (t, 3) [m].
        gap: How near to each the best place known is [m], shape (t,).

    Returns:
        Bounds [m], shape (t,); 0 where nothing is proved.
    """
    if rod.box.dimension == 0:
        return gap.copy()  # one place is reached
    bounds = np.maximum(np.linalg.norm(targets, axis=1) - rod.farthest(), 0.0)
    most = max(1, _BLOCK // _MOST_CELLS)
    for first in range(0, len(targets), most):
        rows = slice(first, first + most)
        proved = _of_block(rod, coarse, targets[rows], gap[rows])
        bounds[rows] = np.maximum(bounds[rows], proved)
    return np.minimum(bounds, gap)


def _of_block(rod: TipMap, coarse: CoarseCells, targets: Array, gap: Array) -> Array:
    """Halve the cells of some targets until they are far enough away or too many."""
    count = len(targets)
    near = [coarse.near(p, _ENOUGH * g) for p, g in zip(targets, gap, strict=True)]
    counts = np.array([len(rows) for rows in near])
    half = coarse.half
    proved = _ENOUGH * gap  # the least bound of all cells that are done
    most = _most_cells(rod.box.dimension)
    many = counts > most
    proved[many] = 0.0
    near = [np.empty(0, np.int64) if no else rows for no, rows in zip(many, near, strict=True)]
    counts[many] = 0
    cells = _Cells(np.repeat(np.arange(count), counts), coarse.center[np.concatenate(near)])
    spent = np.zeros(count, np.int64)
    while len(cells.owner):
        bound = _bounds(rod, targets[cells.owner], cells.center, half)
        spent += np.bincount(cells.owner, minlength=count)
        far = bound >= _ENOUGH * gap[cells.owner]
        hopeless = spent + 2 * np.bincount(cells.owner[~far], minlength=count) > most
        done = far | hopeless[cells.owner]
        np.minimum.at(proved, cells.owner[done], np.maximum(bound[done], 0.0))
        cells = _Cells(cells.owner[~done], cells.center[~done])
        if not len(cells.owner):
            break
        half, cells = _halved(rod, half, cells)
    return proved


def _most_cells(bundles: int) -> int:
    """How many cells may be examined for one target."""
    if bundles <= 3:
        return _MOST_OF_THREE
    return _MOST_CELLS if bundles <= _MOST_BUNDLES else 0


def _halved(rod: TipMap, half: Array, cells: _Cells) -> tuple[Array, _Cells]:
    """Both halves of every cell, along the axis that leaves least error."""
    errors = []
    for j in range(len(half)):
        thinner = half.copy()
        thinner[j] *= 0.5
        errors.append(rod.linearization_error(thinner))
    axis = int(np.argmin(errors))
    half = half.copy()
    half[axis] *= 0.5
    center = np.repeat(cells.center, 2, axis=0)
    center[0::2, axis] -= half[axis]
    center[1::2, axis] += half[axis]
    return half, _Cells(np.repeat(cells.owner, 2), center)


def _bounds(rod: TipMap, targets: Array, center: Array, half: Array) -> Array:
    """How far each target is at least from the image of its cell, negative if it may be in it."""
    n, m = center.shape
    tips, slopes = rod.tips_and_slopes(center)
    away, slopes = targets - tips, slopes * half
    softness = _SOFTNESS * (slopes**2).sum(axis=(1, 2)) + 1e-30
    inside, force = np.empty((n, m)), np.empty((n, 3))
    side = np.ones((n, m))
    project(np.zeros((n, m)), slopes, away, softness, -side, side, inside, force)
    size = np.linalg.norm(force, axis=1)
    normal = -force / np.where(size > 0, size, 1.0)[:, None]
    linear = np.einsum("ni,ni->n", normal, away)
    linear -= np.abs(np.einsum("ni,nij->nj", normal, slopes)).sum(axis=1)
    return linear - rod.linearization_error(half) - _ROUNDING * rod.length
