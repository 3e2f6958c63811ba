"""Figures of an atlas: maps of its metrics, and sheets with a picture of each design."""

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.atlas import DamagedStore, atlas_cloud, over_length
from softreach.atlas.store import DONE
from softreach.cloud.curvature import curvature_statistics
from softreach.cloud.volume import concave_hull
from softreach.geometry.hull import Hull
from softreach.picture.projection import View, view_axes
from softreach.picture.zbuffer import Extent, ZBuffer, draw_mesh
from softreach.plot import coloring, style
from softreach.plot.axes import view_extent
from softreach.plot.reach import drawn_tips, plot_opposite_sides, point_size
from softreach.plot.statistics import SIDES, plot_curvature
from softreach.schema import is_stable
from softreach.support import parallel
from softreach.support.arguments import as_integer
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput, warn
from softreach.support.lazy import Axes, DataArray, Dataset, Figure
from softreach.support.palette import STEEL, activation_colors

_LEFT, _RIGHT, _BOTTOM, _TOP = 0.75, 0.04, 0.62, 0.08  # inches around a sheet
_KEY = 0.45  # inches for the key of colors at least
_VIEW = "oblique"  # of sheets
_METRICS = ("volume", "exact_volume", "unreachability", "exact_unreachability")
_UNITS = {"rad": "°", "1": ""}
_INDEXED = re.compile(r"(?<![a-z])[ERZaρθγ][0-9]+")
_LOWERED = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_NAMES = {
    "volume": "V/L³ (α-shape)",
    "exact_volume": "V/L³ (exact)",
    "convex_volume": "convex V/L³",
    "exact_convex_volume": "convex V/L³ (exact)",
    "unreachability": "UNR (α-shape)",
    "exact_unreachability": "UNR (exact)",
}
_RELATIVE = {"m": " / L", "m2": " / L²", "m3": " / L³", "1/m": " · L"}


def atlas_figures(atlas: Dataset, panels: int = 7) -> Iterator[tuple[str, Any]]:
    """Name and figure (or axes) of each figure that an atlas has the numbers for.

    They are drawn one after the other, so that few clouds are held at once.

    Args:
        atlas: A grid of two parameters, from `open_atlas`.
        panels: Columns and rows of the sheets at most.
    """
    for metric in _METRICS:
        if metric in atlas and np.isfinite(atlas[metric].values).any():
            yield f"map_{metric}", plot_metric_map(atlas, metric)
    if "x_min" not in atlas:
        return
    yield "clouds", plot_cloud_sheet(atlas, panels=panels)
    ends = _thinned(atlas, 2)
    across, up = sheet_axes(ends)
    places = np.ndindex(len(across.values), len(up.values))  # in the paper's order
    clouds = {at: cloud for at in places if (cloud := _cloud_at(ends, *at)) is not None}
    named = {f"{across.text(j)}, {up.text(k)}": cloud for (j, k), cloud in clouds.items()}
    yield "corners", plot_opposite_sides(named, box_over_length=box_over_length(atlas))
    last = len(across.values) - 1
    those = {up.text(k): cloud for (j, k), cloud in clouds.items() if j == last}
    if those:
        ax = plot_curvature({label: curvature_statistics(x) for label, x in those.items()})
        ax.set_title(across.text(last), fontsize=9)
        yield "curvature", ax
    hulls = plot_hull_sheet(atlas, panels=panels)
    grid = hulls.axes[0].get_gridspec()
    if len(those) == len(SIDES) and grid is not None:
        rows, columns = grid.get_geometry()
        for row, color in zip((rows - 1, 0), SIDES, strict=True):  # whose curvatures are compared
            hulls.axes[(row + 1) * columns - 1].spines[:].set(color=color, linewidth=1.6)
    yield "hulls", hulls


def plot_cloud_sheet(atlas: Dataset, *, panels: int = 7) -> Figure:
    """A sheet of the clouds of an atlas at one scale, colored by activation (figure 2a).

    Each is drawn in its own L. Designs that are not done leave a gap.

    Args:
        atlas: A grid of two parameters with the metrics "extent", from `open_atlas`.
        panels: Columns and rows at most; the designs at the ends are always among them.

    Raises:
        InvalidInput: No grid of two parameters, no bounding boxes, or no design is done.
        MissingExtra: matplotlib is not installed.
    """
    box = box_over_length(atlas)

    def image(cloud: Dataset, extent: Extent, columns: int) -> ZBuffer:
        tips = drawn_tips(cloud, style.unit_of(cloud["tip"]))
        pixels = point_size(len(tips), box) * columns / extent.size[0]
        buffer = ZBuffer(extent, columns, oversample=2, color_step=8)
        colors = activation_colors(coloring.bundle_activations(cloud).values)
        buffer.draw_points(tips, colors, max(1.0, pixels), view=_VIEW)
        return buffer

    return _sheet(atlas, panels, box, image, keyed=True)


