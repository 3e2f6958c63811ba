"""Shapes of loaded arms at stations, from what a kernel keeps of their sections."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.rod.tip_map import Frames

__all__ = ["Shapes", "shapes_of"]

Array = NDArray[np.float64]


class Shapes(NamedTuple):
    """Arms at stations."""

    frames: Frames
    moment: Array
    """m [N m] in the directors, shape (n, station, 3)."""
    force: Array
    """n [N] in the directors, shape (n, station, 3)."""

    @classmethod
    def empty(cls, n: int, stations: int) -> Shapes:
        """Room for n."""
        position, moment, force = np.empty((3, n, stations, 3))
        return cls(Frames(position, np.empty((n, stations, 3, 3))), moment, force)

    def put(self, rows: slice, some: Shapes) -> None:
        """Put some into place."""
        self.frames.position[rows], self.frames.directors[rows] = some.frames
        self.moment[rows], self.force[rows] = some.moment, some.force


def shapes_of(
    tips: Array,
    trace: Array,
    force: Array,
    stations: Array,
    lost: NDArray[np.bool_],
    axes: Array,
) -> Shapes:
    """Shapes from what the kernel keeps of sections: axes, moment and tip as each sees them."""
    seen = _orthonormal(trace[..., 0:3], trace[..., 3:6])
    turn = _matrix(trace[..., 12:16])
    world = seen @ turn  # axes of the world in the directors
    directors = np.swapaxes(world, -1, -2) @ axes
    back = np.einsum("nsac,nsc->nsa", seen, trace[..., 9:12]) @ axes
    position = tips[:, None] - back
    position[:, stations == 0.0] = 0.0
    directors[:, stations == 0.0] = np.eye(3)
    moment = np.einsum("nsc,nscd->nsd", trace[..., 6:9], turn)
    follower = np.einsum("nsc,nscd->nsd", trace[..., 16:19], turn)
    thrust = np.einsum("sa,nsad->nsd", force, world) + follower
    for values in (position, directors, moment, thrust):
        values[lost] = np.nan
    return Shapes(Frames(position, directors), moment, thrust)


def _orthonormal(g: Array, h: Array) -> Array:
    """Axes of the world in the frame of the walk, without the errors of the steps."""
    g = g / np.linalg.norm(g, axis=-1, keepdims=True)
    h = h - (g * h).sum(axis=-1, keepdims=True) * g
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    return np.stack([g, h, np.cross(g, h)], axis=-2)


def _matrix(q: Array) -> Array:
    """Rotation matrices of unit quaternions, shape (..., 3, 3)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
