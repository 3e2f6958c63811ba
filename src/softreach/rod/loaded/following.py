"""Branches of equilibria, followed along paths of activations and loads.

A step along a path predicts how the nodes of an arm see the world by the slope of the last one,
and corrects that by Newton's method. It counts where the correction is small, of the frames and of
the tip, and where the equilibrium is stable; otherwise it is tried at half its length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.rod.loaded.shooting import Shots, turn_between, units

if TYPE_CHECKING:
    from softreach.rod.loaded.solver import Solver

__all__ = ["Followed", "Path", "follow"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_CORRECTION, _CORRECTION_OF_NODES = 0.12, 0.03  # [rad], of one segment and of several
_TIP = 3.0  # weight of the correction of a tip [rad/L]
_SHORTEST = 2.0**-20  # of a path, below which its branch has ended
_MOST_STEPS = 3000


@dataclass(frozen=True, eq=False)
class Path:
    """Straight ways from activations and shares of the loads to others, each from 0 to 1."""

    begin: Array
    """Activations, shape (n, bundles)."""
    end: Array
    from_share: Array
    """Of the loads, shape (n,)."""
    to_share: Array

    @classmethod
    def under_all_loads(cls, begin: Array, end: Array) -> Path:
        """From activations to others."""
        ones = np.ones(len(begin))
        return cls(begin, end, ones, ones)

    def at(self, rows: NDArray[np.intp], t: Array) -> tuple[Array, Array]:
        """Activations and shares at places of some paths."""
        gamma = self.begin[rows] + t[:, None] * (self.end[rows] - self.begin[rows])
        share = self.from_share[rows] + t * (self.to_share[rows] - self.from_share[rows])
        return gamma, share


class Followed(NamedTuple):
    """Branches as far as they were followed."""

    shots: Shots
    """The last equilibrium; found where it is that of the end of the path."""
    has_ended: Mask
    """Mask of branches that end before the path does, shape (n,)."""


def follow(
    solver: Solver,
    path: Path,
    start: Shots,
    slope: Array | None = None,
    shortest: float = _SHORTEST,
) -> Followed:
    """Branches of stable equilibria along paths, each by itself.

    Args:
        solver: That of the arm.
        path: Paths.
        start: Equilibria at their beginning.
        slope: Change of the frame along the path, if it is known, shape (n, component).
        shortest: Step, over the length of the path, below which a branch has ended.
    """
    n, length = len(path.begin), solver.tables.arm.length
    allowed = _CORRECTION if solver.tables.segments == 1 else _CORRECTION_OF_NODES
    tips, frame, margin = start.tips.copy(), start.frame.copy(), start.margin.copy()
    goes_on = np.any(path.begin != path.end, axis=1) | (path.from_share != path.to_share)
    place, step = np.where(goes_on, 0.0, 1.0), np.ones(n)
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
        gamma, share = path.at(rows, to)
        found = solver.careful(gamma, guess, share)
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
    return Followed(shots, ended)