def plot_hull_sheet(atlas: Dataset, *, panels: int = 7) -> Figure:
    """A sheet of the lit α-shapes of an atlas at one scale (figure 3a).

    The radius is that of the metric `volume`, or 0.05 L. What is not described here is as in
    `plot_cloud_sheet`.

    Raises:
        InvalidInput: As `plot_cloud_sheet`.
        MissingExtra: matplotlib is not installed.
    """
    alpha = float(atlas["volume"].attrs["alpha_over_length"]) if "volume" in atlas else 0.05

    def image(cloud: Dataset, extent: Extent, columns: int) -> ZBuffer:
        hull = hull_over_length(cloud, alpha)
        buffer = ZBuffer(extent, columns, oversample=3, color_step=4)
        draw_mesh(buffer, hull.vertices, hull.faces, STEEL, _VIEW)
        return buffer

    return _sheet(atlas, panels, box_over_length(atlas), image)


def hull_over_length(cloud: Dataset, alpha: float) -> Hull:
    """The α-shape of the stable tips of a cloud; it, its radius and its volume in L of the arm."""
    tips = cloud.tip.values[is_stable(cloud.tip)]
    return concave_hull(tips / cloud.tip.attrs["length"], alpha)


def box_over_length(atlas: Dataset) -> Array:
    """Corners around all clouds, each in its own L [-], shape (2, 3)."""
    if "x_min" not in atlas:
        raise InvalidInput("atlas", "without bounding boxes", 'built with the metrics "extent"')
    low = [over_length(atlas, f"{axis}_min").min() for axis in "xyz"]
    box = np.array([low, [over_length(atlas, f"{axis}_max").max() for axis in "xyz"]])
    if not np.isfinite(box).all():
        raise InvalidInput("atlas", "no design is done", "at least one design")
    return box


def panel_extent(box: Array, view: View) -> Extent:
    """Extent of the ellipsoid in a box, √Σ(hᵢ eᵢ)² along a unit vector e, and a fifth more."""
    middle, half = box.mean(axis=0), np.ptp(box, axis=0) / 2
    limits = view_extent(box, view)
    axes = view_axes(view)[:2]
    x, y = axes @ middle
    w, h = 1.2 * np.linalg.norm(axes * half, axis=1)
    left, right = max(limits.left, x - w), min(limits.right, x + w)
    return Extent(left, right, max(limits.bottom, y - h), min(limits.top, y + h))


def _sheet(
    atlas: Dataset,
    panels: int,
    box: Array,
    image: Callable[[Dataset, Extent, int], ZBuffer],
    *,
    keyed: bool = False,
) -> Figure:
    """A sheet of images of clouds; the threads read and draw them, the caller places them."""
    picked = _thinned(atlas, as_integer("panels", panels, 1))
    across, up = sheet_axes(picked)
    with style.figure_style():
        places = np.ndindex(picked["status"].shape if keyed else (0,))
        clouds = (_cloud_at(picked, *at) for at in places)
        first = next((cloud.isel(sample=slice(1)) for cloud in clouds if cloud is not None), None)
        key = None if first is None else coloring.color_samples(first, "rgb").key
        extent = panel_extent(box, _VIEW)
        wide, high = extent.size.tolist()
        columns, rows = [wide] * len(across.values), [high] * len(up.values)
        top = max(_KEY, coloring.key_height(key)) if keyed else _TOP
        figure, grid = style.place_panels(style.PAGE, columns, rows, (_LEFT, _RIGHT, _BOTTOM, top))
        grid = grid[::-1]  # row 0 at the bottom
        _label_sheet(figure, grid, (across, up), atlas, top)
        across_each = max(16, round(grid[0, 0].get_position().width * style.PAGE * style.DPI))

        def pixels(row: int, column: int) -> NDArray[np.uint8] | None:
            cloud = _cloud_at(picked, column, row)
            return None if cloud is None else image(cloud, extent, across_each).rgba()

        tasks = (partial(pixels, *place) for place in np.ndindex(grid.shape))
        for ax, rgba in zip(grid.ravel().tolist(), parallel.in_order(tasks), strict=True):
            if rgba is not None:
                ax.imshow(rgba, extent=extent, interpolation="none", aspect="auto")
            ax.set(xlim=extent[:2], ylim=extent[2:], xticks=[], yticks=[])
        _draw_scale(figure, grid[0, 0])
        coloring.draw_figure_key(figure, key, top)
    return figure


