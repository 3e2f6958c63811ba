"""Activations that follow a path of tip positions continuously, on one branch of solutions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.errors import InvalidInput
from softreach.inverse import PathStatus, solve_inverse
from softreach.inverse.continuation import BranchEnd, BranchPoint, Continuation
from softreach.inverse.request import checked_activations, checked_residual, checked_targets
from softreach.inverse.roots import placed
from softreach.rod.free_bundles import free_bundles
from softreach.rod.measured_bundles import bundle_measures, measured_bundles
from softreach.rod.stable_tips import stable_tips
from softreach.rod.tip_map import TipMap, tip_map
from softreach.schema import AXES, activation_attributes, bundle_coordinates, provenance

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["PathStatus", "track_path"]

Array = NDArray[np.float64]

_MEANINGS = " ".join(f"{status.value}={status.name.lower()}" for status in PathStatus)


def track_path(
    arm: Manipulator | TipMap,
    path: ArrayLike,
    start: ArrayLike | None = None,
    *,
    residual_over_length: float = 1e-10,
    tol: float = 1e-6,
) -> xr.Dataset:
    """Follow a path of tip positions, straight between its points, on one branch.

    Each substep is predicted by the Jacobian and corrected by Newton's method; it is halved while
    the correction is large, while det J changes sign (three free bundles), while a bound is
    overstepped or while there is no stable equilibrium. With more free bundles the change of
    activation is least in every substep, and bundles wait at their bounds.

    Args:
        arm: A design with three free bundles or more, or its tip map.
        path: Tip positions in order [m], shape (k, 3).
        start: Activation to begin with [-], shape (bundles,); it is corrected to the first point.
            By default the best-conditioned of all solutions there.
        residual_over_length: Largest |tip - point|, in L.
        tol: Largest error of the tips themselves, in L. A tip map keeps its own.

    Returns:
        Dataset over `point` with `activation` [-] and `tip_error` [m], NaN beyond the end of the
        branch, and `status` (`PathStatus`); `end_activation` and `end_position` are the last on
        the branch, `end_length` the length of path up to there and `end_length_error` how much
        farther the branch may go [m]; the attributes name how it ended: `end` ("" if the whole
        path is followed, else `fold`, `bound`, `unstable` or `no_start`), `end_bundle` and
        `end_bound`.

    Raises:
        InvalidInput: Arguments of another shape or not finite, or fewer than three free bundles.
    """
    points = checked_targets("path", path)
    rod = measured_bundles(tip_map(arm, tol))
    if rod.box.dimension < 3:
        raise InvalidInput("free bundles", rod.box.dimension, "3 or more to follow a path in space")
    if not len(points):
        raise InvalidInput("path.shape", points.shape, "of shape (k, 3) with one point or more")
    residual = checked_residual(residual_over_length)
    tracker = Continuation(free_bundles(stable_tips(rod)), residual * rod.length)
    if start is not None:
        gamma = checked_activations("start", start, rod.box, 1)[0]
        gamma = gamma / bundle_measures(rod)[rod.box.free]
        first = tracker.corrected_start(tracker.box.clip(gamma), points[0])
    else:
        first = _best_start(rod, tracker, points[0], residual)
    followed, end = ([], None) if first is None else _followed(tracker, first, points)
    asked = {"tol": rod.tol, "residual_over_length": residual}
    return _dataset(rod, points, followed, end).assign_attrs(asked)


def _best_start(
    rod: TipMap, tracker: Continuation, target: Array, residual: float
) -> BranchPoint | None:
    """The best-conditioned solution for the first target, if there is one."""
    solution = solve_inverse(rod, target[None], residual_over_length=residual)[0]
    if not len(solution):
        return None
    best = solution.activations[solution.conditions.argmin()] / bundle_measures(rod)
    return tracker.at(best[rod.box.free])


def _followed(
    tracker: Continuation, first: BranchPoint, points: Array
) -> tuple[list[Array], BranchEnd]:
    """Activations of the free bundles at the points that the branch leads to, and its end."""
    end = BranchEnd(PathStatus.FOLLOWED, first)
    followed = [first.gamma]
    for k in range(1, len(points)):
        end = tracker.follow(end.point, points[k - 1], points[k])
        if end.status != PathStatus.FOLLOWED:
            break
        followed.append(end.point.gamma)
    return followed, end


def _dataset(
    rod: TipMap, points: Array, followed: list[Array], end: BranchEnd | None
) -> xr.Dataset:
    """The result; `end` is None if there was nothing to begin with."""
    import xarray as xr

    box, n, units = rod.box, len(followed), activation_attributes(rod.arm)
    outcome = PathStatus.NO_START if end is None else end.status
    status = np.full(len(points), int(outcome), np.int8)
    status[:n] = PathStatus.FOLLOWED
    activation, measures = np.full((len(points), box.bundles), np.nan), bundle_measures(rod)
    length, length_error = _end_length(points, n, end)
    error = np.full(len(points), np.nan)
    end_activation, end_position = np.full(box.bundles, np.nan), np.full(3, np.nan)
    bundle = bound = ""
    if end is not None:
        activation[:n] = box.with_held(np.array(followed))
        error[:n] = np.linalg.norm(placed(rod, activation[:n])[0] - points[:n], axis=1)
        end_activation, end_position = box.with_held(end.point.gamma[None])[0], end.point.tip
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
        {"axis": list(AXES), **bundle_coordinates(rod.arm)},
        {
            **provenance(rod.arm),
            "end": "" if outcome == PathStatus.FOLLOWED else outcome.name.lower(),
            "end_bundle": bundle,
            "end_bound": bound,
        },
    )


def _end_length(points: Array, followed: int, end: BranchEnd | None) -> tuple[float, float]:
    """The length of path up to the end of the branch [m], and its error."""
    if end is None:
        return np.nan, np.nan
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = float(lengths[: followed - 1].sum())
    if end.status != PathStatus.FOLLOWED:
        length += end.done * float(lengths[followed - 1])
    return length, end.error
