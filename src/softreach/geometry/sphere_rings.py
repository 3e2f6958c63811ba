"""Maps of the unit sphere to itself that turning about an axis does not change.

A meridian goes into its own plane, so that one angle tells all: where the image of the meridian
passes the pole, a whole circle of latitude goes there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.sphere_roots import Map, tangents_at

__all__ = ["Rings", "is_axisymmetric", "pole_rings"]

Array = NDArray[np.float64]

_POLAR, _AROUND = 24, 5
_SAMPLES = 8192
_BISECTIONS = 60
_OFF_AXIS = 1e-6


class Rings(NamedTuple):
    """Circles of latitude that go to the pole."""

    points: Array
    """One of each, all on one meridian, shape (n, 3)."""
    signs: NDArray[np.int8]
    """1 where the image moves away from the pole as the place does, else -1; shape (n,)."""
    pole_sign: int
    """The same of the pole itself, which goes to itself."""

    @property
    def complete(self) -> bool:
        """Whether the image of the meridian, which ends opposite, passes the pole that often."""
        return self.pole_sign + 2 * int(self.signs.sum()) == 1


def is_axisymmetric(image: Map, axis: Array, tolerance: float) -> bool:
    """Whether turning about an axis, and mirroring in a plane through it, changes nothing.

    Args:
        image: The map.
        axis: Unit vector, shape (3,).
        tolerance: By which images may miss [rad].
    """
    polar = np.pi * (np.arange(_POLAR) + 0.5) / _POLAR
    around = 2 * np.pi * np.arange(_AROUND) / _AROUND + 0.1
    first, second = tangents_at(axis[None])[:, 0]
    outward = np.cos(around)[:, None] * first + np.sin(around)[:, None] * second
    points = np.cos(polar)[:, None] * axis + np.sin(polar)[:, None] * outward[:, None]
    images = image(points.reshape(-1, 3)).reshape(points.shape)
    sideways = (images * np.cross(axis, outward)[:, None]).sum(axis=2)
    ahead = np.stack([images @ axis, (images * outward[:, None]).sum(axis=2)])
    return bool(max(np.abs(sideways).max(), np.ptp(ahead, axis=1).max()) <= tolerance)


def pole_rings(image: Map, axis: Array, near: Array) -> Rings:
    """All circles of latitude that an axisymmetric map takes to its pole.

    Args:
        image: The map.
        axis: Unit vector, shape (3,); the pole.
        near: A point on the meridian that is asked, shape (3,); any meridian for the pole.
    """
    aside = near - (near @ axis) * axis
    size = float(np.linalg.norm(aside))
    outward = aside / size if size > _OFF_AXIS else tangents_at(axis[None])[0, 0]

    def meridian(angle: Array) -> Array:
        return np.cos(angle)[:, None] * axis + np.sin(angle)[:, None] * outward

    def seen(angle: Array) -> tuple[Array, Array]:
        images = image(meridian(angle))
        return images @ outward, images @ axis

    angles = np.pi * (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    away, ahead = seen(angles)
    crossing = np.flatnonzero((away[1:] * away[:-1] <= 0) & (ahead[1:] + ahead[:-1] > 0))
    low, high, sign = angles[crossing], angles[crossing + 1], np.sign(away[crossing + 1])
    for _ in range(_BISECTIONS if len(low) else 0):
        middle = 0.5 * (low + high)
        above = seen(middle)[0] * sign > 0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    points = meridian(0.5 * (low + high))
    return Rings(points, sign.astype(np.int8), int(np.sign(away[0])))
