"""Drag of an arm by its tip: on along its branch, or as near to the target as that leads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.inverse.path import BranchPoint, Continuation, PathStatus
from softreach.inverse.prepared import prepared_map
from softreach.rod.rods import all_inputs
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array
from softreach.workspace.search import CLOSELY, nearest_tips

_RESIDUAL = 1e-8  # |tip - target| of an arm that follows, in L: far below a pixel
_FLAT = 0.05  # smallest over largest singular value, below which a fold may be near
_ASIDE = 0.02  # from a fold, where the search on its either side begins, in ranges


class Dragged(NamedTuple):
    """Result of one step of a drag."""

    activation: tuple[float, ...]  # of each bundle in its unit
    tip: Array  # place of the tip then [m], (3,)
    gap: float  # distance from there to the target [m]; 0 where the tip follows
    tip_map: TipMap  # the tip map of the arm in the posture in which this leaves it


class Drag:
    """One arm whose tip is dragged from place to place.

    With three free bundles the arm stays on its branch: a fold, where two branches meet, is left
    to the side from which it was entered. With more, each step changes the activation least.
    """

    def __init__(self, arm: Manipulator | TipMap) -> None:
        """Prepare a design, or the tip map of the posture that it is in (`Solution.posture`)."""
        self._prepared = prepared_map(arm)
        self.arm = self._prepared.whole.arm
        self._rod = self._prepared.tip_map
        self._tracker = Continuation(self._rod, _RESIDUAL * self._rod.length)
        self._side = 0.0
        self._last: tuple[tuple[float, ...], BranchPoint] | None = None  # where it was left

    def to(self, activation: tuple[float, ...], target: Array) -> Dragged | None:
        """Drag the tip straight to a target [m]; None without a stable equilibrium to begin with.

        An arm under loads begins in the posture in which the last step left it, if that ended in
        this activation, else in that to which it comes from rest.
        """
        box, measures = self._prepared.whole.box, self._prepared.whole.measures
        if self._last is not None and self._last[0] == activation:
            point = self._last[1]
        else:
            gamma = self._rod.box.clip((np.asarray(activation) / measures)[box.free])
            point = self._tracker.at(gamma).kept()
        if not np.isfinite(point.slope).all():
            return None
        self._side = self._sign(point.slope) or self._side
        if box.dimension >= 3:
            end = self._tracker.follow(point, point.tip, target)
            point = end.point
            if end.status == PathStatus.FOLLOWED:
                return self._dragged(point, target)
        return self._dragged(self._nearest(point, target), target)

    def _nearest(self, point: BranchPoint, target: Array) -> BranchPoint:
        gamma, tip_map = point.gamma, point.tip_map
        scales, starts = self._rod.box.scales, [gamma]
        _, sizes, axes = np.linalg.svd(point.slope * scales)
        if len(sizes) == 3 and sizes[2] <= _FLAT * sizes[0]:
            # On a fold no small change brings the tip nearer: begin on both sides of it.
            starts += [gamma + _ASIDE * axes[2] * scales, gamma - _ASIDE * axes[2] * scales]
        starts = self._rod.box.clip(np.array(starts))
        targets = np.tile(target, (len(starts), 1))
        ends = nearest_tips(tip_map, starts, targets, self._tracker.residual, CLOSELY).gamma
        tips, slopes = tip_map.tips_and_slopes(ends)
        gaps = np.linalg.norm(tips - target, axis=1)
        gaps = np.where(np.isfinite(gaps), gaps, np.inf)
        best = gaps <= gaps.min() + self._tracker.residual
        other_side = [self._side * self._sign(slope) < 0 for slope in slopes]
        away = np.linalg.norm((ends - gamma) / scales, axis=1)
        best_end = np.lexsort((away, other_side, ~best))[0]
        return BranchPoint(ends[best_end], tips[best_end], slopes[best_end], tip_map).kept()

    def _sign(self, slope: Array) -> float:
        """The sheet of three free bundles that the arm is on; 0 next to a fold and for others."""
        if slope.shape[1] != 3:
            return 0.0
        scaled = slope * self._rod.box.scales
        sizes = np.linalg.svd(scaled, compute_uv=False)
        return float(np.sign(np.linalg.det(scaled))) if sizes[2] > 1e-6 * sizes[0] else 0.0

    def _dragged(self, point: BranchPoint, target: Array) -> Dragged:
        whole = self._prepared.whole
        activation = whole.box.with_fixed(point.gamma[None])[0] * whole.measures
        gap = float(np.linalg.norm(point.tip - target))
        within = tuple(float(value) for value in activation)
        self._last, held = (within, point), all_inputs(point.tip_map)
        return Dragged(within, point.tip, 0.0 if gap <= self._tracker.reach_tol else gap, held)
