"""Curves over a common axis, drawn by the page itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.studio.plots.along_arm import AlongArm
from softreach.studio.plots.sweep import Sweep
from softreach.studio.plots.volumes import VolumeCurve

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from viser import GuiApi

Array = NDArray[np.float64]

_AXIS, _GRID = "#868e96", "rgba(134,142,150,0.25)"  # legible on white and on black
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
            {"label": label, "stroke": _AXIS, "grid": {"stroke": _GRID}, "ticks": {"stroke": _GRID}}
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


# A figure as pixels, drawn away from pyplot, which belongs to one thread.


_WIDTH = 4.3  # [inch], about as wide as a panel
_PAPER, _INK = "#242424", "#c9c9c9"  # of a dark page
_DPI = 200  # sharp where a page has two pixels per point


class Picture(NamedTuple):
    """A picture of a design."""

    arm: Manipulator
    image: NDArray[np.uint8]
    """RGB, shape (rows, columns, 3)."""
    text: str = ""
    """What it says in words."""


def blank_figure(height: float, width: float = _WIDTH, dpi: int = _DPI) -> Figure:
    """An empty figure of that size [inch]."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=dpi, layout="constrained")


def pixels(figure: Figure, *, dark: bool = False) -> NDArray[np.uint8]:
    """The figure as RGB; for a dark page its paper is dark, and what is written and drawn light."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    if dark:
        _darken(figure)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    shown = np.asarray(canvas.buffer_rgba())[..., :3].copy()
    if dark:
        white = (shown == 255).all(axis=-1)  # of pictures within the figure
        shown[white] = list(bytes.fromhex(_PAPER[1:]))
    return shown


def _darken(figure: Figure) -> None:
    """Areas keep their colors."""
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
        for one in figure.findobj(kind):
            one.set_color(_INK)


# What has been found for the plots of a tab.


@dataclass(eq=False)
class Figures:
    """Each is None until it is known; jobs replace them, panels show them."""

    along_arm: AlongArm | None = None
    volume_curve: VolumeCurve | None = None
    sweep: Sweep | None = None
    histogram: Picture | None = None
    section: Picture | None = None
    track: xr.Dataset | None = None
    """What `track_path` found for the path."""
