"""Jobs of the moving arm: activations that reach a target, a tip that is dragged, a path."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.inverse.drag import Drag, Dragged
from softreach.inverse.path import PathStatus, track_path
from softreach.studio.found import Lag
from softreach.studio.job import Given, Job, Learned, Results
from softreach.studio.state import StudioState, Vector, solvable_rod, vector
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.inverse import Solution

_FAMILY = 6  # shapes offered where infinitely many reach the target
_DECIMALS = 5  # of the place where a drag rests [L]: a hundredth of a pixel, and can be read
_RESIDUAL = 1e-8  # [L]
_STEP = 0.05  # [s] between points that are played


def _solve(given: Given) -> Results:
    state = given.state
    if state.target is None:
        yield Learned({"answer": None})
        return
    answer, change = _solution(state, state.target), None
    if given.found.takes_nearest and len(answer):
        distance = np.linalg.norm(answer.activations - state.activation, axis=1)
        best = tuple(answer.activations[int(np.argmin(distance))].tolist())
        change = lambda now: now.replace(activation=best)
    yield Learned({"answer": answer, "takes_nearest": False}, change)


def _solution(state: StudioState, target: Vector) -> Solution:
    from softreach.inverse import solve_inverse

    solvable_rod(state.design)
    near = state.activation if len(state.activation) > 3 else None
    return solve_inverse(state.design, [target], near=near, family=_FAMILY, from_rest=True)[0]


def _draw_answer(given: Given) -> None:
    answer, design, scene = given.found.answer, given.state.design, given.scene
    scene.remove("/ghosts")
    if answer is None:
        scene.draw_target(None)
        return
    nearest = None if len(answer) else answer.nearest / design.length
    scene.draw_target(answer.target / design.length, nearest)
    shapes = answer.activations if len(answer) else answer.nearest_activation[None]
    scene.draw_ghosts(design, shapes)


SOLVE_INVERSE = Job(
    "inverse",
    ("design", "target"),
    _solve,
    _draw_answer,
    wanted=lambda state, _: state.target is not None,
    makes=("answer", "takes_nearest"),
    draws=("/ghosts", "/target", "/gap"),
)
"""The activations that reach the target, and their shapes."""


def _follow_tip(given: Given) -> Results:
    """Follow the latest place that a drag passes; where it rests, that is the target."""
    state, pull, drag = given.state, given.found.pull, given.found.drag
    if pull is None:
        return
    solvable_rod(state.design)
    if drag is None or drag.arm != state.design:
        drag = Drag(state.design)
    place = np.round(pull.place, _DECIMALS) if pull.rests else pull.place
    dragged = drag.to(state.activation, place * state.design.length)
    known: dict[str, Any] = {"drag": drag}
    if dragged is None:
        yield Learned(known)
    else:
        known |= {"held": (state.design, dragged), "lag": Lag(place, dragged)}
        target = vector(place * state.design.length) if pull.rests else None
        yield Learned(known, lambda now: _moved(now, state, dragged, target))
    if pull.rests:
        rested = lambda now: now.without(pull)
        yield Learned(rested, ends_step=True)


def _moved(
    now: StudioState, then: StudioState, dragged: Dragged, target: Vector | None
) -> StudioState:
    if now.design != then.design:
        raise InvalidInput("design", "changed", "unchanged while its tip is dragged")
    return now.replace(activation=dragged.activation, target=target)


DRAG_TIP = Job("drag", ("found.pull",), _follow_tip, makes=("pull", "lag"))
"""The arm follows its dragged tip on its branch; where that rests, every branch is looked for."""


def _follow(given: Given) -> Results:
    path = given.state.path
    yield Learned({"track": None})
    if path is not None:
        rod = solvable_rod(given.state.design)
        fits = path.start is not None and len(path.start) == rod.box.bundles
        start = rod.box.clip(np.array(path.start)) if fits else None
        track = track_path(rod, np.array(path.points), start, residual_over_length=_RESIDUAL)
        yield Learned({"track": track})


def _draw_path(given: Given) -> None:
    path, track, length = given.state.path, given.found.track, given.state.design.length
    if path is None:
        given.scene.remove("/path")
        return
    points, done = np.array(path.points), np.empty((0, 3))
    if track is not None and track.sizes["point"] == len(points):
        done = points[track.status.values == PathStatus.FOLLOWED]
        if len(done) and len(done) < len(points):
            done = np.concatenate([done, track.end_position.values[None]])
    given.scene.draw_path(points / length, done / length)


FOLLOW_PATH = Job(
    "path",
    ("design", "path.points", "path.start"),
    _follow,
    _draw_path,
    wanted=lambda state, _: state.path is not None,
    makes=("track",),
    draws=("/path",),
    doing="following the path",
)
"""The activations along the path, and where the branch ends."""


def _play(given: Given) -> Results:
    track, path = given.found.track, given.state.path
    if track is None or path is None:
        return
    count = int((track.status == PathStatus.FOLLOWED).sum())
    activations = track.activation.values
    for point in range(path.at if path.at < count - 1 else 0, count):
        given.check()
        yield Learned(change=lambda now, k=point: at_point(now, activations, k))
        time.sleep(_STEP)


PLAY_PATH = Job("play", (), _play)
"""Moves the arm along the path."""


def at_point(state: StudioState, activations: np.ndarray, point: int) -> StudioState:
    """The arm at a point of its path, with one of the activations there, shape (k, bundles).

    The state stays as it is where the path is not followed.
    """
    if state.path is None or point >= len(state.path.points) or point >= len(activations):
        return state
    there = activations[point]
    if not np.isfinite(there).all():
        return state
    path = replace(state.path, at=point)
    return state.replace(path=path, activation=tuple(there.tolist()))
