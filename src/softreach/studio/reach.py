"""What a design can reach, coarse first and then fine."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.cloud.volume import concave_hull
from softreach.rod.tip_map import TipStatus
from softreach.studio.budget import memory_share
from softreach.studio.effort import level_in_memory
from softreach.studio.rod import TOL
from softreach.studio.worker import all_cores
from softreach.support.errors import no_warnings
from softreach.workspace import (
    ReachableCurve,
    ReachableSet,
    ReachableSolid,
    ReachableSurface,
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
    "shown_rows",
    "shown_samples",
    "unstable_samples",
]

_ALPHA_NUMBERS = 128
"""A point of an α-shape takes about as much memory as a sample of so many activations."""

Rows = slice | NDArray[np.int64]


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
    coarse_seconds: float = 0.25
    """What the first cloud of a loaded arm may take; it has fewer points if they cost more."""
    fine_seconds: float = 5.0
    most_seconds: float = 30.0
    """What an exact set may take before the studio does without it."""


class Size(NamedTuple):
    """How large a reachable set is, in L."""

    name: str
    value: float
    error: float
    unit: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Reach:
    """A cloud and the exact set behind it."""

    arm: Manipulator
    """The design."""
    cloud: xr.Dataset
    exact: ReachableSet | None
    """None while it is not known, and where there is none."""
    fine: bool
    refusal: str = ""
    """Why there is no exact set."""
    notes: tuple[str, ...] = ()
    """What was left out or is coarser than asked, and why."""
    wanted: int = 0
    """Samples that were asked for; there are fewer where each costs much."""
    order: NDArray[np.int64] | None = field(default=None, repr=False)
    """An order whose prefixes are even subsamples, where the cloud's own is not."""

    @property
    def samples(self) -> int:
        """Number of points there are."""
        return self.cloud.sizes["sample"]

    @property
    def volume(self) -> float:
        """Volume [L³]; 0 for all but solids, NaN while it is not known."""
        return math.nan if self.exact is None else self.exact.volume / self.arm.length**3

    @property
    def size(self) -> Size | None:
        """Volume, area or length of what can be reached; None while it is not known."""
        length, found = self.arm.length, self.exact
        match found:
            case None:
                return None
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
    def status(self) -> NDArray[np.int8]:
        """`TipStatus` of every sample."""
        if "status" not in self.cloud:
            return np.full(self.samples, TipStatus.STABLE, np.int8)
        lost = np.isnan(self.cloud.tip.values).any(axis=1)
        return np.where(lost, TipStatus.NO_EQUILIBRIUM, self.cloud.status.values).astype(np.int8)

    @cached_property
    def counts(self) -> NDArray[np.float64]:
        """How many activations reach the place of each sample, as far as that is known, else NaN.

        Filled by `studio.multiplicity`.
        """
        return np.full(self.samples, np.nan)

    @property
    def lost_share(self) -> float:
        """Share of the activation box that the exact set leaves out [-]."""
        return float(getattr(self.exact, "lost_share", 0.0))  # only sets of loaded arms lose any

    def share(self, status: TipStatus) -> float:
        """How many of the samples have a status [-]."""
        return float((self.status == status).mean())

    @cached_property
    def alpha_shape(self) -> Hull:
        """The α-shape of at most 2^17 points that are stable, α = 0.05 L."""
        rows = shown_rows(self, level_in_memory(_ALPHA_NUMBERS, memory_share(), 17))
        with all_cores, no_warnings():  # coarse clouds are sparse
            return concave_hull(self.cloud.tip[rows[self.status[rows] == TipStatus.STABLE]])

    @property
    def alpha_volume(self) -> float | None:
        """Volume of the α-shape [L³], if it has been asked for; nothing is computed."""
        hull: Hull | None = vars(self).get("alpha_shape")
        return None if hull is None else hull.volume / self.arm.length**3


def shown_samples(reach: Reach, level: int) -> Rows:
    """Which samples a picture of 2^level points shows: those that have a tip."""
    first = slice(0, min(1 << level, reach.samples))
    rows = first if reach.order is None else reach.order[first]
    settled = reach.status[rows] != TipStatus.NO_EQUILIBRIUM
    return rows if settled.all() else np.arange(reach.samples)[rows][settled]


def shown_rows(reach: Reach, level: int) -> NDArray[np.int64]:
    """The same samples by their numbers."""
    return np.arange(reach.samples)[shown_samples(reach, level)]


def unstable_samples(reach: Reach, level: int) -> NDArray[np.bool_]:
    """Which of the samples that are shown are unstable."""
    return reach.status[shown_samples(reach, level)] == TipStatus.UNSTABLE


def cloud_points(reach: Reach, level: int) -> NDArray[np.float64]:
    """Tips that a picture of 2^level points shows [L], shape (n, 3)."""
    return reach.cloud.tip.values[shown_samples(reach, level)] / reach.arm.length


def beside(reach: Reach) -> NDArray[np.float64]:
    """How far a cloud stands beside another of about its size [L], shape (3,)."""
    across = cloud_points(reach, 14)[:, 0]
    return np.array([1.3 * float(np.ptp(across)) if len(across) else 0.0, 0.0, 0.0])
