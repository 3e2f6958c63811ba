"""Camera of a tab and the axes that it sees."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.picture.axes_box import axes_box, round_box, seen_from
from softreach.studio.state import Camera, vector
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput
from softreach.support.units import LengthUnit

if TYPE_CHECKING:
    from viser import ClientHandle, SceneApi

FOV = 0.6  # [rad]; viser's 75 degrees draw a ball at the rim as an egg
FINER = 2  # pixels of a saved picture for each of the page, along each side
VIEWS: dict[str, Array] = {
    "oblique": np.array([2.1, -3.85, 1.17]),
    "front": np.array([0.0, -1.0, 0.0]),
    "side": np.array([1.0, 0.0, 0.0]),
    "top": np.array([0.0, -1e-3, 1.0]),  # not quite: z is the way up
}
"""Directions from the middle to the camera."""
UPRIGHT = 0.6  # aspect below which a window is that of a phone
_PATIENCE = 30.0  # [s] for a picture
_NARROWEST = 0.3  # aspect below which a page is only being laid out
_LAID_OUT = 1.0  # [s] after which the width of a new page counts as its own
_ROOM, _ROOM_UPRIGHT = 1.12, 1.22  # times what would just fill the picture, with its numbers
_GRAY = 170, 170, 175  # of the axes


def framing(low: Array, high: Array, direction: Array, aspect: float) -> Camera:
    """Camera that sees all of a box [L] from a direction; the aspect is width over height."""
    room = _ROOM_UPRIGHT if aspect < UPRIGHT else _ROOM
    middle, radius = (low + high) / 2, room * float(np.linalg.norm(high - low)) / 2
    distance = radius / _half_sine(aspect)
    toward = direction / np.linalg.norm(direction)
    if aspect < UPRIGHT:  # the sheet of a phone covers the lower half
        up = np.cross(toward, (-toward[1], toward[0], 0.0))
        middle = middle - 0.45 * distance * np.tan(FOV / 2) * up / np.linalg.norm(up)
    return Camera(position=vector(middle + distance * toward), look_at=vector(middle))


def _half_sine(aspect: float) -> float:
    return float(np.sin(np.arctan(np.tan(FOV / 2) * min(1.0, aspect))))


class TabCamera:
    """Camera of one tab, which the user and the studio both move."""

    def __init__(self, client: ClientHandle) -> None:
        self._client = client
        self._aspect: float | None = None
        self._latest: float | None = None
        self._since = 0.0

    @property
    def aspect(self) -> float:
        """Width of the picture over its height."""
        return self._client.camera.aspect

    @property
    def focal(self) -> float:
        """Focal length [pixel]: what is as far away as it is long is so long in the picture."""
        camera = self._client.camera
        return camera.image_height / (2 * float(np.tan(camera.fov / 2)))

    def actual(self) -> Camera:
        """Camera as it is."""
        camera = self._client.camera
        place = {"position": vector(camera.position), "look_at": vector(camera.look_at)}
        return Camera(**place, aspect=self.aspect)

    def look_from(self, camera: Camera) -> None:
        """Move it."""
        with self._client.atomic():
            shown = self._client.camera
            shown.position, shown.look_at = camera.position, camera.look_at

    def keep_width(self) -> bool:
        """Step back as the picture gets narrower, and forth again; True while the window changes.

        A layout passes through widths that are gone before the page has heard of a step.
        """
        now = self.aspect
        if now < _NARROWEST:
            return False
        if now != self._latest:
            self._latest, self._since = now, time.monotonic()
            return True
        if self._aspect is None and time.monotonic() - self._since < _LAID_OUT:
            return True
        before, self._aspect = self._aspect or now, now
        if (ratio := _half_sine(before) / _half_sine(now)) != 1.0:
            camera = self.actual()
            offset = ratio * np.subtract(camera.position, camera.look_at)
            position = vector(camera.look_at + offset)
            self.look_from(Camera(position=position, look_at=camera.look_at))
        return False

    def picture(self) -> NDArray[np.uint8]:
        """Picture of what it sees now, RGBA on a transparent ground, shape (height, width, 4)."""
        camera, client = self._client.camera, self._client
        size = {"height": FINER * camera.image_height, "width": FINER * camera.image_width}
        try:
            return client.get_render(**size, transport_format="png", timeout=_PATIENCE)
        except TimeoutError:
            allowed = "in the foreground"
            raise InvalidInput("tab", "not drawing", allowed, "bring it to the front") from None


class NumberedBox:
    """A box with numbers around a scene; the camera decides which edges have them."""

    def __init__(self, api: SceneApi) -> None:
        self._api, self._lock = api, threading.RLock()
        self._box = np.array([-0.6, -0.6, -0.4]), np.array([0.6, 0.6, 1.0])  # of most clouds
        self._unit, self._scale = LengthUnit("L", 1.0), 1.0  # of the numbers, and L in it
        self._camera: tuple[Array, float] = np.array([50.0, -80.0, 30.0]), np.inf
        self._drawn: object = None  # what the numbers were drawn for

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
            self._draw()

    def turn(self, camera: Array, focal: float = np.inf) -> None:
        """Number the edges that are the outer ones for a camera [L] of a focal length [pixel]."""
        with self._lock:
            self._camera = camera, focal
            if self._drawn is not None:
                self._draw()

    def _draw(self) -> None:
        (camera, focal), scale, label = self._camera, self._scale, self._unit.label
        side = seen_from(scale * camera, *self._box, focal)
        before, self._drawn = self._drawn, (self._unit, scale, np.array(self._box).tolist(), side)
        if before == self._drawn:
            return
        if before is not None:
            self._api.remove_by_name("/axes")
        ends = [corner[None] for corner in self._box]
        box = axes_box(*ends, camera=scale * camera, focal=focal, label=label)
        lines = (box.lines / scale).astype(np.float32)
        self._api.add_line_segments("/axes/lines", lines, _GRAY, thickness=0.003)
        for k, (text, at) in enumerate(box.labels):
            add_label(self._api, f"/axes/label {k}", text, at / scale)


def add_label(api: SceneApi, path: str, text: str, at: Array) -> None:
    """Words at a place [L], as large on the screen wherever the camera is."""
    api.add_label(path, text, position=at, font_screen_scale=0.8, anchor="center-center")
