"""Proof that no activation changes less: a lower bound of |γ - near| over all that reach a target.

Where tips lie within e of their linearization at the center c of a cell, every activation x of the
cell that reaches p has |A x - b| <= e with A = J(c) and b = p - r(c) + A c. The least change under
this condition alone is bounded from below by its dual of three unknowns, `kernels.change_bounds`.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.inverse.bisection import MOST_BUNDLES, Cells, CoarseCells, Linearized, least_of_cells
from softreach.kernels import change_bounds as dual
from softreach.rod.tip_map import TipMap

__all__ = ["SLACK", "change_bounds"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SLACK = 1e-6  # by which a bound may fall short of the change that it proves to be least
_AIM = 0.9 * SLACK  # where a search ends: rounding is not to decide
_MOST_CELLS = 100_000  # examined for one target
_BLOCK = 16  # targets at once


def change_bounds(
    rod: TipMap, coarse: CoarseCells, targets: Array, near: Array, change: Array
) -> Array:
    """A lower bound of |γ - near| over all activations that reach each target.

    Args:
        rod: The tip map.
        coarse: Its cells.
        targets: Shape (t, 3) [m].
        near: Shape (t, m) [-].
        change: |γ - near| of the best activation known [-], shape (t,).

    Returns:
        Shape (t,) [-]: at least `change - SLACK` where that one is proved to be the least.
    """
    # No activation within the bounds is nearer than the one nearest to `near`, wherever its tip.
    bounds = np.linalg.norm(near - rod.box.clip(near), axis=1)
    if rod.box.dimension <= MOST_BUNDLES and np.isfinite(rod.linearization_error(coarse.half)):
        enough = np.maximum(change - _AIM, 0.0)

        def prove(rows: slice) -> None:
            proved = _of_block(rod, coarse, targets[rows], near[rows], enough[rows])
            bounds[rows] = np.maximum(bounds[rows], proved)

        parallel.run(partial(prove, rows) for rows in parallel.blocks(len(targets), _BLOCK))
    return np.minimum(bounds, change)


def _of_block(
    rod: TipMap, coarse: CoarseCells, targets: Array, near: Array, enough: Array
) -> Array:
    """Halve the cells of some targets until none may change less, or there are too many."""
    rows = [_within(coarse, *case) for case in zip(targets, near, enough, strict=True)]
    owner = np.repeat(np.arange(len(targets)), [len(numbers) for numbers in rows])
    cells = Cells(owner, coarse.center[np.concatenate(rows)])

    def bound(part: Cells, at: Linearized) -> Array:
        one = part.owner
        return _of_cells(targets[one], near[one], enough[one], part.center, at)

    return least_of_cells(rod, coarse.half, cells, enough, bound, _MOST_CELLS)


def _within(coarse: CoarseCells, target: Array, near: Array, change: float) -> Index:
    """Numbers of the cells that may reach a target by less than a change."""
    rows = coarse.near(target, 0.0)
    away = np.maximum(np.abs(coarse.center[rows] - near) - coarse.half, 0.0)
    return rows[np.linalg.norm(away, axis=1) < change]


def _of_cells(targets: Array, near: Array, enough: Array, center: Array, at: Linearized) -> Array:
    """The bound for each cell, `enough` at most, shape (n,)."""
    wanted = targets - at.tips + np.einsum("nij,nj->ni", at.slopes, center)
    low, high, found = center - at.half, center + at.half, np.empty(len(center))
    dual.change_bounds(near, at.slopes, wanted, at.errors, low, high, enough, found)
    return found
