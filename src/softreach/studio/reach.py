"""What a design can reach, coarse first and then fine."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.cloud import compute_cloud, design_of
from softreach.errors import InvalidInput, SoftreachWarning
from softreach.rod.tip_map import TipStatus
from softreach.studio.effort import affordable_level
from softreach.studio.rod import TOL, solvable_rod
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
    "shown_rows",
    "shown_samples",
    "stages",
    "unstable_samples",
]

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
        rows = shown_rows(self, 17)
        with all_cores, warnings.catch_warnings():
            warnings.simplefilter("ignore", SoftreachWarning)  # coarse clouds are sparse
            return concave_hull(self.cloud.tip[rows[self.status[rows] == TipStatus.STABLE]])

    @property
    def alpha_volume(self) -> float | None:
        """Volume of the α-shape [L³], if it has been asked for; nothing is computed."""
        hull: Hull | None = vars(self).get("alpha_shape")
        return None if hull is None else hull.volume / self.arm.length**3


def stages(arm: Manipulator, level: int, quality: Quality, check: StaleCheck) -> Iterator[Reach]:
    """The reach of a design, coarse and then fine; waits for its turn where all cores are used.

    Args:
        arm: The design.
        level: The fine cloud has at least 2^level points, if the arm is not loaded.
        quality: How much is computed in each stage.
        check: Called all the time; raises to stop.

    Raises:
        InvalidInput: Loads that cannot be computed.
    """
    if arm.loads is not None:
        yield from _loaded_stages(arm, level, quality, check)
        return
    fine = max(level, quality.fine_level)
    sizes = (quality.coarse_level, quality.coarse_accuracy), (fine, quality.fine_accuracy)
    for stage, (points, accuracy) in enumerate(sizes):
        check()
        with all_cores:
            cloud = _cloud(arm, points, quality, check)
            exact = _exact(arm, accuracy, quality.tol, check)
        yield Reach(arm=arm, cloud=cloud, exact=exact, fine=stage == 1)


def _loaded_stages(
    arm: Manipulator, level: int, quality: Quality, check: StaleCheck
) -> Iterator[Reach]:
    """First a cloud alone, as large as there is time for; the exact set takes much longer."""
    rod = solvable_rod(arm)
    check()
    points = affordable_level(rod, quality.coarse_seconds, min(level, quality.coarse_level))
    with all_cores:
        cloud = _cloud(arm, points, quality, check)
    first = Reach(arm=arm, cloud=cloud, exact=None, fine=False, wanted=1 << level)
    yield first
    check()
    with all_cores:
        first = _measured(first, quality.coarse_accuracy, quality.tol, check)
    yield first
    check()
    points = affordable_level(rod, quality.fine_seconds, level)
    with all_cores:
        cloud = _cloud(arm, points, quality, check)
        fine = replace(first, cloud=cloud, fine=True)
        accuracy = quality.fine_accuracy
        yield fine if first.refusal else _measured(fine, accuracy, quality.tol, check)


def reached(cloud: xr.Dataset, quality: Quality) -> Reach:
    """The reach that belongs to a cloud from a file."""
    ordered = cloud.attrs.get("sampler") in ("uniform", "sobol")
    shuffled = None if ordered else np.random.default_rng(0).permutation(cloud.sizes["sample"])
    found = Reach(arm=design_of(cloud), cloud=cloud, exact=None, fine=True, order=shuffled)
    with all_cores:
        return _measured(found, quality.fine_accuracy, quality.tol, lambda: None)


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


def _cloud(arm: Manipulator, level: int, quality: Quality, check: StaleCheck) -> xr.Dataset:
    return compute_cloud(arm, 1 << level, 0, "sobol", tol=quality.tol, progress=lambda _: check())


def _measured(reach: Reach, accuracy: float, tol: float, check: StaleCheck) -> Reach:
    """With its exact set, or with why there is none: some activation never comes to rest."""
    try:
        return replace(reach, exact=_exact(reach.arm, accuracy, tol, check))
    except InvalidInput as error:
        return replace(reach, exact=None, refusal=str(error))


def _exact(arm: Manipulator, accuracy: float, tol: float, check: StaleCheck) -> ReachableSet:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)  # the error is shown beside the volume
        return reachable_set(arm, accuracy=accuracy, tol=tol, progress=lambda _: check())
