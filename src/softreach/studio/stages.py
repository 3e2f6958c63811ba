"""What a design can reach, coarse first and then fine, within a budget of time and memory."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.cloud.clouds import compute_cloud, design_of
from softreach.rod.tip_map import TipMap
from softreach.studio.budget import Budget, OverBudget
from softreach.studio.effort import affordable_level, level_in_memory
from softreach.studio.reach import Quality, Reach
from softreach.studio.rod import solvable_rod
from softreach.studio.worker import StaleCheck, all_cores
from softreach.support.errors import InvalidInput, SoftreachWarning
from softreach.workspace import ReachableSet, reachable_set

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["exact_set", "reached", "stages"]

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
    found = None
    for stage, (points, accuracy) in enumerate(sizes):
        check()
        with all_cores:
            found = work.cloud(points, stage == 1, found)
            found = work.measured(found, accuracy)
        yield found


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
    """One design, and whoever waits for what it can reach."""

    arm: Manipulator
    rod: TipMap
    quality: Quality
    check: StaleCheck
    report: Report

    def cloud(self, level: int, fine: bool, known: Reach | None = None) -> Reach:
        """A cloud of 2^level points, or of as many as memory holds, with what is known besides."""
        budget = self._budget(f"computing the cloud of {1 << level:,} points", 1 << level)
        held = level_in_memory(self.rod.box.bundles, budget.memory, level)
        short = f"{1 << held:,} of {1 << level:,} samples: more do not fit into the free memory"
        tol = self.quality.tol
        cloud = compute_cloud(self.arm, 1 << held, sampler="sobol", tol=tol, progress=budget)
        return Reach(
            arm=self.arm,
            cloud=cloud,
            exact=known and known.exact,
            refusal=known.refusal if known else "",
            fine=fine,
            notes=(short,) if held < level else (),
            wanted=1 << level,
        )

    def measured(self, reach: Reach, accuracy: float) -> Reach:
        """With its exact set, or with why there is none, or none as accurate as asked."""
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
    """What was known before of the exact set, and why no more is."""
    needed = f"needs {error}" if isinstance(error, OverBudget) else "needs more memory than is free"
    if reach.exact is None:
        return replace(reach, refusal=f"to {100 * accuracy:g} % it {needed}")
    note = f"exact set coarser than asked: to {100 * accuracy:g} % it {needed}"
    return replace(reach, notes=(*reach.notes, note))


def reached(cloud: xr.Dataset, quality: Quality) -> Reach:
    """The reach that belongs to a cloud from a file."""
    ordered = cloud.attrs.get("sampler") in ("uniform", "sobol")
    shuffled = None if ordered else np.random.default_rng(0).permutation(cloud.sizes["sample"])
    found = Reach(arm=design_of(cloud), cloud=cloud, exact=None, fine=True, order=shuffled)
    work = _Work(found.arm, solvable_rod(found.arm), quality, lambda: None, _silent)
    with all_cores:
        return work.measured(found, quality.fine_accuracy)


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
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)  # the error is shown beside the volume
        return reachable_set(
            arm,
            accuracy=accuracy,
            tol=tol,
            memory=budget.memory if many else None,
            progress=budget,
        )
