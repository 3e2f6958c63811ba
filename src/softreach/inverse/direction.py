"""Poses: places of tip and markers and a direction as rows of one search, by Gauss-Newton in a box.

Rows are (tip - target)/L, the same of each marker, and w q, where the rotation vector
q = (θ - cone)+ (e × d3)/|e × d3| says how far the direction d3 is from the cone around the wanted
e: theory (40). Where a whole frame is wanted, q is the rotation vector between both frames. All
vanish at a pose that meets its goals, next to which steps gain twice as many digits each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from softreach.inverse.request import Request
from softreach.kernels.box.bounded_descent import box_steps
from softreach.rod.inputs import ActivationBox
from softreach.rod.rods import at_marker
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index

Model = Callable[[Index, Array], tuple[Array, Array, Array]]
"""(which functions, activations (n, m)) -> values (n,), gradients (n, m), Hessians (n, m, m)."""

_MOST_STEPS = 120
_STEP_TOL = 1e-12  # step at which a search has converged, in ranges
_VALUE_TOL = 1e-14  # relative increase of a value that is rounding
_INSIDE = 0.999  # of a distance that is allowed: a search for it comes no nearer than that
_LEAST_DAMPING, _LARGEST_DAMPING = 1e-12, 1e8  # parts of the largest curvature
_EXACTLY: dict[str, Any] = {"within": 0.0, "marker_within": {}}
_PULLS = (1e-2, 1e-4, 1e-7, 0.0)
"""Falling weights of ½|γ - near|² beside the goals, so that of all poses that of least change is
found."""


class Poses(NamedTuple):
    """Ends of searches."""

    gamma: Array  # activations [-], (n, m)
    merit: Array  # half the sum of the squared rows, (n,)
    miss: Array  # largest of distances to targets and L times the angle to the cone [m], (n,)


def compromises(tip_map: TipMap, request: Request, start: Array) -> Poses:
    """Local minima of the sum of squared rows from starts (n, m), one for each target.

    From there those with what distances exceed `within` by, where that is asked for.
    """
    ends = _descended(tip_map, replace(request, **_EXACTLY), start, (0.0,))
    wide = request.within or any(request.marker_within.values())
    return _descended(tip_map, request, ends.gamma, (0.0,)) if wide else ends


def nearest_poses(tip_map: TipMap, request: Request, start: Array) -> Poses:
    """Poses that meet their goals with little change from `near`, from starts (n, m)."""
    return _descended(tip_map, replace(request, **_EXACTLY), start, _PULLS)


def direction_errors(tip_map: TipMap, request: Request, target: Index, gamma: Array) -> Array:
    """Angles between the tips' directions and those wanted for some targets [rad], shape (n,)."""
    if request.direction is None:
        return np.full(len(gamma), np.nan)
    if not len(gamma):
        return np.empty(0)
    if request.orientation is not None:
        return _angles_of_frames(tip_map.tip_frames(gamma), request.orientation[target])[0]
    return angles_from(tip_map.tip_directions(gamma), request.direction[target])[0]


def marker_errors(tip_map: TipMap, request: Request, target: Index, gamma: Array) -> Array:
    """Distances of markers from where they are wanted for some targets [m], (n, markers)."""
    errors = [
        np.linalg.norm(at_marker(tip_map, name).tips(gamma) - places[target], axis=1)
        for name, places in request.markers.items()
    ]
    return np.reshape(errors, (len(request.markers), len(gamma))).T


_Rows = tuple[Array, Array, Array]
"""Rows (n, 3), their derivatives (n, 3, m), and their lengths without weights, (n,)."""


def goal_rows(tip_map: TipMap, request: Request, which: Index, gamma: Array) -> _Rows:
    """Rows (n, r) of all goals, their derivatives (n, r, m) and the miss [m] at γ (n, m)."""
    motions = tip_map.tips_and_slopes if request.direction is None else tip_map.tip_motions
    (tips, slopes, *turns), length = motions(gamma), tip_map.length
    parts = [_place_rows(tips, slopes, request.targets[which], request.within, length)]
    if turns:
        parts.append(_turn_rows(tip_map, request, which, gamma, *turns))
    for name, places in request.markers.items():
        moved, within = at_marker(tip_map, name).tips_and_slopes(gamma), request.marker_within
        parts.append(_place_rows(*moved, places[which], within.get(name, 0.0), length))
    rows, slopes = (np.concatenate([part[k] for part in parts], axis=1) for k in (0, 1))
    return rows, slopes, length * np.max([part[2] for part in parts], axis=0)


def _place_rows(points: Array, slopes: Array, wanted: Array, within: float, length: float) -> _Rows:
    away, moves = (points - wanted) / length, slopes / length
    if within:
        away, moves = _beyond(away, moves, _INSIDE * within / length)
    return away, moves, np.linalg.norm(away, axis=1)


