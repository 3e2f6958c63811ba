"""What a design can reach, coarse first and then fine."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.cloud import compute_cloud, design_of
from softreach.errors import SoftreachWarning
from softreach.studio.rod import TOL
from softreach.studio.worker import StaleCheck, all_cores
from softreach.volume import concave_hull
from softreach.workspace import (
    ReachableCurve,
    ReachableSet,
    ReachableSolid,
    ReachableSurface,
    reachable_set,
)

if TYPE_CHECKING:
    import xarray as xr

    from softreach.geometry.hull import Hull

__all__ = [
    "Quality",
    "Reach",
    "Size",
    "beside",
    "cloud_points",
    "reached",
    "shown_samples",
    "stages",
]


@dataclass(frozen=True, kw_only=True)
class Quality:
    """How much is computed before the first picture, and after it."""

    coarse_level: int = 16
    fine_level: int = 19
    coarse_accuracy: float = 0.02
    """Relative error allowed in the volume."""
    fine_accuracy: float = 0.003
    tol: float = TOL
    """Largest tip error, in L."""


class Size(NamedTuple):
    """How large a reachable set is, in L."""

    name: str
    value: float
    error: float
    unit: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Reach:
    """A cloud and the exact set behind it."""

    cloud: xr.Dataset
    exact: ReachableSet
    fine: bool
    order: NDArray[np.int64] | None = field(default=None, repr=False)
    """An order whose prefixes are even subsamples, where the cloud's own is not."""

    @property
    def arm(self) -> Manipulator:
        """The design."""
        return self.exact.arm

    @property
    def samples(self) -> int:
        """Number of points there are."""
        return self.cloud.sizes["sample"]

    @property
    def volume(self) -> float:
        """Volume [L³]; 0 for all but solids."""
        return self.exact.volume / self.arm.length**3

    @property
    def size(self) -> Size:
        """Volume, area or length of what can be reached."""
        length, found = self.arm.length, self.exact
        match found:
            case ReachableSolid():
                return Size(
                    "volume", found.volume / length**3, found.volume_error / length**3, "L³"
                )
            case ReachableSurface():
                return Size("area", found.area / length**2, found.area_error / length**2, "L²")
            case ReachableCurve():
                error = found.curve_length_error / length
                return Size("length", found.curve_length / length, error, "L")
            case _:
                return Size("point", 0.0, 0.0, "")

    @property
    def unreachability(self) -> float:
        """UNR [-]; NaN without a volume."""
        return self.exact.unreachability if isinstance(self.exact, ReachableSolid) else math.nan

    @cached_property
    def alpha_shape(self) -> Hull:
        """The α-shape of at most 2^17 points, α = 0.05 L."""
        with all_cores, warnings.catch_warnings():
            warnings.simplefilter("ignore", SoftreachWarning)  # coarse clouds are sparse
            return concave_hull(self.cloud.tip[shown_samples(self, 17)])

    @property
    def alpha_volume(self) -> float | None:
        """Volume of the α-shape [L³], if it has been asked for; nothing is computed."""
        hull: Hull | None = vars(self).get("alpha_shape")
        return None if hull is None else hull.volume / self.arm.length**3


def stages(arm: Manipulator, level: int, quality: Quality, check: StaleCheck) -> Iterator[Reach]:
    """The reach of a design, coarse and then fine; waits for its turn where all cores are used.

    Args:
        arm: The design.
        level: The fine cloud has at least 2^level points.
        quality: How much is computed in each stage.
        check: Called all the time; raises to stop.
    """
    fine = max(level, quality.fine_level)
    sizes = (quality.coarse_level, quality.coarse_accuracy), (fine, quality.fine_accuracy)
    for stage, (points, accuracy) in enumerate(sizes):
        check()
        with all_cores:
            cloud = compute_cloud(
                arm, 1 << points, 0, "sobol", tol=quality.tol, progress=lambda _: check()
            )
            exact = _exact(arm, accuracy, quality.tol, check)
        yield Reach(cloud=cloud, exact=exact, fine=stage == 1)


def reached(cloud: xr.Dataset, quality: Quality) -> Reach:
    """The reach that belongs to a cloud from a file."""
    with all_cores:
        exact = _exact(design_of(cloud), quality.fine_accuracy, quality.tol, lambda: None)
    ordered = cloud.attrs.get("sampler") in ("uniform", "sobol")
    shuffled = None if ordered else np.random.default_rng(0).permutation(cloud.sizes["sample"])
    return Reach(cloud=cloud, exact=exact, fine=True, order=shuffled)


def shown_samples(reach: Reach, level: int) -> slice | NDArray[np.int64]:
    """Which samples a picture of 2^level points shows."""
    first = slice(0, min(1 << level, reach.samples))
    return first if reach.order is None else reach.order[first]


def cloud_points(reach: Reach, level: int) -> NDArray[np.float64]:
    """Tips that a picture of 2^level points shows [L], shape (n, 3)."""
    return reach.cloud.tip.values[shown_samples(reach, level)] / reach.arm.length


def beside(reach: Reach) -> NDArray[np.float64]:
    """How far a cloud stands beside another of about its size [L], shape (3,)."""
    return np.array([1.3 * float(np.ptp(cloud_points(reach, 14)[:, 0])), 0.0, 0.0])


def _exact(arm: Manipulator, accuracy: float, tol: float, check: StaleCheck) -> ReachableSet:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)  # the error is shown beside the volume
        return reachable_set(arm, accuracy=accuracy, tol=tol, progress=lambda _: check())
