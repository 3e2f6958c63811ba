"""Style of every figure: light, small type, thin lines, images sharp at print size."""

import os
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.geometry.surface import SurfaceMesh
from softreach.picture.page import Figure3D
from softreach.support.arguments import POSITIVE, as_flag, as_given, as_path
from softreach.support.arrays import Array, as_floats, as_indices
from softreach.support.errors import InvalidInput, MissingExtra, Range
from softreach.support.files.atomic import StrPath, writing
from softreach.support.files.formats import PAGES, PICTURES, format_of
from softreach.support.lazy import Axes, DataArray, Dataset, Figure
from softreach.support.units import METER, LengthUnit, as_unit

Unit = str | LengthUnit | None  # one asked for, "m", "cm", "mm" or "L"; None for L if known, else m
DPI = 250  # pixels per inch of images inside figures, and of saved PNG files
_RC: dict[str, Any] = {
    "figure.facecolor": "white",
    "font.family": "sans-serif",
    "font.size": 8,
    "axes.facecolor": "white",
    "axes.edgecolor": "0.35",
    "axes.linewidth": 0.6,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "legend.fontsize": 7,
    "legend.frameon": False,
}
_TICKS = {"labelsize": 7, "color": "0.25", "major.width": 0.6, "major.size": 2.5}
_RC |= {f"{axis}tick.{name}": value for axis in "xy" for name, value in _TICKS.items()}
# names that others gave, such as $x_1$ or 50 %, are no mathematics and no LaTeX
_TEXT: dict[str, Any] = {"text.parse_math": False, "text.usetex": False}
# text stays text in vector files, so that a journal can set it in its own type
_SAVING: dict[str, Any] = {"pdf.fonttype": 42, "svg.fonttype": "none"}
# at this level a PNG takes less than half the time of the default for 5 % more bytes
_ENCODINGS: dict[str, Any] = {".png": {"pil_kwargs": {"compress_level": 4}}}
_ENCODINGS[".pdf"] = {"metadata": {"CreationDate": None}}
LENGTH = POSITIVE._replace(unit="m")
PLACE = Range(unit="m")
SIZE = Range(0.0, 1e3, "pixels", open_low=True)
WIDTH = Range(1.0, 100.0, "inches")
PAGE = 6.9  # width of figures of several panels, a page's [inch]


def pyplot() -> Any:
    """matplotlib.pyplot, loaded at first use."""
    try:
        from matplotlib import pyplot as plt

        _load_backend()
    except ModuleNotFoundError as error:
        raise MissingExtra("matplotlib") from error
    except ValueError as error:  # of a backend that does not exist
        known = ("a backend of matplotlib", "unset it or use agg")
        raise InvalidInput("MPLBACKEND", os.environ.get("MPLBACKEND", ""), *known) from error
    return plt


@cache
def _load_backend() -> None:
    """Load the backend, whose settings the end of a style's context would undo later."""
    from matplotlib import pyplot as plt

    if not plt.get_fignums():
        plt.switch_backend(plt.get_backend())


def figure_style(ax: Axes | None = None) -> AbstractContextManager[None]:
    """Our defaults for a new figure; the caller's axes keep theirs. Text is what it says."""
    return pyplot().rc_context(_TEXT if ax is not None else _RC | _TEXT)


def new_figure(**options: Any) -> Figure:
    """A figure to be returned: a notebook shows what a cell returns, and not a second time."""
    figure = pyplot().figure(**options)
    if "inline" in pyplot().get_backend():
        pyplot().close(figure)
    return figure


def small_axes(width: float = 3.4, height: float = 2.8) -> Axes:
    """Axes in a new figure of that size [inch], by default a journal's column wide."""
    return pyplot().subplots(figsize=(width, height), layout="constrained")[1]


@contextmanager
def styled_axes(ax: Axes | None, width: float = 3.4, height: float = 2.8) -> Iterator[Axes]:
    """The caller's axes, or new ones of that size [inch] in our style."""
    with figure_style(as_axes(ax)):
        yield small_axes(width, height) if ax is None else ax


def place_panels(
    width: float,
    columns: Sequence[float],
    rows: Sequence[float],
    around: tuple[float, float, float, float],
    gaps: tuple[float, float] = (0.0, 0.0),
) -> tuple[Figure, NDArray[np.object_]]:
    """A figure of a width [inch], and its panels at one scale, shape (rows, columns).

    Columns and rows are what each shows in width and in height, in one unit; `around` is the room
    at the left, right, bottom and top, and `gaps` that between columns and between rows [inch].
    """
    (left, right, bottom, top), (beside, between) = around, gaps
    scale = (width - left - right - beside * (len(columns) - 1)) / sum(columns)
    wide, high = scale * sum(columns), scale * sum(rows)
    height = bottom + high + between * (len(rows) - 1) + top
    place = {
        "left": left / width,
        "right": 1 - right / width,
        "bottom": bottom / height,
        "top": 1 - top / height,
        "wspace": beside * len(columns) / wide,
        "hspace": between * len(rows) / high,
    }
    figure = new_figure(figsize=(width, height))
    ratios = {"height_ratios": rows, "width_ratios": columns}
    grid = figure.add_gridspec(len(rows), len(columns), **ratios, **place)
    return figure, grid.subplots(squeeze=False)