def _label_sheet(
    figure: Figure, grid: NDArray[Any], axes: Sequence["SheetAxis"], atlas: Dataset, top: float
) -> None:
    for ax in grid.ravel().tolist():
        ax.patch.set_visible(False)
        ax.spines[:].set(color="0.88", linewidth=0.4)
    for ax, value in zip(grid[0], axes[0].values, strict=True):
        ax.set_xlabel(f"{value:.4g}", labelpad=3)
    for ax, value in zip(grid[:, 0], axes[1].values, strict=True):
        ax.set_ylabel(f"{value:.4g}", rotation=0, ha="right", va="center", labelpad=4)
    width, height = figure.get_size_inches()
    middle = (_LEFT + width - _RIGHT) / 2 / width, (_BOTTOM + height - top) / 2 / height
    across, up = (
        axis.label + f", {len(axis.values)} of {size} values" * (len(axis.values) < size)
        for axis, size in zip(axes, atlas["status"].shape, strict=True)
    )
    figure.text(middle[0], 0.12 / height, across, ha="center", fontsize=9)
    figure.text(0.1 / width, middle[1], up, va="center", rotation=90, fontsize=9)


def _draw_scale(figure: Figure, panel: Axes) -> None:
    width, height = figure.get_size_inches()
    ax = figure.add_axes((0.04 / width, 0.02 / height, _LEFT / width, (_BOTTOM - 0.1) / height))
    left, right = panel.get_xlim()
    inch = (right - left) / (panel.get_position().width * width)  # in L
    ax.set(xlim=(0, _LEFT * inch), ylim=(0, (_BOTTOM - 0.1) * inch))
    ax.set_axis_off()
    start, center = 0.08 * inch, np.array([0.22, 0.27]) * inch
    # of a sheet of few columns it is longer than the margin is wide
    line = {"color": "0.2", "lw": 1.2, "solid_capstyle": "butt", "clip_on": False}
    ax.plot([start, start + 0.5], [start] * 2, **line)
    ax.text(start + 0.5 + 0.04 * inch, start, "L/2", fontsize=7, va="center")
    for name, direction in zip("xyz", view_axes(_VIEW)[:2].T, strict=True):
        x, y = center + 0.15 * inch * direction
        arrow = {"arrowstyle": "-|>,head_width=0.1,head_length=0.2", "lw": 0.6, "shrinkA": 0}
        ax.annotate("", (x, y), tuple(center), arrowprops=arrow | {"color": "0.2", "shrinkB": 0})
        x, y = center + 0.22 * inch * direction
        ax.text(x, y, name, fontsize=7, ha="center", va="center")


def _thinned(atlas: Dataset, panels: int) -> Dataset:
    return atlas.isel({dim: evenly(atlas.sizes[dim], panels) for dim in atlas["status"].dims})


