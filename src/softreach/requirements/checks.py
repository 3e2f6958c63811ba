"""A design against requirements: met or missed, by how much, and what it would take."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.inverse.prepared import prepared_map
from softreach.inverse.solutions import Solutions, Status
from softreach.inverse.solve import solve_inverse
from softreach.requirements.advice import advice
from softreach.requirements.findings import (
    Finding,
    design_limits,
    limit_finding,
    measure_findings,
    places_text,
    shown_unit,
    with_payload,
)
from softreach.requirements.parts import Keep, Target
from softreach.requirements.poses import PoseRules, some_corners, worst_pose
from softreach.requirements.regions import Region
from softreach.requirements.requirements import Requirements
from softreach.rod.kinematics import configuration
from softreach.rod.rods import in_steps, tip_map
from softreach.rod.tip_map import TipMap
from softreach.rod.view import stable_tips
from softreach.sampling import sample_cube
from softreach.schema import AXES, provenance
from softreach.support import parallel
from softreach.support.arguments import as_instance, as_integer, as_number
from softreach.support.arrays import Array, Index, Mask
from softreach.support.errors import InvalidInput, Range, no_warnings
from softreach.support.lazy import lazy
from softreach.support.progress import Progress, as_progress, silent
from softreach.support.units import LengthUnit
from softreach.workspace import ReachableSolid, reachable_set
from softreach.workspace.search import nearest_tips

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Check", "Coverage", "check"]

_BLOCK = 32_768  # places at once: bounds the memory
_FAMILY = 32  # activations tried for a place of an arm with more than three free bundles
_MOST_TRIED = 4_096  # places for which they are
_LEAST_PLACES = 64  # in a region to be covered
_MOST_PLACES = 100_000
_TOL = 1e-6
_SAME = 1e-4  # of the ranges, by which poses are told apart
_ROUGH_TOL = 1e-4  # of tips on the way of a search, in L
_SEEDS, _NEIGHBORS = 256, 5
"""Samples that quick descents start from, and how many of them for each place."""
_CELLS = 16  # along each axis of three bundles: as many solutions as with 32, in half the time


class Coverage(NamedTuple):
    """Share of a region that the tip reaches."""

    name: str
    """Of the target."""
    payload: float | None
    """Mass at the tip [kg]; None for the loads of the design."""
    share: float
    error: float
    """Standard deviation of a share of so many places, which are spread more evenly than chance
    would."""
    places: int
    """Number of places in the region that were tried."""


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
        InvalidInput: Arguments of another kind.
        InvalidDesign: A payload or a limit of mass needs a modulus or a density that is not there.
    """
    arm = a_manipulator("arm", arm)
    needs = as_instance("requirements", requirements, Requirements, "Requirements")
    accuracy = as_number("accuracy", accuracy, Range(1e-4, 0.2))
    return _checked(arm, needs, accuracy, as_progress(progress), _chosen)


def quick_check(arm: Manipulator, requirements: Requirements, accuracy: float) -> Check:
    """As `check`, with poses from a few descents to each place, for designs on the way of a search.

    A place that these do not reach counts as missed, although another pose may reach it.
    """
    return _checked(arm, requirements, accuracy, silent, _descended)


_Chooser = Callable[[PoseRules, Array, Array], "Posed"]


def _checked(
    arm: Manipulator, needs: Requirements, accuracy: float, step: Progress, choose: _Chooser
) -> Check:
    """A design against requirements, with poses that are chosen for blocks of places."""
    payloads = needs.payloads or (None,)
    arms = [with_payload(arm, payload) for payload in payloads]
    posed: list[Posed] = []
    coverages: list[Coverage] = []
    for payload, loaded in zip(payloads, arms, strict=True):
        rules = _rules(loaded, needs, accuracy)
        if choose is _descended:
            rules = replace(rules, known_rod=_rough_map(loaded))
        posed.append(_solved(rules, needs.places, _within(needs), step, choose))
        for target in needs.targets:
            if target.region is not None:
                coverages.append(_coverage(rules, target, payload, accuracy, step))
    joined = {name: np.stack([getattr(each, name) for each in posed]) for name in Posed._fields}
    made = Check(
        arm=arm,
        requirements=needs,
        payloads=payloads,
        findings=(),
        coverages=tuple(coverages),
        accuracy=accuracy,
        **{name: joined[name] for name in ("gaps", "poses", "effort", "nearest")},
    )
    findings = (
        *_reach_findings(made, joined, arms),
        *_cover_findings(made),
        *_keep_findings(made, joined, arms),
        *_limit_findings(made, joined, arms),
        *measure_findings(arm, needs, accuracy),
    )
    return replace(made, findings=findings)


