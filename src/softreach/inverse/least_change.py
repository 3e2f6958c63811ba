"""More bundles than the target needs: of all activations that reach it, those that change least.

The least of local minima of |γ - near| from many starts: `near`, seeds near the target that change
little and lie apart, and what reached the target otherwise.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import chain
from typing import NamedTuple

import numpy as np

from softreach.inverse.direction import nearest_poses
from softreach.inverse.prepared import PreparedMap
from softreach.inverse.request import Request
from softreach.inverse.roots import Reached, descend, first_of_each, reach
from softreach.kernels.box import sequential_projection as kernels
from softreach.kernels.box.box_projection import project
from softreach.kernels.box.sequential_projection import choose_apart
from softreach.rod.tip_map import BLOCK, TipMap, TipOutputs
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask, joined, rows

_TOGETHER = BLOCK // 16  # searches that one thread runs side by side
_CANDIDATES = 300
_STARTS = 7  # from seeds all over the box and from those on faces, as they are and moved
_APART = 0.15
_SURVEY = 3  # steps after which searches are compared
_SURVIVORS, _MERGED = 6, 0.05  # searches of a target that go on, and how far they are apart
_SETTLED, _MOST_COARSE = 1e-4, 30  # step and steps at which searches of the coarse map end
_HIT = 1e-5  # miss of the coarse map in L, below which a search is on its target
_NEARBY = 0.05  # the same, below which it may be on it on the exact map
_LEADING, _DISTINCT = 4, 0.01  # searches that go on to the exact map, and how far they are apart
_MARGIN = 1e-2  # by which, and by which part, the change of one may be above the least
_NEARLY_HIT = 1e-8  # miss of the exact map in L, above which a search lost its target
_STEEP = 1e3  # penalty, in 1/L, above which a target lies next to a fold or a boundary
_HIGH_PENALTY = 1e4
_EQUAL = 1e-6  # difference of changes below which neither is less
_APART_IN_FAMILY = 1e-3  # least difference of two of a family, in ranges
_ROUNDS = 4  # of random activations as many as are wanted
_POLISHED, _MOST_POLISHING, _MOST_AGAIN = 1e-9, 300, 60
_BLOCK = 4096  # targets at once: bounds the memory of their candidates


def least_changes(prepared: PreparedMap, request: Request) -> tuple[Index, Array, Reached]:
    """The activation of least change for each target, then others of the solution family.

    The others are nearest to random activations, and apart: fewer than `family` where searches end
    at what is known. Numbers of targets, activations, and the best place for every target.
    """
    search = _in_blocks if request.is_of_place else _posed
    known = search(prepared, request)
    reached = np.flatnonzero(known.residual <= request.residual)
    solved = request.of(reached)
    first = known.gamma[reached]
    families = _Families(first, request.family, prepared.tip_map.box.scales)
    box, rng = prepared.tip_map.box, np.random.default_rng(request.seed)
    # One sequence for all targets, so that a target's family does not depend on its neighbors.
    size = request.family - 1, box.bundles
    rounds = (rng.uniform(box.low, box.high, size) for _ in range(_ROUNDS))
    for near in chain.from_iterable(rounds):
        rows = np.flatnonzero(families.counts < request.family)
        if not len(rows):
            break
        another = replace(solved.of(rows), near=np.tile(near, (len(rows), 1)))
        other = search(prepared, another, families.members[rows, 0])
        met = other.residual <= request.residual
        families.add(rows[met], other.gamma[met], solved.near[rows[met]])
    return np.repeat(reached, families.counts), families.members[families.is_member], known


class _Families:
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
        """Add one activation each to some targets if it is new; least change from `near` first."""
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
    parts = [Reached(np.empty((0, prepared.tip_map.box.bundles)), np.empty(0))]
    for block in parallel.blocks(len(request.targets), _BLOCK):
        part = None if known is None else known[block]
        parts.append(_least_change(prepared, request.of(block), part))
    return joined(parts)


def _least_change(prepared: PreparedMap, request: Request, known: Array | None) -> Reached:
    """The least of local minima, by the coarse map, then by the exact one; or the nearest place."""
    count, tip_map = len(request.targets), prepared.tip_map
    every = _starts(prepared, request)
    # The best searches of each target after a few steps, those that are apart.
    survey = sqp(prepared.coarse_map, request, *every, most=_SURVEY)
    places = _by_owner(every[0], survey.merit, count)
    owner, start = prepared.seeds.starts(survey.gamma[places], _SURVIVORS, _MERGED)
    if known is not None:
        owner, start = np.concatenate([owner, np.arange(count)]), np.concatenate([start, known])
    coarse = sqp(prepared.coarse_map, request, owner, start, settled=_SETTLED, most=_MOST_COARSE)
    leading = _leading(prepared, request, owner, coarse)
    start, begin = coarse.gamma[leading], coarse.proximity[leading]
    polish = partial(sqp, settled=_POLISHED, most=_MOST_POLISHING)
    fine = polish(tip_map, request, owner[leading], start, proximity=begin)
    # Where a search lost its target, that lies next to a fold or a boundary.
    lost = np.zeros(count, bool)
    off = (fine.residual > _NEARLY_HIT * tip_map.length) | (fine.penalty > _STEEP)
    lost[owner[leading[off]]] = True
    lost |= np.bincount(owner, coarse.residual <= _HIT * tip_map.length, count) == 0
    owner = owner[leading]
    ends = _best(owner, _on_target(tip_map, request, owner, fine), request)
    if len(left := np.flatnonzero(ends.residual > request.residual)):
        ends.gamma[left], ends.residual[left] = reach(prepared, request.of(left), ends.gamma[left])
        lost[left] = True
    if lost.any():
        return _searched_again(prepared, request, ends, np.flatnonzero(lost), *every)
    return ends


def _leading(prepared: PreparedMap, request: Request, owner: Index, ends: Minima) -> Index:
    """Searches on their targets whose ends are apart and may be the least of their target."""
    change = np.linalg.norm(ends.gamma - request.near[owner], axis=1)
    miss = ends.residual / prepared.tip_map.length
    worth = np.where(miss > _HIT, 1e100 * (1.0 + miss), change)
    places = _by_owner(owner, worth, len(request.targets))
    chosen = np.zeros(places.shape, bool)
    choose_apart(ends.gamma[places], prepared.seeds.scales, _LEADING, _DISTINCT, chosen)
    worth = worth[places]
    chosen &= worth <= worth[:, :1] * (1.0 + _MARGIN) + _MARGIN
    # Next to a fold the coarse map may miss by a little what the exact one reaches.
    nearly = (miss[places] > _HIT) & (miss[places] < _NEARBY) & (change[places] < worth[:, :1])
    return np.unique(places[chosen | nearly])


def _by_owner(owner: Index, value: Array, count: int) -> Index:
    """A row for every owner with what it owns, least value first, filled up with the least."""
    order = np.lexsort((value, owner))
    counts = np.bincount(owner, minlength=count)
    first = np.cumsum(counts) - counts
    places = first[:, None] + np.arange(counts.max(initial=0))
    return order[np.where(places < (first + counts)[:, None], places, first[:, None])]


def _on_target(tip_map: TipMap, request: Request, owner: Index, ends: Minima) -> Reached:
    """Ends of searches, brought to their targets where these are nearly reached."""
    gamma, residual = ends.gamma.copy(), ends.residual.copy()
    off = np.flatnonzero(residual > request.residual)
    more = descend(tip_map, request.targets[owner[off]], gamma[off], request.residual, most=20)
    gamma[off], residual[off] = more.gamma, more.distance
    return Reached(gamma, residual)


def _searched_again(
    prepared: PreparedMap, request: Request, ends: Reached, lost: Index, owner: Index, start: Array
) -> Reached:
    """Search again on the exact map from every start, also with the target before less change."""
    tip_map, chosen = prepared.tip_map, np.isin(owner, lost)
    owner = np.concatenate([owner[chosen], lost])
    start = np.concatenate([start[chosen], ends.gamma[lost]])
    search = partial(sqp, settled=_POLISHED, most=_MOST_AGAIN)
    plain = search(tip_map, request, owner, start)
    at = descend(tip_map, request.targets[owner], start, request.residual)
    hit = np.flatnonzero(at.distance <= request.residual)
    kept = search(tip_map, request, owner[hit], at.gamma[hit], penalty=_HIGH_PENALTY)
    on_target = partial(_on_target, tip_map, request)
    reached = Reached(at.gamma[hit], at.distance[hit])
    every = joined([ends, on_target(owner, plain), reached, on_target(owner[hit], kept)])
    owners = [np.arange(len(request.targets)), owner, owner[hit], owner[hit]]
    return _best(np.concatenate(owners), every, request)


def _best(owner: Index, ends: Reached, request: Request) -> Reached:
    """The end of least change among those that reach their target, else the nearest one."""
    change = np.linalg.norm(ends.gamma - request.near[owner], axis=1)
    worst = np.where(ends.residual > request.residual, 1e100 * (1 + ends.residual), change)
    return rows(ends, first_of_each(owner, worst, len(request.targets)))


def _starts(prepared: PreparedMap, request: Request) -> tuple[Index, Array]:
    """The activation to stay near to, and seeds near the target that change little."""
    starts = [(np.arange(len(request.targets)), prepared.tip_map.box.clip(request.near))]
    # Moved ones lie in the right basin where the seeds are dense, the others where they are few.
    for seeds in (prepared.seeds, prepared.face_seeds):
        starts.append(seeds.near(request.targets, request.near, _CANDIDATES, _STARTS, _APART))
    owner, start = map(np.concatenate, zip(*starts, strict=True))
    return owner, start


def _posed(prepared: PreparedMap, request: Request, known: Array | None = None) -> Reached:
    """The pose of least change that meets its goals, from several starts, or the nearest one.

    Its residual [m] holds L times the angle by which the direction misses, if that is more.
    """
    count, tip_map = len(request.targets), prepared.tip_map
    at_place = _in_blocks(prepared, replace(request, direction=None, markers={}), known).gamma
    owner, start = _starts(prepared, request)
    begun = [at_place] if known is None else [at_place, known]
    owner = np.concatenate([*[np.arange(count)] * len(begun), owner])
    ends = nearest_poses(tip_map, request.of(owner), np.concatenate([*begun, start]))
    change = np.linalg.norm(ends.gamma - request.near[owner], axis=1)
    worth = np.where(ends.miss > request.residual, 1e100 * (1.0 + ends.merit), change)
    best = first_of_each(owner, worth, count)
    return Reached(ends.gamma[best], ends.miss[best])


class Minima(NamedTuple):
    """Ends of searches for the least change."""

    gamma: Array  # activations [-], (n, m)
    residual: Array  # |tip - target| [m], (n,)
    merit: Array  # ½|γ - near|² and the penalty of the miss, (n,)
    proximity: Array  # σ of the last step, (n,)
    penalty: Array  # penalty of the miss, in 1/L: half as much again as its multiplier, (n,)


def sqp(
    tip_map: TipMap,
    request: Request,
    owner: Index,
    start: Array,
    *,
    penalty: float = 0.0,
    proximity: Array | float = kernels.FIRST_PROXIMITY,
    settled: float = 1e-6,
    most: int = 60,
) -> Minima:
    """Minimize ½|γ - near|² subject to tip = target `owner` and bounds, from starts (n, m).

    Each step minimizes ½|x - near|² + ½σ|x - γ|² where the linearized map meets the target, inside
    the bounds, exactly: sequential quadratic programming with a multiple of the identity for
    the Hessian, of which the proximity σ is a secant estimate. It is taken if ½|x - near|² +
    penalty·|miss| falls as it should; else σ grows. A high least penalty keeps a search near its
    target next to a fold or a boundary. It ends at steps below `settled`, in ranges.
    """
    # Copies: kernels are compiled once more for arrays that are read-only or not contiguous.
    n, owner = len(start), owner.copy()
    request = replace(request, targets=request.targets.copy(), near=request.near.copy())
    begin = np.full(n, proximity)
    minima = Minima(start.copy(), np.empty(n), np.empty(n), begin, np.empty(n))
    # Searches that end make room for others; only the last of a task run by a few.
    share = max(_TOGETHER, -(-n // parallel.thread_count()))
    tip_map.prepare()
    search = partial(_searched, tip_map, request, penalty=penalty, limits=(settled, most))
    blocks = parallel.blocks(n, share)
    parallel.run(partial(search, owner[block], rows(minima, block)) for block in blocks)
    return minima._replace(residual=minima.residual * tip_map.length)


def _searched(
    tip_map: TipMap,
    request: Request,
    owner: Index,
    ends: Minima,
    penalty: float,
    limits: tuple[float, int],
) -> None:
    box, total = tip_map.box, len(owner)
    bounds = (box.low.copy(), box.high.copy(), box.scales.copy())
    running = _room(min(total, _TOGETHER), box.bundles)
    tips, ahead = np.empty_like(running.miss), np.empty_like(running.slope)
    wanted, length, begun, n = (owner, request.targets, request.near), tip_map.length, 0, 0
    while begun < total or n:
        more = min(total - begun, len(tips) - n)
        new, old = slice(n, n + more), slice(begun, begun + more)
        running.row[new], running.steps[new] = np.arange(begun, begun + more), 0
        running.trial[new], running.proximity[new] = ends.gamma[old], ends.proximity[old]
        running.penalty[new], running.multiplier[new] = penalty, 0.0
        running.reach[new] = kernels.LONGEST_STEP
        n, begun = n + more, begun + more
        tip_map.fill(running.trial[:n], TipOutputs(tips[:n], ahead[:n]))
        if tip_map.supports_unstable:
            lost = np.isnan(tips[:n, 0])
            tips[:n][lost], ahead[:n][lost] = kernels.NOWHERE, 0.0
        n = kernels.judge(running, n, tips, ahead, *wanted, bounds, length, limits, ends)
        at = rows(running, slice(n))
        step = at.trial, at.multiplier
        project(at.center, at.slope, at.wanted, at.softness, at.low, at.high, *step)
        kernels.next_trials(running, n, owner, request.near)


def _room(n: int, m: int) -> kernels.Running:
    return kernels.Running(
        row=np.empty(n, np.int64),
        steps=np.empty(n, np.int64),
        slope=np.empty((n, 3, m)),
        **{name: np.empty((n, 3)) for name in ("miss", "wanted", "multiplier")},
        **{name: np.empty((n, m)) for name in ("gamma", "center", "low", "high", "trial")},
        **{name: np.empty(n) for name in ("penalty", "proximity", "reach", "weight")},
        **{name: np.empty(n) for name in ("gain", "softness")},
    )
