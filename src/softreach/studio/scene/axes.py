"""Box with numbers around everything; the camera decides which edges are numbered."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.picture.axes_box import Side, axes_box, round_box, seen_from
from softreach.support.units import in_lengths

if TYPE_CHECKING:
    from viser import SceneApi

    from softreach.arm.manipulator import Manipulator

Array = NDArray[np.float64]

_GRAY = 170, 170, 175


class NumberedBox:
    """One box, drawn into one scene."""

    def __init__(self, api: SceneApi) -> None:
        self._api, self._lock = api, threading.RLock()
        self._box = np.array([-0.6, -0.6, -0.4]), np.array([0.6, 0.6, 1.0])
        self._unit, self._scale = in_lengths(1.0), 1.0  # of the numbers, and L in it
        self._camera: Array = np.array([50.0, -80.0, 30.0])
        self._focal = np.inf

    @property
    def corners(self) -> tuple[Array, Array]:
        """The lowest and the highest [L]."""
        low, high = self._box
        return low / self._scale, high / self._scale

    def draw(self, *points: Array, arm: Manipulator) -> None:
        """Surround points [L], shapes (n, 3), with numbers in the unit of the arm."""
        with self._lock:
            self._unit, self._scale = arm.length_unit, arm.length / arm.length_unit.size
            self._box = round_box(*(self._scale * each for each in points))
            self._remove()
            self._draw()

    def turn(self, camera: Array, focal: float = np.inf) -> None:
        """Number the edges that are the outer ones for a camera [L] of a focal length [pixel]."""
        with self._lock:
            before = self._side()
            self._camera, self._focal = camera, focal
            if self._is_drawn and self._side() != before:
                self._remove()
                self._draw()

    def _side(self) -> Side:
        return seen_from(self._scale * self._camera, *self._box, self._focal)

    @property
    def _is_drawn(self) -> bool:
        return self._api.get_handle_by_name("/axes/lines") is not None

    def _remove(self) -> None:
        if self._api.get_handle_by_name("/axes") is not None:
            self._api.remove_by_name("/axes")

    def _draw(self) -> None:
        low, high = self._box
        camera = self._scale * self._camera
        box = axes_box(
            low[None], high[None], camera=camera, focal=self._focal, label=self._unit.label
        )
        lines = (box.lines / self._scale).astype(np.float32)
        self._api.add_line_segments("/axes/lines", lines, _GRAY, thickness=0.003)
        for k, (text, at) in enumerate(box.labels):
            add_label(self._api, f"/axes/label {k}", text, at / self._scale)


def add_label(api: SceneApi, path: str, text: str, at: Array) -> None:
    """Words at a place [L], as large on the screen wherever the camera is."""
    api.add_label(path, text, position=at, font_screen_scale=0.8, anchor="center-center")