@dataclass(frozen=True, eq=False, repr=False)
class Check:
    """A design against requirements."""

    arm: Manipulator
    """The design, with its own loads."""
    requirements: Requirements
    payloads: tuple[float | None, ...]
    """Masses at the tip [kg]; None for the loads of the design."""
    findings: tuple[Finding, ...]
    """Every requirement: targets, regions, limits, measures."""
    coverages: tuple[Coverage, ...]
    """Shares of regions that are to be covered, by payload and target."""
    accuracy: float
    gaps: Array
    """Distance of the tip to every place of every target [m], shape (payload, place)."""
    poses: Array
    """Inputs chosen for each place, in their units, shape (payload, place, inputs)."""
    effort: Array
    """√Σ(γ/g)² of these, g being the larger size of the bounds of an input [-], shape (payload,
    place)."""
    nearest: Array
    """Tips of these poses [m], shape (payload, place, 3)."""

    @property
    def met(self) -> bool:
        """True if every requirement is met."""
        return all(finding.met for finding in self.findings)

    @property
    def excess(self) -> float:
        """Sum of what the findings miss [-]."""
        return float(sum(finding.excess for finding in self.findings))

    @property
    def places(self) -> Array:
        """The places [m], shape (place, 3)."""
        return self.requirements.places

    @lazy
    def target_of(self) -> Index:
        """Index of the target that each place belongs to, shape (place,)."""
        counts = [0 if t.places is None else len(t.places) for t in self.requirements.targets]
        return np.repeat(np.arange(len(counts)), counts)

    @property
    def reached(self) -> Mask:
        """Mask of the places that are met, shape (payload, place)."""
        return self.gaps <= np.maximum(_within(self.requirements), _TOL * self.arm.length)

    @property
    def regions(self) -> tuple[tuple[str, Region], ...]:
        """Regions with what they are for: "stay_inside", "avoid" or "cover"."""
        kept = ((keep.kind, keep.region) for keep in self.requirements.keeps)
        targets = (target.region for target in self.requirements.targets)
        return (*kept, *(("cover", region) for region in targets if region is not None))

    def shapes(self, count: int) -> xr.Dataset | None:
        """The arm in poses of some places that are apart, under the largest payload.

        Args:
            count: Number of poses at most.

        Returns:
            As `configuration` has them; None where there are no places.
        """
        count = as_integer("count", count, 0)
        rows = np.unique(np.linspace(0, len(self.places) - 1, count).round().astype(int))
        rows = rows[rows >= 0] if len(self.places) else rows[:0]
        if not len(rows):
            return None
        arm = with_payload(self.arm, self.payloads[-1])
        shapes = configuration(arm, self.poses[-1, rows])
        held = np.isfinite(shapes["position"].values).all(axis=(1, 2))
        return shapes.isel(sample=held) if held.any() else None

    def __repr__(self) -> str:
        missed = sum(not finding.met for finding in self.findings)
        count = len(self.findings)
        verdict = f"missed, {missed} of {count}" if missed else f"met, all {count}"
        size = shown_unit(self.arm).text(self.arm.length)
        lines = [f"Requirements of an arm of {size}: {verdict}"]
        width = max((len(finding.name) for finding in self.findings), default=0)
        for finding in self.findings:
            verdict = "met" if finding.met else "MISSED"
            lines.append(f"  {verdict:<6}  {finding.name:<{width}}  {finding.text}")
        return "\n".join(lines)

    def to_dataset(self) -> xr.Dataset:
        """Places with their gaps, poses and efforts, and the findings, labeled."""
        import xarray as xr

        at = ("payload", "place")
        findings = self.findings
        masses = [np.nan if payload is None else payload for payload in self.payloads]
        names = [self.requirements.targets[k].name for k in self.target_of]
        return xr.Dataset(
            {
                "position": (("place", "axis"), self.places, {"units": "m"}),
                "target": ("place", np.array(names, dtype=str)),
                "gap": (at, self.gaps, {"units": "m"}),
                "reached": (at, self.reached),
                "pose": ((*at, "input"), self.poses),
                "nearest": ((*at, "axis"), self.nearest, {"units": "m"}),
                "effort": (at, self.effort, {"units": "1"}),
                "met": ("finding", [finding.met for finding in findings]),
                "excess": ("finding", [finding.excess for finding in findings], {"units": "1"}),
                "text": ("finding", np.array([finding.text for finding in findings], dtype=str)),
                "share": ("coverage", [each.share for each in self.coverages], {"units": "1"}),
                "share_error": ("coverage", [each.error for each in self.coverages]),
            },
            {
                "axis": list(AXES),
                "payload": ("payload", masses, {"units": "kg"}),
                "input": list(self.arm.input_names),
                "input_unit": ("input", list(self.arm.input_units)),
                "finding": np.array([finding.name for finding in findings], dtype=str),
                "kind": ("finding", np.array([finding.kind for finding in findings], dtype=str)),
                "coverage": np.array([each.name for each in self.coverages], dtype=str),
            },
            {**provenance(self.arm), "length": self.arm.length},
        )


