"""Drag of the tip in the scene: the ball on it with its three axes, and how far the arm lags."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.geometry.rays import along_axis
from softreach.geometry.surface import tube_surface
from softreach.studio.scene.camera import add_label
from softreach.support.arrays import Array

if TYPE_CHECKING:
    from viser import SceneApi

OnDrag = Callable[[str, Array], None]
"""(phase "start", "update" or "end"; where the ball should be [L]), on the event loop: quick."""

_HALO, _SMALLEST, _POINTER = 0.035, 0.016, 0.009  # radii [L]
_CLEAR = 0.4  # opacity of a ball that is seen through
_COLOR, _LIGHT, _LAG = (25, 25, 30), (255, 225, 90), (220, 30, 120)
_AXES = {"x": (200, 55, 55), "y": (45, 140, 60), "z": (55, 90, 210)}
_ARROW = np.array([[0, 0.03], [5e-3, 0.03], [5e-3, 0.1], [0.012, 0.1], [0, 0.13]])
"""Radii and heights of half of an arrow [L]."""
_LETTER = 0.15  # of an axis, from the ball [L]


class DragBall:
    """Nodes that move instead of being drawn anew: a node that is replaced is let go."""

    def __init__(self, api: SceneApi, on_drag: OnDrag, eye: Callable[[], Array]) -> None:
        """Draw into a scene once there is a tip; `eye` tells where the camera is [L]."""
        self._api, self._on_drag, self._eye = api, on_drag, eye
        self._nodes: tuple[Any, Any] | None = None

    def move(self, tip: Array | None, radius: float, *, dark: bool, clear: bool) -> None:
        """Put the ball on the tip of an arm of this radius [L], clear or not, or hide it."""
        if self._nodes is None and tip is not None:
            self._nodes = self._drawn(tip)
        if self._nodes is None:
            return
        halo, ball = self._nodes
        halo.visible = tip is not None
        if tip is None:
            return
        halo.position = tip
        ball.radius, halo.radius = max(1.2 * radius, _SMALLEST), max(1.6 * radius, _HALO)
        halo.color = ball.color = _LIGHT if dark else _COLOR
        ball.opacity = _CLEAR if clear else None

    def show_lag(self, ends: tuple[Array, Array] | None, gap: str) -> None:
        """A line between where the tip should be and is [L], and how long it is; "" for none."""
        if ends is None or not gap:
            if self._api.get_handle_by_name("/lag") is not None:
                self._api.remove_by_name("/lag")
            return
        wanted, tip = ends
        line = np.stack([tip - wanted, np.zeros(3)])[None].astype(np.float32)
        self._api.add_icosphere("/lag", _POINTER, _LAG, cast_shadow=False, position=wanted)
        self._api.add_line_segments("/lag/line", line, _LAG, thickness=0.004)
        self._api.add_label("/lag/label", f"{gap} short", anchor="bottom-center")

    def _drawn(self, tip: Array) -> tuple[Any, Any]:
        api, (radii, heights) = self._api, _ARROW.T
        look: Any = {"cast_shadow": False}
        halo: Any = api.add_icosphere("/grip", _HALO, _COLOR, opacity=0.25, position=tip, **look)
        ball = api.add_icosphere("/grip/ball", _SMALLEST, _COLOR, **look)
        self._grip(halo, halo, lambda _, seen: seen)
        for axis, (name, color) in enumerate(_AXES.items()):
            path, direction = f"/grip/{name}", np.eye(3)[axis]
            first, second = (np.tile(np.roll(direction, k), (len(heights), 1)) for k in (1, 2))
            mesh = tube_surface(np.outer(heights, direction), first, second, radii, sides=12)
            vertices = mesh.vertices.astype(np.float32)
            arrow = api.add_mesh_simple(path, vertices, mesh.faces, color=color, **look)
            add_label(api, f"{path}/letter", name, _LETTER * direction)
            way = lambda begin, seen, d=direction: along_axis(begin, d, self._eye(), seen) * d
            self._grip(arrow, halo, way)
        return halo, ball

    def _grip(self, node: Any, halo: Any, place: Callable[[Array, Array], Array]) -> None:
        """Let a node be dragged: the ball moves as the place of its begin and what is seen."""
        begin, pressed = np.zeros(3), np.zeros(3)

        @node.on_drag("left")
        async def _(event: Any) -> None:  # on the event loop, which keeps phases in order
            nonlocal begin, pressed
            if event.phase == "start":
                begin = np.array(halo.position)
                pressed = place(begin, np.array(event.start_position))
            reached = place(begin, np.array(event.end_position))
            self._on_drag(event.phase, begin + reached - pressed)
