"""Proofs by branch and bound that no activation reaches a target with less change.

Cells of the activation box are made smaller by what the target and the change leave of them, and
those that remain are halved, until none can hold a smaller change.

In the cells that all targets share the tip is linear but for an error that is known beforehand. In
those that remain of them it is quadratic, and what is left of the third order.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from softreach.inverse.proofs import MOST_BUNDLES, CoarseCells
from softreach.kernels.box.change_bounds import contract
from softreach.rod.linearization import CubicRemainder
from softreach.rod.tip_map import TipMap
from softreach.support import parallel
from softreach.support.arrays import Array, Index, rows

SLACK = 1e-6  # by which a bound may fall short of the change that it proves to be least
_AIM = 0.9 * SLACK  # where a search ends: rounding is not to decide
_MOST_CELLS = 60_000  # examined for one target
_TARGET_BLOCK = 16  # targets at once
_CELL_BLOCK = 4_096  # cells at once
_STEP = 1e-7  # of differences of slopes, in widths of the box
_ROUNDING = 1e-12  # of tips, in L


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
        coarse.cubic_remainder  # noqa: B018, before threads ask for it
        enough = np.maximum(change - _AIM, 0.0)

        def prove(rows: slice) -> None:
            asked = _Asked(targets[rows], near[rows], enough[rows])
            bounds[rows] = np.maximum(bounds[rows], _least(rod, coarse, asked))

        parallel.run(partial(prove, rows) for rows in parallel.blocks(len(targets), _TARGET_BLOCK))
    return np.minimum(bounds, change)


class _Asked(NamedTuple):
    """What is to be proved of some targets."""

    targets: Array
    """Shape (t, 3) [m]."""
    near: Array
    """Shape (t, m) [-]."""
    enough: Array
    """Bounds at which a cell is done [-], shape (t,)."""


class _Boxes(NamedTuple):
    """Parts of cells, each of interest for one target."""

    owner: Index
    """Number of the target, shape (n,)."""
    cell: Index
    """Number of the cell in which it lies, shape (n,)."""
    center: Array
    """Activation [-], shape (n, m)."""
    half: Array
    """Half widths [-], shape (n, m)."""
    multiplier: Array
    """That of the best bound of what it is a part of, shape (n, 3)."""


class _Model(NamedTuple):
    """The tip map in boxes: quadratic but for an error."""

    tips: Array
    """At the centers [m], shape (n, 3)."""
    slopes: Array
    """∂r/∂γ there [m], shape (n, 3, m)."""
    seconds: Array
    """∂²r/∂γ² there [m], shape (n, 3, m, m)."""
    errors: Array
    """Bounds of what that leaves [m], shape (n,)."""


def _least(rod: TipMap, coarse: CoarseCells, asked: _Asked) -> Array:
    """A lower bound for each target over all activations, `enough` at most."""
    least, count = asked.enough.copy(), len(asked.enough)
    boxes, spent = _smaller_cells(coarse, asked), np.zeros(count, np.int64)
    remainder = coarse.cubic_remainder
    while len(boxes.owner):
        owner, axis = boxes.owner, np.empty(len(boxes.owner), np.int64)
        bounds = np.empty(len(owner))
        for first in range(0, len(owner), _CELL_BLOCK):
            block = slice(first, first + _CELL_BLOCK)
            part = rows(boxes, block)
            _contract(part, _quadratic(rod, remainder, part), asked, bounds[block], axis[block])
        spent += np.bincount(owner, minlength=count)
        left = bounds < asked.enough[owner]
        most = spent + 2 * np.bincount(owner[left], minlength=count)
        hopeless = left & (most > _MOST_CELLS)[owner]
        np.minimum.at(least, owner[hopeless], bounds[hopeless])
        left &= ~hopeless
        boxes = _halved(rows(boxes, left), axis[left])
    return least


def _smaller_cells(coarse: CoarseCells, asked: _Asked) -> _Boxes:
    """What the linear part leaves of the cells that all targets share."""
    cells = [_within(coarse, *case) for case in zip(*asked, strict=True)]
    cell, owner = np.concatenate(cells), np.repeat(np.arange(len(cells)), [*map(len, cells)])
    n, m = len(cell), len(coarse.half)
    half = np.tile(coarse.half, (n, 1))
    boxes = _Boxes(owner, cell, coarse.center[cell], half, np.zeros((n, 3)))
    slopes, seconds = coarse.slopes[cell] / coarse.half, np.zeros((n, 3, m, m))
    model = _Model(coarse.tips[cell], slopes, seconds, coarse.errors[cell])
    bounds = np.empty(n)
    _contract(boxes, model, asked, bounds, np.empty(n, np.int64))
    return rows(boxes, bounds < asked.enough[owner])


def _within(coarse: CoarseCells, target: Array, near: Array, change: float) -> Index:
    """Numbers of the cells that may reach a target by less than a change."""
    cells = coarse.near(target, 0.0)
    away = np.maximum(np.abs(coarse.center[cells] - near) - coarse.half, 0.0)
    return cells[np.linalg.norm(away, axis=1) < change]


def _quadratic(rod: TipMap, remainder: CubicRemainder, boxes: _Boxes) -> _Model:
    """The tip map in boxes; on the calling thread.

    Differences of slopes over so short a step miss second derivatives by less than what the
    remainder leaves for quadrature and rounding.
    """
    n, m = boxes.center.shape
    step = _STEP * rod.box.widths
    moved = np.repeat(boxes.center[:, None], m + 1, axis=1)
    moved[:, 1:] += np.diag(step)
    tips, slopes = np.empty((n * (m + 1), 3)), np.empty((n * (m + 1), 3, m))
    rod.fill(moved.reshape(-1, m), tips, slopes)
    slopes = slopes.reshape(n, m + 1, 3, m)
    seconds = (slopes[:, 1:] - slopes[:, :1]).transpose(0, 2, 1, 3) / step[:, None]
    seconds = 0.5 * (seconds + seconds.transpose(0, 1, 3, 2))
    errors = remainder.errors(boxes.cell, boxes.half) + _ROUNDING * rod.length
    tips, slopes = tips[:: m + 1].copy(), slopes[:, 0].copy()
    return _Model(tips, slopes, seconds, errors)


def _contract(boxes: _Boxes, model: _Model, asked: _Asked, bounds: Array, axis: Index) -> None:
    """Make boxes smaller in place, and put bounds and the axes to halve next into place."""
    targets, near, enough = (values[boxes.owner] for values in asked)
    contract(*boxes[2:], *model, targets, near, enough, bounds, axis)


def _halved(boxes: _Boxes, axis: Index) -> _Boxes:
    """Both halves of every box."""
    halves, row = rows(boxes, np.repeat(np.arange(len(axis)), 2)), np.arange(2 * len(axis))
    axis = np.repeat(axis, 2)
    halves.half[row, axis] *= 0.5
    halves.center[row, axis] += np.where(row % 2, 1.0, -1.0) * halves.half[row, axis]
    return halves
