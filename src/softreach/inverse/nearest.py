"""The reachable point nearest to a target, and the activation that leads there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.inverse.prepared import PreparedMap
from softreach.inverse.request import Request
from softreach.inverse.roots import Roots, placed
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index
from softreach.workspace.search import CLOSELY, Nearest, nearest_tips

_SEED = 1
_BEYOND = 1e-3  # of the residual, to which a search goes on
_MOST_STEPS = 60


def nearest(prepared: PreparedMap, request: Request, known: Roots | None = None) -> Nearest:
    """The nearest tip found from seeds for each target.

    Args:
        prepared: The tip map.
        request: Targets.
        known: Roots to begin from as well.
    """
    tip_map, targets = prepared.tip_map, request.targets
    target, start = starts(prepared, targets, known)
    ends = nearest_tips(tip_map, start, targets[target], request.residual, CLOSELY)
    return nearest_at(
        tip_map, targets, ends.gamma[first_of_each(target, ends.distance, len(targets))]
    )


def starts(prepared: PreparedMap, targets: Array, known: Roots | None) -> tuple[Index, Array]:
    """Seeds near each target, and known roots: numbers of targets, and activations."""
    if not len(targets):
        return np.empty(0, np.int64), np.empty((0, prepared.tip_map.box.bundles))
    target, start = prepared.seeds.starts(prepared.seeds.nearest(targets))
    if known is None:
        return target, start
    return np.concatenate([target, known.target]), np.concatenate([start, known.gamma])


def descend(
    tip_map: TipMap, targets: Array, start: Array, residual: float, most: int = _MOST_STEPS
) -> Nearest:
    """The local minimum of distance from each start, to well within the residual.

    Args:
        tip_map: The tip map.
        targets: One for each start [m], shape (n, 3).
        start: Inside the bounds [-], shape (n, m).
        residual: |tip - target| at which a target is reached [m].
        most: Steps.
    """
    return nearest_tips(tip_map, start, targets, _BEYOND * residual, CLOSELY._replace(most=most))


def reach(prepared: PreparedMap, request: Request, start: Array) -> Reached:
    """The activation found whose tip is nearest to each target, with growing effort.

    Most targets are reached from the seed whose tip is nearest. The rest lie where the map is
    singular or on the boundary of the reachable set, which is the image of faces of the box on
    which few bundles are free: these are searched from many seeds, on such faces too, that lie
    apart.

    Args:
        prepared: The tip map.
        request: Targets, and the residual at which one is reached.
        start: Activations to begin from, shape (t, m).
    """
    box, targets = prepared.tip_map.box, request.targets
    first = descend(prepared.tip_map, targets, box.clip(start), request.residual)
    gamma, residual = first.gamma, first.distance
    rng = np.random.default_rng(_SEED)
    for effort in _EFFORTS:
        # One set for all targets, so that no answer depends on the other targets.
        anywhere = rng.uniform(box.low, box.high, (effort.random, len(box.low)))
        left = np.flatnonzero(residual > request.residual)
        if not len(left):
            break
        for rows in np.array_split(left, 1 + len(left) * effort.neighbors // 100_000):
            owner, ends = _searched(prepared, request.of(rows), effort, anywhere)
            best = first_of_each(owner, ends.distance, len(rows))
            better = ends.distance[best] < residual[rows]
            gamma[rows[better]] = ends.gamma[best[better]]
            residual[rows[better]] = ends.distance[best[better]]
    return Reached(gamma, residual)


class Reached(NamedTuple):
    """The best place found for each target."""

    gamma: Array
    """Activations [-], shape (t, m)."""
    residual: Array
    """|tip - target| [m], shape (t,)."""


def nearest_at(tip_map: TipMap, targets: Array, gamma: Array) -> Nearest:
    """Tips of the activations, to rounding, and how far they are from the targets."""
    tip = placed(tip_map, gamma)
    return Nearest(gamma, tip, np.linalg.norm(tip - targets, axis=1))


class _Effort(NamedTuple):
    neighbors: int
    """Seeds looked at."""
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


def _searched(
    prepared: PreparedMap, request: Request, effort: _Effort, anywhere: Array
) -> tuple[Index, Nearest]:
    count = len(request.targets)
    owners, starts = [np.repeat(np.arange(count), len(anywhere))], [np.tile(anywhere, (count, 1))]
    for marks in (prepared.seeds, prepared.face_seeds):
        near = marks.nearest(request.targets, effort.neighbors)
        owner, start = marks.starts(near, effort.starts, effort.apart)
        owners.append(owner)
        starts.append(start)
        if effort.neighbors == 1:  # nearly all are reached from here
            break
    owner, start = np.concatenate(owners), np.concatenate(starts)
    return owner, descend(prepared.tip_map, request.targets[owner], start, request.residual)


def first_of_each(owner: Index, value: Array, count: int) -> Index:
    """The row of least value of each of `count` owners, all of whom have some, shape (count,)."""
    order = np.lexsort((value, owner))
    return order[np.searchsorted(owner[order], np.arange(count))]
