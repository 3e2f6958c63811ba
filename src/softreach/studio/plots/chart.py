"""Chart of curves beside the scene, drawn by the page itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from viser import GuiApi

Array = NDArray[np.float64]

_AXIS_INK, _GRID = "#868e96", "rgba(134,142,150,0.25)"  # legible on white and on black
_HEIGHT = 210  # pixels
_MARK = "mark"
_HERE: Any = {
    "label": "this design", "scale": _MARK, "stroke": "#d9731a", "width": 1.5, "dash": (5.0, 3.0),
    "points": {"show": False},
}  # fmt: skip
"""A line across the whole chart, whatever the scale of its curves."""


class Curve(NamedTuple):
    """Name and looks of one line of a chart."""

    name: str
    color: str
    points: bool = False
    """Marks on its points."""


class Chart:
    """Curves over a common axis, drawn by the page itself; nothing before the first `show`."""

    def __init__(self, gui: GuiApi, container: Any, y: str = "") -> None:
        """Take the place of a chart.

        Args:
            gui: Of the tab.
            container: Folder or tab that it goes into.
            y: Label of the vertical axis, with its unit, unless `show` has it.
        """
        self._gui, self._container, self._y = gui, container, y
        whole = {"auto": False, "range": (0.0, 1.0)}
        self._scales: Any = {"x": {"time": False}, "y": {"auto": True}, _MARK: whole}
        self._widget: Any = None
        self._made_of: object = None

    def show(
        self,
        label: str,
        x: Array,
        curves: Sequence[Curve],
        values: Sequence[Array],
        here: float | None = None,
        y: str = "",
    ) -> None:
        """Draw curves; those of the same names over the same axis are moved, others made anew.

        Args:
            label: Of the horizontal axis, with its unit.
            x: Ascending, shape (n,).
            curves: Their names and looks.
            values: Of each, shape (n,).
            here: Where a vertical line is, on the horizontal axis; None for none.
            y: Label of the vertical axis, with its unit, if it may change.
        """
        data = (np.asarray(x, float), *(np.asarray(each, float) for each in values))
        if here is not None:
            data = _marked(data, here)
        made_of = label, y, here is None, *curves
        if made_of == self._made_of:
            self._widget.data = data
            return
        if self._widget is not None:
            self._widget.remove()
        self._made_of = made_of
        with self._container:
            self._widget = self._gui.add_uplot(
                data,
                ({"label": label}, *map(_series, curves), *([] if here is None else [_HERE])),
                scales=self._scales,
                axes=(_axis(label), _axis(y or self._y) | {"size": 56}),
                height=_HEIGHT,
            )


def _marked(data: Sequence[Array], here: float) -> tuple[Array, ...]:
    """The data with a vertical line: two points at one place, which belong to no curve."""
    at = int(np.searchsorted(data[0], here, side="right"))
    x, *values = (np.insert(each, at, 2 * [here if each is data[0] else np.nan]) for each in data)
    line = np.full(len(x), np.nan)
    line[at : at + 2] = 0.0, 1.0
    return x, *values, line


def _axis(label: str) -> Any:
    return {
        "label": label, "stroke": _AXIS_INK, "grid": {"stroke": _GRID}, "ticks": {"stroke": _GRID}
    }  # fmt: skip


def _series(curve: Curve) -> Any:
    points = {"show": curve.points, "size": 7, "fill": curve.color}
    return {"label": curve.name, "stroke": curve.color, "width": 2, "points": points}
