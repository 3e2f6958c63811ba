"""Reach of a design: its cloud and its exact set, coarse first and then fine, within a budget."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.cloud.clouds import compute_cloud
from softreach.picture.zbuffer import vertex_normals
from softreach.rod.rods import all_inputs
from softreach.rod.tip_map import TipMap, TipStatus, has_tip
from softreach.sampling import cube_blocks
from softreach.studio.state import TOL, solvable_rod
from softreach.studio.work import Budget, OverBudget, StaleCheck, all_cores
from softreach.support import parallel
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput, NotPossible, no_warnings
from softreach.workspace import ReachableSet, reachable_set
from softreach.workspace.sheets import Sheets

if TYPE_CHECKING:
    import xarray as xr

    from softreach.rod.clearance import ClearanceMap

Report = Callable[[str], object]  # shows the reader what is being done
_quiet: Report = lambda doing: None
_INSIDE = 2e-3  # depth behind a boundary at which activations are counted [L]
_LEVEL, _NEIGHBORS = 15, 8  # of 2^15 samples the nearest tell what is not known of a surface
_PILOT = 512  # samples, by which the cost of one is measured
_LOWEST = 10  # level below which a cloud shows no shape
_BLOCK = 1 << 13  # targets solved at a time: a tenth of a second, after which others have a turn


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Sizes and accuracies before the first picture, and after it."""

    coarse_level: int = 16
    fine_level: int = 19
    coarse_accuracy: float = 0.02  # relative error allowed in the volume
    fine_accuracy: float = 0.003
    tol: float = TOL  # largest tip error, in L
    coarse_seconds: float = 0.25  # time for the first cloud of a loaded arm, which bounds its size
    fine_seconds: float = 5.0
    most_seconds: float = 30.0  # time for an exact set, before the studio does without it


class Size(NamedTuple):
    """Size of a reachable set."""

    name: str
    value: float  # [m^power]
    error: float
    power: int  # 3 for a volume, 2 for an area, 1 for a length, 0 for a point


@dataclass(frozen=True, kw_only=True, eq=False)
class Reach:
    """A cloud and the exact set behind it."""

    arm: Manipulator
    cloud: xr.Dataset
    exact: ReachableSet | None  # None while it is not known, and where there is none
    fine: bool
    refusal: str = ""  # reason why there is no exact set
    notes: tuple[str, ...] = ()  # parts that are left out or coarser than wanted, and why
    wanted: int = 0  # number of samples; there are fewer where each costs much

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
        if self.exact is None:
            return None
        if not (power := self.exact.dimension):
            return Size("point", 0.0, 0.0, 0)
        word = ("curve_length", "area", "volume")[power - 1]
        value, error = (float(getattr(self.exact, word + part)) for part in ("", "_error"))
        return Size(word.removeprefix("curve_"), value, error, power)

    @property
    def unreachability(self) -> float:
        """UNR [-]; NaN without a volume."""
        if self.exact is None or self.exact.dimension < 3:
            return math.nan
        return self.exact.unreachability

    @cached_property
    def status(self) -> NDArray[np.int8]:
        """`TipStatus` of every sample."""
        if "status" not in self.cloud:
            return np.full(self.samples, TipStatus.STABLE, np.int8)
        status = self.cloud.status.values
        lost = has_tip(status) & np.isnan(self.cloud.tip.values).any(axis=1)
        return np.where(lost, TipStatus.UNDECIDED, status).astype(np.int8)

    @cached_property
    def counts(self) -> Array:
        """Number of activations at the place of each sample; NaN before `count_activations`."""
        return np.full(self.samples, np.nan)

    @cached_property
    def clearances(self) -> Array:
        """Clearance of the arm in each sample [m]; NaN before `sample_clearances`."""
        return np.full(self.samples, np.nan)

    @property
    def has_surface(self) -> bool:
        """True if there is a boundary to be drawn."""
        return self.exact is not None and self.exact.dimension >= 2

    @cached_property
    def sheets(self) -> Sheets:
        """Boundary of a solid as it is drawn, or a surface; slow the first time."""
        assert self.exact is not None
        return self.exact.sheets()

    @cached_property
    def boundary(self) -> Reach:
        """The same with the vertices of `sheets`, a little inside, in place of the samples."""
        sheets, given = self.sheets, self.cloud.activation
        inward = -_INSIDE * self.arm.length * vertex_normals(sheets.vertices, sheets.faces)
        activation = sheets.activation
        if activation is None:  # the mean of those of the nearest samples
            shown = given.values[shown_samples(self, _LEVEL)]
            activation = shown[nearest_samples(self, sheets.vertices)].mean(axis=1)
        plain = self.cloud[["tip", "activation"]].drop_vars("status", errors="ignore")
        cloud = plain.isel(sample=np.zeros(len(activation), np.int64))
        cloud = cloud.assign(
            tip=(cloud.tip.dims, sheets.vertices + inward, cloud.tip.attrs),
            activation=(given.dims, activation, given.attrs),
        )
        return replace(self, cloud=cloud)

    def beside(self, arm: Manipulator) -> Reach:
        """The same of a design that differs in its surroundings and its unit alone."""
        cloud = self.cloud.assign_attrs(design=arm.to_toml())
        made, kept = replace(self, arm=arm, cloud=cloud), ("status", "counts", "sheets")
        vars(made).update({name: value for name, value in vars(self).items() if name in kept})
        return made

    def share(self, status: TipStatus) -> float:
        """Share of the samples that have a status [-]."""
        return float((self.status == status).mean())