class Posed(NamedTuple):
    """The pose chosen for each place, under one payload."""

    gaps: Array
    poses: Array
    effort: Array
    nearest: Array
    excess: Array
    """Of each rule, shape (place, rule)."""
    value: Array
    """Of each rule, shape (place, rule)."""
    error: Array
    """Of the values of regions between stations [m], shape (place, rule)."""


def _within(needs: Requirements) -> Array:
    """Distance to which each place must be reached [m], shape (place,)."""
    each = [np.full(len(t.places), t.within) for t in needs.targets if t.places is not None]
    return np.concatenate([np.empty(0), *each])


def _rules(arm: Manipulator, needs: Requirements, accuracy: float) -> PoseRules:
    keeps = [keep for keep in needs.keeps if keep.when == "targets" and needs.targets]
    return PoseRules.of(arm, keeps, needs.limits, 0.1 * accuracy * arm.length)


def _rough_map(arm: Manipulator) -> TipMap:
    """A tip map for designs on the way, whose shapes have no more steps than its tips."""
    rod = tip_map(arm, _ROUGH_TOL)
    return in_steps(arm, rod.steps, rod)


def _solved(
    rules: PoseRules, places: Array, within: Array, step: Progress, choose: _Chooser
) -> Posed:
    """The poses at places, in blocks."""
    count, inputs, k = len(places), rules.arm.inputs, len(rules)
    shapes = ((), (inputs,), (), (3,), (k,), (k,), (k,))
    room = Posed(*(np.zeros((count, *shape)) for shape in shapes))
    for block in parallel.blocks(count, _BLOCK):
        for whole, part in zip(room, choose(rules, places[block], within[block]), strict=True):
            whole[block] = part
        step(len(places[block]))
    return room


def _chosen(rules: PoseRules, places: Array, within: Array) -> Posed:
    arm = rules.arm
    try:
        with no_warnings():
            solutions = solve_inverse(prepared_map(arm, _TOL, cells=_CELLS), places)
    except InvalidInput as error:
        if error.name != "loads":
            raise
        return _fallen(rules, places)
    chosen = _best(rules, solutions)
    broken = (chosen.excess.sum(axis=1) > 0.0) & (solutions.statuses == Status.REACHED)
    if (tip_map(arm).box.dimension > 3) and 0 < broken.sum() <= _MOST_TRIED:
        rows = np.flatnonzero(broken)
        with no_warnings():
            family = solve_inverse(
                prepared_map(arm, _TOL, cells=_CELLS), places[rows], family=_FAMILY
            )
        for all_places, some in zip(chosen, _best(rules, family), strict=True):
            all_places[rows] = some
    # A place that is reached to the error of the tips is reached.
    reached = solutions.statuses == Status.REACHED
    gaps = np.where(reached, np.minimum(chosen.gaps, _TOL * arm.length), chosen.gaps)
    return chosen._replace(gaps=gaps)


