"""Slices of a reachable set: how many activations reach each place, and where the map folds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from softreach.errors import InvalidInput
from softreach.plot.style import figure_style, pyplot

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

__all__ = ["plot_slice"]

_COLORS = ("white", "#cfe3f2", "#f2a65a", "#c8553d", "#6b2737")
_LABELS = ("out of reach", "one activation", "two", "three", "four or more")
_PLANES = {"x": ("y", "z"), "y": ("x", "z"), "z": ("x", "y")}


def plot_slice(
    grid: xr.Dataset,
    ax: Axes | None = None,
    *,
    normal: str = "x",
    at: float = 0.0,
    length: float = 1.0,
    key: bool = True,
) -> Axes:
    """Draw one plane of a reachable set: the number of activations that reach each place.

    A black line surrounds the places that the map reaches with both orientations: they lie behind a
    fold. A set of more than three bundles has no such numbers and shows what is reachable.

    Args:
        grid: `ReachableSet.grid`: `count` and `degree`, or `occupied`, over x, y, z [m].
        ax: Axes to draw in; None for a new figure.
        normal: Axis that the plane is normal to: "x", "y" or "z".
        at: Where the plane cuts that axis [m]; the nearest layer of cells is shown.
        length: L [m], the unit of the axes.
        key: Whether to explain the colors.

    Returns:
        The axes, in units of L.

    Raises:
        InvalidInput: Another normal, or a plane that misses the grid.
        MissingExtra: matplotlib is not installed.
    """
    layer = _layer(grid, normal, at)
    across, up = _PLANES[normal]
    name = "count" if "count" in layer else "occupied"
    shown = np.minimum(layer[name].transpose(up, across).values.astype(int), len(_COLORS) - 1)
    half = grid.attrs["cell"] / 2
    edges = [
        float(f(layer[axis]) + s) for axis in (across, up) for f, s in ((min, -half), (max, half))
    ]
    with figure_style(ax):
        axes: Axes = _new_axes() if ax is None else ax
        _draw(axes, shown, [edge / length for edge in edges])
        if "degree" in layer:
            _draw_folds(axes, layer, across, up, length)
        axes.set(xlabel=f"{across} / L", ylabel=f"{up} / L", aspect="equal")
        axes.set_title(f"{normal} = {at / length:.3g} L")
        if key:
            _draw_key(axes, int(shown.max()), name)
    return axes


def _new_axes() -> Axes:
    return pyplot().subplots(figsize=(3.4, 4.2), layout="constrained")[1]


def _layer(grid: xr.Dataset, normal: str, at: float) -> xr.Dataset:
    if normal not in _PLANES:
        raise InvalidInput("normal", repr(normal), '"x", "y" or "z"')
    centers, half = grid[normal].values, grid.attrs["cell"] / 2
    if not centers[0] - half <= at <= centers[-1] + half:
        raise InvalidInput("at", at, f"between {centers[0]:.4g} and {centers[-1]:.4g} m")
    return grid.sel({normal: at}, method="nearest")


def _draw(ax: Axes, shown: np.ndarray, extent: list[float]) -> None:
    from matplotlib.colors import ListedColormap

    left, right, bottom, top = extent
    ax.imshow(
        shown,
        origin="lower",
        extent=(left, right, bottom, top),
        cmap=ListedColormap(_COLORS),
        vmin=-0.5,
        vmax=len(_COLORS) - 0.5,
        interpolation="nearest",
    )


def _draw_folds(ax: Axes, layer: xr.Dataset, across: str, up: str, length: float) -> None:
    folded = (layer["count"] > abs(layer["degree"])).transpose(up, across).values
    if folded.any():
        places = layer[across].values / length, layer[up].values / length
        ax.contour(*places, folded.astype(float), levels=[0.5], colors="black", linewidths=0.6)


def _draw_key(ax: Axes, highest: int, name: str) -> None:
    from matplotlib.patches import Patch

    labels = _LABELS[1 : highest + 1] if name == "count" else ("reachable",)
    patches = [Patch(color=c, label=t) for c, t in zip(_COLORS[1:], labels, strict=False)]
    title = "reached by" if name == "count" else None
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.2), "ncols": 2}
    ax.legend(handles=patches, title=title, **place)
