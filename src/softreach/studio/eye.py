"""Where the eye of a tab is."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.studio.state import Camera, vector

if TYPE_CHECKING:
    from viser import ClientHandle

__all__ = ["Eye"]

_STEP_BACK = 1.4  # times the distance, for two clouds side by side


class Eye:
    """The camera of one tab, which the user and the studio both move."""

    def __init__(self, client: ClientHandle) -> None:
        """Follow the camera of a client."""
        self._client = client

    def on_move(self, moved: Callable[[], None]) -> None:
        """Call this whenever the eye has moved."""
        self._client.camera.on_update(lambda _: moved())

    def camera(self) -> Camera:
        """Where it is now."""
        camera = self._client.camera
        return Camera(position=vector(camera.position), look_at=vector(camera.look_at))

    def look_from(self, camera: Camera) -> None:
        """Move it."""
        with self._client.atomic():
            self._client.camera.position = camera.position
            self._client.camera.look_at = camera.look_at

    def step_back(self, shift: NDArray[np.float64]) -> None:
        """Make room for a second cloud that stands `shift` [L] beside the first."""
        self._step(shift, _STEP_BACK)

    def step_forth(self, shift: NDArray[np.float64]) -> None:
        """The inverse of `step_back`."""
        self._step(-shift, 1 / _STEP_BACK)

    def _step(self, shift: NDArray[np.float64], stretch: float) -> None:
        now = self.camera()
        look_at = np.asarray(now.look_at) + shift / 2
        position = (np.asarray(now.position) - now.look_at) * stretch + look_at
        self.look_from(Camera(position=vector(position), look_at=vector(look_at)))
