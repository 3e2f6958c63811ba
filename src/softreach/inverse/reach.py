"""An activation that reaches each target, whatever the number of bundles, with growing effort.

Most targets are reached from the landmark whose tip is nearest. The rest lie where the map is
singular or on the boundary of the reachable set, which is the image of faces of the box on which
few bundles are free: these are searched from many landmarks, on such faces too, that lie apart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.inverse.descent import Descent, descend
from softreach.inverse.prepared_map import PreparedMap
from softreach.inverse.request import Request

__all__ = ["Reached", "reach"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class _Effort(NamedTuple):
    """How many searches a target that is still left is worth."""

    neighbors: int
    """Landmarks looked at."""
    starts: int
    """Most searches from them."""
    apart: float
    """Their least distance, in ranges."""
    random: int
    """Searches from anywhere."""


_EFFORTS = (
    _Effort(neighbors=1, starts=1, apart=0.0, random=0),
    _Effort(neighbors=24, starts=4, apart=0.15, random=0),
    _Effort(neighbors=128, starts=24, apart=0.1, random=8),
    _Effort(neighbors=1000, starts=150, apart=0.05, random=100),
)
_SEED = 1


class Reached(NamedTuple):
    """The best place found for each target."""

    gamma: Array
    """Activations [-], shape (t, m)."""
    residual: Array
    """|tip - target| [m], shape (t,)."""


def reach(prepared: PreparedMap, request: Request, start: Array) -> Reached:
    """The activation found whose tip is nearest to each target.

    Args:
        prepared: The tip map.
        request: Targets, and the residual at which one is reached.
        start: Activations to begin from, shape (t, m).
    """
    box, targets = prepared.rod.box, request.targets
    first = descend(prepared.rod, targets, box.clip(start), request.residual)
    gamma, residual = first.gamma, first.residual
    rng = np.random.default_rng(_SEED)
    for effort in _EFFORTS:
        # One set for all targets, so that no answer depends on the other targets.
        anywhere = rng.uniform(box.low, box.high, (effort.random, len(box.low)))
        left = np.flatnonzero(residual > request.residual)
        if not len(left):
            break
        for rows in np.array_split(left, 1 + len(left) * effort.neighbors // 100_000):
            owner, found = _searched(prepared, request.of(rows), effort, anywhere)
            best = first_of_each(owner, found.residual, len(rows))
            better = found.residual[best] < residual[rows]
            gamma[rows[better]] = found.gamma[best[better]]
            residual[rows[better]] = found.residual[best[better]]
    return Reached(gamma, residual)


def _searched(
    prepared: PreparedMap, request: Request, effort: _Effort, anywhere: Array
) -> tuple[Index, Descent]:
    """Searches from landmarks all over the box, from those on its faces, and from anywhere."""
    count = len(request.targets)
    owners, starts = [np.repeat(np.arange(count), len(anywhere))], [np.tile(anywhere, (count, 1))]
    for marks in (prepared.landmarks, prepared.face_landmarks):
        near = marks.nearest(request.targets, effort.neighbors)
        owner, start = marks.starts(near, effort.starts, effort.apart)
        owners.append(owner)
        starts.append(start)
        if effort.neighbors == 1:  # nearly all are reached from here
            break
    owner, start = np.concatenate(owners), np.concatenate(starts)
    return owner, descend(prepared.rod, request.targets[owner], start, request.residual)


def first_of_each(owner: Index, value: Array, count: int) -> Index:
    """The row of least value of each of `count` owners, all of whom have some, shape (count,)."""
    order = np.lexsort((value, owner))
    return order[np.searchsorted(owner[order], np.arange(count))]