def _descended(rules: PoseRules, places: Array, within: Array) -> Posed:
    """Poses at the ends of descents from the samples whose tips are nearest to each place."""
    from scipy.spatial import KDTree

    rod, count = rules.rod, len(places)
    gamma = rod.box.from_cube(sample_cube("sobol", _SEEDS, rod.box.bundles))
    gamma = np.concatenate([gamma, some_corners(rod)])
    tips = stable_tips(rod).tips(gamma)
    known = np.isfinite(tips).all(axis=1)
    if not known.any():
        return _fallen(rules, places)
    gamma, tips = gamma[known], tips[known]
    near = KDTree(tips).query(places, k=min(_NEIGHBORS, len(tips)))[1].reshape(count, -1)
    owner = np.repeat(np.arange(count), near.shape[1])
    enough = _TOL * rod.length
    ends = nearest_tips(rod, gamma[near.ravel()], places[owner], enough)
    least = np.full(count, np.inf)
    np.minimum.at(least, owner, ends.distance)
    # Local minima that are farther away than another are no poses at the place.
    wanted = np.maximum(np.maximum(within, enough)[owner], least[owner] * (1.0 + 1e-9))
    kept = np.flatnonzero(ends.distance <= wanted)
    # Most descents to a place end in one pose.
    same = np.column_stack([owner[kept], np.rint(rod.box.to_cube(ends.gamma[kept]) / _SAME)])
    kept = kept[np.unique(same, axis=0, return_index=True)[1]]
    return _ranked(
        rules, places, owner[kept], ends.gamma[kept], ends.distance[kept], ends.tips[kept]
    )


def _best(rules: PoseRules, solutions: Solutions) -> Posed:
    """Of each target the solution that breaks the rules least, then that of least effort."""
    missing = np.flatnonzero(solutions.counts == 0)
    owner = np.concatenate([np.repeat(np.arange(len(solutions)), solutions.counts), missing])
    gamma = np.concatenate([solutions.activations, solutions.nearest_activations[missing]])
    gaps = np.concatenate([solutions.residuals, solutions.gaps[missing]])
    nearest = np.concatenate(
        [np.repeat(solutions.targets, solutions.counts, axis=0), solutions.nearest[missing]]
    )
    return _ranked(rules, solutions.targets, owner, gamma, gaps, nearest)


def _ranked(
    rules: PoseRules, places: Array, owner: Index, gamma: Array, gaps: Array, nearest: Array
) -> Posed:
    """Of each place the pose that breaks the rules least, then that of least effort.

    Args:
        rules: Regions and limits of poses.
        places: Shape (place, 3).
        owner: Place of each pose; each place has one at least.
        gamma: Inputs of the poses.
        gaps: Distances from their tips to the places [m].
        nearest: Their tips.
    """
    lost = ~np.isfinite(gamma).all(axis=1)
    gamma[lost] = rules.rod.box.low
    judged = rules.judged(gamma)
    effort = np.linalg.norm(gamma / effort_scales(rules.arm), axis=1)
    broken = judged.excess.sum(axis=1)
    order = np.lexsort((effort, broken, owner))
    best = order[np.searchsorted(owner[order], np.arange(len(places)))]
    away = np.linalg.norm(places - rules.arm.base.position, axis=1)
    gaps = np.where(np.isfinite(gaps[best]), gaps[best], away + rules.arm.length)
    rest = (judged.excess[best], judged.value[best], judged.error[best])
    return Posed(gaps, gamma[best], effort[best], np.nan_to_num(nearest[best]), *rest)


def effort_scales(arm: Manipulator) -> Array:
    """Largest bound of each input, which its effort counts in, shape (inputs,)."""
    largest = np.abs(arm.input_bounds).max(axis=1, initial=0.0)
    return np.where(largest > 0.0, largest, 1.0)


