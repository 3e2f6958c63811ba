"""How activations move when the tip moves straight to a point, and arms dragged by their tips.

A path is followed by predictor and corrector on one branch; a drag goes on along the branch that
the arm is on, or as near to the target as that leads.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.inverse.prepared import prepared_map
from softreach.inverse.request import RESIDUALS, as_activations
from softreach.inverse.roots import descend
from softreach.inverse.solve import solve_inverse
from softreach.rod.rods import all_inputs, as_tip_map, free_bundles, measured_bundles
from softreach.rod.tip_map import TipMap
from softreach.schema import AXES, activation_attributes, bundle_coordinates, provenance
from softreach.support.arguments import as_number
from softreach.support.arrays import Array, Mask, as_points
from softreach.support.errors import InvalidInput
from softreach.support.units import LengthUnit
from softreach.workspace.search import CLOSELY, nearest_tips

if TYPE_CHECKING:
    import xarray as xr

_LONGEST = 0.1  # predicted change of activation in one substep, in ranges
_SHORTEST = 1e-10  # substep at which a branch is at its end, in L
_SHORTEST_TORN = 1e-7  # the same where stability is lost: there the tip moves without limit
_CORRECTION = 0.25  # against the prediction, beyond which the branch may have been left
_AT_BOUND = 1e-9  # in ranges
_MOST_CORRECTIONS = 10
_SINGULAR = 1e-10  # singular values below this part of the largest do not count


def track_path(
    arm: Manipulator | TipMap,
    path: ArrayLike,
    start: ArrayLike | None = None,
    *,
    residual_over_length: float = 1e-10,
    tol: float = 1e-6,
    point: str | None = None,
) -> xr.Dataset:
    """Follow a path of tip positions, straight between its points, on one branch.

    Each substep is predicted by the Jacobian and corrected by Newton's method; it is halved while
    the correction is large, while det J changes sign (three free bundles), while a bound is
    overstepped or while the arm snaps. With more free bundles the change of
    activation is least in every substep, and bundles wait at their bounds. The posture of an arm
    under loads is continued along the path, from that to which the start leads from rest.

    Args:
        arm: A design with three free bundles or more, or its tip map.
        path: Tip positions in order [m], shape (k, 3).
        start: Activation to begin with [-], shape (bundles,); it is corrected to the first point.
            By default the best-conditioned of all solutions there.
        residual_over_length: |tip - point| to which activations are corrected, in L. Where the
            bounds do not let the tip come so near, a point is followed by the nearest tip as far as
            `tol`: whether the arm reaches it is more than its tips can say.
        tol: Largest error of the tips themselves, in L. A tip map keeps its own.
        point: Name of the marker that counts as the tip, such as that of a tool; by default that
            of the design. Of a tip map its own counts.

    Returns:
        Dataset over `point` with `activation` [-] and `tip_error` [m], NaN beyond the end of the
        branch, and `status` (`PathStatus`); `end_activation` and `end_position` are the last on
        the branch, `end_length` the length of path up to there and `end_length_error` how much
        farther the branch may go [m]; the attributes name how it ended: `end` ("end" if the whole
        path is followed, else `fold`, `bound`, `snaps` or `no_start`), `end_bundle` and
        `end_bound`.

    Raises:
        InvalidInput: Arguments of another shape or not finite, or fewer than three free bundles.

    Examples:
        >>> path = sr.track_path(sr.designs.minimal_trunk(), [[0.2, 0.1, 0.6], [0.2, 0.15, 0.6]])
        >>> path.activation.values.round(2)
        array([[-1.14, -0.82, -0.92],
               [-1.16, -0.85, -0.89]])
    """
    points = as_points("path", path)
    tip_map = measured_bundles(as_tip_map(arm, tol, point=point))
    if (free := tip_map.box.dimension) < 3:
        raise InvalidInput("free bundles", free, "3 or more to follow a path in space")
    if not len(points):
        raise InvalidInput("path.shape", points.shape, "of shape (k, 3) with one point or more")
    residual = as_number("residual_over_length", residual_over_length, RESIDUALS)
    tracker = Continuation(free_bundles(tip_map), residual * tip_map.length)
    first = None
    if start is not None:
        gamma = as_activations("start", start, tip_map.box, 1)[0]
        gamma = gamma / tip_map.measures[tip_map.box.free]
        first = tracker.corrected_start(tracker.box.clip(gamma), points[0])
    else:
        options = {"residual_over_length": residual, "from_rest": True}
        (solution,) = solve_inverse(tip_map, points[:1], **options)
        if len(solution):
            best = solution.activations[solution.conditions.argmin()] / tip_map.measures
            first = tracker.at(best[tip_map.box.free])
    end = None if first is None else BranchEnd(PathStatus.FOLLOWED, first.kept())
    followed = [] if end is None else [end.point]
    while end is not None and end.status == PathStatus.FOLLOWED and len(followed) < len(points):
        end = tracker.follow(end.point, *points[len(followed) - 1 : len(followed) + 1])
        if end.status == PathStatus.FOLLOWED:
            followed.append(end.point)
    tolerances = {"tol": tip_map.tol, "residual_over_length": residual}
    return _dataset(tip_map, points, followed, end).assign_attrs(tolerances)


class PathStatus(IntEnum):
    """Outcome for a point of the path."""

    FOLLOWED = 0
    """The tip is there, on the branch of the start: `tip_error` says how near."""
    FOLD = 1
    """Beyond a fold: the branch turns back before this point."""
    BOUND = 2
    """Beyond a bound: too few bundles could move on within theirs."""
    NO_START = 3
    """The first point cannot be reached, or not from the start given."""
    SNAPS = 4
    """Beyond a loss of stability: there the arm under loads snaps to another posture."""


def end_text(track: xr.Dataset, unit: LengthUnit) -> str:
    """Where a path that `track_path` followed ends, and why there, in words."""
    count, points = int((track.status == PathStatus.FOLLOWED).sum()), track.sizes["point"]
    end, way = track.attrs["end"], unit.rounded(float(track.end_length))
    if end == "no_start":
        return "The first point cannot be reached, or not from the starting activation."
    if end == "end":
        return f"All {points} points are followed: {way} of path."
    error = unit.rounded(float(track.end_length_error), digits=".1g")
    reasons = {
        "fold": "the branch turns back (a fold)",
        "snaps": f"the arm snaps to another posture (± {error})",
        "bound": "{end_bundle} is at its {end_bound} bound",
    }
    reason = reasons[end].format(**track.attrs)
    return f"{count} of {points} points are followed, {way} of path: there {reason}."


_MEANINGS = " ".join(f"{status.value}={status.name.lower()}" for status in PathStatus)


class Continuation:
    """Following branches of solutions of one tip map, all of whose bundles are free."""

    def __init__(self, tip_map: TipMap, residual: float) -> None:
        """Set up for tips within `residual` [m] of their points, or as near as tips can tell."""
        self.tip_map, self.box, self.residual = tip_map, tip_map.box, residual
        self.reach_tol = max(residual, tip_map.tol * tip_map.length)
        self._torn = False  # whether the last correction met a place where the arm snaps

    def at(self, gamma: Array, tip_map: TipMap | None = None) -> BranchPoint:
        """A tip map linearized at an activation (m,), by default that of postures from rest."""
        tip_map = tip_map or self.tip_map
        tips, slopes = tip_map.tips_and_slopes(gamma[None])
        return BranchPoint(gamma, tips[0], slopes[0], tip_map)

    def corrected_start(self, gamma: Array, target: Array) -> BranchPoint | None:
        """The activation corrected to a first target, if it can be within the bounds."""
        start = self._corrected(self.tip_map, gamma, target, self.box.is_free)
        if start is None or (self.box.excess(start.gamma) > _AT_BOUND).any():
            return self._within_bounds(self.tip_map, gamma, target[None])
        return self._clipped(start)

    def follow(self, point: BranchPoint, begin: Array, end: Array) -> BranchEnd:
        """Move the tip from one place straight to another, as far as the branch goes."""
        done, part, torn = 0.0, 1.0, False
        distance = float(np.linalg.norm(end - begin))
        if distance == 0.0:
            return BranchEnd(PathStatus.FOLLOWED, point, done=1.0)
        shortest = _SHORTEST * self.tip_map.length / distance
        shortest_torn = _SHORTEST_TORN * self.tip_map.length / distance
        while done < 1.0:
            part = min(part, 1.0 - done)
            last = part >= 1.0 - done
            target = end if last else begin + (done + part) * (end - begin)
            ahead = self._predicted(point, target)
            torn = torn or self._torn
            if isinstance(ahead, BranchEnd):
                # Where a bound is met, the tip may be as near as tips can tell.
                if (beside := self._beside(point, target)) is None:
                    return ahead._replace(done=done, error=shortest * distance)
                ahead = beside
            if isinstance(ahead, BranchPoint):
                point, torn = ahead.kept(), False
                done, part = 1.0 if last else done + part, 2 * part
            elif part * ahead < (shortest_torn if torn else shortest):
                if (beside := self._beside(point, end)) is not None:
                    return BranchEnd(PathStatus.FOLLOWED, beside, done=1.0)
                why = PathStatus.SNAPS if torn else PathStatus.FOLD
                return BranchEnd(why, point, done=done, error=part * distance)
            else:
                part *= ahead
        return BranchEnd(PathStatus.FOLLOWED, point, done=1.0)

    def _predicted(self, point: BranchPoint, target: Array) -> BranchPoint | BranchEnd | float:
        """Predict and correct, bundles held at bounds; a number says how to shorten the substep."""
        gamma, bundle, upper, self._torn = point.gamma, -1, False, False
        moving = self.box.is_free
        while moving.sum() >= 3:
            step = _least_norm(point.slope, moving) @ (target - point.tip)
            size = np.abs(step / self.box.scales).max()
            ahead = gamma + step
            blocked = moving & self._at_bound(gamma) & (self.box.excess(ahead) > _AT_BOUND)
            if not blocked.any():
                if size > _LONGEST:
                    return float(0.9 * _LONGEST / size)
                corrected = self._corrected(point.tip_map, ahead, target, moving)
                if corrected is None or self._left_branch(point, ahead, corrected):
                    return 0.5
                over = self.box.excess(corrected.gamma) > _AT_BOUND
                if not over.any():
                    return self._clipped(corrected)
                blocked = over & self._at_bound(gamma)
                if not blocked.any():  # end just inside the bounds
                    way = (corrected.gamma - gamma)[over]
                    bound = np.where(way > 0.0, self.box.high[over], self.box.low[over])
                    inside = 1.0 - 0.5 * _AT_BOUND * self.box.scales[over] / np.abs(way)
                    part = (bound - gamma[over]) / way * np.minimum(inside, 1 - 1e-6)
                    return float(np.clip(part.min(), 1e-6, 0.9999))
                ahead = corrected.gamma
            bundle = int(np.flatnonzero(blocked)[0])
            upper = bool(ahead[bundle] > self.box.high[bundle])
            moving = moving & ~blocked
        return BranchEnd(PathStatus.BOUND, point, bundle, upper)

    def _beside(self, point: BranchPoint, target: Array) -> BranchPoint | None:
        """The point of the branch that is at a place as far as tips can tell; None if none is."""
        # All of the way there has to be as near to the reachable set: half of it is looked at.
        targets = np.array([0.5 * (point.tip + target), target])
        beside = self._within_bounds(point.tip_map, point.gamma, targets)
        if beside is None or self._left_branch(point, beside.gamma, beside):
            return None
        far = np.abs(beside.gamma - point.gamma) > _LONGEST * self.box.scales
        return None if far.any() else beside

    def _within_bounds(self, tip_map: TipMap, gamma: Array, targets: Array) -> BranchPoint | None:
        """Nearest to the last of some places (k, 3), if all are as near as tips can tell."""
        start = np.tile(gamma, (len(targets), 1))
        ends = descend(tip_map, targets, start, self.residual)
        if not (ends.distance <= self.reach_tol).all():
            return None
        return self.at(ends.gamma[-1], tip_map)

    def _corrected(
        self, tip_map: TipMap, gamma: Array, target: Array, moving: Mask
    ) -> BranchPoint | None:
        """Newton's method with the least-norm step of the moving bundles; None if it fails."""
        least, self._torn = np.inf, False
        for _ in range(_MOST_CORRECTIONS):
            point = self.at(gamma, tip_map)
            if not np.isfinite(point.slope).all():
                self._torn = True
                return None
            error = target - point.tip
            residual = float(np.linalg.norm(error))
            if residual <= 0.1 * self.residual:
                return point
            if residual > 2 * least:
                return None
            least = min(least, residual)
            gamma = gamma + _least_norm(point.slope, moving) @ error
            if (self.box.excess(gamma) > 0.1).any():
                return None
        return None

    def _left_branch(self, point: BranchPoint, ahead: Array, corrected: BranchPoint) -> bool:
        """True if the correction was large, or passed a fold."""
        predicted = np.linalg.norm((ahead - point.gamma) / self.box.scales)
        correction = np.linalg.norm((corrected.gamma - ahead) / self.box.scales)
        if correction > _CORRECTION * predicted + 1e-9:
            return True
        if point.slope.shape[1] > 3:
            return False
        return bool(np.linalg.det(point.slope) * np.linalg.det(corrected.slope) <= 0)

    def _clipped(self, point: BranchPoint) -> BranchPoint:
        gamma = self.box.clip(point.gamma)
        return point if np.array_equal(gamma, point.gamma) else self.at(gamma, point.tip_map)

    def _at_bound(self, gamma: Array) -> Mask:
        return self.box.excess(gamma) >= -2 * _AT_BOUND


