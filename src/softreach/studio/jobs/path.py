"""Jobs of a path of the tip: followed, and played."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from softreach.inverse.path import PathStatus, track_path
from softreach.studio.session import AskedJob, Job
from softreach.studio.settings import TipPath
from softreach.studio.state import StudioState, solvable_rod
from softreach.studio.work import StaleCheck

_RESIDUAL = 1e-8  # [L]
_STEP = 0.05  # [s] between points that are played


class FollowPath(Job):
    """The activations along the path, and where the branch ends."""

    depends_on = "design", "path.points", "path.start"
    only_with = "path"

    def run(self, check: StaleCheck) -> None:
        check()
        session, state = self.session, self.session.state
        session.figures.track = None
        if state.path is None:
            session.scene.remove("/path")
            session.show()
            return
        points = np.array(state.path.points)
        session.scene.draw_path(points / state.design.length, np.empty((0, 3)))
        with session.working("following the path"):
            self._follow(state, state.path, points)
        check()
        session.show()

    def _follow(self, state: StudioState, path: TipPath, points: np.ndarray) -> None:
        session, rod = self.session, solvable_rod(state.design)
        fits = path.start is not None and len(path.start) == rod.box.bundles
        start = rod.box.clip(np.array(path.start)) if fits else None
        track = track_path(rod, points, start, residual_over_length=_RESIDUAL)
        session.figures.track = track
        done = points[track.status.values == PathStatus.FOLLOWED]
        if len(done) and len(done) < len(points):
            done = np.concatenate([done, track.end_position.values[None]])
        session.scene.draw_path(points / state.design.length, done / state.design.length)


class PlayPath(AskedJob):
    """Moves the arm along the path."""

    def do(self, check: StaleCheck) -> None:
        track, path = self.session.figures.track, self.session.state.path
        if track is None or path is None:
            return
        count = int((track.status == PathStatus.FOLLOWED).sum())
        first = path.at if path.at < count - 1 else 0
        for point in range(first, count):
            check()
            self.session.update(lambda state, k=point: at_point(state, track.activation.values, k))
            time.sleep(_STEP)


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