def _fallen(rules: PoseRules, places: Array) -> Posed:
    """Poses of an arm that no activation holds under its loads: none counts as near."""
    arm, count = rules.arm, len(places)
    away = np.linalg.norm(places - arm.base.position, axis=1) + arm.length
    gamma = np.tile(rules.rod.box.low, (count, 1))
    rule = np.zeros((count, len(rules)))
    base = np.tile(arm.base.position, (count, 1))
    return Posed(away, gamma, np.zeros(count), base, rule, rule, rule)


def _coverage(
    rules: PoseRules, target: Target, payload: float | None, accuracy: float, step: Progress
) -> Coverage:
    """The share of a region that is reached."""
    assert target.region is not None
    count = int(np.clip(0.25 / accuracy**2, _LEAST_PLACES, _MOST_PLACES))
    places = target.region.places(count)
    near = max(target.within, _TOL * rules.arm.length)
    if len(rules):
        posed = _solved(rules, places, np.full(count, target.within), step, _chosen)
        inside = (posed.gaps <= near) & (posed.excess.sum(axis=1) == 0.0)
    else:
        inside = _reachable(rules.arm, places, target.within, accuracy)
        step(count)
    share = float(inside.mean())
    # of a share of 0 or 1, what one place more or less makes of it
    error = float(np.sqrt(max(share * (1.0 - share), 1.0 / count) / count))
    return Coverage(target.name, payload, share, error, count)


def _reachable(arm: Manipulator, places: Array, within: float, accuracy: float) -> Mask:
    """Mask of the places that the tip reaches, whatever the pose."""
    try:
        with no_warnings():
            reached = reachable_set(arm, accuracy=accuracy)
    except InvalidInput as error:
        if error.name != "loads":
            raise
        return np.zeros(len(places), bool)
    if not isinstance(reached, ReachableSolid):
        return np.zeros(len(places), bool)  # without a volume
    return reached.distance(places) <= within if within > 0.0 else reached.contains(places)


def _under(payload: float | None) -> str:
    return "" if payload is None else f" with {payload:.4g} kg"


def _reach_findings(
    made: Check, joined: dict[str, Array], arms: list[Manipulator]
) -> Iterator[Finding]:
    length, unit = made.arm.length, shown_unit(made.arm)
    for index, target in enumerate(made.requirements.targets):
        if target.places is None:
            continue
        own = made.target_of == index
        gaps, reached = made.gaps[:, own], made.reached[:, own]
        load, place = np.unravel_index(int(gaps.argmax()), gaps.shape)
        met = places_text(int(reached.all(axis=0).sum()), len(target.places))
        if reached.all():
            effort = float(made.effort[:, own].max())
            near = f" to {unit.text(target.within)}" if target.within else ""
            yield Finding(
                target.name, "reach", True, 0.0, f"{met} reached{near}, effort up to {effort:.3g}"
            )
            continue
        gap, number = float(gaps[load, place]), int(np.flatnonzero(own)[place])
        excess = max(gap - target.within, _TOL * length) / length
        where = ", ".join(f"{x / unit.size:.4g}" for x in target.places[place])
        text = f"{met} reached; place {place + 1} at ({where}) {unit.name}"
        more = ""
        if (
            gap
            > length + float(np.linalg.norm(target.places[place] - made.arm.base.position)) - 1e-9
        ):
            text += f" is not held{_under(made.payloads[load])}: no stable equilibrium"
        else:
            text += (
                f" is missed by {_length(gap - target.within, unit)}{_under(made.payloads[load])}"
            )
            more = advice(arms[load], target.places[place], made.poses[load, number], unit)
        held = [
            p for p, row in zip(made.payloads, reached, strict=True) if p is not None and row.all()
        ]
        if held:
            more += f"; all reached with {max(held):.4g} kg"
        yield Finding(target.name, "reach", False, excess, text + more)


def _length(value: float, unit: LengthUnit, digits: int = 4) -> str:
    return f"{value / unit.size + 0.0:.{digits}g} {unit.name}"  # + 0.0: no minus before 0


