"""Jobs of a path of the tip: followed, played, written as an animation; paths of plain shapes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.inverse.path import PathStatus, track_path
from softreach.plot.path_movie import path_movie
from softreach.studio.reach import cloud_points
from softreach.studio.session import AskedJob, Job
from softreach.studio.settings import TipPath
from softreach.studio.state import Camera, StudioState, solvable_rod
from softreach.studio.work import StaleCheck
from softreach.support.errors import InvalidInput

_RESIDUAL = 1e-8  # [L]
_STEP = 0.05  # [s] between points that are played
_LEVEL = 14  # of the cloud behind an animation


class FollowPath(Job):
    """The activations along the path, and where the branch ends."""

    depends_on = "design", "path.points", "path.start"
    only_with = "path"

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
        track = track_path(rod, points, start, residual_over_length=_RESIDUAL)
        session.figures.track = track
        done = points[track.status.values == PathStatus.FOLLOWED]
        if len(done) and len(done) < len(points):
            done = np.concatenate([done, track.end_position.values[None]])
        session.scene.draw_path(points / state.design.length, done / state.design.length)


class PlayPath(AskedJob):
    """Moves the arm along the path."""

    def do(self, check: StaleCheck) -> None:
        """Move from where the arm is, or from the first point, to the last that is followed."""
        track, path = self.session.figures.track, self.session.state.path
        if track is None or path is None:
            return
        count = int((track.status == PathStatus.FOLLOWED).sum())
        first = path.at if path.at < count - 1 else 0
        for point in range(first, count):
            check()
            self.session.update(lambda state, k=point: at_point(state, track.activation.values, k))
            time.sleep(_STEP)


class WriteMovie(AskedJob):
    """The arm along its path as a GIF."""

    def do(self, check: StaleCheck) -> None:
        """Draw and send it; says how far it is, and can be canceled."""
        session, path = self.session, self.session.state.path
        track, reach = session.figures.track, session.reach
        if track is None or path is None or reach is None:
            raise InvalidInput("path", "none yet", "followed before it is animated")

        def progress(share: float) -> None:
            check()
            session.report(f"drawing path.gif, {100 * share:.0f} %")

        movie = path_movie(
            track,
            reach.arm.length * cloud_points(reach, _LEVEL),
            view=view_from(session.camera.usual()),
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


def view_from(camera: Camera) -> tuple[float, float]:
    """Azimuth and elevation of the camera [rad]."""
    x, y, z = np.subtract(camera.position, camera.look_at)
    return float(np.arctan2(y, x)), float(np.arctan2(z, np.hypot(x, y)))


# Paths of a few plain shapes that begin at the tip.


Array = NDArray[np.float64]

PLANES: Mapping[str, tuple[int, int]] = {"x, y": (0, 1), "x, z": (0, 2), "y, z": (1, 2)}
"""The plane of a shape: its first and its second direction."""

_POINTS = 97


def drawn_path(shape: str, plane: str, size: float, tip: ArrayLike) -> Array:
    """A shape through the tip, which is where it begins.

    Args:
        shape: One of `PATH_SHAPES`.
        plane: One of `PLANES`.
        size: Largest extent, in the unit of the tip; negative for the other side.
        tip: Where it begins.

    Returns:
        Points in the unit of the tip, shape (n, 3).

    Raises:
        InvalidInput: An unknown shape or plane, or no size.
    """
    for name, value, known in (("shape", shape, PATH_SHAPES), ("plane", plane, PLANES)):
        if value not in known:
            raise InvalidInput(name, value, f"one of {', '.join(known)}")
    if not (np.isfinite(size) and size != 0):
        raise InvalidInput("size", size, "a finite number other than 0")
    across = PATH_SHAPES[shape](np.linspace(0.0, 1.0, _POINTS))
    points = np.tile(np.asarray(tip, float), (_POINTS, 1))
    points[:, PLANES[plane]] += size * across
    return points


def straight_path(corners: ArrayLike, points: int = _POINTS) -> Array:
    """Even points on the straight lines between corners, which are among them, shape (n, 3)."""
    places = np.asarray(corners, float)
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    pieces = np.maximum(1, np.round(points * lengths / max(lengths.sum(), 1e-300)).astype(int))
    parts = [
        start + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * (end - start)
        for start, end, count in zip(places[:-1], places[1:], pieces, strict=True)
    ]
    return np.concatenate([*parts, places[-1:]])


def _circle(share: Array) -> Array:
    angle = 2 * np.pi * share
    return np.stack([np.cos(angle) - 1.0, np.sin(angle)], axis=1) / 2


def _figure_eight(share: Array) -> Array:
    angle = 2 * np.pi * share
    return np.stack([np.sin(angle), np.sin(2 * angle)], axis=1) / 2


def _line(share: Array) -> Array:
    return np.stack([share, np.zeros_like(share)], axis=1)


PATH_SHAPES: Mapping[str, Callable[[Array], Array]] = {
    "circle": _circle,
    "figure eight": _figure_eight,
    "line": _line,
}
"""From shares of the way, 0 to 1, to places in the plane."""
