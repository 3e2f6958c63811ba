"""Where an arm is redundant, and where its tips gather: means over the cells of a grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.arguments import POSITIVE, checked, dataset, optional, within
from softreach.redundancy.distance import evaluated_samples
from softreach.schema import a_cloud, cell_dataset, tip_cells

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["distance_map", "tip_density"]


@checked(
    cloud=a_cloud,
    distance=dataset(kind="DataArray"),
    cell=optional(within(POSITIVE._replace(unit="m"))),
)
def distance_map(
    cloud: xr.Dataset, distance: xr.DataArray, *, cell: float | None = None
) -> xr.Dataset:
    """Mean D̄ of the evaluated points in each cell of a grid.

    Args:
        cloud: The cloud that D̄ was computed from.
        distance: D̄ from `activation_distance`.
        cell: Edge of the cells [m]; None for L/20.

    Returns:
        Dataset over the centers x, y, z [m] of cells: `activation_distance` [-], NaN where no point
        with neighbors was evaluated; `activation_distance_error`, the standard error of that mean,
        NaN for fewer than two points; and `evaluated`, the number of points.

    Raises:
        InvalidInput: D̄ of another cloud, or cells that are not positive or too many.
    """
    grid, evaluated = tip_cells(cloud, cell), evaluated_samples(distance, cloud)
    count = grid.count(evaluated[np.isfinite(distance.values)])
    name = {"long_name": "mean activation-space distance D̄ in the cell", "units": "1"}
    number = {"long_name": "evaluated points with neighbors", "units": "1"}
    error = {"long_name": "standard error of activation_distance", "units": "1"}
    mean = grid.mean(distance.values, evaluated)
    squares = grid.mean(distance.values**2, evaluated)
    several = np.where(count > 1, count - 1.0, np.nan)
    scatter = np.sqrt((squares - mean**2).clip(0.0) / several)
    return cell_dataset(
        grid,
        activation_distance=(mean, name),
        activation_distance_error=(scatter, error),
        evaluated=(count, number),
    ).assign_attrs(cloud.attrs)


@checked(cloud=a_cloud, cell=optional(within(POSITIVE._replace(unit="m"))))
def tip_density(cloud: xr.Dataset, *, cell: float | None = None) -> xr.Dataset:
    """Local density of tips, and how uneven it is.

    The attribute `coefficient_of_variation` is that of the counts in occupied cells; `chance` is
    what it would be for points spread evenly over them, 1 / sqrt(mean count), and `heterogeneity`
    what chance leaves of it: sqrt(coefficient_of_variation² - chance²), 0 at least. Cells that the
    cloud's border cuts count as they are.

    Args:
        cloud: tip(sample, axis) [m].
        cell: Edge of the cells [m]; None for L/20.

    Returns:
        Dataset over the centers x, y, z [m] of cells: `density` [1/m³], 0 where there is no tip,
        and `density_error`, its standard error for independent samples.

    Raises:
        InvalidInput: No cloud, or cells that are not positive or too many.
    """
    grid = tip_cells(cloud, cell)
    count = grid.count()
    name = {"long_name": "tips per volume", "units": "m-3"}
    error = {"long_name": "standard error of density", "units": "m-3"}
    return cell_dataset(
        grid,
        density=(count / grid.volume, name),
        density_error=(np.sqrt(count) / grid.volume, error),
    ).assign_attrs({**cloud.attrs, **_unevenness(count)})


def _unevenness(count: NDArray[np.intp]) -> dict[str, float]:
    occupied = count[count > 0]
    variation, chance = occupied.std() / occupied.mean(), occupied.mean() ** -0.5
    return {
        "coefficient_of_variation": float(variation),
        "chance": float(chance),
        "heterogeneity": float(np.sqrt(max(variation**2 - chance**2, 0.0))),
    }
