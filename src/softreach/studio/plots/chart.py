"""Curves over a common axis, drawn by the page itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from viser import GuiApi

__all__ = ["Chart", "Curve"]

Array = NDArray[np.float64]

_INK, _GRID = "#868e96", "rgba(134,142,150,0.25)"  # legible on white and on black
_HEIGHT = 210  # pixels


class Curve(NamedTuple):
    """What one line of a chart is called and how it looks."""

    name: str
    color: str
    dashed: bool = False
    points: bool = False
    """Whether its points are marked."""


class Chart:
    """A chart in a container; nothing is shown before the first `show`."""

    def __init__(
        self, gui: GuiApi, container: Any, x: str, y: str, *, logarithmic: bool = False
    ) -> None:
        """Take the place of a chart.

        Args:
            gui: Of the tab.
            container: Folder or tab that it goes into.
            x: Label of the horizontal axis, with its unit.
            y: Of the vertical one.
            logarithmic: Whether the horizontal axis is.
        """
        self._gui, self._container = gui, container
        self._axes: Any = tuple(
            {"label": label, "stroke": _INK, "grid": {"stroke": _GRID}, "ticks": {"stroke": _GRID}}
            | ({"size": 56} if label == y else {})
            for label in (x, y)
        )
        across = {"time": False, **({"distr": 3, "log": 10} if logarithmic else {})}
        self._scales: Any = {"x": across, "y": {"auto": True}}
        self._x = x
        self._widget: Any = None
        self._made_of: tuple[Curve, ...] = ()

    def show(self, x: Array, curves: Sequence[Curve], values: Sequence[Array]) -> None:
        """Draw curves; those of the same names are moved, others made anew.

        Args:
            x: Ascending, shape (n,).
            curves: What they are.
            values: Of each, shape (n,).
        """
        data = (np.asarray(x, float), *(np.asarray(one, float) for one in values))
        if self._widget is None or tuple(curves) != self._made_of:
            self.remove()
            self._made_of = tuple(curves)
            with self._container:
                self._widget = self._gui.add_uplot(
                    data,
                    ({"label": self._x}, *map(_series, curves)),
                    scales=self._scales,
                    axes=self._axes,
                    height=_HEIGHT,
                )
        else:
            self._widget.data = data
            self._widget.visible = True

    def remove(self) -> None:
        """Take it away until it is shown again."""
        if self._widget is not None:
            self._widget.remove()
        self._widget = None


def _series(curve: Curve) -> Any:
    made: dict[str, Any] = {"label": curve.name, "stroke": curve.color, "width": 2}
    made["points"] = {"show": curve.points, "size": 7, "fill": curve.color}
    return made | ({"dash": (6.0, 4.0)} if curve.dashed else {})