class BranchPoint(NamedTuple):
    """An activation with the tip map linearized there."""

    gamma: Array  # activation of the free bundles [-], (m,)
    tip: Array  # tip [m], (3,)
    slope: Array  # ∂r/∂γ [m], (3, m)
    tip_map: TipMap  # the tip map, whose posture it is

    def kept(self) -> BranchPoint:
        """The same, to go on from this posture."""
        return self._replace(tip_map=self.tip_map.continued_from(self.gamma[None]))


class BranchEnd(NamedTuple):
    """End of a branch as far as it was followed."""

    status: PathStatus
    point: BranchPoint  # the last point on it
    bundle: int = -1  # the bundle at its bound
    upper: bool = False  # True for its upper bound
    done: float = 0.0  # the part of the way to the next point that was followed [-]
    error: float = 0.0  # largest distance that the branch may go farther [m]


def _least_norm(slope: Array, moving: Mask) -> Array:
    """Pseudoinverse of the Jacobian of the moving bundles, shape (m, 3): theory (39)."""
    return np.asarray(np.linalg.pinv(slope * moving, rcond=_SINGULAR), np.float64)


def _dataset(
    tip_map: TipMap, points: Array, followed: list[BranchPoint], end: BranchEnd | None
) -> xr.Dataset:
    import xarray as xr

    box, n = tip_map.box, len(followed)
    units = activation_attributes(tip_map.arm, box.names)
    outcome = PathStatus.NO_START if end is None else end.status
    status = np.where(np.arange(len(points)) < n, PathStatus.FOLLOWED, outcome).astype(np.int8)
    activation, measures = np.full((len(points), box.bundles), np.nan), tip_map.measures
    lengths, error = np.linalg.norm(np.diff(points, axis=0), axis=1), np.full(len(points), np.nan)
    length = length_error = np.nan
    end_activation, end_position = np.full(box.bundles, np.nan), np.full(3, np.nan)
    bundle = bound = ""
    if end is not None:
        activation[:n] = box.with_fixed(np.array([point.gamma for point in followed]))
        tips = np.array([point.tip for point in followed])
        error[:n] = np.linalg.norm(tips - points[:n], axis=1)
        end_activation, end_position = box.with_fixed(end.point.gamma[None])[0], end.point.tip
        length, length_error = float(lengths[: n - 1].sum()), end.error
        if end.status != PathStatus.FOLLOWED:
            length += end.done * float(lengths[n - 1])
        if end.status == PathStatus.BOUND:
            bundle, bound = box.names[box.free[end.bundle]], "upper" if end.upper else "lower"
    return xr.Dataset(
        {
            "position": (("point", "axis"), points, {"units": "m"}),
            "activation": (("point", "bundle"), activation * measures, units),
            "tip_error": ("point", error, {"units": "m"}),
            "status": ("point", status, {"units": "1", "meanings": _MEANINGS}),
            "end_activation": ("bundle", end_activation * measures, units),
            "end_position": ("axis", end_position, {"units": "m"}),
            "end_length": ((), length, {"units": "m"}),
            "end_length_error": ((), length_error, {"units": "m"}),
        },
        {"axis": list(AXES), **bundle_coordinates(tip_map.arm, tip_map.box.names)},
        {
            **provenance(tip_map.arm, tip_map.frame),
            "end": "end" if outcome == PathStatus.FOLLOWED else outcome.name.lower(),
            "end_bundle": bundle,
            "end_bound": bound,
        },
    )


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