def save_figure(
    figure: Figure | Axes | Figure3D, path: StrPath, *, overwrite: bool = False
) -> None:
    """Save as .png, .pdf, .svg or another format that matplotlib knows, whole or not at all.

    What `plot_3d` made is saved as .html, a page in one file.

    Args:
        figure: The figure, or axes in it.
        path: The file; it is replaced only when the new one is complete.
        overwrite: Whether it may replace a file.

    Raises:
        InvalidInput: Unknown suffix, or something is there.
        NotWritten: It cannot be written.
    """
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    if isinstance(figure, Figure3D):
        format_of(path, PAGES)
        with writing(path, overwrite=overwrite) as file:
            file.write(figure.html.encode())
        return
    if not hasattr(figure, "get_figure") or isinstance(figure, type):
        allowed = "a figure or axes of matplotlib, or one of plot_3d"
        raise InvalidInput("figure", as_given(figure), allowed)
    format_of(path, PICTURES)
    suffix = Path(path).suffix.lower()
    with pyplot().rc_context(_SAVING), writing(path, overwrite=overwrite) as file:
        root = figure.get_figure(root=True)
        if root is not None:
            root.savefig(file, dpi=DPI, format=suffix[1:], **_ENCODINGS.get(suffix, {}))


def legend_above(ax: Axes, columns: int = 3, **more: Any) -> None:
    """A legend over the upper edge of axes, each label once; none without labels."""
    handles, labels = ax.get_legend_handles_labels()
    if kinds := dict(zip(labels, handles, strict=True)):
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": columns}
        ax.legend(kinds.values(), kinds.keys(), **place, **more)


def remark(ax: Axes, text: str) -> None:
    """Small words above axes, at the left."""
    ax.set_title(text, fontsize=7, color="0.25", loc="left")


def write_note(ax: Axes, text: str, right: float, up: float) -> None:
    """Small text in axes, at a place from 0 to 1 to the right and up, within the nearer edges."""
    across, along = ("right" if right > 0.5 else "left"), ("top" if up > 0.5 else "bottom")
    place = {"ha": across, "va": along, "transform": ax.transAxes}
    paper = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
    ax.text(right, up, text, fontsize=7, color="0.25", zorder=5, bbox=paper, **place)


def inked(figure: Figure, color: str) -> None:
    """Write all words of a figure in a color, and those of legends without a frame."""
    from matplotlib.legend import Legend
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        text.set_color(color)
    for legend in figure.findobj(Legend):
        legend.set_frame_on(False)


def a_result(name: str, value: Any, kind: str, maker: str) -> Any:
    """What a function returned, of a class of that name, which need not be loaded."""
    if kind in [base.__name__ for base in type(value).__mro__]:
        return value
    raise InvalidInput(name, as_given(value), f"what `{maker}` returned")


def a_surface(name: str, value: Any) -> SurfaceMesh:
    """Anything with vertices and faces that index them."""
    allowed = "an object with vertices [m], shape (v, 3), and faces, shape (f, 3)"
    if isinstance(value, type) or not (hasattr(value, "vertices") and hasattr(value, "faces")):
        raise InvalidInput(name, as_given(value), allowed)
    return value


def some_bundles(arm: Manipulator, value: Any) -> list[int]:
    """Indices of bundles of an arm; None stands for all."""
    value = range(arm.bundles) if value is None else value
    if isinstance(value, set | frozenset | range):
        value = sorted(value)
    return as_indices("bundles", value, arm.bundles, "bundles of the arm").tolist()


def as_axes(ax: Any) -> Any:
    """Axes of matplotlib, which need not be loaded to know them, or None."""
    known = hasattr(ax, "imshow") and hasattr(ax, "get_figure") and not isinstance(ax, type)
    if ax is None or (known and ax.name != "3d"):
        return ax
    raise InvalidInput("ax", as_given(ax), "axes of matplotlib in two dimensions, or None")


def as_box(name: str, value: Any) -> Array:
    """A lower and an upper corner, shape (2, 3)."""
    allowed = "a lower and an upper corner, finite numbers of shape (2, 3)"
    corners = as_floats(name, value, allowed)
    rising = corners.shape == (2, 3) and bool((corners[0] < corners[1]).all())
    if rising and np.isfinite(corners).all():
        return corners
    raise InvalidInput(name, corners.tolist(), allowed)


def unit_of(data: Dataset | DataArray, unit: Unit = None) -> LengthUnit:
    """The unit of lengths on paper for data, whose attributes may say how long the arm is [m]."""
    length = data.attrs.get("length")
    return unit_for(None if length is None else float(length), unit)


def unit_for(length: float | None, unit: Unit = None) -> LengthUnit:
    """The unit asked for, else L of an arm of that length [m], else the meter."""
    if unit is not None:
        return as_unit(unit, length)
    return METER if length is None else LengthUnit("L", length)


def common_unit(units: list[LengthUnit]) -> LengthUnit:
    """Any of them, if all are L or all are of one size, so that they may share axes."""
    if len({unit.name for unit in units}) != 1:
        what = "some with and some without attrs['length']" if units else "none"
        raise InvalidInput("data", what, "one or more, all with attrs['length'] or all without")
    return units[0]
