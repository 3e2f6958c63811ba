"""Slices of a reachable set: how many activations reach each place, and where the map folds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.picture.projection import View, is_mirrored, plane_of, sight_axis
from softreach.plot.lengths import Unit, unit_of
from softreach.plot.style import PLACE, WIDTH, as_axes, figure_style, pyplot, small_axes
from softreach.support.arguments import as_dataset, as_flag, as_number
from softreach.support.arrays import as_floats
from softreach.support.errors import InvalidInput
from softreach.support.units import LengthUnit

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_slice", "plot_slices"]

_COLORS = ("white", "#cfe3f2", "#f2a65a", "#c8553d", "#6b2737")
_LABELS = ("out of reach", "one activation", "two", "three", "four or more")


def plot_slice(
    grid: xr.Dataset,
    *,
    ax: Axes | None = None,
    view: View = "front",
    at: float | None = None,
    key: bool = True,
    unit: Unit = None,
) -> Axes:
    """Draw one plane of a reachable set: the number of activations that reach each place.

    A black line surrounds the places that the map reaches with both orientations: they lie behind a
    fold. A set of more than three bundles has no such numbers and shows what is reachable.

    Args:
        grid: `ReachableSet.grid`: `count` and `degree`, or `occupied`, over x, y, z [m].
        ax: Axes to draw in; None for a new figure.
        view: A view along an axis: "front" for a plane y = at, "side" for x = at, "top" for z = at.
        at: Where the plane cuts that axis [m]; the nearest layer of cells is shown. None for the
            middle of the set.
        key: Whether to explain the colors.
        unit: Of the axes: "m", "cm", "mm" or "L"; None for L if the grid knows it (attribute
            `length`), else m.

    Returns:
        The axes, in that unit.

    Raises:
        InvalidInput: Not a view along an axis, or a plane that misses the grid.
        MissingExtra: matplotlib is not installed.
    """
    grid, ax = as_dataset("grid", grid, "x", "y", "z"), as_axes(ax)
    axis, counted, key = sight_axis(view), unit_of(grid, unit), as_flag("key", key)
    at = _middle(grid, axis) if at is None else as_number("at", at, PLACE)
    layer = _layer(grid, axis, at)
    with figure_style(ax):
        ax = small_axes(3.4, 4.2) if ax is None else ax
        highest = _draw(ax, layer, view, counted)
        ax.set_title(f"{axis} = {counted.of(at):.3g} {counted.name}")
        if key:
            below = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 4.5}
            _draw_key(ax, highest, "count" in layer, **below)
    return ax


def plot_slices(
    grid: xr.Dataset,
    *,
    at: Sequence[float] | None = None,
    width: float = 9.6,
    unit: Unit = None,
) -> Figure:
    """Draw the three planes of a reachable set that meet at a point: from the side, front and top.

    Args:
        grid: As in `plot_slice`.
        at: The point [m]; None for the middle of the set.
        width: Of the figure [inch].
        unit: As in `plot_slice`.

    Raises:
        InvalidInput: Not a point, or one outside the grid.
        MissingExtra: matplotlib is not installed.
    """
    grid, width = as_dataset("grid", grid, "x", "y", "z"), as_number("width", width, WIDTH)
    point = as_floats("at", [_middle(grid, axis) for axis in "xyz"] if at is None else at)
    if point.shape != (3,):
        raise InvalidInput("at.shape", point.shape, "a point (x, y, z) [m]")
    with figure_style():
        size = (width, 0.375 * width)
        figure, axes = pyplot().subplots(1, 3, figsize=size, layout="constrained")
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
    return float(np.rint(middle / tenth) * tenth)


def _layer(grid: xr.Dataset, axis: str, at: float) -> xr.Dataset:
    centers, half = grid[axis].values, grid.attrs["cell"] / 2
    if not centers[0] - half <= at <= centers[-1] + half:
        inside = f"between {centers[0]:.4g} and {centers[-1]:.4g} m along {axis}"
        raise InvalidInput("at", at, inside)
    return grid.sel({axis: at}, method="nearest")


def _draw(ax: Axes, layer: xr.Dataset, view: View, unit: LengthUnit) -> int:
    plane = plane_of(view)
    assert plane is not None  # the view is along an axis
    across, up = plane
    name = "count" if "count" in layer else "occupied"
    shown = np.minimum(layer[name].transpose(up, across).values.astype(int), len(_COLORS) - 1)
    centers = unit.of(layer[across].values), unit.of(layer[up].values)
    _draw_cells(ax, shown, *centers, half=float(unit.of(layer.attrs["cell"])) / 2)
    if "degree" in layer:
        folded = (layer["count"] > abs(layer["degree"])).transpose(up, across).values
        if folded.any():
            ax.contour(*centers, folded.astype(float), levels=[0.5], colors="black", linewidths=0.6)
    ax.set(xlabel=unit.label(across), ylabel=unit.label(up), aspect="equal")
    if is_mirrored(view) and not ax.xaxis_inverted():
        ax.invert_xaxis()
    return int(shown.max())


def _draw_cells(
    ax: Axes, shown: np.ndarray, across: np.ndarray, up: np.ndarray, half: float
) -> None:
    from matplotlib.colors import ListedColormap

    ax.imshow(
        shown,
        origin="lower",
        extent=(across[0] - half, across[-1] + half, up[0] - half, up[-1] + half),
        cmap=ListedColormap(_COLORS),
        vmin=-0.5,
        vmax=len(_COLORS) - 0.5,
        interpolation="nearest",
    )


def _draw_key(owner: Axes | Figure, highest: int, counted: bool, **place: Any) -> None:
    from matplotlib.patches import Patch

    labels = _LABELS[1 : highest + 1] if counted else ("reachable",)
    patches = [Patch(color=c, label=t) for c, t in zip(_COLORS[1:], labels, strict=False)]
    owner.legend(handles=patches, title="reached by" if counted else None, ncols=2, **place)
