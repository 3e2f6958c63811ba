"""Reach of a design: its cloud and its exact set, coarse first and then fine, within a budget."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.cloud.clouds import compute_cloud, design_of
from softreach.picture.shading import vertex_normals
from softreach.rod.tip_map import TipMap, TipStatus, has_tip
from softreach.studio.state import TOL, solvable_rod
from softreach.studio.work import (
    Budget,
    OverBudget,
    StaleCheck,
    affordable_level,
    all_cores,
    level_in_memory,
)
from softreach.support.errors import InvalidInput, no_warnings
from softreach.workspace import (
    ReachableCurve,
    ReachableSet,
    ReachableSolid,
    ReachableSurface,
    reachable_set,
)
from softreach.workspace.sheets import Sheets

if TYPE_CHECKING:
    import xarray as xr


_INSIDE = 2e-3
"""Depth behind a boundary at which activations are counted [L]."""
_NEIGHBORS = 8

Rows = slice | NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Sizes and accuracies before the first picture, and after it."""

    coarse_level: int = 16
    fine_level: int = 19
    coarse_accuracy: float = 0.02
    """Relative error allowed in the volume."""
    fine_accuracy: float = 0.003
    tol: float = TOL
    """Largest tip error, in L."""
    coarse_seconds: float = 0.25
    """Time for the first cloud of a loaded arm; it has fewer points if they cost more."""
    fine_seconds: float = 5.0
    most_seconds: float = 30.0
    """Time for an exact set, before the studio does without it."""


class Size(NamedTuple):
    """Size of a reachable set."""

    name: str
    value: float
    """[m^power]."""
    error: float
    power: int
    """3 for a volume, 2 for an area, 1 for a length, 0 for a point."""


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
    """Reason why there is no exact set."""
    notes: tuple[str, ...] = ()
    """Parts that are left out or coarser than wanted, and why."""
    wanted: int = 0
    """Number of samples wanted; there are fewer where each costs much."""
    order: NDArray[np.int64] | None = field(default=None, repr=False)
    """An order whose prefixes are even subsamples, where the cloud's own is not."""

    @property
    def samples(self) -> int:
        """Number of points there are."""
        return self.cloud.sizes["sample"]

    @property
    def volume(self) -> float:
        """Volume [m³]; 0 for all but solids, NaN while it is not known."""
        return math.nan if self.exact is None else self.exact.volume

    @property
    def size(self) -> Size | None:
        """Volume, area or length of what can be reached; None while it is not known."""
        match exact := self.exact:
            case None:
                return None
            case ReachableSolid():
                return Size("volume", exact.volume, exact.volume_error, 3)
            case ReachableSurface():
                return Size("area", exact.area, exact.area_error, 2)
            case ReachableCurve():
                return Size("length", exact.curve_length, exact.curve_length_error, 1)
            case _:
                return Size("point", 0.0, 0.0, 0)

    @property
    def unreachability(self) -> float:
        """UNR [-]; NaN without a volume."""
        return self.exact.unreachability if isinstance(self.exact, ReachableSolid) else math.nan

    @cached_property
    def status(self) -> NDArray[np.int8]:
        """`TipStatus` of every sample."""
        if "status" not in self.cloud:
            return np.full(self.samples, TipStatus.STABLE, np.int8)
        status = self.cloud.status.values
        lost = has_tip(status) & np.isnan(self.cloud.tip.values).any(axis=1)
        return np.where(lost, TipStatus.UNDECIDED, status).astype(np.int8)

    @cached_property
    def counts(self) -> NDArray[np.float64]:
        """Number of activations that reach the place of each sample; NaN where it is not known.

        Filled by `studio.multiplicity`.
        """
        return np.full(self.samples, np.nan)

    @property
    def lost_share(self) -> float:
        """Share of the activation box that the exact set leaves out [-]."""
        return float(getattr(self.exact, "lost_share", 0.0))  # only sets of loaded arms lose any

    @property
    def has_surface(self) -> bool:
        """True if there is a boundary to be drawn."""
        return isinstance(self.exact, ReachableSolid | ReachableSurface)

    @cached_property
    def sheets(self) -> Sheets:
        """Boundary of a solid as it is drawn, or a surface; slow the first time."""
        if isinstance(self.exact, ReachableSolid):
            return self.exact.sheets()
        assert isinstance(self.exact, ReachableSurface)
        return Sheets.of(self.exact.surface())

    @cached_property
    def boundary(self) -> Reach:
        """The same with the vertices of `sheets`, a little inside, in place of the samples.

        Where activations are not known they are the mean of those of the nearest samples.
        """
        sheets, given = self.sheets, self.cloud.activation
        inward = -_INSIDE * self.arm.length * vertex_normals(sheets.vertices, sheets.faces)
        activation = sheets.activation
        if activation is None:
            activation = given.values[nearest_samples(self, sheets.vertices)].mean(axis=1)
        cloud = (
            self.cloud[["tip", "activation"]]
            .drop_vars("status", errors="ignore")
            .isel(sample=np.zeros(len(activation), np.int64))
        )
        cloud = cloud.assign(
            tip=(cloud.tip.dims, sheets.vertices + inward, cloud.tip.attrs),
            activation=(given.dims, activation, given.attrs),
        )
        return replace(self, cloud=cloud, order=None)

    def share(self, status: TipStatus) -> float:
        """Share of the samples that have a status [-]."""
        return float((self.status == status).mean())


