"""Board in the scene: a square picture that faces the camera of a new tab, and clicks on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.studio.scene.camera import plane_crossing

if TYPE_CHECKING:
    from softreach.studio.scene.scene import Scene

__all__ = ["Board"]

Array = NDArray[np.float64]

_ANGLE = 0.5  # [rad] about z, so that the board faces the camera of a new tab
_RIGHT = np.array([np.cos(_ANGLE), np.sin(_ANGLE), 0.0])
_UP = np.array([0.0, 0.0, 1.0])
_SIZE = 1.7  # [L]
_TURN = (  # the picture's right goes to _RIGHT, its down to -z
    np.sqrt(0.5) * np.cos(_ANGLE / 2),
    -np.sqrt(0.5) * np.cos(_ANGLE / 2),
    -np.sqrt(0.5) * np.sin(_ANGLE / 2),
    np.sqrt(0.5) * np.sin(_ANGLE / 2),
)


class Board:
    """One board, left or right of the arm."""

    def __init__(self, scene: Scene, path: str, side: float = -1.0) -> None:
        """Nothing is drawn yet.

        Args:
            scene: The scene.
            path: Of its node.
            side: -1 for the left of the arm, 1 for its right.
        """
        self._scene, self._path = scene, path
        self._center = 2.0 * side * _RIGHT + 0.4 * _UP

    def draw(self, image: NDArray[np.uint8]) -> None:
        """Show a square picture."""
        self._scene.draw_picture(self._path, image, _SIZE, self._center, _TURN)

    def place_under(
        self, origin: Sequence[float], direction: Sequence[float]
    ) -> tuple[float, float] | None:
        """Place under the cursor, 0 to 1 from the lower left; None beside the board."""
        hit = plane_crossing(origin, direction, self._center, np.cross(_UP, _RIGHT))
        if hit is None:
            return None
        right, up = (hit - self._center) @ np.stack([_RIGHT, _UP]).T / _SIZE + 0.5
        return (float(right), float(up)) if 0 <= right <= 1 and 0 <= up <= 1 else None

    def in_scene(self, right: float, up: float) -> Array:
        """Place of the scene [L] where a place of the picture is."""
        return self._center + _SIZE * ((right - 0.5) * _RIGHT + (up - 0.5) * _UP)

    @property
    def corners(self) -> Array:
        """Corners of the board in the scene [L], shape (4, 3)."""
        return np.array([self.in_scene(right, up) for right in (0, 1) for up in (0, 1)])
