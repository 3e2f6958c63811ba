"""Proofs by branch and bound, over halved cells of the box, that no tip is nearer to a target."""

from __future__ import annotations

from functools import partial

import numpy as np

from softreach.kernels.box.box_projection import near_cells, project
from softreach.rod.tip_map import TipMap, TipOutputs
from softreach.support import parallel
from softreach.support.arrays import Array, Index

_MOST_BUNDLES = 6  # with more, halving cells proves nothing that can be afforded
_COARSE = 70_000  # cells that all targets share
_ROUNDING = 1e-12  # of tips, in L
_BLOCK = 16_384  # cells at once
_ENOUGH = 0.2  # of the way from the reach_tol to the gap: a bound that large ends the search
_MOST_EXCLUSION_CELLS = 20_000  # examined for one target
_MOST_OF_THREE = 4_000  # the same with three bundles or fewer, where a proof needs far fewer
_TARGET_BLOCK = 10  # targets at once
_SOFTNESS = 1e-6  # of the linear problem that says in which direction the target lies


def gap_bounds(
    tip_map: TipMap, coarse: CoarseCells, targets: Array, gap: Array, reach_tol: float
) -> Array:
    """Lower bounds (t,) of the distance of targets (t, 3) from all that the box reaches [m].

    The distance of a target p from the linear image of a cell with center c and half widths h is
    n·(p - r(c)) - Σ hj |n·Jj| at least, for any unit vector n, and its distance from the image no
    smaller by more than `TipMap.linearization_errors`. Bounds are 0 where nothing is proved, and
    no larger than the gap of the best place known; below `reach_tol` they prove nothing of the arm.
    """
    if tip_map.box.dimension == 0:
        return gap.copy()  # one place is reached
    from_base = np.linalg.norm(targets - np.array(tip_map.pose.position), axis=1)
    bounds = np.maximum(from_base - tip_map.farthest(), 0.0)
    enough = reach_tol + _ENOUGH * (gap - reach_tol)

    def prove(rows: slice) -> None:
        proved = _exclusion_of_block(tip_map, coarse, targets[rows], enough[rows])
        bounds[rows] = np.maximum(bounds[rows], proved)

    parallel.run(partial(prove, rows) for rows in parallel.blocks(len(targets), _TARGET_BLOCK))
    return np.minimum(bounds, gap)


class CoarseCells:
    """The box in even cells with what all targets ask of them."""

    def __init__(self, tip_map: TipMap) -> None:
        box, m = tip_map.box, tip_map.box.dimension
        side = max(1, int(_COARSE ** (1 / max(m, 1)) + 1e-9))
        places = np.indices((side,) * m).reshape(m, side**m).T
        cube = (places + 0.5) / side
        self.center, self.half = box.from_cube(cube), 0.5 * box.widths / side
        self.tips, slopes = tip_map.tips_and_slopes(self.center)
        self.errors = _errors(tip_map, self.center, self.half)
        self.slopes = slopes * self.half
        self.radii = np.linalg.norm(self.slopes, axis=1).sum(axis=1)

    def near(self, target: Array, distance: float) -> Index:
        """Numbers of the cells whose tips may come so near to a target."""
        room = np.empty(len(self.center), np.int64)
        count = near_cells(self.tips, self.slopes, self.radii, self.errors, target, distance, room)
        return room[:count]


def _exclusion_of_block(
    tip_map: TipMap, coarse: CoarseCells, targets: Array, enough: Array
) -> Array:
    """Halve the cells of some targets until they are far enough away or too many."""
    near = [coarse.near(*case) for case in zip(targets, enough, strict=True)]
    counts = np.array([len(rows) for rows in near])
    most = _MOST_EXCLUSION_CELLS if tip_map.box.dimension <= _MOST_BUNDLES else 0
    most = _MOST_OF_THREE if tip_map.box.dimension <= 3 else most
    few = counts <= most
    owner, half = np.repeat(np.arange(len(enough)), counts * few), coarse.half
    kept = [cells[: len(cells) * ok] for cells, ok in zip(near, few, strict=True)]
    center = coarse.center[np.concatenate(kept)]
    least = np.where(few, enough, 0.0)
    spent = np.zeros(len(enough), np.int64)
    while len(owner):
        blocks = parallel.blocks(len(owner), _BLOCK)
        each = [_distances(tip_map, half, center[b], targets[owner[b]]) for b in blocks]
        bounds = np.concatenate(each)
        spent += np.bincount(owner, minlength=len(enough))
        left = bounds < enough[owner]
        halves = np.bincount(owner[left], minlength=len(enough)) * 2
        hopeless = left & (spent + halves > most)[owner]
        np.minimum.at(least, owner[hopeless], bounds[hopeless])
        left &= ~hopeless
        # Both halves of each cell along the axis of least error.
        thinner = np.where(np.eye(len(half), dtype=bool), 0.5 * half, half)
        axis = int(np.argmin([tip_map.linearization_error(widths) for widths in thinner]))
        half, center = thinner[axis], np.repeat(center[left], 2, axis=0)
        center[0::2, axis] -= half[axis]
        center[1::2, axis] += half[axis]
        owner = np.repeat(owner[left], 2)
    return np.maximum(least, 0.0)


def _distances(tip_map: TipMap, half: Array, center: Array, targets: Array) -> Array:
    """Least distance of each target from its cell's image, negative if it may be in it."""
    n, m = center.shape
    tips, slopes = np.empty((n, 3)), np.empty((n, 3, m))
    tip_map.fill(center, TipOutputs(tips, slopes))
    away, slopes = targets - tips, slopes * half
    softness = _SOFTNESS * (slopes**2).sum(axis=(1, 2)) + 1e-30
    force, side = np.zeros((n, 3)), np.ones((n, m))
    project(np.zeros_like(side), slopes, away, softness, -side, side, np.empty_like(side), force)
    size = np.linalg.norm(force, axis=1)
    normal = -force / np.where(size > 0, size, 1.0)[:, None]
    linear = np.einsum("ni,ni->n", normal, away)
    linear -= np.abs(np.einsum("ni,nij->nj", normal, slopes)).sum(axis=1)
    return linear - _errors(tip_map, center, half)


def _errors(tip_map: TipMap, center: Array, half: Array) -> Array:
    return tip_map.linearization_errors(center, half) + _ROUNDING * tip_map.length