def _cover_findings(made: Check) -> Iterator[Finding]:
    for target in made.requirements.targets:
        if target.region is None:
            continue
        own = [each for each in made.coverages if each.name == target.name]
        worst = min(own, key=lambda each: each.share)
        met = worst.share >= target.share
        text = (
            f"{100 * worst.share:.2f} ± {100 * worst.error:.2g} % covered of at least "
            f"{100 * target.share:.4g} %{_under(worst.payload)}"
        )
        yield Finding(target.name, "cover", met, max(target.share - worst.share, 0.0), text)


def _keep_findings(
    made: Check, joined: dict[str, Array], arms: list[Manipulator]
) -> Iterator[Finding]:
    at_targets = bool(made.requirements.targets)
    column = 0
    for keep in made.requirements.keeps:
        if keep.when == "targets" and at_targets:
            values = joined["value"][..., column], joined["error"][..., column]
            excess = joined["excess"][..., column]
            column += 1
            yield _kept_at_targets(made, keep, *values, excess)
        else:
            yield _kept_always(made, keep, arms)


def _kept_at_targets(made: Check, keep: Keep, value: Array, error: Array, excess: Array) -> Finding:
    unit = shown_unit(made.arm)
    if not value.size:
        return Finding(keep.name, keep.kind, True, 0.0, "counted in what is covered")
    load, place = np.unravel_index(int(value.argmax()), value.shape)
    where = f"at place {place + 1}{_under(made.payloads[load])}"
    return _kept(
        keep, float(value[load, place]), float(error[load, place]), float(excess.max()), where, unit
    )


def _kept_always(made: Check, keep: Keep, arms: list[Manipulator]) -> Finding:
    """A region that every pose must keep to, by a search for the worst."""
    worst: list[tuple[float, float, float, str]] = []
    for payload, loaded in zip(made.payloads, arms, strict=True):
        rules = PoseRules(loaded, (keep,), {}, 0.1 * made.accuracy * loaded.length)
        gamma, judged = worst_pose(rules)
        inputs = ", ".join(f"{x:.4g}" for x in gamma)
        where = f"in the worst pose found, ({inputs}){_under(payload)}"
        value, excess, error = (float(column[0, 0]) for column in judged)
        worst.append((value, error, excess, where))
    value, error, excess, where = max(worst)
    return _kept(keep, value, error, excess, where, shown_unit(made.arm))


def _kept(
    keep: Keep, value: float, error: float, excess: float, where: str, unit: LengthUnit
) -> Finding:
    """How far a region is missed, or by how much it is kept to."""
    of = "the tip" if keep.of == "tip" else "the arm"
    close = f" (to {_length(error, unit, 2)})" if keep.of == "arm" else ""
    if excess > 0.0:
        beyond = "outside" if keep.inside else "inside or too near"
        text = f"{of} is {_length(value, unit)}{close} {beyond} {where}"
    elif not np.isfinite(value):
        text = "no pose to judge"
    else:
        text = f"{of} keeps {_length(-value, unit)}{close} to spare {where}"
    return Finding(keep.name, keep.kind, excess == 0.0, excess, text)


def _limit_findings(
    made: Check, joined: dict[str, Array], arms: list[Manipulator]
) -> Iterator[Finding]:
    needs = made.requirements
    yield from design_limits(made.arm, needs)
    rules = _rules(arms[0], needs, made.accuracy)
    for column, (name, most) in enumerate(rules.limits.items(), len(rules.keeps)):
        values = joined["value"][..., column]
        if values.size:
            load, place = np.unravel_index(int(values.argmax()), values.shape)
            value = float(values[load, place])
            where = f", at place {place + 1}{_under(made.payloads[load])}"
        elif needs.targets:
            value, where = 0.0, ", counted in what is covered"
        else:
            value, where = (
                max(_rules(each, needs, made.accuracy).of_bounds(name) for each in arms),
                ", over all bounds",
            )
        yield limit_finding(name, value if np.isfinite(value) else 0.0, most, made.arm, where)
