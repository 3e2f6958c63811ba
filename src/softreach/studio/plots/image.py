"""A figure as pixels, drawn away from pyplot, which belongs to one thread."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Picture", "blank_figure", "pixels"]

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