def shown_samples(reach: Reach, level: int) -> Rows:
    """Samples that a picture of 2^level points shows: those that have a tip."""
    first = slice(0, min(1 << level, reach.samples))
    rows = first if reach.order is None else reach.order[first]
    settled = has_tip(reach.status[rows])
    return rows if settled.all() else np.arange(reach.samples)[rows][settled]


def shown_rows(reach: Reach, level: int) -> NDArray[np.int64]:
    """The same samples by their numbers."""
    return np.arange(reach.samples)[shown_samples(reach, level)]


def nearest_samples(reach: Reach, points: NDArray[np.float64], level: int = 15) -> Rows:
    """Numbers of the samples nearest to each point [m], of the 2^level first, shape (n, k)."""
    from scipy.spatial import KDTree

    rows = shown_rows(reach, level)
    count = min(_NEIGHBORS, len(rows))
    near = KDTree(reach.cloud.tip.values[rows]).query(points, count)[1]
    return near.reshape(len(points), count)


def unstable_samples(reach: Reach, level: int) -> NDArray[np.bool_]:
    """Mask of the unstable ones among the samples that are shown."""
    return reach.status[shown_samples(reach, level)] == TipStatus.UNSTABLE


def cloud_points(reach: Reach, level: int) -> NDArray[np.float64]:
    """Tips that a picture of 2^level points shows [L], shape (n, 3)."""
    return reach.cloud.tip.values[shown_samples(reach, level)] / reach.arm.length


# Stages: coarse first and then fine, within a budget of time and memory.


Report = Callable[[str], None]
"""Told what is being computed, and how far it is."""


def _silent(doing: str) -> None:
    del doing


def stages(
    arm: Manipulator,
    level: int,
    quality: Quality,
    check: StaleCheck,
    report: Report = _silent,
) -> Iterator[Reach]:
    """The reach of a design, coarse and then fine; waits for its turn where all cores are used.

    Args:
        arm: The design.
        level: The fine cloud has at least 2^level points, where there is time and memory for them.
        quality: How much is computed in each stage, and how long it may take.
        check: Called all the time; raises to stop.
        report: Told what is being computed.

    Raises:
        InvalidInput: Loads that cannot be computed.
    """
    work = _Work(arm, solvable_rod(arm), quality, check, report)
    if arm.loads is not None or work.rod.box.dimension > 3:
        yield from _slow_stages(work, level)
        return
    fine = max(level, quality.fine_level)
    sizes = (quality.coarse_level, quality.coarse_accuracy), (fine, quality.fine_accuracy)
    reach = None
    for stage, (points, accuracy) in enumerate(sizes):
        check()
        with all_cores:
            reach = work.cloud(points, stage == 1, reach)
            reach = work.measured(reach, accuracy)
        yield reach


def _slow_stages(work: _Work, level: int) -> Iterator[Reach]:
    """First a cloud alone, as large as there is time for; the exact set takes much longer."""
    work.check()
    quality = work.quality
    points = affordable_level(work.rod, quality.coarse_seconds, min(level, quality.coarse_level))
    with all_cores:
        first = replace(work.cloud(points, False), wanted=1 << level)
    yield first
    work.check()
    with all_cores:
        first = work.measured(first, quality.coarse_accuracy)
    yield first
    work.check()
    points = affordable_level(work.rod, quality.fine_seconds, level)
    with all_cores:
        fine = replace(work.cloud(points, True, first), wanted=1 << level)
        if fine.samples < fine.wanted:
            note = f"fewer samples than asked: {fine.wanted:,} would take too long"
            fine = replace(fine, notes=(*fine.notes, note))
        if not first.refusal:
            fine = work.measured(fine, quality.fine_accuracy)
    yield fine  # outside of the turn: whoever draws it may take one


