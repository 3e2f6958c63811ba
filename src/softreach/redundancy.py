"""How differently an arm must be activated to reach nearly the same place (section 5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.errors import InvalidInput
from softreach.geometry.neighbors import mean_value_distance
from softreach.schema import cell_dataset, check_cloud, tip_cells

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "RedundancySummary",
    "activation_distance",
    "distance_map",
    "redundancy_summary",
    "tip_density",
]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

THRESHOLD = 0.25  # between a minimal arm's D̄ of some 0.05 and a redundant one's of order 1


def activation_distance(
    cloud: xr.Dataset, radius: float, queries: int | ArrayLike | None = None
) -> xr.DataArray:
    """Mean activation-space distance of tips to their neighbors (section 5; theory (44)).

    D̄(p_i, r) = Σ_j ‖Γ_j - Γ_i‖₂ / K over the K *other* points j with |p_j - p_i| <= r. Point i
    itself is not counted; another point at the same place is. Where K = 0 the point is isolated
    and D̄ is NaN. Neighbors always come from the full cloud, whatever is evaluated.

    Memory is a sorted copy of the cloud and a few blocks, however many neighbors there are; the
    result does not depend on the number of threads.

    Args:
        cloud: tip(sample, axis) [m] and activation(sample, fiber) [-].
        radius: r [m]; the paper's is L/60. 0 leaves the tips at the same place.
        queries: How many samples are evaluated, one from each of as many equal parts of the
            cloud, always the same ones; or their indices; None for all.

    Returns:
        D̄ [-] over `sample`, whose coordinate is the index in the cloud; the coordinate
        `neighbors` is K.

    Raises:
        InvalidInput: No cloud, tips or activations that are not finite, a radius below zero, or
            queries that are no samples of the cloud.
    """
    import xarray as xr

    check_cloud(cloud)
    chosen = _chosen(queries, cloud.sizes["sample"])
    tip, activation = cloud["tip"].values, cloud["activation"].values
    mean, others = mean_value_distance(tip, activation, radius, chosen)
    sample = np.arange(cloud.sizes["sample"]) if chosen is None else chosen
    counted = {"long_name": "other tips within the radius", "units": "1"}
    return xr.DataArray(
        mean,
        {"sample": sample, "neighbors": ("sample", others, counted)},
        ("sample",),
        name="activation_distance",
        attrs={
            "long_name": "mean activation-space distance D̄",
            "units": "1",
            "radius": float(radius),
        },
    )


@dataclass(frozen=True, kw_only=True)
class RedundancySummary:
    """D̄ of a cloud in numbers; isolated points count in `isolated` alone."""

    evaluated: int
    """Number of points evaluated."""
    isolated: float
    """Share of them without a neighbor [-]."""
    median: float
    """Median of D̄ [-]."""
    quantiles: dict[float, float]
    """Quantiles of D̄ [-] by probability."""
    threshold: float
    """The D̄ [-] above which a place counts as redundant."""
    redundant_points: float
    """Share of the points whose D̄ exceeds the threshold [-]."""
    redundant_volume: float
    """Share of the measured volume in whose cells the mean D̄ exceeds the threshold [-]."""
    measured_volume: float
    """Volume of the cells that hold an evaluated point with neighbors [m³]."""
    occupied_volume: float
    """Volume of the cells that hold a tip of the cloud [m³]."""


def redundancy_summary(
    cloud: xr.Dataset,
    distance: xr.DataArray,
    *,
    threshold: float = THRESHOLD,
    cell: float | None = None,
    quantiles: Sequence[float] = (0.05, 0.25, 0.75, 0.95),
) -> RedundancySummary:
    """Median and quantiles of D̄, isolated points, and where it exceeds a threshold.

    Points gather where the arm goes often, so shares of points and of volume differ. The volume is
    that of grid cells: evaluate enough points that `measured_volume` is near `occupied_volume`.

    Args:
        cloud: The cloud that D̄ was computed from.
        distance: D̄ from `activation_distance`.
        threshold: The D̄ [-] above which a place counts as redundant.
        cell: Edge of the grid cells [m]; None for L/20.
        quantiles: Probabilities.

    Raises:
        InvalidInput: D̄ of another cloud, or cells that are not positive or too many.
    """
    values = distance.values[np.isfinite(distance.values)]
    grid, evaluated = tip_cells(cloud, cell), _samples(distance, cloud)
    mean = grid.mean(distance.values, evaluated)
    known = np.isfinite(mean)
    found = np.quantile(values, quantiles) if len(values) else np.full(len(quantiles), np.nan)
    return RedundancySummary(
        evaluated=len(evaluated),
        isolated=_share(np.isnan(distance.values)),
        median=float(np.median(values)) if len(values) else np.nan,
        quantiles=dict(zip(map(float, quantiles), found.tolist(), strict=True)),
        threshold=float(threshold),
        redundant_points=_share(values > threshold),
        redundant_volume=_share(mean[known] > threshold),
        measured_volume=int(known.sum()) * grid.volume,
        occupied_volume=int(np.count_nonzero(grid.count())) * grid.volume,
    )


def distance_map(
    cloud: xr.Dataset, distance: xr.DataArray, cell: float | None = None
) -> xr.Dataset:
    """Mean D̄ of the evaluated points in each cell of a grid.

    Args:
        cloud: The cloud that D̄ was computed from.
        distance: D̄ from `activation_distance`.
        cell: Edge of the cells [m]; None for L/20.

    Returns:
        Dataset over the centers x, y, z [m] of cells: `activation_distance` [-], NaN where no point
        with neighbors was evaluated, and `evaluated`, the number of those points.

    Raises:
        InvalidInput: D̄ of another cloud, or cells that are not positive or too many.
    """
    grid, evaluated = tip_cells(cloud, cell), _samples(distance, cloud)
    count = grid.count(evaluated[np.isfinite(distance.values)])
    name = {"long_name": "mean activation-space distance D̄ in the cell", "units": "1"}
    number = {"long_name": "evaluated points with neighbors", "units": "1"}
    mean = grid.mean(distance.values, evaluated)
    return cell_dataset(grid, activation_distance=(mean, name), evaluated=(count, number))


def tip_density(cloud: xr.Dataset, cell: float | None = None) -> xr.Dataset:
    """Local density of tips, and how uneven it is.

    The attribute `coefficient_of_variation` is that of the counts in occupied cells; `chance` is
    what it would be for points strewn evenly over them, 1 / sqrt(mean count), and `heterogeneity`
    what chance leaves of it: sqrt(coefficient_of_variation² - chance²), 0 at least. Cells that the
    cloud's border cuts count as they are.

    Args:
        cloud: tip(sample, axis) [m].
        cell: Edge of the cells [m]; None for L/20.

    Returns:
        Dataset over the centers x, y, z [m] of cells: `density` [1/m³], 0 where there is no tip.

    Raises:
        InvalidInput: No cloud, or cells that are not positive or too many.
    """
    grid = tip_cells(cloud, cell)
    count = grid.count()
    name = {"long_name": "tips per volume", "units": "m-3"}
    return cell_dataset(grid, density=(count / grid.volume, name)).assign_attrs(_unevenness(count))


def _unevenness(count: Index) -> dict[str, float]:
    occupied = count[count > 0]
    variation, chance = occupied.std() / occupied.mean(), occupied.mean() ** -0.5
    return {
        "coefficient_of_variation": float(variation),
        "chance": float(chance),
        "heterogeneity": float(np.sqrt(max(variation**2 - chance**2, 0.0))),
    }


def _share(which: NDArray[np.bool_]) -> float:
    return float(which.mean()) if which.size else np.nan


def _samples(distance: xr.DataArray, cloud: xr.Dataset) -> Index:
    """Which samples of the cloud were evaluated."""
    n = cloud.sizes["sample"]
    if distance.dims != ("sample",) or "sample" not in distance.coords:
        raise InvalidInput("distance", distance.dims, "made by activation_distance")
    return _indices(distance["sample"].values, n, "distance.sample")


def _chosen(queries: int | ArrayLike | None, n: int) -> Index | None:
    """Indices of the samples to be evaluated; None for all."""
    if queries is None:
        return None
    if isinstance(queries, int | np.integer) and not isinstance(queries, bool):
        return _strided(int(queries), n)
    return _indices(queries, n, "queries")


def _strided(count: int, n: int) -> Index:
    """One sample of each of `count` equal parts, at a random but fixed place in it.

    Every k-th one would do for independent samples, but in a Sobol sequence those share leading
    bits, that is a corner of the activation box.
    """
    if not 0 <= count <= n:
        raise InvalidInput("queries", count, f"from 0 to the cloud's {n} samples, or their indices")
    place = np.random.default_rng(0).random(count)
    return np.minimum((np.arange(count) + place) * (n / max(count, 1)), n - 1).astype(np.intp)


def _indices(given: ArrayLike, n: int, name: str) -> Index:
    array = np.asarray(given)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        found = f"{array.dtype} array of shape {array.shape}"
        raise InvalidInput(name, found, "one-dimensional, of whole numbers")
    if array.size and (array.min() < 0 or array.max() >= n):
        found = f"indices from {array.min()} to {array.max()}"
        raise InvalidInput(name, found, f"from 0 to {n - 1}, the cloud's last sample")
    return array.astype(np.intp)
