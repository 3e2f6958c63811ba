"""Redundancy in numbers: how far activations differ, and for what share of the places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.arguments import POSITIVE, checked, dataset, optional, within
from softreach.arrays import as_shares
from softreach.errors import Range
from softreach.quantity import quantity
from softreach.redundancy.distance import evaluated_samples
from softreach.schema import a_cloud, is_stable, tip_cells

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["RedundancySummary", "redundancy_summary"]

Array = NDArray[np.float64]

THRESHOLD = 0.25  # between a minimal arm's D̄ of some 0.05 and a redundant one's of order 1


@dataclass(frozen=True, kw_only=True, repr=False)
class RedundancySummary:
    """D̄ of a cloud in numbers; isolated points count in `isolated` alone.

    Errors are standard errors for points that are drawn independently. The shares of volume have
    none: they depend on the size of the cells, and on how much of what is occupied is measured.
    """

    evaluated: int
    """Number of points evaluated, stable equilibria all of them."""
    isolated: float
    """Share of them without a neighbor [-]."""
    median: float
    """Median of D̄ [-]."""
    median_error: float
    """Half the distance of the quantiles that a median of so many points scatters between [-]."""
    quantiles: dict[float, float]
    """Quantiles of D̄ [-] by probability."""
    threshold: float
    """The D̄ [-] above which a place counts as redundant."""
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

        numbers = {name: value for name, value in vars(self).items() if name != "quantiles"}
        units = {name: "m3" if name in _VOLUMES else "1" for name in numbers}
        return xr.Dataset(
            {
                **{name: ((), value, {"units": units[name]}) for name, value in numbers.items()},
                "quantiles": ("quantile", list(self.quantiles.values()), {"units": "1"}),
            },
            {"quantile": list(self.quantiles)},
        )

    def __repr__(self) -> str:
        shares = ", ".join(f"{100 * p:g} % below {d:.3g}" for p, d in self.quantiles.items())
        points = quantity(100 * self.redundant_points, "%", 100 * self.redundant_points_error)
        measured = self.measured_volume / self.occupied_volume
        return (
            f"RedundancySummary: median D̄ {quantity(self.median, error=self.median_error)}, "
            f"{shares}\n"
            f"  D̄ > {self.threshold:g} for {points} of the points, "
            f"{100 * self.redundant_volume:.3g} % of the volume\n"
            f"  {self.evaluated:,} points evaluated, {100 * self.isolated:.3g} % isolated; "
            f"{100 * measured:.3g} % of the volume measured"
        )


_VOLUMES = ("measured_volume", "occupied_volume")


@checked(
    cloud=a_cloud,
    distance=dataset(kind="DataArray"),
    threshold=within(Range()),
    cell=optional(within(POSITIVE._replace(unit="m"))),
    quantiles=as_shares,
)
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
    grid, evaluated = tip_cells(cloud, cell), evaluated_samples(distance, cloud)
    stable = is_stable(cloud)[evaluated]
    mean = grid.mean(distance.values, evaluated)
    known = np.isfinite(mean)
    found = np.quantile(values, quantiles) if len(values) else np.full(len(quantiles), np.nan)
    return RedundancySummary(
        evaluated=int(stable.sum()),
        isolated=_share(np.isnan(distance.values[stable])),
        median=float(np.median(values)) if len(values) else np.nan,
        median_error=_median_error(values),
        quantiles=dict(zip(map(float, quantiles), found.tolist(), strict=True)),
        threshold=float(threshold),
        redundant_points=_share(values > threshold),
        redundant_points_error=_share_error(values > threshold),
        redundant_volume=_share(mean[known] > threshold),
        measured_volume=int(known.sum()) * grid.volume,
        occupied_volume=int(np.count_nonzero(grid.count())) * grid.volume,
    )


def _share(which: NDArray[np.bool_]) -> float:
    return float(which.mean()) if which.size else np.nan


def _share_error(which: NDArray[np.bool_]) -> float:
    share = _share(which)
    return float(np.sqrt(share * (1.0 - share) / which.size)) if which.size else np.nan


def _median_error(values: Array) -> float:
    """Half the distance of the quantiles 1/2 ± 1/(2√n), between which a median scatters."""
    if not len(values):
        return np.nan
    reach = min(0.5, 0.5 / np.sqrt(len(values)))
    low, high = np.quantile(values, [0.5 - reach, 0.5 + reach])
    return float(high - low) / 2.0