def shown_samples(reach: Reach, level: int) -> Index:
    """Numbers of the samples that a picture of 2^level points shows: those that have a tip."""
    rows = np.arange(min(1 << level, reach.samples))
    return rows[has_tip(reach.status[rows])]


def nearest_samples(reach: Reach, points: Array) -> Index:
    """Places of the nearest to points [m] among `shown_samples(reach, 15)`, shape (n, k)."""
    from scipy.spatial import KDTree

    tips = reach.cloud.tip.values[shown_samples(reach, _LEVEL)]
    count = min(_NEIGHBORS, len(tips))
    return KDTree(tips).query(points, count)[1].reshape(len(points), count)


def cloud_points(reach: Reach, level: int) -> Array:
    """Tips that a picture of 2^level points shows [L], shape (n, 3)."""
    return reach.cloud.tip.values[shown_samples(reach, level)] / reach.arm.length


def stages(
    arm: Manipulator, level: int, quality: Quality, check: StaleCheck, report: Report = _quiet
) -> Iterator[Reach]:
    """The reach of a design, coarse and then fine; waits for its turn where all cores are used.

    Where samples cost much, under loads and with more than three bundles, the first cloud comes
    alone, and clouds are as large as there is time for; else the fine one has 2^level points.
    """
    rod, work = solvable_rod(arm), _Work(arm, level, quality, check, report)
    is_slow = arm.loads is not None or rod.box.dimension > 3
    coarse, fine = quality.coarse_level, max(level, quality.fine_level)
    if is_slow:
        check()
        coarse = affordable_level(rod, quality.coarse_seconds, min(level, coarse))
        fine = affordable_level(rod, quality.fine_seconds, level)
    rough, last = quality.coarse_accuracy, (fine, quality.fine_accuracy)
    plan = ((coarse, 0.0), (0, rough), last) if is_slow else ((coarse, rough), last)
    reach: Reach | None = None
    for points, accuracy in plan:
        check()
        with all_cores:  # and not while it is drawn, which may take a turn
            if reach is None or points:
                reach = work.sampled(reach, points)
            if accuracy:
                reach = work.measured(reach, accuracy)
        yield reach


@dataclass(frozen=True)
class _Work:
    arm: Manipulator
    level: int
    quality: Quality
    check: StaleCheck
    report: Report

    def sampled(self, known: Reach | None, at: int) -> Reach:
        """A cloud of 2^at points, with what is known besides."""
        count, wanted, fine = 1 << at, 1 << self.level, known is not None
        budget = self._budget(f"computing the cloud of {count:,} points", count)
        tol = self.quality.tol
        cloud = compute_cloud(self.arm, count, sampler="sobol", tol=tol, progress=budget)
        reach = known or Reach(arm=self.arm, cloud=cloud, exact=None, fine=False)
        return replace(reach, cloud=cloud, fine=fine, notes=(), wanted=wanted)

    def measured(self, reach: Reach, accuracy: float) -> Reach:
        """With its exact set, or the reason why there is none, or none as accurate as wanted."""
        if reach.refusal:
            return reach
        budget = self._budget(f"computing the exact set to {100 * accuracy:g} %")
        try:
            return replace(reach, exact=exact_set(reach.arm, accuracy, self.quality.tol, budget))
        except (InvalidInput, OverBudget, MemoryError) as error:
            if isinstance(error, InvalidInput) and error.name != "memory":
                return replace(reach, exact=None, refusal=str(error))  # never at rest
            # or of so many bundles that no search fits
            reason = error if isinstance(error, OverBudget) else "more memory than is free"
        needed = f"to {100 * accuracy:g} % it needs {reason}"
        if reach.exact is None:
            return replace(reach, refusal=needed)
        return replace(reach, notes=(*reach.notes, f"exact set coarser than asked: {needed}"))

    def _budget(self, doing: str, total: int = 0) -> Budget:
        def report(done: int) -> None:
            part = f", {100 * done // total} %" if total else f", {done:,} cells"
            self.report(doing + part if done else doing)

        return Budget(self.check, self.quality.most_seconds, report)


