"""Arms that are really made with deviations: what they keep of the reach of a design."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.inverse.solve import solve_inverse
from softreach.optimization.deviations import TOL, FirstOrder, region_places
from softreach.requirements.requirements import Requirements, Target, with_payload
from softreach.rod.rods import as_tip_map
from softreach.sampling import sample_cube
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask
from softreach.support.errors import InvalidDesign, InvalidInput, no_warnings
from softreach.support.progress import Progress
from softreach.workspace.reach import reachable_set
from softreach.workspace.reachable import ReachableSolid
from softreach.workspace.search import nearest_tips

_POOL = 1 << 17  # places of space among which those are that are followed
_FOLLOWED = 1 << 13  # near the boundary, and as many away from it
_NEAR = 4.0  # deviations of the boundary
_MOST_TRIED = 1024  # places of targets that arms are made for
_STARTS = 8  # of searches for a place, beside the solutions of the design


class _Followed(NamedTuple):
    """Places within the reach of the design, more of them near its boundary."""

    places: tuple[Array, Array]
    """Near the boundary, and away from it."""
    shares: tuple[float, float]
    """Share of the volume that each stands for."""

    @classmethod
    def of(cls, first: FirstOrder, seed: int) -> _Followed:
        solid, boundary = first.solid, first.boundary
        low, high = boundary.places.min(axis=0), boundary.places.max(axis=0)
        pool = low + (high - low) * sample_cube("sobol", _POOL, 3, seed)
        pool = pool[solid.contains(pool)]
        moves = np.linalg.norm(boundary.speed_at(pool) * first.deviations.sigmas, axis=1)
        width = math.sqrt(float(boundary.area.mean()))
        near = boundary.distance(pool) < _NEAR * moves + width
        parts = pool[near][:_FOLLOWED], pool[~near][:_FOLLOWED]
        return cls(parts, (float(near.mean()), float((~near).mean())))

    def kept(self, contains: Callable[[Array], Mask]) -> float:
        """Share of the volume that another set contains."""
        return sum(
            share * float(contains(part).mean())
            for part, share in zip(self.places, self.shares, strict=True)
            if len(part)
        )

    def error(self, kept: float) -> float:
        """Standard error of such a share, as if the places were random."""
        share, count = self.shares[0], max(1, len(self.places[0]))
        lost = min(1.0, (1.0 - kept) / max(share, 1e-9))
        return share * math.sqrt(lost * (1.0 - lost) / count)


class _Made(NamedTuple):
    kept: float
    volume: float
    unreachability: float
    reached: tuple[Mask, ...]
    """Of the places tried, for each target that has places."""
    covered: tuple[float, ...]
    """Of each region."""


class ArmsMade(NamedTuple):
    """All arms that were made."""

    made: list[_Made]
    impossible: int
    error_of_kept: float


def arms_made(first: FirstOrder, count: int, seed: int, progress: Progress) -> ArmsMade:
    """Arms with the first of the changes, each asked what it keeps."""
    if not count:
        return ArmsMade([], 0, math.nan)
    followed = _Followed.of(first, seed)
    starts = [
        _starts(first, places[tried(len(places))])
        for target in with_places(first.needs)
        if (places := target.places) is not None
    ]
    tasks = (partial(_made, first, followed, starts, change) for change in first.changes[:count])
    made, impossible = [], 0
    for each in parallel.in_order(tasks):
        progress(1)
        if each is None:
            impossible += 1
        else:
            made.append(each)
    kept = float(np.mean([each.kept for each in made])) if made else math.nan
    return ArmsMade(made, impossible, followed.error(kept))


def _made(
    first: FirstOrder, followed: _Followed, starts: list[list[Array]], change: Array
) -> _Made | None:
    """An arm with deviations; None if there is no such arm."""
    with parallel.undivided(), no_warnings():
        try:
            arm = first.deviations.made(change)
            solid = reachable_set(arm, accuracy=first.accuracy)
            if not isinstance(solid, ReachableSolid):
                return None
            return _Made(
                followed.kept(solid.contains),
                solid.volume,
                solid.unreachability,
                tuple(
                    _reached(arm, first, target, start)
                    for target, start in zip(with_places(first.needs), starts, strict=True)
                ),
                tuple(_share(arm, solid, first, t) for t in with_region(first.needs)),
            )
        except InvalidDesign:
            return None
        except InvalidInput as error:
            if error.name != "loads":
                raise
            return None


def with_places(needs: Requirements) -> list[Target]:
    """Targets that are places."""
    return [target for target in needs.targets if target.places is not None]


def with_region(needs: Requirements) -> list[Target]:
    """Targets that are regions."""
    return [target for target in needs.targets if target.region is not None]


def tried(count: int) -> Index:
    """Numbers of the places that arms are made for, evenly spread over all."""
    return np.unique(np.linspace(0, count - 1, min(count, _MOST_TRIED)).astype(np.int64))


def _starts(first: FirstOrder, places: Array) -> list[Array]:
    """Places of the cube to search from: of all solutions of the design, and of a grid."""
    box, count = as_tip_map(first.deviations.arm).box, len(places)
    solutions = solve_inverse(first.deviations.arm, places, from_rest=True)
    rows = [solutions.nearest_activations]
    for number in range(int(solutions.counts.max(initial=0))):
        has = solutions.counts > number
        row = solutions.nearest_activations.copy()
        row[has] = solutions.activations[solutions.offsets[:-1][has] + number]
        rows.append(row)
    known = [np.nan_to_num(box.to_cube(row)[:, box.free], nan=0.5) for row in rows]
    grid = sample_cube("sobol", _STARTS, box.dimension)
    return [*known, *(np.tile(start, (count, 1)) for start in grid)]


def _reached(arm: Manipulator, first: FirstOrder, target: Target, starts: list[Array]) -> Mask:
    """Places that an arm reaches under every payload, of those that are tried: by searches."""
    assert target.places is not None
    places = target.places[tried(len(target.places))]
    within, held = max(target.within, TOL * arm.length), np.ones(len(places), bool)
    for payload in first.needs.payloads or (None,):
        rod, gaps = as_tip_map(with_payload(arm, payload)), np.full(len(places), np.inf)
        for start in starts:
            left = np.flatnonzero(gaps > within)
            if len(left):
                gamma = rod.box.from_free_cube(start[left])
                nearest = nearest_tips(rod, gamma, places[left], within)
                gaps[left] = np.fmin(gaps[left], nearest.distance)
        held &= gaps <= within
    return held


def _share(arm: Manipulator, solid: ReachableSolid, first: FirstOrder, target: Target) -> float:
    places, share = region_places(target), 1.0
    for payload in first.needs.payloads or (None,):
        loaded = with_payload(arm, payload)
        own = solid if loaded is arm else reachable_set(loaded, accuracy=first.accuracy)
        if not isinstance(own, ReachableSolid):
            return 0.0
        inside = own.distance(places) <= target.within if target.within else own.contains(places)
        share = min(share, float(inside.mean()))
    return share