class _Work(NamedTuple):
    arm: Manipulator
    rod: TipMap
    quality: Quality
    check: StaleCheck
    report: Report

    def cloud(self, level: int, fine: bool, known: Reach | None = None) -> Reach:
        """A cloud of 2^level points, or of as many as memory holds, with what is known besides."""
        budget = self._budget(f"computing the cloud of {1 << level:,} points", 1 << level)
        fitting = level_in_memory(self.rod.box.bundles, budget.memory, level)
        short = f"{1 << fitting:,} of {1 << level:,} samples: more do not fit into the free memory"
        tol = self.quality.tol
        cloud = compute_cloud(self.arm, 1 << fitting, sampler="sobol", tol=tol, progress=budget)
        return Reach(
            arm=self.arm,
            cloud=cloud,
            exact=known and known.exact,
            refusal=known.refusal if known else "",
            fine=fine,
            notes=(short,) if fitting < level else (),
            wanted=1 << level,
        )

    def measured(self, reach: Reach, accuracy: float) -> Reach:
        """With its exact set, or with why there is none, or none as accurate as wanted."""
        budget = self._budget(f"computing the exact set to {100 * accuracy:g} %")
        try:
            exact = _exact(reach.arm, accuracy, self.quality.tol, budget)
        except InvalidInput as error:
            if error.name == "memory":  # so many bundles that no search fits
                return _without(reach, accuracy, MemoryError())
            return replace(reach, exact=None, refusal=str(error))  # never at rest
        except (OverBudget, MemoryError) as error:
            return _without(reach, accuracy, error)
        return replace(reach, exact=exact, refusal="")

    def _budget(self, doing: str, total: int = 0) -> Budget:
        def report(done: int) -> None:
            part = f", {100 * done // total} %" if total else f", {done:,} cells"
            self.report(doing + part if done else doing)

        return Budget(self.check, self.quality.most_seconds, report)


def _without(reach: Reach, accuracy: float, error: Exception) -> Reach:
    """Reach with the exact set known before, and with the reason why no more is."""
    needed = f"needs {error}" if isinstance(error, OverBudget) else "needs more memory than is free"
    if reach.exact is None:
        return replace(reach, refusal=f"to {100 * accuracy:g} % it {needed}")
    note = f"exact set coarser than asked: to {100 * accuracy:g} % it {needed}"
    return replace(reach, notes=(*reach.notes, note))


def reached(cloud: xr.Dataset, quality: Quality) -> Reach:
    """The reach that belongs to a cloud from a file."""
    ordered = cloud.attrs.get("sampler") in ("uniform", "sobol")
    shuffled = None if ordered else np.random.default_rng(0).permutation(cloud.sizes["sample"])
    reach = Reach(arm=design_of(cloud), cloud=cloud, exact=None, fine=True, order=shuffled)
    work = _Work(reach.arm, solvable_rod(reach.arm), quality, lambda: None, _silent)
    with all_cores:
        return work.measured(reach, quality.fine_accuracy)


def exact_set(
    arm: Manipulator, accuracy: float, tol: float, check: StaleCheck, seconds: float
) -> ReachableSet:
    """The exact set alone.

    Args:
        arm: The design.
        accuracy: Relative error allowed in the volume.
        tol: Largest tip error, in L.
        check: Called all the time; raises to stop.
        seconds: What it may take [s].

    Raises:
        InvalidInput: Some activation never comes to rest.
        OverBudget: It takes more time or memory.
    """
    return _exact(arm, accuracy, tol, Budget(check, seconds))


def _exact(arm: Manipulator, accuracy: float, tol: float, budget: Budget) -> ReachableSet:
    many = solvable_rod(arm).box.dimension > 3
    with no_warnings():  # the error is shown beside the volume
        return reachable_set(
            arm,
            accuracy=accuracy,
            tol=tol,
            memory=budget.memory if many else None,
            progress=budget,
        )
