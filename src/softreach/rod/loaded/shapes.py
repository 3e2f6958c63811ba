"""Shapes of loaded arms at stations, from what a kernel keeps of their sections."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.base import rotation_matrices
from softreach.rod.tip_map import Frames

__all__ = ["LoadedShapes", "shapes_of"]

Array = NDArray[np.float64]


class LoadedShapes(NamedTuple):
    """Arms at stations."""

    frames: Frames
    moment: Array
    """m [N m] in the directors, shape (n, station, 3)."""
    force: Array
    """n [N] in the directors, shape (n, station, 3)."""

    @classmethod
    def empty(cls, n: int, stations: int) -> LoadedShapes:
        """Room for n."""
        position, moment, force = np.empty((3, n, stations, 3))
        return cls(Frames(position, np.empty((n, stations, 3, 3))), moment, force)

    def put(self, rows: slice, some: LoadedShapes) -> None:
        """Put some into place."""
        self.frames.position[rows], self.frames.directors[rows] = some.frames
        self.moment[rows], self.force[rows] = some.moment, some.force

    def on_base(self) -> LoadedShapes:
        """Moved and turned so that their last station stands on the base, and without it."""
        (position, directors), moment, force = self
        turn = np.swapaxes(directors[:, -1], -1, -2)
        position, directors = (position - position[:, -1:]) @ turn, directors @ turn[:, None]
        frames = Frames(position[:, :-1], directors[:, :-1])
        return LoadedShapes(frames, moment[:, :-1], force[:, :-1])


def shapes_of(
    tips: Array, trace: Array, rows: NDArray[np.intp], force: Array, stations: Array
) -> LoadedShapes:
    """Shapes from what the kernel keeps of sections; NaN where a tip is.

    Args:
        tips: r [m], shape (n, 3).
        trace: Of all boundaries of steps, tip first, as `respond` fills it.
        rows: The boundary of each station.
        force: Dead force at the stations along the world's axes [N], shape (station, 3).
        stations: Z [m].
    """
    axes = _world(trace[:, -1])[:, None]
    trace = trace[:, rows]
    world, turn = _world(trace), rotation_matrices(trace[..., 12:16])
    directors = np.swapaxes(world, -1, -2) @ axes
    back = _rows(trace[..., 9:12], turn) @ np.swapaxes(world, -1, -2) @ axes
    position = tips[:, None] - back[..., 0, :]
    position[:, stations == 0.0] = 0.0
    directors[:, stations == 0.0] = np.eye(3)
    moment = _rows(trace[..., 6:9], turn)[..., 0, :]
    thrust = _rows(force + trace[..., 16:19], world)[..., 0, :]
    for values in (position, directors, moment, thrust):
        values[np.isnan(tips).any(axis=1)] = np.nan
    return LoadedShapes(Frames(position, directors), moment, thrust)


def _rows(vectors: Array, matrices: Array) -> Array:
    """Row vectors times matrices, shape (..., 1, 3)."""
    return vectors[..., None, :] @ matrices


def _world(trace: Array) -> Array:
    """Axes of the world in the directors of sections, as rows, shape (..., 3, 3)."""
    return _orthonormal(trace[..., 0:3], trace[..., 3:6]) @ rotation_matrices(trace[..., 12:16])


def _orthonormal(g: Array, h: Array) -> Array:
    """Axes of the world in the frame of the walk, without the errors of the steps."""
    g = g / np.linalg.norm(g, axis=-1, keepdims=True)
    h = h - (g * h).sum(axis=-1, keepdims=True) * g
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    return np.stack([g, h, np.cross(g, h)], axis=-2)
