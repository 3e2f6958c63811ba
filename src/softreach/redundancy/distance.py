"""How differently an arm must be activated to reach nearly the same place (section 5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arguments import checked, plain, within
from softreach.arm.manipulator import Manipulator
from softreach.arrays import as_indices
from softreach.errors import InvalidInput, Range
from softreach.geometry.neighbors import mean_value_distance
from softreach.rod.measured_bundles import activation_measures
from softreach.schema import a_cloud, check_cloud, is_stable

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["activation_distance", "evaluated_samples"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@checked(cloud=a_cloud, radius=within(Range(0.0, unit="m")))
def activation_distance(
    cloud: xr.Dataset, radius: float, *, queries: int | ArrayLike | None = None
) -> xr.DataArray:
    """Mean activation-space distance of tips to their neighbors (section 5; theory (44)).

    D̄(p_i, r) = Σ_j ‖Γ_j - Γ_i‖₂ / K over the K *other* points j with |p_j - p_i| <= r. Point i
    itself is not counted; another point at the same place is. Where K = 0 the point is isolated
    and D̄ is NaN. Neighbors always come from the full cloud, whatever is evaluated. Where bundles
    have different units, the activation of each counts in its own range. Of an arm under loads the
    tips that are no stable equilibria are nobody's neighbors, and D̄ there is NaN.

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
    """
    import xarray as xr

    check_cloud(cloud)
    chosen = _chosen(queries, cloud.sizes["sample"])
    tip, activation = cloud["tip"].values, cloud["activation"].values
    if "unit" in cloud.coords:
        activation = activation / activation_measures(Manipulator.from_toml(cloud.attrs["design"]))
    sample = np.arange(cloud.sizes["sample"]) if chosen is None else chosen
    if (stable := is_stable(cloud)).all():
        mean, others = mean_value_distance(tip, activation, radius, chosen)
    else:
        mean, others = _among(stable, tip, activation, radius, sample)
    counted = {"long_name": "other tips within the radius", "units": "1"}
    return xr.DataArray(
        mean,
        {"sample": sample, "neighbors": ("sample", others, counted)},
        ("sample",),
        name="activation_distance",
        attrs={
            **cloud.attrs,
            "long_name": "mean activation-space distance D̄",
            "units": cloud["activation"].attrs.get("units", "1"),
            "radius": float(radius),
        },
    )


def _among(
    stable: NDArray[np.bool_], tip: Array, activation: Array, radius: float, sample: Index
) -> tuple[Array, Index]:
    """D̄ and K of some samples among the stable ones; NaN and 0 of those that are not."""
    mean, others = np.full(len(sample), np.nan), np.zeros(len(sample), np.intp)
    asked, number = stable[sample], np.cumsum(stable) - 1
    found = mean_value_distance(tip[stable], activation[stable], radius, number[sample[asked]])
    mean[asked], others[asked] = found
    return mean, others


def evaluated_samples(distance: xr.DataArray, cloud: xr.Dataset) -> Index:
    """Which samples of the cloud were evaluated."""
    n = cloud.sizes["sample"]
    if distance.dims != ("sample",) or "sample" not in distance.coords:
        raise InvalidInput("distance", distance.dims, "made by activation_distance")
    return as_indices("distance.sample", distance["sample"].values, n, "samples of the cloud")


def _chosen(queries: int | ArrayLike | None, n: int) -> Index | None:
    """Indices of the samples to be evaluated; None for all."""
    if queries is None:
        return None
    count = plain(queries)
    if isinstance(count, int) and not isinstance(count, bool):
        return _strided(count, n)
    return as_indices("queries", queries, n, "samples of the cloud")


def _strided(count: int, n: int) -> Index:
    """One sample of each of `count` equal parts, at a random but fixed place in it.

    Every k-th one would do for independent samples, but in a Sobol sequence those share leading
    bits, that is a corner of the activation box.
    """
    if not 0 <= count <= n:
        raise InvalidInput("queries", count, f"from 0 to the cloud's {n} samples, or their indices")
    place = np.random.default_rng(0).random(count)
    return np.minimum((np.arange(count) + place) * (n / max(count, 1)), n - 1).astype(np.intp)
