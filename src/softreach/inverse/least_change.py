"""More bundles than the target needs: of all activations that reach it, those that change least.

Local minima of |γ - near| among the activations that reach a target are found from many starts:
`near` itself, seeds near the target that change little and lie apart, and whatever reached the
target otherwise. The least of them is the answer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from softreach.inverse.descent import descend
from softreach.inverse.nearest import Reached, first_of_each, reach
from softreach.inverse.prepared import PreparedMap
from softreach.inverse.request import Request
from softreach.inverse.sqp import constrained_minima, sqp, survey
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index, Mask

__all__ = ["least_changes"]


_CANDIDATES = 300
_STARTS, _FACE_STARTS = 14, 10
_APART = 0.15
_SURVEY = 5  # steps after which searches are compared
_SURVIVORS, _MERGED = 6, 0.05  # searches of a target that go on, and how far they are apart
_HIGH_PENALTY = 1e4
_EQUAL = 1e-6  # difference of changes below which neither is less
_APART_IN_FAMILY = 1e-3  # least difference of two of a family, in ranges
_ROUNDS = 4  # of random activations as many as are wanted
_POLISHED, _MOST_POLISHING = 1e-9, 300
_BLOCK = 4096  # targets at once: bounds the memory of their candidates


def least_changes(prepared: PreparedMap, request: Request) -> tuple[Index, Array, Reached]:
    """The activation of least change for each target, then others of the solution family.

    The others are those nearest to random activations, whatever their direction, and apart from
    each other: fewer than `family` where further searches end at what is known.

    Args:
        prepared: The tip map.
        request: Targets, and what is preferred.

    Returns:
        Number of the target and activation, sorted by target, those of least change first; and the
        best place found for every target, reached or not.
    """
    known = _in_blocks(prepared, replace(request, direction=None))
    reached = np.flatnonzero(known.residual <= request.residual)
    asked = request.of(reached)
    first = known.gamma[reached]
    if request.direction is not None:
        first = _turned(prepared, asked, first)
    families = _Families(first, request.family, prepared.rod.box.scales)
    for near in _random_activations(prepared.rod, request):
        rows = np.flatnonzero(families.counts < request.family)
        if not len(rows):
            break
        one = replace(asked.of(rows), near=np.tile(near, (len(rows), 1)), direction=None)
        other = _in_blocks(prepared, one, families.members[rows, 0]).gamma
        families.add(rows, other, None if request.direction is not None else asked.near[rows])
    return np.repeat(reached, families.counts), families.members[families.is_member], known


def _random_activations(rod: TipMap, request: Request) -> Iterator[Array]:
    """Activations that others of a family stay near to.

    One sequence for all targets, so that a target's family does not depend on its neighbors.
    """
    rng = np.random.default_rng(request.seed)
    for _ in range(_ROUNDS):
        yield from rng.uniform(rod.box.low, rod.box.high, (request.family - 1, rod.box.bundles))


class _Families:
    """Activations of each target that are apart from each other."""

    def __init__(self, first: Array, most: int, scales: Array) -> None:
        """Begin with one of each target, shape (t, m); `most` is for how many there is room."""
        self.members = np.repeat(first[:, None], most, axis=1)
        self.counts = np.ones(len(first), np.int64)
        self._scales = scales

    @property
    def is_member(self) -> Mask:
        """Entries of `members` that are taken, shape (t, most)."""
        return np.arange(self.members.shape[1]) < self.counts[:, None]

    def add(self, rows: Index, other: Array, near: Array | None) -> None:
        """Add one activation to some targets, if it is a new one, and put the least change first.

        Args:
            rows: Numbers of the targets.
            other: An activation for each.
            near: Activations from which changes count; None where the first stays first.
        """
        apart = np.abs(self.members[rows] - other[:, None]) / self._scales
        distance = np.where(self.is_member[rows], apart.max(axis=2), np.inf)
        alike = (distance <= _APART_IN_FAMILY).sum(axis=1)
        is_new = alike == 0
        place = np.where(is_new, self.counts[rows], distance.argmin(axis=1))
        old = np.where(is_new[:, None], other, self.members[rows, place])
        if near is not None:  # of two that are one, that of less change
            change = np.linalg.norm(other - near, axis=1)
            less = (change < np.linalg.norm(old - near, axis=1) - _EQUAL) & (alike == 1)
            old = np.where(less[:, None], other, old)
        self.members[rows, place] = old
        self.counts[rows] += is_new
        if near is not None:
            first = self.members[rows, 0]
            less = np.linalg.norm(old - near, axis=1) < np.linalg.norm(first - near, axis=1)
            rows, place = rows[less], place[less]
            self.members[rows, place], self.members[rows, 0] = first[less], old[less]


def _in_blocks(prepared: PreparedMap, request: Request, known: Array | None = None) -> Reached:
    """`_least_change` of a few thousand targets at a time."""
    count = len(request.targets)
    gamma, residual = np.empty((count, prepared.rod.box.bundles)), np.empty(count)
    for first in range(0, count, _BLOCK):
        rows = slice(first, min(first + _BLOCK, count))
        part = None if known is None else known[rows]
        gamma[rows], residual[rows] = _least_change(prepared, request.of(rows), part)
    return Reached(gamma, residual)


def _least_change(prepared: PreparedMap, request: Request, known: Array | None) -> Reached:
    """The least of the local minima found; where none reaches its target, the nearest place."""
    count = len(request.targets)
    owner, start = _promising(prepared, request, *_starts(prepared, request))
    if known is not None:
        owner, start = np.concatenate([owner, np.arange(count)]), np.concatenate([start, known])
    gamma, residual = sqp(prepared.rod, request.of(owner), start)
    best = _least(owner, gamma, residual, request)
    ends = Reached(gamma[best], residual[best])
    left = np.flatnonzero(ends.residual > request.residual)
    more = reach(prepared, request.of(left), ends.gamma[left])
    ends.gamma[left], ends.residual[left] = more
    # Where some search lost its target, the target lies next to a fold or a boundary.
    lost = np.bincount(owner, residual > request.residual, count) > 0
    ends = _searched_again(prepared, request, ends, np.flatnonzero(lost), owner, start)
    return _polished(prepared, request, ends)


def _polished(prepared: PreparedMap, request: Request, ends: Reached) -> Reached:
    """The best once more, until its steps are negligible; kept where that changes less."""
    gamma, residual = sqp(
        prepared.rod, request, ends.gamma, settled=_POLISHED, most=_MOST_POLISHING
    )
    owner = np.tile(np.arange(len(gamma)), 2)
    gamma = np.concatenate([ends.gamma, gamma])
    residual = np.concatenate([ends.residual, residual])
    best = _least(owner, gamma, residual, request)
    return Reached(gamma[best], residual[best])


def _searched_again(
    prepared: PreparedMap, request: Request, ends: Reached, rows: Index, owner: Index, start: Array
) -> Reached:
    """Search once more for some targets: first for them, then for less change without leaving."""
    rod, chosen = prepared.rod, np.isin(owner, rows)
    owner = np.concatenate([owner[chosen], rows])
    start = np.concatenate([start[chosen], ends.gamma[rows]])
    at = descend(rod, request.targets[owner], start, request.residual)
    hit = at.residual <= request.residual
    gamma, residual = sqp(rod, request.of(owner[hit]), at.gamma[hit], penalty=_HIGH_PENALTY)
    count = len(request.targets)
    owner = np.concatenate([np.arange(count), owner[hit], owner[hit]])
    gamma = np.concatenate([ends.gamma, at.gamma[hit], gamma])
    residual = np.concatenate([ends.residual, at.residual[hit], residual])
    best = _least(owner, gamma, residual, request)
    return Reached(gamma[best], residual[best])


def _least(owner: Index, gamma: Array, residual: Array, request: Request) -> Index:
    """The row of least change among those that reach their target, else the nearest one."""
    change = np.linalg.norm(gamma - request.near[owner], axis=1)
    change[residual > request.residual] = 1e100
    worst = np.where(residual > request.residual, 1e100 * (1 + residual), change)
    return first_of_each(owner, worst, len(request.targets))


def _starts(prepared: PreparedMap, request: Request) -> tuple[Index, Array]:
    """The activation to stay near to, and seeds near the target that change little."""
    owners = [np.arange(len(request.targets))]
    starts = [prepared.rod.box.clip(request.near)]
    for marks, most in ((prepared.seeds, _STARTS), (prepared.face_seeds, _FACE_STARTS)):
        gamma = marks.nearest(request.targets, _CANDIDATES)
        order = ((gamma - request.near[:, None]) ** 2).sum(axis=2).argsort(axis=1, kind="stable")
        gamma = np.take_along_axis(gamma, order[:, :, None], axis=1)
        owner, start = marks.starts(gamma, most, _APART)
        owners.append(owner)
        starts.append(start)
    return np.concatenate(owners), np.concatenate(starts)


def _promising(
    prepared: PreparedMap, request: Request, owner: Index, start: Array
) -> tuple[Index, Array]:
    """Activations of the best searches of each target after a few steps, those that are apart."""
    gamma, merit = survey(prepared.rod, request.of(owner), start, _SURVEY)
    order = np.lexsort((merit, owner))
    counts = np.bincount(owner, minlength=len(request.targets))
    first = np.cumsum(counts) - counts
    # A row for every target, filled up with its best, which is chosen once.
    places = first[:, None] + np.arange(counts.max(initial=0))
    places = np.where(places < (first + counts)[:, None], places, first[:, None])
    return prepared.seeds.starts(gamma[order[places]], _SURVIVORS, _MERGED)


def _turned(prepared: PreparedMap, request: Request, known: Array) -> Array:
    """The best compromise of change and direction that keeps the position, from several starts."""
    count = len(known)
    owner, start = _starts(prepared, request)
    owner, start = np.concatenate([np.arange(count), owner]), np.concatenate([known, start])
    gamma, residual = constrained_minima(prepared.rod, request.of(owner), start)
    cost = np.where(
        residual <= request.residual, _cost(prepared.rod, request.of(owner), gamma), np.inf
    )
    gamma, cost = (
        np.concatenate([gamma, known]),
        np.concatenate([cost, _cost(prepared.rod, request, known)]),
    )
    owner = np.concatenate([owner, np.arange(count)])
    return gamma[first_of_each(owner, cost, count)]


def _cost(rod: TipMap, request: Request, gamma: Array) -> Array:
    """|γ - near|² + w² |d3 - direction|², shape (n,)."""
    cost = np.linalg.norm(gamma - request.near, axis=1) ** 2
    if request.direction is not None and len(gamma):
        error = rod.tip_directions(gamma) - request.direction
        cost += (request.direction_weight * np.linalg.norm(error, axis=1)) ** 2
    return cost
