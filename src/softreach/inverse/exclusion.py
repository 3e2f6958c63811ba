"""Proof that a target is out of reach: a lower bound of its distance from the reachable set.

The distance of a target p from the linear image of a cell with center c and half widths h is
n·(p - r(c)) - Σ hj |n·Jj| at least, for any unit vector n, and its distance from the image no
smaller than that by more than the error of the linearization.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.inverse.bisection import (
    MOST_BUNDLES,
    Cells,
    CoarseCells,
    Linearized,
    least_of_cells,
)
from softreach.kernels.box_projection import project
from softreach.rod.tip_map import TipMap

__all__ = ["gap_bounds"]

Array = NDArray[np.float64]

_ENOUGH = 0.2  # of the gap of the best place: a bound that large ends the search
_MOST_CELLS = 20_000  # examined for one target
_MOST_OF_THREE = 4_000  # the same with three bundles or fewer, where a proof needs far fewer
_BLOCK = 10  # targets at once
_SOFTNESS = 1e-6  # of the linear problem that says in which direction the target lies


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

    def prove(rows: slice) -> None:
        proved = _of_block(rod, coarse, targets[rows], gap[rows])
        bounds[rows] = np.maximum(bounds[rows], proved)

    parallel.run(partial(prove, rows) for rows in parallel.blocks(len(targets), _BLOCK))
    return np.minimum(bounds, gap)


def _of_block(rod: TipMap, coarse: CoarseCells, targets: Array, gap: Array) -> Array:
    """Halve the cells of some targets until they are far enough away or too many."""
    near = [coarse.near(p, _ENOUGH * g) for p, g in zip(targets, gap, strict=True)]
    counts = np.array([len(rows) for rows in near])
    most = _most_cells(rod.box.dimension)
    few = counts <= most
    chosen = np.concatenate([rows[: len(rows) * ok] for rows, ok in zip(near, few, strict=True)])
    cells = Cells(np.repeat(np.arange(len(gap)), counts * few), coarse.center[chosen])
    enough = np.where(few, _ENOUGH * gap, 0.0)

    def bound(part: Cells, at: Linearized) -> Array:
        return _distances(targets[part.owner], at)

    return np.maximum(least_of_cells(rod, coarse.half, cells, enough, bound, most), 0.0)


def _most_cells(bundles: int) -> int:
    """How many cells may be examined for one target."""
    if bundles <= 3:
        return _MOST_OF_THREE
    return _MOST_CELLS if bundles <= MOST_BUNDLES else 0


def _distances(targets: Array, at: Linearized) -> Array:
    """How far each target is at least from the image of its cell, negative if it may be in it."""
    n, _, m = at.slopes.shape
    away, slopes = targets - at.tips, at.slopes * at.half
    softness = _SOFTNESS * (slopes**2).sum(axis=(1, 2)) + 1e-30
    inside, force = np.empty((n, m)), np.empty((n, 3))
    side = np.ones((n, m))
    project(np.zeros((n, m)), slopes, away, softness, -side, side, inside, force)
    size = np.linalg.norm(force, axis=1)
    normal = -force / np.where(size > 0, size, 1.0)[:, None]
    linear = np.einsum("ni,ni->n", normal, away)
    linear -= np.abs(np.einsum("ni,nij->nj", normal, slopes)).sum(axis=1)
    return linear - at.errors
