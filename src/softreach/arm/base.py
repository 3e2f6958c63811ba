"""The pose of an arm: where in the world its base is clamped, and which way it points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.number import as_numbers, number
from softreach.arm.part import Part, Triple
from softreach.support.arrays import Array, read_only
from softreach.support.errors import Fault
from softreach.support.lazy import lazy

Matrix = tuple[Triple, Triple, Triple]

POINTS: Mapping[str, Matrix] = MappingProxyType(
    {
        "up": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        "down": ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)),
        "x": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)),
        "-x": ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
        "y": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
        "-y": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    }
)
"""Rotations by the way in the world in which the straight arm then points: about x, but about y
where it points along x. All numbers are exact."""

_ALLOWED = (
    f"must be one of {', '.join(POINTS)}, or a rotation: a 3x3 matrix or a quaternion (w, x, y, z)"
)
_NEAR = 1e-6  # Largest error of the numbers of a rotation: what is typed with seven digits


@dataclass(frozen=True, kw_only=True)
class Base(Part):
    """The pose of the clamped end in the world, whose z points up.

    A point at p in the frame of the base, where the arm begins at 0 along +z, is at
    `position` + `rotation` p in the world.

    Raises:
        InvalidDesign: A field is not what it must be, such as a rotation that is none.
    """

    position: Triple = number(
        "r(0)", "m", "where the arm is clamped in the world", default=(0.0,) * 3, shape="triple"
    )
    """[m]."""
    points: str | Matrix = "up"
    """The way the straight arm points: "up", "down" (it hangs; turned about x), "x", "-x" (turned
    about y), "y", "-y" (about x); or a rotation, kept as the rows of its matrix."""
    turn: float = number("ψ", "rad", "turn about the way the arm points", default=0.0)
    """Turn about the axis of the arm by the right hand [rad], before the arm is made to point."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.points, str):
            rows = tuple(map(tuple, np.asarray(_as_rotation(self.points)).tolist()))
            object.__setattr__(self, "points", rows)

    def _faults(self) -> list[Fault]:
        read = _as_rotation(self.points)
        faults = [Fault("points", self.points, read)] if isinstance(read, str) else []
        return super()._faults() + faults

    @lazy
    def rotation(self) -> Array:
        """The axes of the base in the world as columns [-], shape (3, 3), read-only."""
        turned = np.array(_as_rotation(self.points), float)
        if np.abs(turned @ turned.T - np.eye(3)).max() > 1e-15:  # typed with fewer digits
            left, _, right = np.linalg.svd(turned)
            turned = left @ right
        if self.turn:
            c, s = np.cos(self.turn), np.sin(self.turn)
            turned = turned @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return read_only(turned)

    @lazy
    def is_identity(self) -> bool:
        """True if the frame of the base is that of the world."""
        return not any(self.position) and bool((self.rotation == np.eye(3)).all())

    def to_world(self, points: ArrayLike) -> Array:
        """Places in the world [m] of points in the frame of the base, shape (..., 3)."""
        return self.directions_to_world(points) + np.array(self.position)

    def to_base(self, points: ArrayLike) -> Array:
        """Places in the frame of the base [m] of points in the world, shape (..., 3)."""
        return self.directions_to_base(np.asarray(points, float) - np.array(self.position))

    def directions_to_world(self, vectors: ArrayLike) -> Array:
        """Forces and directions in the world of those in the frame of the base, shape (..., 3)."""
        return _turned(self.rotation, np.asarray(vectors, float))

    def directions_to_base(self, vectors: ArrayLike) -> Array:
        """Forces and directions in the frame of the base of those in the world, shape (..., 3)."""
        return _turned(self.rotation.T, np.asarray(vectors, float))

    def __str__(self) -> str:
        place = ", at ({:g}, {:g}, {:g}) m".format(*self.position) if any(self.position) else ""
        turn = f", turned by {np.degrees(self.turn):.6g}°" if self.turn else ""
        way = self.points
        if not isinstance(way, str):
            way = "along ({:.4g}, {:.4g}, {:.4g})".format(*self.rotation[:, 2] + 0.0)
        return f"points {way}{turn}{place}"


def _as_rotation(points: Any) -> Array | str:
    if isinstance(points, str):
        return np.array(POINTS[points]) if points in POINTS else _ALLOWED
    numbers = as_numbers(points.as_matrix() if hasattr(points, "as_matrix") else points)
    if numbers.shape not in ((4,), (3, 3)) or not np.isfinite(numbers).all():
        return _ALLOWED
    if numbers.ndim == 2:
        off = float(np.abs(numbers.T @ numbers - np.eye(3)).max())
        if off > _NEAR:
            columns = f"its columns are not of length 1 and at right angles, by {off:.2g}"
            return f"must be a rotation; {columns}"
        left_handed = np.linalg.det(numbers) < 0
        return "must be a rotation; these axes are left-handed" if left_handed else numbers
    size = float(np.linalg.norm(numbers))
    if abs(size - 1.0) > _NEAR:
        return f"must be a quaternion (w, x, y, z) of length 1, not {size:.4g}"
    return rotation_matrices(numbers / size)


def rotation_matrices(quaternions: Array) -> Array:
    """Rotation matrices of unit quaternions (w, x, y, z), shape (..., 3, 3)."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _turned(rotation: Array, vectors: Array) -> Array:
    """Each vector turned alone, so that others beside it do not change its last bits."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([a * x + b * y + c * z for a, b, c in rotation.tolist()], axis=-1)


UPRIGHT = Base()  # At the origin of the world, where the frame of the base is that of the world