def _turn_rows(
    tip_map: TipMap, request: Request, which: Index, gamma: Array, directions: Array, turn: Array
) -> _Rows:
    assert request.direction is not None
    if request.orientation is not None:
        angle, axis = _angles_of_frames(tip_map.tip_frames(gamma), request.orientation[which])
    else:
        angle, axis = angles_from(directions, request.direction[which])
        along = np.einsum("ni,nij->nj", directions, turn)
        turn = turn - directions[:, :, None] * along[:, None]
    excess = (angle - request.cone).clip(0.0)
    if request.cone:  # along the cone nothing is wanted, nor inside of it
        turn = axis[:, :, None] * np.einsum("ni,nij->nj", axis, turn)[:, None]
        turn *= (excess > 0.0)[:, None, None]
    weight = request.direction_weight
    return weight * excess[:, None] * axis, weight * turn, excess


def _beyond(away: Array, moves: Array, room: float) -> tuple[Array, Array]:
    """The parts of vectors (n, 3) that are beyond a ball, and their derivatives, (n, 3, m)."""
    gap = np.linalg.norm(away, axis=1)
    axis = away / np.where(gap > 0.0, gap, 1.0)[:, None]
    share = np.minimum(1.0, room / np.where(gap > 0.0, gap, room))[:, None]
    along = axis[:, :, None] * np.einsum("ni,nij->nj", axis, moves)[:, None]
    moved = (1.0 - share)[:, None] * moves + share[:, None] * along
    return (1.0 - share) * away, moved * (share < 1.0)[:, None]


def angles_from(directions: Array, wanted: Array) -> tuple[Array, Array]:
    """Angles [rad], and the unit vectors around which directions are turned from those wanted."""
    cross = np.cross(wanted, directions)
    sine = np.linalg.norm(cross, axis=1)
    axis = cross / np.where(sine > 0.0, sine, 1.0)[:, None]
    return np.arctan2(sine, np.einsum("ni,ni->n", directions, wanted)), axis


def _angles_of_frames(frames: Array, wanted: Array) -> tuple[Array, Array]:
    """Angles [rad] and axes of the rotations from wanted frames to others, both (n, 3, 3)."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(frames @ wanted.transpose(0, 2, 1)).as_rotvec()
    angle = np.linalg.norm(turn, axis=1)
    return angle, turn / np.where(angle > 0.0, angle, 1.0)[:, None]


def _descended(tip_map: TipMap, request: Request, start: Array, pulls: tuple[float, ...]) -> Poses:
    """Descend from start i to target i with each of the pulls toward `near`, one after another."""
    gamma = tip_map.box.clip(start)
    for pull in pulls:
        gamma, _ = minimize(partial(pose_model, tip_map, request, pull), gamma, tip_map.box)
    rows, _, miss = goal_rows(tip_map, request, np.arange(len(gamma)), gamma)
    return Poses(gamma, 0.5 * _squares(rows), np.nan_to_num(miss, nan=np.inf))


def pose_model(
    tip_map: TipMap, request: Request, pull: float, which: Index, gamma: Array
) -> tuple[Array, Array, Array]:
    """½|rows|² + ½ pull |γ - near|² at activations (n, m) of searches `which` (n,).

    Values (n,), gradients (n, m) and Hessians (n, m, m) without the curvature of rows.
    """
    rows, slopes, _ = goal_rows(tip_map, request, which, gamma)
    change = gamma - request.near[which]
    value = 0.5 * _squares(rows) + 0.5 * pull * _squares(change)
    gradient = np.einsum("ni,nij->nj", rows, slopes) + pull * change
    hessian = slopes.transpose(0, 2, 1) @ slopes + pull * np.eye(gamma.shape[1])
    return value, gradient, hessian


def minimize(model: Model, start: Array, box: ActivationBox) -> tuple[Array, Array]:
    """Minimize function i from start i, shape (n, m), by damped Newton within the bounds.

    Activations of local minima, and the functions there (n,).
    """
    low, high, scales = box.low.copy(), box.high.copy(), box.scales
    gamma, damping = start.copy(), np.full(len(start), 1e-3)
    active = np.arange(len(start))
    value, gradient, hessian = model(active, gamma)
    active = active[np.isfinite(value)]
    for _ in range(_MOST_STEPS):
        if not len(active):
            break
        trial, damped = np.empty((len(active), start.shape[1])), damping[active]
        box_steps(gamma[active], gradient[active], hessian[active], damped, low, high, trial)
        step = (np.abs(trial - gamma[active]) / scales).max(axis=1, initial=0.0)
        ahead = model(active, trial)
        accepted = ahead[0] <= value[active] + _VALUE_TOL * np.abs(value[active])
        taken = active[accepted]
        gamma[taken] = trial[accepted]
        value[taken], gradient[taken], hessian[taken] = (part[accepted] for part in ahead)
        eased = np.maximum(0.1 * damped, _LEAST_DAMPING)
        damping[active] = np.where(accepted, eased, np.maximum(10.0 * damped, 1e-6))
        active = active[(step > _STEP_TOL) & (damping[active] < _LARGEST_DAMPING)]
    return gamma, value


def _squares(rows: Array) -> Array:
    return np.einsum("ni,ni->n", rows, rows)
