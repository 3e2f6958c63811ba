"""Branches of equilibria, followed along ways of activations or loads.

A step along a way predicts how the nodes of an arm see the world by the slope of the last one,
and corrects that by Newton's method. It counts where the correction is small, of the frames and of
the tip, and where the equilibrium is stable; otherwise it is tried at half its length.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.rod.loaded.shooting import ALL_LOADS, Shots, turn_between, units

if TYPE_CHECKING:
    from softreach.rod.loaded.solver import Solver

__all__ = ["Followed", "follow"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_CORRECTION, _CORRECTION_OF_NODES = 0.12, 0.03  # [rad], of one segment and of several
_TIP = 3.0  # weight of the correction of a tip [rad/L]
_SHORTEST = 2.0**-20  # of a path, below which its branch has ended
_MOST_STEPS = 3000


class Followed(NamedTuple):
    """Branches as far as they were followed."""

    shots: Shots
    """The last equilibrium; found where it is that of the end of the way."""
    has_ended: Mask
    """Mask of branches that end before the way does, shape (n,)."""
    share: Array
    """Of the way that was followed, shape (n,)."""


def follow(
    solver: Solver,
    begin: Array,
    end: Array,
    start: Shots,
    slope: Array | None = None,
    *,
    hangs: bool = True,
    shortest: float = _SHORTEST,
) -> Followed:
    """Branches of stable equilibria along straight ways between activations, each by itself.

    Args:
        solver: That of the arm.
        begin: Activations, shape (n, bundles).
        end: Others.
        start: Equilibria at the beginning.
        slope: Change of the frame along the way, if it is known, shape (n, component).
        hangs: Whether the loads are on; if not, they are put on along the way.
        shortest: Step, over the length of the way, below which a branch has ended.
    """
    n, length = len(begin), solver.tables.arm.length
    allowed = _CORRECTION if solver.tables.segments == 1 else _CORRECTION_OF_NODES
    tips, frame, margin = start.tips.copy(), start.frame.copy(), start.margin.copy()
    place, step = np.where(hangs & (begin == end).all(axis=1), 1.0, 0.0), np.ones(n)
    slopes = np.zeros_like(frame) if slope is None else slope.copy()
    moves, steps_known = np.zeros((n, 3)), np.zeros(n, int)
    ended = ~start.is_found
    for _ in range(_MOST_STEPS):
        rows = np.flatnonzero(~ended & (place < 1.0))
        if not len(rows):
            break
        to = np.minimum(1.0, place[rows] + step[rows])
        h = to - place[rows]
        guess = units(frame[rows] + h[:, None] * slopes[rows])
        gamma = begin[rows] + to[:, None] * (end[rows] - begin[rows])
        found = solver.careful(gamma, guess, ALL_LOADS if hangs else to)
        with np.errstate(all="ignore"):  # of what is not found
            turn = turn_between(found.frame, guess)
            missed = found.tips - tips[rows] - h[:, None] * moves[rows]
            off = np.linalg.norm(missed, axis=1) / length
        is_first = steps_known[rows] == 0
        change = np.maximum(turn, np.where(is_first, 0.5, 1.0) * _TIP * off)
        most = np.where(is_first, 2.0, 1.0) * allowed
        good = found.is_found & (change < most) & (found.margin > 0.0)
        on, h_on = rows[good], h[good, None]
        slopes[on] = (found.frame[good] - frame[on]) / h_on
        moves[on] = (found.tips[good] - tips[on]) / h_on
        tips[on], frame[on], margin[on] = found.tips[good], found.frame[good], found.margin[good]
        place[on] = to[good]
        steps_known[on] += 1
        with np.errstate(all="ignore"):  # of a secant's error, to half of what is allowed
            wanted = 0.5 * (np.sqrt(1.0 + 4.0 * allowed / change) - 1.0)
        step[rows] = h * np.where(
            good, np.clip(wanted, 0.5, 4.0), np.where(wanted > 0.1, 0.4, 0.25)
        )
        ended[rows] = ~good & (step[rows] < shortest)
    shots = Shots(tips, frame, margin, start.is_found & (place >= 1.0))
    return Followed(shots, ended, place)
