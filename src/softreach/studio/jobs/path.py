"""Jobs of a path of the tip: followed, and played."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from softreach.inverse.path import PathStatus, track_path
from softreach.studio.found import Found
from softreach.studio.job import Job, Learned, Page, Results, Tools
from softreach.studio.state import StudioState, solvable_rod

_RESIDUAL = 1e-8  # [L]
_STEP = 0.05  # [s] between points that are played


def _follow(state: StudioState, found: Found, tools: Tools) -> Results:
    del found, tools
    path = state.path
    yield Learned({"track": None})
    if path is not None:
        rod = solvable_rod(state.design)
        fits = path.start is not None and len(path.start) == rod.box.bundles
        start = rod.box.clip(np.array(path.start)) if fits else None
        track = track_path(rod, np.array(path.points), start, residual_over_length=_RESIDUAL)
        yield Learned({"track": track})


def _draw_path(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    if state.path is None:
        page.scene.remove("/path")
        return {}
    points, done, track = np.array(state.path.points), np.empty((0, 3)), found.track
    if track is not None and track.sizes["point"] == len(points):
        done = points[track.status.values == PathStatus.FOLLOWED]
        if len(done) and len(done) < len(points):
            done = np.concatenate([done, track.end_position.values[None]])
    page.scene.draw_path(points / state.design.length, done / state.design.length)
    return {}


FOLLOW_PATH = Job(
    "path",
    ("design", "path.points", "path.start"),
    _follow,
    _draw_path,
    wanted=lambda state: state.path is not None,
    makes=("track",),
    doing="following the path",
    draws=("/path",),
)
"""The activations along the path, and where the branch ends."""


def _play(state: StudioState, found: Found, tools: Tools) -> Results:
    track, path = found.track, state.path
    if track is None or path is None:
        return
    count = int((track.status == PathStatus.FOLLOWED).sum())
    activations = track.activation.values
    for point in range(path.at if path.at < count - 1 else 0, count):
        tools.check()
        yield Learned(change=lambda now, k=point: at_point(now, activations, k))
        time.sleep(_STEP)


PLAY_PATH = Job("play", (), _play)
"""Moves the arm along the path."""


def at_point(state: StudioState, activations: np.ndarray, point: int) -> StudioState:
    """The arm at a point of its path.

    Args:
        state: With a path.
        activations: At its points, shape (k, bundles).
        point: Which one; the state stays as it is where it is not followed.
    """
    if state.path is None or point >= len(state.path.points) or point >= len(activations):
        return state
    there = activations[point]
    if not np.isfinite(there).all():
        return state
    path = replace(state.path, at=point)
    return state.replace(path=path, activation=tuple(there.tolist()))
