"""The clouds of a scene, without the points that hide the arm, and thin while it is dragged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from softreach.studio.sight import Sight, in_the_way

if TYPE_CHECKING:
    from viser import SceneApi

__all__ = ["Clouds", "Dots"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Dots:
    """Points [L] and how they look."""

    points: Array
    """Shape (n, 3)."""
    colors: NDArray[np.uint8]
    """RGB, shape (n, 3) or (3,)."""
    size: float
    """[L]."""
    shape: Literal["circle", "diamond"] = "circle"

    def where(self, kept: NDArray[np.bool_]) -> Dots:
        """Those that are kept."""
        colors = self.colors[kept] if self.colors.ndim == 2 else self.colors
        return Dots(points=self.points[kept], colors=colors, size=self.size, shape=self.shape)


class Clouds:
    """Draws clouds, and draws those again whose hidden points change as eye or arm move."""

    def __init__(self, api: SceneApi) -> None:
        """Draw into a scene."""
        self._api = api
        self._known: dict[str, tuple[Dots, NDArray[np.bool_]]] = {}
        self._sight: Sight | None = None
        self._cut = "none"
        self._most: int | None = None

    def draw(self, path: str, dots: Dots) -> None:
        """All but the points in the way of what the last `look` wanted to see."""
        kept = self._kept(dots)
        self._known[path] = dots, kept
        self._send(path, dots.where(kept))

    def look(self, sight: Sight | None, cut: str, most: int | None = None) -> None:
        """Cut away what hides the arm; nothing is sent of a cloud that keeps its points.

        Args:
            sight: Who looks at what; None for nobody.
            cut: One of `sight.CUTS`.
            most: How many points to draw of a cloud, the first of it, which then stay the same
                until others are asked for; None for all.
        """
        is_thin = most is not None and most == self._most
        self._sight, self._cut, self._most = sight, cut, most
        if is_thin:  # it hides little, and the page draws no frame while it takes up another
            return
        for path, (dots, before) in list(self._known.items()):
            kept = self._kept(dots)
            if not np.array_equal(kept, before):
                self._known[path] = dots, kept
                self._send(path, dots.where(kept))

    def forget(self, path: str) -> None:
        """Draw a cloud no more; its node is the caller's to remove."""
        self._known.pop(path, None)

    def hidden(self, points: Array) -> NDArray[np.bool_]:
        """Which points [L], shape (n, 3), are cut away."""
        if self._sight is None:
            return np.zeros(len(points), bool)
        return in_the_way(points, self._sight, self._cut)

    def _kept(self, dots: Dots) -> NDArray[np.bool_]:
        kept = ~self.hidden(dots.points)
        if self._most is not None:
            kept[self._most :] = False
        return kept

    def _send(self, path: str, dots: Dots) -> None:
        if not len(dots.points):
            if self._api.get_handle_by_name(path) is not None:
                self._api.remove_by_name(path)
            return
        # viser's default is float16: a quarter of a millimeter in a meter
        self._api.add_point_cloud(
            path,
            dots.points.astype(np.float32),
            dots.colors,
            point_size=dots.size,
            precision="float32",
            point_shape=dots.shape,
            point_shading="gradient",
        )
