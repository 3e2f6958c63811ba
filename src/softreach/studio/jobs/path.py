"""Follows the path of a tab with the arm, plays it, and writes it as an animation."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from softreach.inverse.path import PathStatus, track_path
from softreach.studio.jobs.job import AskedJob, Job
from softreach.studio.movie import path_movie
from softreach.studio.reach import cloud_points
from softreach.studio.rod import solvable_rod
from softreach.studio.settings import TipPath
from softreach.studio.state import Camera, StudioState
from softreach.studio.worker import StaleCheck
from softreach.support.errors import InvalidInput

__all__ = ["FollowPath", "PlayPath", "WriteMovie", "at_point"]

_RESIDUAL = 1e-8  # [L]
_STEP = 0.05  # [s] between points that are played
_LEVEL = 14  # of the cloud behind an animation


class FollowPath(Job):
    """The activations along the path, and where the branch ends."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """The design and the path, not how far along it the arm is."""
        path = state.path
        return path and (state.design, path.points, path.start)

    def run(self, check: StaleCheck) -> None:
        """Follow and draw it; or take away what was drawn."""
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
        found = track_path(rod, points, start, residual_over_length=_RESIDUAL)
        session.figures.track = found
        done = points[found.status.values == PathStatus.FOLLOWED]
        if len(done) and len(done) < len(points):
            done = np.concatenate([done, found.end_position.values[None]])
        session.scene.draw_path(points / state.design.length, done / state.design.length)


class PlayPath(AskedJob):
    """Moves the arm along the path."""

    def do(self, check: StaleCheck) -> None:
        """From where the arm is, or from the first point, to the last that is followed."""
        found, path = self.session.figures.track, self.session.state.path
        if found is None or path is None:
            return
        count = int((found.status == PathStatus.FOLLOWED).sum())
        first = path.at if path.at < count - 1 else 0
        for point in range(first, count):
            check()
            self.session.update(lambda state, k=point: at_point(state, found.activation.values, k))
            time.sleep(_STEP)


class WriteMovie(AskedJob):
    """The arm along its path as a GIF."""

    def do(self, check: StaleCheck) -> None:
        """Draw and send it; says how far it is, and can be canceled."""
        session, path = self.session, self.session.state.path
        found, reach = session.figures.track, session.reach
        if found is None or path is None or reach is None:
            raise InvalidInput("path", "none yet", "followed before it is animated")

        def progress(share: float) -> None:
            check()
            session.report(f"drawing path.gif, {100 * share:.0f} %")

        activations = found.activation.values[found.status.values == PathStatus.FOLLOWED]
        if not len(activations):
            raise InvalidInput("path", "not reached", "one whose first point is reached")
        arm = session.state.design
        points = np.array(path.points) / arm.length
        movie = path_movie(
            arm,
            activations,
            points,
            cloud_points(reach, _LEVEL),
            view=_view_from(session.eye.camera()),
            progress=progress,
        )
        check()
        session.client.send_file_download("path.gif", movie, save_immediately=True)
        session.say(f"path.gif is written: {len(movie) / 1e6:.1f} MB.")


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


def _view_from(camera: Camera) -> tuple[float, float]:
    """Azimuth and elevation of the eye [rad]."""
    x, y, z = np.subtract(camera.position, camera.look_at)
    return float(np.arctan2(y, x)), float(np.arctan2(z, np.hypot(x, y)))
