"""A design against requirements: the verdict, by how much, and what it would take."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.requirements.check_result import TOL, Check, Coverage
from softreach.requirements.chosen_poses import Chooser, Posed, chosen, descended, solved
from softreach.requirements.findings import measure_findings
from softreach.requirements.parts import Target
from softreach.requirements.poses import PoseRules
from softreach.requirements.requirements import Requirements
from softreach.requirements.verdicts import verdicts
from softreach.rod.rods import in_steps, tip_map
from softreach.support.arguments import as_instance, as_number
from softreach.support.arrays import Array, Mask
from softreach.support.errors import InvalidInput, Range, no_warnings
from softreach.support.progress import Progress, as_progress, silent
from softreach.workspace import ReachableSet, ReachableSolid, reachable_set

__all__ = ["Check", "Coverage", "Sets", "check", "checked", "quick_check", "sets_to"]

_LEAST_PLACES = 64  # in a region to be covered
_MOST_PLACES = 100_000
_ROUGH_TOL = 1e-4  # of tips on the way of a search, in L

Sets = Callable[[Manipulator], ReachableSet]
"""Reachable sets of a design and of it under payloads."""


def check(
    arm: Manipulator,
    requirements: Requirements,
    *,
    accuracy: float = 1e-2,
    progress: Progress | None = None,
) -> Check:
    """A design against requirements, every one of them judged.

    Places are met by `solve_inverse`. Of all activations that put the tip at a place, the one
    counts that keeps best to the regions and limits of poses, and then the one of least effort;
    with more than three free bundles, other activations are tried where that of least effort
    breaks a rule, so that some may be missed. At a place out of reach it is the nearest pose found.

    Args:
        arm: The design.
        requirements: The requirements.
        accuracy: Error of shares of regions that are covered, and relative error of volumes.
        progress: Called with the number of places done since its last call.

    Returns:
        The findings, which print themselves.

    Raises:
        InvalidInput: Arguments of another kind, or requirements that ask for nothing.
        InvalidDesign: A payload or a limit of mass needs a modulus or a density that is not there.

    Warns:
        SoftreachWarning: The error of a reachable set is larger than asked.
    """
    arm = a_manipulator("arm", arm)
    needs = as_instance("requirements", requirements, Requirements, "Requirements")
    accuracy = as_number("accuracy", accuracy, Range(1e-4, 0.2))
    if not (needs.targets or needs.keeps or needs.limits.given or needs.measures):
        allowed = "a target, a region to keep to, a limit or a measure, or several"
        raise InvalidInput("requirements", "nothing that an arm could miss", allowed)
    return checked(arm, needs, accuracy, sets_to(accuracy), as_progress(progress))


def quick_check(
    arm: Manipulator, requirements: Requirements, accuracy: float, sets: Sets | None = None
) -> Check:
    """As `check`, with poses from a few descents to each place, for designs on the way of a search.

    A place that these do not reach counts as missed, although another pose may reach it.
    """
    sets = sets_to(accuracy, quiet=True) if sets is None else sets
    return checked(arm, requirements, accuracy, sets, choose=descended)


def sets_to(accuracy: float, *, quiet: bool = False) -> Sets:
    """Reachable sets to a relative error of volumes, each computed once; `quiet` without warnings.

    Those on the way of a search are quiet.
    """

    def set_of(arm: Manipulator) -> ReachableSet:
        return reachable_set(arm, accuracy=accuracy)

    return cache(no_warnings()(set_of) if quiet else set_of)


def checked(
    arm: Manipulator,
    needs: Requirements,
    accuracy: float,
    sets: Sets,
    step: Progress = silent,
    *,
    choose: Chooser = chosen,
) -> Check:
    """A design against requirements, with poses that are chosen for blocks of places.

    Args:
        arm: The design.
        needs: The requirements.
        accuracy: As for `check`.
        sets: Reachable sets to this accuracy.
        step: Called with the number of places done since its last call.
        choose: Source of the poses.
    """
    payloads = needs.payloads or (None,)
    keeps = [keep for keep in needs.keeps if keep.when == "targets" and needs.targets]
    every: list[PoseRules] = []
    posed: list[Posed] = []
    coverages: list[Coverage] = []
    for payload, loaded in zip(payloads, needs.under_payloads(arm), strict=True):
        rules = PoseRules.of(loaded, keeps, needs.limits, 0.1 * accuracy * arm.length)
        every.append(rules)
        if choose is descended:  # on the way, with shapes in no more steps than tips
            rod = tip_map(loaded, _ROUGH_TOL)
            rules = replace(rules, known_rod=in_steps(loaded, rod.steps, rod))
        posed.append(solved(rules, needs.places, needs.within, step, choose))
        for target in needs.targets:
            if target.region is not None:
                coverages.append(_coverage(rules, target, payload, accuracy, sets, step))
    joined = Posed(*(np.stack(each) for each in zip(*posed, strict=True)))
    made = Check(
        arm=arm,
        requirements=needs,
        payloads=payloads,
        findings=(),
        coverages=tuple(coverages),
        accuracy=accuracy,
        gaps=joined.gaps,
        poses=joined.poses,
        effort=joined.effort,
        nearest=joined.nearest,
    )
    measures = measure_findings(arm, needs, accuracy, partial(sets, arm))
    return replace(made, findings=(*verdicts(made, joined, every), *measures))


def _coverage(
    rules: PoseRules,
    target: Target,
    payload: float | None,
    accuracy: float,
    sets: Sets,
    step: Progress,
) -> Coverage:
    assert target.region is not None
    count = int(np.clip(0.25 / accuracy**2, _LEAST_PLACES, _MOST_PLACES))
    places = target.region.places(count)
    near = max(target.within, TOL * rules.arm.length)
    if len(rules):
        posed = solved(rules, places, np.full(count, target.within), step, chosen)
        inside = (posed.gaps <= near) & (posed.excess.sum(axis=1) == 0.0)
    else:
        inside = _reachable(partial(sets, rules.arm), places, target.within)
        step(count)
    share = float(inside.mean())
    # of a share of 0 or 1, what one place more or less makes of it
    error = float(np.sqrt(max(share * (1.0 - share), 1.0 / count) / count))
    return Coverage(target.name, payload, share, error, count)


def _reachable(known: Callable[[], ReachableSet], places: Array, within: float) -> Mask:
    """Mask of the places that the tip reaches, whatever the pose."""
    try:
        reached = known()
    except InvalidInput as error:
        if error.name != "loads":
            raise
        return np.zeros(len(places), bool)
    if not isinstance(reached, ReachableSolid):  # without a volume
        rod = reached.tip_map
        return reached.distance(places) <= max(within, rod.tol * rod.length)
    return reached.distance(places) <= within if within > 0.0 else reached.contains(places)
