"""Plot beside the scene: what it depends on, how it is computed and shown; charts and pictures."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.studio.fields import Fields
from softreach.studio.reach import Reach
from softreach.studio.work import StaleCheck

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from viser import GuiApi

    from softreach.studio.session import Session

Array = NDArray[np.float64]


class Plot(ABC):
    """Plot beside the scene; a tab has one of each kind, and computes those that are shown.

    What is computed says by its `arm` which design it is of.
    """

    name: ClassVar[str]
    """In the settings."""
    label: ClassVar[str]
    hint: ClassVar[str]
    depends_on: ClassVar[tuple[str, ...]]
    """Attributes of the state that decide the result, such as "appearance.level"."""
    of_reach: ClassVar[bool] = False
    """True if it is computed from the reach, whose job asks for the plot."""

    @abstractmethod
    def __init__(self, gui: GuiApi, folder: Any) -> None:
        """Take the place of the plot in a folder."""

    @classmethod
    def add_settings(cls, fields: Fields) -> None:
        """Add fields for what can be chosen of the plot: nothing by default."""
        del fields

    @staticmethod
    @abstractmethod
    def compute(session: Session, check: StaleCheck) -> Iterator[Any]:
        """Results, each better than the one before; none while what it is computed from is not.

        Args:
            session: Of the tab, in whose present state the plot is shown.
            check: To be called between stages; raises if the plot is no longer wanted.
        """

    @abstractmethod
    def show(self, result: Any) -> str:
        """Draw a result, and return its content in words."""


@dataclass(eq=False)
class Figures:
    """Results of the plots of a tab; jobs replace them, panels show them."""

    plots: dict[str, Any] = field(default_factory=dict)
    """The latest result of each plot by its name."""
    track: xr.Dataset | None = None
    """Result of `track_path` for the path."""


def complete_reach(session: Session) -> Reach | None:
    """Reach of the design of the state, if it is complete; its job says when it is."""
    reach = session.reach
    complete = reach is not None and reach.fine and reach.arm == session.state.design
    return reach if complete else None


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


_PAPER, _INK = "#242424", "#c9c9c9"  # of a dark page


class Picture(NamedTuple):
    """Picture of a design."""

    arm: Manipulator
    image: NDArray[np.uint8]
    """RGB, shape (rows, columns, 3)."""
    text: str = ""
    """Its content in words."""


def pixels(figure: Figure, *, dark: bool = False) -> NDArray[np.uint8]:
    """The figure as RGB; for a dark page its paper is dark, and what is written and drawn light."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    if dark:
        _darken(figure)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())[..., :3].copy()
    if dark:
        white = (image == 255).all(axis=-1)  # of pictures within the figure
        image[white] = list(bytes.fromhex(_PAPER[1:]))
    return image


def _darken(figure: Figure) -> None:
    from matplotlib.legend import Legend
    from matplotlib.lines import Line2D
    from matplotlib.spines import Spine
    from matplotlib.text import Text

    figure.set_facecolor(_PAPER)
    for ax in figure.axes:
        ax.set_facecolor(_PAPER)
        ax.tick_params(which="both", colors=_INK)
    for legend in figure.findobj(Legend):
        legend.get_frame().set(facecolor=_PAPER, edgecolor=_INK)
    for spine in figure.findobj(Spine):
        spine.set_edgecolor(_INK)
    for kind in (Text, Line2D):
        for artist in figure.findobj(kind):
            artist.set_color(_INK)