def exact_set(arm: Manipulator, accuracy: float, tol: float, budget: Budget) -> ReachableSet:
    """The exact set, to a relative error of its volume and a largest tip error in L."""
    memory = budget.memory if solvable_rod(arm).box.dimension > 3 else None
    with no_warnings():  # the error is shown beside the volume
        return reachable_set(arm, accuracy=accuracy, tol=tol, memory=memory, progress=budget)


def affordable_level(rod: TipMap, seconds: float, wanted: int) -> int:
    """The level of the largest cloud, at most wanted, that one core computes in time [s]."""
    samples = max(seconds, 1e-9) / _seconds_each(rod)
    return min(wanted, max(_LOWEST, math.floor(math.log2(samples))))


@lru_cache(maxsize=64)
def _seconds_each(rod: TipMap) -> float:
    """Cost of one sample [s], once everything is compiled and prepared."""
    (cube,) = cube_blocks("sobol", _PILOT, rod.box.bundles, 0, _PILOT)
    gamma, compute = rod.box.from_cube(cube), rod.status if rod.supports_unstable else rod.tips
    compute(gamma[:16])
    seconds = []
    for _ in range(2):
        start = time.perf_counter()
        compute(gamma)
        seconds.append(time.perf_counter() - start)
    return max(min(seconds), 1e-6) / _PILOT


def count_activations(
    reach: Reach, rows: Index, check: StaleCheck = lambda: None, report: Report = _quiet
) -> Array:
    """Number of stable activations that reach each sample, shape (n,), kept with the reach."""
    # by the inverse: the grid of the exact set is wrong near folds, where half of the samples are
    from softreach.inverse import solve_inverse

    if reach.exact is not None and reach.exact.route == "flux":
        reach.counts[:] = 1.0  # proved one to one
    rod, tips = solvable_rod(reach.arm), reach.cloud.tip.values
    counted = lambda missing: solve_inverse(rod, tips[missing]).counts.astype(float)
    return _completed(reach.counts, rows, counted, "counting activations", check, report)


def sample_clearances(
    reach: Reach, rows: Index, check: StaleCheck = lambda: None, report: Report = _quiet
) -> Array:
    """Clearance of the arm in each sample [m], shape (n,), kept; NaN if its base is in a solid."""
    gamma = reach.cloud.activation.values
    with suppress(NotPossible):
        room = clearance_map(reach.arm)
        known = lambda missing: room.of(gamma[missing]).value
        return _completed(reach.clearances, rows, known, "computing clearances", check, report)
    return reach.clearances[rows]


def _completed(
    values: Array,
    rows: Index,
    compute: Callable[[Index], Array],
    doing: str,
    check: StaleCheck,
    report: Report,
) -> Array:
    """Values of these rows; those that are NaN are computed, and kept."""
    missing = rows[np.isnan(values[rows])]
    for block in parallel.blocks(len(missing), _BLOCK):
        check()
        with all_cores:
            values[missing[block]] = compute(missing[block])
        report(f"{doing}: {block.stop:,} of {len(missing):,} points")
    return values[rows]


@lru_cache(maxsize=8)
def clearance_map(arm: Manipulator) -> ClearanceMap:
    """The map from activations to the clearance of an arm; NotPossible with its base in a solid."""
    from softreach.rod.clearance import ClearanceMap

    return ClearanceMap(all_inputs(solvable_rod(arm)))
