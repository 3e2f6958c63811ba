"""The reachable point nearest to a target, and the activation that leads there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.inverse.minimum import Minimum, minimum
from softreach.inverse.objective import Objective
from softreach.rod.kinematics import tip_positions
from softreach.sampling import sample_cube

__all__ = ["Landmarks", "Nearest", "descend", "landmarks", "nearest"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_MOST = 150_000  # landmarks on a grid of the box
_DIMENSIONS = 6  # from which on a grid is too coarse to be worth more than a low-discrepancy set
_ASKED = 24
_STARTS = 3
_APART = 0.15  # of the ranges: two starts lead to different minima


class Landmarks:
    """Activations with their tips, to begin from: the vertices of a grid over the box."""

    def __init__(self, gamma: Array, tip: Array, width: Array) -> None:
        from scipy.spatial import KDTree

        self.gamma, self.tip, self.width = gamma, tip, width
        self.tree = KDTree(tip)

    def near(self, targets: Array, count: int = _ASKED) -> Index:
        """The landmarks whose tips are nearest, nearest first, shape (t, count)."""
        count = min(count, len(self.tip))
        return np.asarray(self.tree.query(targets, k=count)[1], np.int64).reshape(-1, count)

    def starts(self, targets: Array) -> tuple[Index, Array]:
        """For each target the nearest landmark, and the next ones far from it in the box.

        Returns:
            Number of the target and activation of each start, sorted by target.
        """
        return self.spread(self.gamma[self.near(targets)])

    def spread(self, gamma: Array) -> tuple[Index, Array]:
        """Of candidates (t, k, m), best first, the first and others far from those before."""
        chosen = np.zeros(gamma.shape[:2], bool)
        chosen[:, 0] = True
        for k in range(1, gamma.shape[1]):
            apart = np.abs(gamma[:, :k] - gamma[:, k : k + 1]) / self.width
            alone = (~chosen[:, :k] | (apart.max(axis=2) > _APART)).all(axis=1)
            chosen[:, k] = alone & (chosen.sum(axis=1) < _STARTS)
        return np.nonzero(chosen)[0], gamma[chosen]


class Nearest(NamedTuple):
    """The nearest reachable points."""

    gamma: Array
    """Activations [-], shape (t, m)."""
    tip: Array
    """The points [m], shape (t, 3)."""
    settled: NDArray[np.bool_]
    """Whether the search came to rest, shape (t,)."""

    def of(self, rows: Index) -> Nearest:
        """Those of some of the targets."""
        return Nearest(self.gamma[rows], self.tip[rows], self.settled[rows])


def landmarks(arm: Manipulator, tol: float) -> Landmarks:
    """Landmarks all over the box, of any number of bundles."""
    low, high = arm.bounds.T
    free = np.flatnonzero(high > low)
    gamma = np.tile(low, (1, 1))
    if len(free):
        side = int(_MOST ** (1 / len(free)))
        sampler, n = ("grid", side ** len(free)) if len(free) <= _DIMENSIONS else ("sobol", 1 << 17)
        cube = np.asarray(sample_cube(sampler, n, len(free)))
        gamma = np.tile(low, (len(cube), 1))
        gamma[:, free] += cube * (high - low)[free]
    return Landmarks(gamma, tip_positions(arm, gamma, tol), np.where(high > low, high - low, 1.0))


def nearest(
    arm: Manipulator,
    places: Landmarks,
    targets: Array,
    tol: float,
    direction: Array | None = None,
    weight: float = 0.0,
    more: tuple[Index, Array] | None = None,
) -> Nearest:
    """The best of the local minima of the distance found from several starts for each target.

    Args:
        arm: The design.
        places: Where to begin.
        targets: Targets [m], shape (t, 3).
        tol: Largest tip error, in L.
        direction: Wanted tip directions, unit vectors, shape (t, 3).
        weight: What a direction error of 1 rad counts for, in L.
        more: Further starts: number of the target and activation.
    """
    of, start = places.starts(targets)
    if more is not None:
        of, start = np.concatenate([of, more[0]]), np.concatenate([start, more[1]])
    found = descend(arm, targets, of, start, tol, direction, weight)
    order = np.lexsort((found.value, of))
    best = order[np.searchsorted(of[order], np.arange(len(targets)))]
    gamma = found.gamma[best]
    return Nearest(gamma, tip_positions(arm, gamma, tol), found.settled[best])


def descend(
    arm: Manipulator,
    targets: Array,
    of: Index,
    start: Array,
    tol: float,
    direction: Array | None = None,
    weight: float = 0.0,
) -> Minimum:
    """A local minimum of the distance to target `of[i]` from every start i, of shape (n, m)."""
    low, high = arm.bounds.T.copy()
    goal = Objective(
        arm=arm,
        tol=tol,
        targets=targets[of],
        direction=None if direction is None else direction[of],
        weight=weight,
    )
    return minimum(goal, start, low, high)