def evenly(size: int, most: int) -> Index:
    """Numbers from 0 to size - 1, both among them; at equal steps if that leaves half of `most`."""
    shown = min(size, most)
    steps = (n for n in range(shown, shown // 2, -1) if n > 1 and (size - 1) % (n - 1) == 0)
    return np.rint(np.linspace(0, size - 1, next(steps, shown))).astype(int)


def _cloud_at(atlas: Dataset, column: int, row: int) -> Dataset | None:
    if int(atlas["status"][column, row]) != DONE:
        return None
    places = zip(map(str, atlas["status"].dims), (column, row), strict=True)
    try:
        return atlas_cloud(atlas, **{dim: float(atlas[dim][k]) for dim, k in places})
    except DamagedStore as error:
        warn(f"a cloud is left out: {error}")
        return None


class SheetAxis(NamedTuple):
    """A parameter along an edge of a sheet, in the units of people."""

    label: str
    values: tuple[float, ...]

    def text(self, k: int) -> str:
        """One of its values, such as "φ = 2°"."""
        symbol, _, unit = self.label.partition(" (")
        unit = unit.rstrip(")")
        return f"{symbol} = {self.values[k]:.4g}{' ' if unit.isalpha() else ''}{unit}"


def sheet_axes(atlas: Dataset) -> tuple[SheetAxis, SheetAxis]:
    """The two parameters of an atlas, for the horizontal and the vertical edge."""
    if len(dims := atlas["status"].dims) != 2:
        raise InvalidInput("atlas", f"of dimensions {dims}", "a grid of two parameters")
    return _axis(atlas[dims[0]]), _axis(atlas[dims[1]])


def plot_metric_map(atlas: Dataset, metric: str, *, ax: Axes | None = None) -> Axes:
    """Contours of a metric over the two parameters of an atlas (figure 3b); its best is marked.

    Volumes and lengths are relative to each design's own L. The best is the largest value, of
    unreachability the smallest. Designs without a value stay white; each of a single row is a cell.

    Args:
        atlas: From `open_atlas`, a grid of two parameters.
        metric: Which one.
        ax: Axes to draw in; None for a new figure.

    Raises:
        InvalidInput: No such metric, or no two parameters.
        MissingExtra: matplotlib is not installed.
    """
    across, up = sheet_axes(atlas)
    if metric not in atlas or atlas[metric].dims != atlas["status"].dims:
        raise InvalidInput("metric", metric, "a metric of the atlas")
    values = over_length(atlas, metric).values.T
    with style.styled_axes(ax) as ax:
        shown = np.ma.masked_invalid(values)
        if min(values.shape) < 2 or not shown.count() or np.ptp(shown.compressed()) == 0:
            filled = ax.pcolormesh(_edges(across), _edges(up), shown, cmap=coloring.COLORMAP)
        else:
            filled = ax.contourf(across.values, up.values, shown, 14, cmap=coloring.COLORMAP)
            levels = np.asarray(filled.levels)[::2]
            ink = ["w" if k < 0.65 * len(levels) else "0.15" for k in range(len(levels))]
            lines = ax.contour(across.values, up.values, shown, levels, colors=ink, linewidths=0.5)
            ax.clabel(lines, fontsize=6, fmt="%g")
        if np.isfinite(values).any():
            _mark_best(ax, across, up, values, smallest="unreachability" in metric)
        relative = _RELATIVE.get(atlas[metric].attrs.get("units", "1"), "")
        label = _NAMES.get(metric, metric.replace("_", " ") + relative)
        ax.figure.colorbar(filled, ax=ax, label=label)
        ax.set(xlabel=across.label, ylabel=up.label)
    return ax


def _axis(values: DataArray) -> SheetAxis:
    si_unit = values.attrs.get("units", "1")
    unit = _UNITS.get(si_unit, si_unit)
    shown = np.degrees(values.values) if si_unit == "rad" else values.values
    name = str(values.name).replace("_", " ")
    if symbol := values.attrs.get("symbol"):
        name = _INDEXED.sub(lambda found: found[0].translate(_LOWERED), symbol)
        name += f" of {part}" if (part := values.attrs.get("part")) else ""
    return SheetAxis(f"{name} ({unit})" if unit else name, tuple(np.round(shown, 9).tolist()))


def _edges(axis: SheetAxis) -> Array:
    """Of cells around the values, the outer ones like their neighbors; around one value 1 wide."""
    values = np.asarray(axis.values, float)
    if len(values) == 1:
        return values + [-0.5, 0.5]
    middle = (values[1:] + values[:-1]) / 2
    return np.array([2 * values[0] - middle[0], *middle, 2 * values[-1] - middle[-1]])


def _mark_best(ax: Axes, across: SheetAxis, up: SheetAxis, values: Array, smallest: bool) -> None:
    best = np.nanargmin(values) if smallest else np.nanargmax(values)
    row, column = np.unravel_index(best, values.shape)
    place = across.values[column], up.values[row]
    dot = {"ms": 5, "mfc": "w", "mec": "k", "mew": 0.8, "clip_on": False, "zorder": 5}
    ax.plot(*place, "o", **dot)
    # inside the axes, whichever edge the best lies at
    left = column > (len(across.values) - 1) / 2
    down = row > (len(up.values) - 1) / 2
    away = {"xytext": (-7 if left else 7, -6 if down else 6), "textcoords": "offset points"}
    look = {"ha": "right" if left else "left", "va": "top" if down else "bottom", "fontsize": 7}
    look["bbox"] = {"fc": "w", "ec": "none", "pad": 1.2, "alpha": 0.8}
    ax.annotate(f"{values[row, column]:.3f}", place, **away, **look)
