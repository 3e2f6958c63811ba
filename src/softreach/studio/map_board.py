"""The map of an atlas as a board in the scene: drawn, marked, and read under a click."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.studio.atlas_map import AtlasMap, atlas_map, held_places
from softreach.studio.picking import plane_crossing
from softreach.studio.scene import Scene
from softreach.studio.state import MapView

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MapBoard", "board_of"]

Array = NDArray[np.float64]

_ANGLE = 0.5  # [rad] about z, so that the board faces the eye that a tab begins with
_RIGHT = np.array([np.cos(_ANGLE), np.sin(_ANGLE), 0.0])
_UP = np.array([0.0, 0.0, 1.0])
_SIZE = 1.7  # [L]
_TURN = (  # the picture's right goes to _RIGHT, its down to -z
    np.sqrt(0.5) * np.cos(_ANGLE / 2),
    -np.sqrt(0.5) * np.cos(_ANGLE / 2),
    -np.sqrt(0.5) * np.sin(_ANGLE / 2),
    np.sqrt(0.5) * np.sin(_ANGLE / 2),
)
_CENTER = -2.0 * _RIGHT + 0.4 * _UP


class MapBoard:
    """The board of one tab."""

    def __init__(self, scene: Scene, atlas: xr.Dataset) -> None:
        """Nothing is drawn yet."""
        self._scene, self.atlas = scene, atlas
        self.map: AtlasMap | None = None
        """What is drawn."""
        self._drawn: tuple[MapView, dict[str, int]] | None = None

    def draw(self, view: MapView, design: Manipulator) -> None:
        """Show a map and where the design is on it; the map is drawn anew if it changes.

        Raises:
            InvalidInput: There is no such map.
        """
        wanted = view, held_places(self.atlas, view, design)
        if wanted != self._drawn:
            self.map = atlas_map(self.atlas, view, wanted[1]) if view.shown else None
            self._drawn = wanted
            self._scene.remove("/atlas")
            if self.map is not None:
                self._scene.draw_picture("/atlas/map", self.map.image, _SIZE, _CENTER, _TURN)
        self._mark(design)

    def parameters_under(
        self, origin: Sequence[float], direction: Sequence[float]
    ) -> dict[str, float] | None:
        """The place of the atlas under the cursor, {} beside the axes, None beside the board."""
        hit = plane_crossing(origin, direction, _CENTER, np.cross(_UP, _RIGHT))
        if self.map is None or hit is None:
            return None
        right, up = (hit - _CENTER) @ np.stack([_RIGHT, _UP]).T / _SIZE + 0.5
        if not (0 <= right <= 1 and 0 <= up <= 1):
            return None
        return self.map.parameters_at(float(right), float(up)) or {}

    def place_of(self, **at: float) -> Array:
        """Where in the scene the map shows a design [L]."""
        assert self.map is not None
        right, up = self.map.place_of(**at)
        return _CENTER + _SIZE * ((right - 0.5) * _RIGHT + (up - 0.5) * _UP)

    @property
    def corners(self) -> Array:
        """Where it stands in the scene [L], shape (4, 3)."""
        ends = (-_SIZE / 2, _SIZE / 2)
        return np.array([_CENTER + right * _RIGHT + up * _UP for right in ends for up in ends])

    def _mark(self, design: Manipulator) -> None:
        self._scene.remove("/atlas/here")
        at = None if self.map is None else self.map.values_of(design)
        if at is not None:
            self._scene.draw_mark("/atlas/here", self.place_of(**at))


def board_of(scene: Scene, atlas: xr.Dataset | None) -> MapBoard | None:
    """A board, if there is an atlas that a map can be drawn of."""
    if atlas is None or len(atlas["status"].dims) < 2:
        return None
    return MapBoard(scene, atlas)
