"""Distance between activations that reach nearly the same place (section 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.geometry.neighbors import mean_value_distance
from softreach.rod.inputs import activation_measures
from softreach.schema import cell_dataset, check_cloud, is_stable, tip_cells
from softreach.support.arguments import as_dataset, as_number, plain
from softreach.support.arrays import Index, Mask, as_indices
from softreach.support.errors import InvalidInput, Range
from softreach.support.quantity import quantity

if TYPE_CHECKING:
    import xarray as xr

_SHARES = (0.05, 0.25, 0.75, 0.95)
THRESHOLD = 0.25  # between a minimal arm's D̄ of some 0.05 and a redundant one's of order 1
_VOLUMES = ("measured_volume", "occupied_volume")


def activation_distance(
    cloud: xr.Dataset, radius: float, *, queries: int | ArrayLike | None = None
) -> xr.DataArray:
    """Mean activation-space distance of tips to their neighbors (section 5; theory (44)).

    D̄(p_i, r) = Σ_j ‖Γ_j - Γ_i‖₂ / K over the K *other* points j with |p_j - p_i| <= r. Point i
    itself is not counted; another point at the same place is. Where K = 0 the point is isolated
    and D̄ is NaN. Neighbors always come from the full cloud, whatever is evaluated. Where bundles
    have different units, the activation of each counts in its own range. Of an arm under loads the
    tips that are no stable equilibria are no neighbors, and D̄ there is NaN.

    Memory is a sorted copy of the cloud and a few blocks, however many neighbors there are; the
    result does not depend on the number of threads.

    Args:
        cloud: tip(sample, axis) [m] and activation(sample, bundle) [-].
        radius: r [m]; the paper's is L/60. 0 leaves the tips at the same place.
        queries: How many samples are evaluated, one from each of as many equal parts of the
            cloud, always the same ones; or their indices; None for all.

    Returns:
        D̄ [unit of the activations] over `sample`, whose coordinate is the index in the cloud;
        `neighbors` is K. D̄ of one point scatters by about 1/√K of the spread among its neighbors.

    Raises:
        InvalidInput: No cloud, tips or activations that are not finite, a radius below zero, or
            queries that are no samples of the cloud.

    Examples:
        >>> cloud = sr.compute_cloud(sr.designs.redundant_trunk(), n=5000)
        >>> sr.activation_distance(cloud, radius=0.1, queries=3).values.round(1)
        array([0.8, 0.6, 0.4])
    """
    import xarray as xr

    check_cloud(cloud)
    radius = as_number("radius", radius, Range(0.0, unit="m"))
    chosen = _chosen(queries, cloud.sizes["sample"])
    tip, activation = cloud["tip"].values, cloud["activation"].values
    if "unit" in cloud.coords:
        activation = activation / activation_measures(Manipulator.from_toml(cloud.attrs["design"]))
    sample = np.arange(cloud.sizes["sample"]) if chosen is None else chosen
    if (stable := is_stable(cloud)).all():
        mean, others = mean_value_distance(tip, activation, radius, chosen)
    else:
        mean, others = np.full(len(sample), np.nan), np.zeros(len(sample), np.intp)
        mask, number = stable[sample], np.cumsum(stable) - 1
        values = tip[stable], activation[stable]
        mean[mask], others[mask] = mean_value_distance(*values, radius, number[sample[mask]])
    counted = {"long_name": "other tips within the radius", "units": "1"}
    coordinates = {"sample": sample, "neighbors": ("sample", others, counted)}
    distance = xr.DataArray(mean, coordinates, ("sample",), "activation_distance", cloud.attrs)
    return distance.assign_attrs(
        long_name="mean activation-space distance D̄",
        units=cloud["activation"].attrs.get("units", "1"),
        radius=radius,
    )


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
    occupied = count[count > 0]
    variation, chance = occupied.std() / occupied.mean(), occupied.mean() ** -0.5
    name = {"long_name": "tips per volume", "units": "m-3"}
    error = {"long_name": "standard error of density", "units": "m-3"}
    return cell_dataset(
        grid,
        density=(count / grid.volume, name),
        density_error=(np.sqrt(count) / grid.volume, error),
    ).assign_attrs(
        **cloud.attrs,
        coefficient_of_variation=float(variation),
        chance=float(chance),
        heterogeneity=float(np.sqrt(max(variation**2 - chance**2, 0.0))),
    )


def redundancy_summary(
    cloud: xr.Dataset,
    distance: xr.DataArray,
    *,
    threshold: float = THRESHOLD,
    cell: float | None = None,
) -> RedundancySummary:
    """Median and quantiles of D̄, isolated points, and where it exceeds a threshold.

    Points gather where the arm goes often, so shares of points and of volume differ. The volume is
    that of grid cells: evaluate enough points that `measured_volume` is near `occupied_volume`.

    Args:
        cloud: The cloud that D̄ was computed from.
        distance: D̄ from `activation_distance`.
        threshold: The D̄ [its unit] above which a place counts as redundant.
        cell: Edge of the grid cells [m]; None for L/20.

    Raises:
        InvalidInput: D̄ of another cloud, or cells that are not positive or too many.
    """
    threshold = as_number("threshold", threshold)
    grid, evaluated = tip_cells(cloud, cell), evaluated_samples(distance, cloud)
    values = distance.values[np.isfinite(distance.values)]
    stable = is_stable(cloud)[evaluated]
    mean = grid.mean(distance.values, evaluated)
    known, share = np.isfinite(mean), _share(values > threshold)
    # A median scatters between the quantiles 1/2 ± 1/(2√n).
    off = min(0.5, 0.5 / np.sqrt(max(len(values), 1)))
    shares = [0.5, 0.5 - off, 0.5 + off, *_SHARES]
    middle, low, high, *heights = np.quantile(values if len(values) else [np.nan], shares).tolist()
    return RedundancySummary(
        unit=distance.attrs.get("units", "1"),
        evaluated=int(stable.sum()),
        isolated=_share(np.isnan(distance.values[stable])),
        median=middle,
        median_error=(high - low) / 2.0,
        quantiles=dict(zip(_SHARES, heights, strict=True)),
        threshold=threshold,
        redundant_points=share,
        redundant_points_error=float(np.sqrt(share * (1.0 - share) / max(len(values), 1))),
        redundant_volume=_share(mean[known] > threshold),
        measured_volume=int(known.sum()) * grid.volume,
        occupied_volume=int(np.count_nonzero(grid.count())) * grid.volume,
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class RedundancySummary:
    """D̄ of a cloud in numbers; isolated points count in `isolated` alone.

    Errors are standard errors for points that are drawn independently. The shares of volume have
    none: they depend on the size of the cells, and on how much of what is occupied is measured.
    """

    unit: str
    """Unit of D̄, which is that of the activations; "1" where they are numbers."""
    evaluated: int
    """Number of points evaluated, stable equilibria all of them."""
    isolated: float
    """Share of them without a neighbor [-]."""
    median: float
    """Median of D̄ [unit]."""
    median_error: float
    """Half the distance of the quantiles between which such a median scatters [unit]."""
    quantiles: dict[float, float]
    """Quantiles of D̄ [unit] by probability."""
    threshold: float
    """The D̄ [unit] above which a place counts as redundant."""
    redundant_points: float
    """Share of the points whose D̄ exceeds the threshold [-]."""
    redundant_points_error: float
    """√(p (1 - p) / points) of that share p [-]."""
    redundant_volume: float
    """Share of the measured volume in whose cells the mean D̄ exceeds the threshold [-]."""
    measured_volume: float
    """Volume of the cells that hold an evaluated point with neighbors [m³]."""
    occupied_volume: float
    """Volume of the cells that hold a tip of the cloud [m³]."""

    def to_dataset(self) -> xr.Dataset:
        """All numbers with their units, `quantiles` over `quantile`."""
        import xarray as xr

        numbers = {k: x for k, x in vars(self).items() if k not in ("unit", "quantiles")}
        of_distance = dict.fromkeys(("median", "median_error", "threshold"), self.unit)
        units = dict.fromkeys(numbers, "1") | dict.fromkeys(_VOLUMES, "m3") | of_distance
        return xr.Dataset(
            {
                **{name: ((), value, {"units": units[name]}) for name, value in numbers.items()},
                "quantiles": ("quantile", list(self.quantiles.values()), {"units": self.unit}),
            },
            {"quantile": list(self.quantiles)},
        )

    def __repr__(self) -> str:
        shares = ", ".join(f"{100 * p:g} % below {d:.3g}" for p, d in self.quantiles.items())
        points = quantity(100 * self.redundant_points, "%", 100 * self.redundant_points_error)
        measured = self.measured_volume / self.occupied_volume
        unit = "" if self.unit == "1" else self.unit
        return (
            f"RedundancySummary: median D̄ {quantity(self.median, unit, self.median_error)}, "
            f"{shares}\n"
            f"  D̄ > {self.threshold:g} for {points} of the points, "
            f"{100 * self.redundant_volume:.3g} % of the volume\n"
            f"  {self.evaluated:,} points evaluated, {100 * self.isolated:.3g} % isolated; "
            f"{100 * measured:.3g} % of the volume measured"
        )


def evaluated_samples(distance: xr.DataArray, cloud: xr.Dataset) -> Index:
    """Indices of the samples of the cloud that were evaluated."""
    n = cloud.sizes["sample"]
    distance = as_dataset("distance", distance, kind="DataArray")
    if distance.dims != ("sample",) or "sample" not in distance.coords:
        raise InvalidInput("distance", distance.dims, "made by activation_distance")
    return as_indices("distance.sample", distance["sample"].values, n, "samples of the cloud")


def _chosen(queries: int | ArrayLike | None, n: int) -> Index | None:
    if queries is None:
        return None
    count = plain(queries)
    if isinstance(count, bool) or not isinstance(count, int):
        return as_indices("queries", queries, n, "samples of the cloud")
    # One of each of `count` even parts, at a random but fixed place in it: every k-th one of a
    # Sobol sequence would share leading bits, that is a corner of the activation box.
    if not 0 <= count <= n:
        raise InvalidInput("queries", count, f"from 0 to the cloud's {n} samples, or their indices")
    ends = np.arange(count + 1) * n // max(count, 1)
    place = np.random.default_rng(0).random(count)
    return ends[:-1] + (place * np.diff(ends)).astype(np.intp)


def _share(which: Mask) -> float:
    return float(which.mean()) if which.size else np.nan
