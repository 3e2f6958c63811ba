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


def pixels(figure: Figure) -> NDArray[np.uint8]:
    """The figure as RGB."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
