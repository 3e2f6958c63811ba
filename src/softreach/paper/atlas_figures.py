"""The figures of an atlas, one after the other, so that one cloud at a time is held."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.support.errors import warn

if TYPE_CHECKING:
    import xarray as xr

    from softreach.geometry.hull import Hull
    from softreach.plot import SheetAxis

__all__ = ["atlas_figures", "hulls_of"]

_METRICS = ("volume", "exact_volume", "unreachability", "exact_unreachability")


def atlas_figures(atlas: xr.Dataset, panels: int = 7) -> Iterator[tuple[str, Any]]:
    """Name and figure (or axes) of each figure that the atlas has the numbers for.

    Args:
        atlas: A grid of two parameters, from `open_atlas`.
        panels: Columns and rows of the sheets at most.
    """
    from softreach import plot

    for metric in _METRICS:
        if metric in atlas and np.isfinite(atlas[metric].values).any():
            yield f"map_{metric}", plot.plot_metric_map(atlas, metric)
    if "x_min" not in atlas:
        return
    box: dict[str, Any] = {"box_over_length": plot.box_over_length(atlas)}
    picked = _thinned(atlas, panels)
    edges = plot.sheet_axes(picked)
    yield "clouds", plot.plot_cloud_sheet(_clouds(picked), *edges, **box)
    yield "corners", plot.plot_opposite_sides(_corners(atlas), **box)
    if (statistics := _curvature(atlas)) is not None:
        yield "curvature", statistics
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
    from softreach.atlas import DamagedStore, atlas_cloud
    from softreach.atlas.store import DONE

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
    from softreach.cloud.volume import concave_hull
    from softreach.rod.tip_map import TipStatus

    cloud_at = _clouds(atlas)
    alpha_over_length = (
        float(atlas["volume"].attrs["alpha_over_length"]) if "volume" in atlas else 0.05
    )

    def hull_at(column: int, row: int) -> Hull | None:
        cloud = cloud_at(column, row)
        if cloud is None:
            return None
        tips = cloud.tip.values / cloud.tip.attrs["length"]
        if "status" in cloud:
            tips = tips[cloud.status.values == TipStatus.STABLE]
        return concave_hull(tips, alpha_over_length)

    return hull_at


def _corners(atlas: xr.Dataset) -> dict[str, xr.Dataset]:
    """Title and cloud at the ends of both parameters, in the paper's order."""
    from softreach.plot import sheet_axes

    ends = _thinned(atlas, 2)
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


def _curvature(atlas: xr.Dataset) -> Any:
    """The first against the last value of the second parameter, at the last of the first.

    None if neither design is done.
    """
    from softreach.cloud.curvature import curvature_statistics
    from softreach.plot import plot_curvature, sheet_axes

    ends = _thinned(atlas, 2)
    across, up = sheet_axes(ends)
    clouds = {f"{_at(up, k)}": _clouds(ends)(len(across.values) - 1, k) for k in range(2)}
    panels = {label: cloud for label, cloud in clouds.items() if cloud is not None}
    if not panels:
        return None
    ax = plot_curvature({label: curvature_statistics(cloud) for label, cloud in panels.items()})
    ax.set_title(_at(across, -1), fontsize=9)
    return ax
