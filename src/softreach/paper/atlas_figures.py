"""The figures of an atlas, one after the other, so that one cloud at a time is held."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import xarray as xr

from softreach import plot
from softreach.atlas import DamagedStore, atlas_cloud
from softreach.atlas.store import DONE
from softreach.cloud.curvature import curvature_statistics
from softreach.cloud.volume import concave_hull
from softreach.geometry.hull import Hull
from softreach.plot import SheetAxis, sheet_axes
from softreach.schema import is_stable
from softreach.support.errors import warn

__all__ = ["atlas_figures", "hulls_of"]

_METRICS = ("volume", "exact_volume", "unreachability", "exact_unreachability")


def atlas_figures(atlas: xr.Dataset, panels: int = 7) -> Iterator[tuple[str, Any]]:
    """Name and figure (or axes) of each figure that the atlas has the numbers for.

    Args:
        atlas: A grid of two parameters, from `open_atlas`.
        panels: Columns and rows of the sheets at most.
    """
    for metric in _METRICS:
        if metric in atlas and np.isfinite(atlas[metric].values).any():
            yield f"map_{metric}", plot.plot_metric_map(atlas, metric)
    if "x_min" not in atlas:
        return
    box: dict[str, Any] = {"box_over_length": plot.box_over_length(atlas)}
    picked, ends = _thinned(atlas, panels), _thinned(atlas, 2)
    edges = sheet_axes(picked)
    yield "clouds", plot.plot_cloud_sheet(_clouds(picked), *edges, **box)
    yield "corners", plot.plot_opposite_sides(_corners(ends), **box)
    if (curvature := _curvature(ends)) is not None:
        yield "curvature", curvature
    yield "hulls", plot.plot_hull_sheet(hulls_of(picked), *edges, length=1.0, **box)


def _thinned(atlas: xr.Dataset, panels: int) -> xr.Dataset:
    """As many designs along each parameter as there are panels, the ends among them."""
    sizes = {str(dim): atlas.sizes[dim] for dim in atlas["status"].dims}
    places = {
        dim: np.unique(np.rint(np.linspace(0, size - 1, min(size, panels))).astype(int))
        for dim, size in sizes.items()
    }
    return atlas.isel(places)


def _clouds(atlas: xr.Dataset) -> Callable[[int, int], xr.Dataset | None]:
    """(column, row) -> the cloud of the design there, if it is done and not damaged."""
    first, second = map(str, atlas["status"].dims)

    def cloud_at(column: int, row: int) -> xr.Dataset | None:
        if int(atlas["status"][column, row]) != DONE:
            return None
        at = {first: float(atlas[first][column]), second: float(atlas[second][row])}
        try:
            return atlas_cloud(atlas, **at)
        except DamagedStore as error:
            warn(f"a cloud is left out: {error}")
            return None

    return cloud_at


def hulls_of(atlas: xr.Dataset) -> Callable[[int, int], Hull | None]:
    """(column, row) -> the hull of the design there in lengths of its own, if it is done."""
    cloud_at = _clouds(atlas)
    alpha = float(atlas["volume"].attrs["alpha_over_length"]) if "volume" in atlas else 0.05

    def hull_at(column: int, row: int) -> Hull | None:
        if (cloud := cloud_at(column, row)) is None:
            return None
        tips = cloud.tip.values[is_stable(cloud.tip)]
        return concave_hull(tips / cloud.tip.attrs["length"], alpha)

    return hull_at


def _corners(ends: xr.Dataset) -> dict[str, xr.Dataset]:
    """Title and cloud at the ends of both parameters, in the paper's order."""
    across, up = sheet_axes(ends)
    cloud_at = _clouds(ends)
    places = [(column, row) for column in range(2) for row in range(2)]
    pairs = ((f"{_at(across, j)}, {_at(up, i)}", cloud_at(j, i)) for j, i in places)
    return {title: cloud for title, cloud in pairs if cloud is not None}


def _at(axis: SheetAxis, k: int) -> str:
    symbol, _, unit = axis.label.partition(" (")
    unit = unit.rstrip(")")
    space = " " if unit.isalpha() else ""
    return f"{symbol} = {axis.values[k]:.4g}{space}{unit}"


def _curvature(ends: xr.Dataset) -> Any:
    """The first against the last value of the second parameter, at the last of the first.

    None if neither design is done.
    """
    across, up = sheet_axes(ends)
    clouds = {_at(up, k): _clouds(ends)(len(across.values) - 1, k) for k in range(2)}
    done = {label: cloud for label, cloud in clouds.items() if cloud is not None}
    if not done:
        return None
    ax = plot.plot_curvature({label: curvature_statistics(cloud) for label, cloud in done.items()})
    ax.set_title(_at(across, -1), fontsize=9)
    return ax
