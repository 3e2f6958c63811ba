"""Activations that follow a path of tip positions continuously, on one branch of solutions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.errors import InvalidInput
from softreach.inverse import solve_inverse
from softreach.inverse.continuation import Continuation, PathStatus, Stop
from softreach.inverse.problem import checked_number, checked_targets
from softreach.rod.kinematics import tip_positions
from softreach.rod.tip_map import tip_map
from softreach.schema import AXES

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["PathStatus", "track_path"]

Array = NDArray[np.float64]


def track_path(
    arm: Manipulator,
    path: ArrayLike,
    start: ArrayLike | None = None,
    *,
    tol: float = 1e-10,
    tip_tol: float = 1e-6,
) -> xr.Dataset:
    """Follow a path of tip positions, straight between its points, on one branch.

    Each substep is predicted by the Jacobian and corrected by Newton's method; it is halved while
    the correction is large, while det J changes sign (three bundles) or while a bound is
    overstepped. With more bundles the change of activation is least in every substep, and bundles
    wait at their bounds.

    Args:
        arm: A design of three bundles or more.
        path: Tip positions in order [m], shape (k, 3).
        start: Activation to begin with [-], shape (bundles,); it is corrected to the first point.
            By default the best-conditioned of all solutions there.
        tol: Largest |tip - point|, in L.
        tip_tol: Largest error of the tips themselves, in L.

    Returns:
        Dataset over `point` with `activation` [-] and `tip_error` [m], NaN beyond the end of the
        branch, and `status` (`PathStatus`); `end_activation` and `end_position` are the last on
        the branch, and the attributes name how it ended: `end` ("" if the whole path is
        followed), `end_bundle` and `end_bound`.

    Raises:
        InvalidInput: Arguments of another shape or not finite, or fewer than three bundles.
    """
    points = checked_targets("path", path)
    if arm.bundles < 3:
        raise InvalidInput("arm.bundles", arm.bundles, "3 or more, to follow a path in space")
    if not len(points):
        raise InvalidInput("path.shape", points.shape, "of shape (k, 3) with one point or more")
    tracker = Continuation(arm, checked_number("tol", tol, 1e-13, 1e-2) * arm.length, tip_tol)
    activation = np.full((len(points), arm.bundles), np.nan)
    gamma = _first(tracker, points[0], start, tol)
    if gamma is None:
        return _dataset(tracker, points, activation, 0, Stop(PathStatus.NO_START, activation[0]))
    activation[0] = gamma
    for k in range(1, len(points)):
        stop = tracker.follow(activation[k - 1], points[k - 1], points[k])
        if stop.status != PathStatus.FOLLOWED:
            return _dataset(tracker, points, activation, k, stop)
        activation[k] = stop.gamma
    stop = Stop(PathStatus.FOLLOWED, activation[-1])
    return _dataset(tracker, points, activation, len(points), stop)


def _first(
    tracker: Continuation, point: Array, start: ArrayLike | None, tol: float
) -> Array | None:
    """An activation that puts the tip at the first point, if there is one."""
    arm = tracker.arm
    if start is not None:
        gamma = tip_map(arm, tracker.tip_tol).box.check(np.atleast_2d(np.asarray(start, float)))[0]
        return tracker.begun(np.clip(gamma, *arm.bounds.T), point)
    solution = solve_inverse(arm, point[None], tol=tol, tip_tol=tracker.tip_tol)[0]
    if not len(solution):
        return None
    return solution.activations[solution.condition.argmin()]


def _dataset(
    tracker: Continuation, points: Array, activation: Array, reached: int, stop: Stop
) -> xr.Dataset:
    import xarray as xr

    arm = tracker.arm
    status = np.full(len(points), int(stop.status), np.int8)
    status[:reached] = PathStatus.FOLLOWED
    error = np.full(len(points), np.nan)
    tips = tip_positions(arm, activation[:reached], tracker.tip_tol)
    error[:reached] = np.linalg.norm(tips - points[:reached], axis=1)
    last = np.full(3, np.nan)
    if np.isfinite(stop.gamma).all():
        last = tip_positions(arm, stop.gamma[None], tracker.tip_tol)[0]
    ended = stop.status == PathStatus.BOUND
    return xr.Dataset(
        {
            "position": (("point", "axis"), points, {"units": "m"}),
            "activation": (("point", "bundle"), activation, {"units": "1"}),
            "tip_error": ("point", error, {"units": "m"}),
            "status": ("point", status, {"units": "1", "meanings": _MEANINGS}),
            "end_activation": ("bundle", stop.gamma, {"units": "1"}),
            "end_position": ("axis", last, {"units": "m"}),
        },
        {"axis": list(AXES), "bundle": list(arm.bundle_names)},
        {
            "design": arm.to_toml(),
            "end": "" if stop.status == PathStatus.FOLLOWED else stop.status.name.lower(),
            "end_bundle": arm.bundle_names[stop.bundle] if ended else "",
            "end_bound": ("upper" if stop.upper else "lower") if ended else "",
        },
    )


_MEANINGS = " ".join(f"{status.value}={status.name.lower()}" for status in PathStatus)
