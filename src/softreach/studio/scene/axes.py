"""Box with numbers around everything; the camera decides which edges are numbered."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.picture.axes_box import axes_box, round_box, seen_from

if TYPE_CHECKING:
    from viser import SceneApi

Array = NDArray[np.float64]

_GRAY = 170, 170, 175


class NumberedBox:
    """One box, drawn into one scene."""

    def __init__(self, api: SceneApi) -> None:
        """Draw into a scene, around an arm for the time being."""
        self._api = api
        self.corners = np.array([-0.6, -0.6, -0.4]), np.array([0.6, 0.6, 1.0])
        """The lowest and the highest [L]."""
        self._camera: Array = np.array([50.0, -80.0, 30.0])
        self._focal = np.inf

    def draw(self, *points: Array, shown: bool) -> None:
        """Surround points [L], shapes (n, 3)."""
        self.corners = round_box(*points)
        self._remove()
        if shown:
            self._draw()

    def turn(self, camera: Array, focal: float = np.inf) -> None:
        """Number the edges that are the outer ones for a camera [L] of a focal length [pixel]."""
        before = seen_from(self._camera, *self.corners, self._focal)
        self._camera, self._focal = camera, focal
        if self._is_drawn and seen_from(camera, *self.corners, focal) != before:
            self._remove()
            self._draw()

    @property
    def _is_drawn(self) -> bool:
        return self._api.get_handle_by_name("/axes/lines") is not None

    def _remove(self) -> None:
        if self._api.get_handle_by_name("/axes") is not None:
            self._api.remove_by_name("/axes")

    def _draw(self) -> None:
        low, high = self.corners
        box = axes_box(low[None], high[None], camera=self._camera, focal=self._focal)
        lines = box.lines.astype(np.float32)
        self._api.add_line_segments("/axes/lines", lines, _GRAY, thickness=0.003)
        for k, (text, at) in enumerate(box.labels):
            add_label(self._api, f"/axes/label {k}", text, at)


def add_label(api: SceneApi, path: str, text: str, at: Array) -> None:
    """Words at a place [L], as large on the screen wherever the camera is."""
    api.add_label(path, text, position=at, font_screen_scale=0.8, anchor="center-center")
