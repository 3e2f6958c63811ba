"""Pictures of reachable sets and hulls: lit surfaces, volumes over α, slices by multiplicity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.surface import SurfaceMesh
from softreach.picture.projection import View, is_mirrored, plane_of, sight_axis
from softreach.picture.zbuffer import draw_mesh
from softreach.plot import style
from softreach.plot.axes import Panel
from softreach.plot.coloring import draw_entries
from softreach.support.arguments import as_dataset, as_flag, as_mapping, as_number
from softreach.support.arrays import as_floats
from softreach.support.errors import InvalidInput, Range
from softreach.support.palette import STEEL
from softreach.support.units import LengthUnit

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_VOLUMES = Range(0.0, unit="m³")
_ROW = (9.6, 3.6)  # inches
_COLORS = ("white", "#cfe3f2", "#f2a65a", "#c8553d", "#6b2737")
_LABELS = ("out of reach", "one activation", "two", "three", "four or more")


def plot_hull(
    hull: SurfaceMesh,
    *,
    ax: Axes | None = None,
    view: View = "front",
    length: float | None = None,
    box: ArrayLike | None = None,
    unit: style.Unit = None,
) -> Axes:
    """Draw the boundary of a hull in one view.

    Args:
        hull: A hull, the surface of a reachable set, or anything with vertices [m] and faces.
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        length: L [m], which divides coordinates unless `unit` says otherwise; None leaves meters.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all of it.
        unit: Of the axes: "m", "cm", "mm", or "L" with `length`; None for L with it, else m.

    Raises:
        InvalidInput: Unknown view or unit, or no vertices.
        MissingExtra: matplotlib is not installed.
    """
    hull = style.a_surface("hull", hull)
    length = None if length is None else as_number("length", length, style.LENGTH)
    counted = style.unit_for(length, unit)
    vertices = counted.of(hull.vertices)
    with Panel.opened(vertices, counted, ax, view, box) as panel:
        buffer = panel.buffer(oversample=3)
        draw_mesh(buffer, vertices, hull.faces, STEEL, view)
        panel.show(buffer)
    return panel.ax


def plot_volume_curve(
    curves: Mapping[str, ArrayLike],
    alphas: ArrayLike,
    *,
    ax: Axes | None = None,
    length: float | None = None,
    exact: float | None = None,
    convex: float | None = None,
    unit: style.Unit = None,
) -> Axes:
    """Draw V(α) of clouds.

    Args:
        curves: Label -> volumes [m³] from `volume_curve`, shape (n,).
        alphas: Their radii [m], shape (n,).
        ax: Axes to draw in; None for a new figure.
        length: L [m], by which radii, and volumes by its cube, are divided; None leaves them in m.
        exact: Volume of the reachable set [m³], drawn as a line.
        convex: Volume of its convex hull [m³], likewise.
        unit: As in `plot_hull`; volumes in liters beside cm, in mL beside mm.

    Raises:
        InvalidInput: Radii and volumes of different shapes.
        MissingExtra: matplotlib is not installed.
    """
    from matplotlib.ticker import LogLocator, NullFormatter

    curves, radii = as_mapping("curves", curves, as_floats), as_floats("alphas", alphas)
    length = None if length is None else as_number("length", length, style.LENGTH)
    exact = None if exact is None else as_number("exact", exact, _VOLUMES)
    convex = None if convex is None else as_number("convex", convex, _VOLUMES)
    counted = style.unit_for(length, unit)
    with style.styled_axes(ax, 3.4, 2.6) as ax:
        for label, volumes in curves.items():
            if np.shape(volumes) != radii.shape:
                raise InvalidInput(label, np.shape(volumes), f"volumes of {radii.shape} radii")
            ax.plot(counted.of(radii), counted.of(volumes, 3), linewidth=1.2, label=label)
        for value, name, look in ((exact, "exact", "-"), (convex, "convex hull", ":")):
            if value is not None:
                ax.axhline(float(counted.of(value, 3)), color="0.3", lw=0.8, ls=look, label=name)
        ax.set(xscale="log", xlabel=counted.label("radius α"), ylim=(0, None))
        few = float(np.max(radii)) < 100 * float(np.min(radii))
        ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if few else (1,)))
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.set_ylabel(counted.label("V", 3))
        ax.legend(loc="lower right")
    return ax


def plot_slice(
    grid: xr.Dataset,
    *,
    ax: Axes | None = None,
    view: View = "front",
    at: float | None = None,
    key: bool = True,
    unit: style.Unit = None,
) -> Axes:
    """Draw one plane of a reachable set: the number of activations that reach each place.

    A black line surrounds the places that the map reaches with both orientations: they lie behind a
    fold. A set of more than three bundles has no such numbers and shows what is reachable.

    Args:
        grid: `ReachableSet.grid`: `count` and `degree`, or `occupied`, over x, y, z [m].
        ax: Axes to draw in; None for a new figure.
        view: A view along an axis: "front" for a plane y = at, "side" for x = at, "top" for z = at.
        at: Where the plane cuts that axis [m], to the nearest layer of cells; None for the middle.
        key: Whether to explain the colors.
        unit: Of the axes: "m", "cm", "mm" or "L"; None for L by the attribute `length`, else m.

    Raises:
        InvalidInput: Not a view along an axis, or a plane that misses the grid.
        MissingExtra: matplotlib is not installed.
    """
    grid = as_dataset("grid", grid, "x", "y", "z")
    axis, counted, key = sight_axis(view), style.unit_of(grid, unit), as_flag("key", key)
    at = _middle(grid, axis) if at is None else as_number("at", at, style.PLACE)
    centers, half = grid[axis].values, grid.attrs["cell"] / 2
    if not centers[0] - half <= at <= centers[-1] + half:
        allowed = f"between {centers[0]:.4g} and {centers[-1]:.4g} m along {axis}"
        raise InvalidInput("at", at, allowed)
    layer = grid.sel({axis: at}, method="nearest")
    with style.styled_axes(ax, 3.4, 4.2) as ax:
        highest = _draw(ax, layer, view, counted)
        place = at if abs(at) > 1e-6 * half else 0.0  # no -0, nor what rounding left of 0
        ax.set_title(f"{axis} = {counted.of(place):.3g} {counted.name}")
        if key:
            below = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 4.5}
            _draw_key(ax, highest, "count" in layer, **below)
    return ax


def plot_slices(
    grid: xr.Dataset, *, at: Sequence[float] | None = None, unit: style.Unit = None
) -> Figure:
    """Draw the three planes of a reachable set that meet at a point: from the side, front and top.

    Args:
        grid: As in `plot_slice`.
        at: The point [m]; None for the middle of the set.
        unit: As in `plot_slice`.

    Raises:
        InvalidInput: Not a point, or one outside the grid.
        MissingExtra: matplotlib is not installed.
    """
    grid = as_dataset("grid", grid, "x", "y", "z")
    point = as_floats("at", [_middle(grid, axis) for axis in "xyz"] if at is None else at)
    if point.shape != (3,):
        raise InvalidInput("at.shape", point.shape, "a point (x, y, z) [m]")
    with style.figure_style():
        figure = style.new_figure(figsize=_ROW, layout="constrained")
        axes = figure.subplots(1, 3)
        for ax, view, place in zip(axes, ("side", "front", "top"), point.tolist(), strict=True):
            plot_slice(grid, ax=ax, view=view, at=place, unit=unit, key=False)
        highest = max(int(ax.images[0].get_array().max()) for ax in axes)
        _draw_key(figure, highest, "count" in grid, loc="outside lower center")
    return figure


def _middle(grid: xr.Dataset, axis: str) -> float:
    """Middle of what is reached along an axis, to a tenth of a cell [m]."""
    reached = grid["count" if "count" in grid else "occupied"] > 0
    extent = grid[axis].values[reached.any([other for other in "xyz" if other != axis]).values]
    middle = (extent[0] + extent[-1]) / 2 if len(extent) else grid[axis].values.mean()
    tenth = grid.attrs["cell"] / 10
    return float(np.rint(middle / tenth) * tenth) + 0.0  # no -0


def _draw(ax: Axes, layer: xr.Dataset, view: View, unit: LengthUnit) -> int:
    from matplotlib.colors import ListedColormap

    across, up = plane_of(view) or ("x", "z")  # the view is along an axis
    name = "count" if "count" in layer else "occupied"
    shown = np.minimum(layer[name].transpose(up, across).values.astype(int), len(_COLORS) - 1)
    x, y = unit.of(layer[across].values), unit.of(layer[up].values)
    half = float(unit.of(layer.attrs["cell"])) / 2
    extent = (x[0] - half, x[-1] + half, y[0] - half, y[-1] + half)
    scale = {"cmap": ListedColormap(_COLORS), "vmin": -0.5, "vmax": len(_COLORS) - 0.5}
    ax.imshow(shown, origin="lower", extent=extent, interpolation="nearest", **scale)
    if "degree" in layer:
        folded = (layer["count"] > abs(layer["degree"])).transpose(up, across).values
        if folded.any():
            ax.contour(x, y, folded.astype(float), levels=[0.5], colors="black", linewidths=0.6)
    ax.set(xlabel=unit.label(across), ylabel=unit.label(up), aspect="equal")
    if is_mirrored(view) and not ax.xaxis_inverted():
        ax.invert_xaxis()
    return int(shown.max())


def _draw_key(owner: Axes | Figure, highest: int, counted: bool, **place: Any) -> None:
    labels = _LABELS[1 : highest + 1] if counted else ("reachable",)
    entries = zip(labels, _COLORS[1:], strict=False)
    draw_entries(owner, entries, title="reached by" if counted else None, ncols=2, **place)
