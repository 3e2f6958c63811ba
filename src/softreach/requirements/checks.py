"""A design against requirements: the verdict, by how much, and what it would take."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.geometry.regions import Region
from softreach.inverse.request import ANGLE_TOL
from softreach.requirements.findings import (
    Finding,
    Verdict,
    advice,
    design_limits,
    limit_finding,
    measure_findings,
    share_error,
    verdict_of,
)
from softreach.requirements.parts import TOL, Goals, Keep, Target
from softreach.requirements.poses import Posed, PoseRules, solved
from softreach.requirements.requirements import Requirements, with_payload
from softreach.rod.kinematics import configuration
from softreach.rod.rods import as_tip_map, in_steps
from softreach.rod.tip_map import InvalidLoads
from softreach.schema import AXES, provenance
from softreach.support.arguments import as_instance, as_integer, as_number
from softreach.support.arrays import Array, Index, Mask, over
from softreach.support.errors import NotPossible, Range, counted, no_warnings
from softreach.support.lazy import Dataset, lazy
from softreach.support.progress import Progress, as_progress, silent
from softreach.support.report import Report, Reported, Section
from softreach.support.units import LengthUnit
from softreach.workspace import ReachableSet, reachable_set

_LEAST_PLACES = 64  # in a region to be covered
_MOST_PLACES = 100_000
_ROUGH_TOL = 1e-4  # of tips on the way of a search, in L

Sets = Callable[[Manipulator], ReachableSet]  # Reachable sets of a design and of it under payloads


class Coverage(NamedTuple):
    """Share of a region that the tip reaches."""

    name: str
    """Name of the target."""
    payload: float | None
    """Mass at the tip [kg]; None for the loads of the design."""
    share: float
    """Share of the places tried that the tip reaches [-]."""
    error: float
    """Standard deviation of the share [-]; the places are spread more evenly than chance would."""
    places: int
    """Number of places in the region that were tried."""


@dataclass(frozen=True, eq=False, repr=False)
class Check(Reported):
    """A design against requirements."""

    arm: Manipulator
    """The design, with its own loads."""
    requirements: Requirements
    """The requirements."""
    payloads: tuple[float | None, ...]
    """Masses at the tip [kg]; None for the loads of the design."""
    findings: tuple[Finding, ...]
    """Every requirement: targets, regions, limits, measures."""
    coverages: tuple[Coverage, ...]
    """Shares of regions that are to be covered, by payload and target."""
    accuracy: float
    """Relative error allowed in shares of regions and in volumes [-]."""
    gaps: Array
    """Distance of the tip to every place of every target [m], shape (payload, place)."""
    poses: Array
    """Inputs chosen for each place [unit], shape (payload, place, inputs)."""
    effort: Array
    """√Σ(γ/g)² of these, g being the larger size of the bounds of an input [-], shape (payload,
    place)."""
    nearest: Array
    """Tips of these poses [m], shape (payload, place, 3)."""
    direction_errors: Array
    """Angles between their directions and those wanted [rad], NaN where any will do, shape
    (payload, place)."""

    @property
    def verdict(self) -> Verdict:
        """Missed if one requirement is, else undecided if one is."""
        every = {finding.verdict for finding in self.findings}
        return "missed" if "missed" in every else "undecided" if "undecided" in every else "met"

    @property
    def met(self) -> bool:
        """True if every requirement is met."""
        return self.verdict == "met"

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
        counts = [len(target.points) for target in self.requirements.targets]
        return np.repeat(np.arange(len(counts)), counts)

    @property
    def reached(self) -> Mask:
        """Mask of the places that are met, shape (payload, place)."""
        goals = self.requirements.goals
        return goals.reached(self.gaps, self.direction_errors, self.arm.length)

    @property
    def regions(self) -> tuple[tuple[str, Region], ...]:
        """Regions with what they are for: "stay_inside", "avoid" or "cover"."""
        kept = ((keep.kind, keep.region) for keep in self.requirements.keeps)
        return (*kept, *(("cover", region) for _, region in self.requirements.regions))

    def shapes(self, count: int) -> Dataset | None:
        """The arm in poses of some places that are apart, under the largest payload.

        Args:
            count: Number of poses at most.

        Returns:
            As `configuration` has them; None where there are no places.
        """
        if not (count := min(as_integer("count", count, 0), len(self.places))):
            return None
        rows = np.unique(np.linspace(0, len(self.places) - 1, count).round().astype(int))
        arm = with_payload(self.arm, self.payloads[-1])
        shapes = configuration(arm, self.poses[-1, rows])
        held = np.isfinite(shapes["position"].values).all(axis=(1, 2))
        return shapes.isel(sample=held) if held.any() else None

    def report(self) -> Report:
        """Verdict, every requirement and a picture, to be printed, or saved as an .html file."""
        from softreach.plot.arm import plot_check

        own, unit = [finding.verdict for finding in self.findings], self.arm.length_unit
        words = [word for word in ("missed", "undecided") if word in own]
        counts = [f"{word}, {own.count(word)} of {len(own)}" for word in words]
        counts = counts or [f"met, all {len(own)}"]
        space = 9 if "undecided" in own else 6
        rows = [(f.word.ljust(space), f.name, f.text) for f in self.findings]
        caption, drawn = "The arm at the places that it must reach.", partial(plot_check, self)
        return Report(
            title="Requirements of an arm",
            verdict=f"Requirements of an arm of {unit.text(self.arm.length)}: {'; '.join(counts)}",
            state=self.verdict,
            sections=[
                Section(title="Requirements", rows=rows, printed=max(1, len(rows))),
                Section(title="Picture", figures=lambda: [(drawn(unit=unit).figure, caption)]),
                Section(title="The design", text=self.arm.to_toml()),
                Section(title="The requirements", text=self.requirements.to_toml()),
            ],
        )

    def to_dataset(self) -> Dataset:
        """Places with their gaps, poses and efforts, and the findings, labeled."""
        import xarray as xr

        at, findings, covers = ("payload", "place"), self.findings, self.coverages
        masses = [np.nan if payload is None else payload for payload in self.payloads]
        of_places = [self.requirements.targets[k].name for k in self.target_of]
        kinds = ("name", "kind", "verdict", "text")
        words = {x: np.array([getattr(each, x) for each in findings], dtype=str) for x in kinds}
        values = over(("place", "axis"), "m", position=self.places)
        values |= over("place", target=np.array(of_places, dtype=str))
        values |= over(at, "m", gap=self.gaps)
        values |= over(at, "rad", direction_error=self.direction_errors)
        values |= over(at, reached=self.reached) | over((*at, "input"), pose=self.poses)
        values |= over((*at, "axis"), "m", nearest=self.nearest)
        values |= over(at, "1", effort=self.effort)
        values |= over("finding", met=[each.met for each in findings], verdict=words["verdict"])
        values |= over("finding", "1", excess=[each.excess for each in findings])
        values |= over("finding", text=words["text"])
        values |= over("coverage", "1", share=[each.share for each in covers])
        values |= over("coverage", share_error=[each.error for each in covers])
        names = {"axis": list(AXES), "input": list(self.arm.input_names), "finding": words["name"]}
        names["coverage"] = np.array([each.name for each in covers], dtype=str)
        names |= over("payload", "kg", payload=masses) | over("finding", kind=words["kind"])
        names |= over("input", input_unit=list(self.arm.input_units))
        return xr.Dataset(values, names, {**provenance(self.arm), "length": self.arm.length})


def check(
    arm: Manipulator,
    requirements: Requirements,
    *,
    accuracy: float = 1e-2,
    point: str | None = None,
    progress: Progress | None = None,
) -> Check:
    """A design against requirements, every one of them judged.

    Places and directions are met by `solve_inverse`. Of all activations that put the tip at a
    place, in the direction that is wanted there, the one counts that keeps best to the regions and
    limits of poses, and then the one of least effort; with more than three free bundles, other
    activations are tried where that of least effort breaks a rule, so that some may be missed. At
    a place out of reach it is the nearest pose found, and where the direction cannot be met that
    which is least off at the place.

    Args:
        arm: The design.
        requirements: The requirements.
        accuracy: Error of shares of regions that are covered, and relative error of volumes.
        point: Name of the marker that counts as the tip; by default that of the design.
        progress: Called with the number of places done since its last call.

    Returns:
        The findings, which print themselves.

    Raises:
        InvalidInput: Arguments of another kind.
        NotPossible: Empty requirements.
        InvalidDesign: A payload or a limit of mass needs a modulus or a density that is not there.

    Warns:
        SoftreachWarning: The error of a reachable set is larger than asked.

    Examples:
        >>> target = sr.requirements.Target([0.2, 0.1, 0.6], name="shelf")
        >>> found = sr.check(sr.designs.minimal_trunk(), sr.Requirements(targets=[target]))
        >>> found.findings[0].verdict
        'met'
    """
    arm = a_manipulator("arm", arm).at_point(point)
    needs = as_instance("requirements", requirements, Requirements, "Requirements")
    accuracy = as_number("accuracy", accuracy, Range(1e-4, 0.2))
    if not (needs.targets or needs.keeps or needs.limits.given or needs.measures):
        hint = "add a target, a region to keep to, a limit or a measure"
        raise NotPossible(f"the requirements are empty: {hint}")
    return checked(arm, needs, accuracy, step=as_progress(progress))


def sets_to(accuracy: float, *, quiet: bool = False) -> Sets:
    """Reachable sets to a relative error of volumes, each computed once."""
    set_of = partial(reachable_set, accuracy=accuracy)
    return cache(no_warnings()(set_of) if quiet else set_of)


def checked(
    arm: Manipulator,
    needs: Requirements,
    accuracy: float,
    sets: Sets | None = None,
    *,
    step: Progress = silent,
    quick: bool = False,
) -> Check:
    """As `check`, with reachable sets that are known.

    `quick`, for designs on the way of a search, with poses from a few descents to each place: one
    that these do not reach counts as missed, although another pose may reach it.
    """
    sets = sets_to(accuracy, quiet=quick) if sets is None else sets
    payloads = tuple(needs.payloads) or (None,)
    keeps = tuple(keep for keep in needs.keeps if keep.when == "targets" and needs.targets)
    count = int(np.clip(0.25 / accuracy**2, _LEAST_PLACES, _MOST_PLACES))
    every: list[PoseRules] = []
    posed: list[Posed] = []
    coverages: list[Coverage] = []
    for payload, loaded in zip(payloads, needs.under_payloads(arm), strict=True):
        rules = PoseRules(loaded, keeps, needs.limits.of_poses, 0.1 * accuracy * arm.length)
        every.append(rules)
        if quick:  # with shapes in no more steps than tips
            rod = as_tip_map(loaded, TOL if needs.goals.directed.any() else _ROUGH_TOL)
            rules = replace(rules, known_rod=in_steps(loaded, rod.steps, rod))
        posed.append(solved(rules, needs.goals, step, quick=quick))
        for target, region in needs.regions:
            share = float(_covered(rules, target, region.places(count), sets, step).mean())
            error = float(share_error(share, count))
            coverages.append(Coverage(target.name, payload, share, error, count))
    whole = Posed(*(np.stack(each) for each in zip(*posed, strict=True)))
    made = Check(arm, needs, payloads, (), tuple(coverages), accuracy, *whole[:5])
    findings = (
        *_reach_findings(made, every),
        *_cover_findings(made),
        *_keep_findings(made, whole, every),
        *design_limits(arm, needs),
        *_limit_findings(made, whole, every),
        *measure_findings(arm, needs, accuracy, partial(sets, arm)),
    )
    return replace(made, findings=findings)


def _covered(rules: PoseRules, target: Target, places: Array, sets: Sets, step: Progress) -> Mask:
    if len(rules):
        posed = solved(rules, Goals.of(places, target.within), step)
        near = max(target.within, TOL * rules.arm.length)
        return (posed.gaps <= near) & (posed.excess.sum(axis=1) == 0.0)
    step(len(places))
    try:
        reached = sets(rules.arm)
    except InvalidLoads:
        return np.zeros(len(places), bool)
    if reached.dimension == 3 and not target.within:
        return reached.contains(places)
    least = reached.tip_map.tol * reached.tip_map.length if reached.dimension < 3 else 0.0
    return reached.distance(places) <= max(target.within, least)


def _largest(values: Array) -> tuple[int, int]:
    return divmod(int(values.argmax()), values.shape[1])


def _under(payload: float | None) -> str:
    return "" if payload is None else f" with {payload:.4g} kg"


def _reach_findings(made: Check, rules: Sequence[PoseRules]) -> Iterator[Finding]:
    for index, target in enumerate(made.requirements.targets):
        if target.places is None:
            continue
        own = made.target_of == index
        if not made.reached[:, own].all():
            yield _missed(made, rules, target, own)
            continue
        near = f" to {made.arm.length_unit.text(target.within)}" if target.within else ""
        if target.goals.directed[0]:
            near += f", up to {np.degrees(target.cone):.4g}° off the direction"
        effort = f"effort up to {made.effort[:, own].max():.3g}"
        text = f"{counted(len(target.points), 'place')} reached{near}, {effort}"
        yield Finding(target.name, "reach", "met", 0.0, text)


def _missed(made: Check, rules: Sequence[PoseRules], target: Target, own: Mask) -> Finding:
    """What is missed of a target, by the place at which that is most."""
    length, unit = made.arm.length, made.arm.length_unit
    gaps, turns, reached = (x[:, own] for x in (made.gaps, made.direction_errors, made.reached))
    beyond = np.nan_to_num(turns - target.cone).clip(0.0)
    load, place = _largest(np.where(reached, -1.0, gaps + length * beyond))
    gap, point, laden = float(gaps[load, place]), target.points[place], _under(made.payloads[load])
    far, excess, missed, more = gap > max(target.within, TOL * length), 0.0, [], ""
    if far:
        excess = max(gap - target.within, TOL * length) / length
        missed = [f"missed by {unit.rounded(gap - target.within)}"]
    if beyond[load, place] > ANGLE_TOL:
        excess += float(beyond[load, place])
        allowed = f" ({np.degrees(target.cone):.4g}° allowed)" if target.cone else ""
        missed.append(f"{np.degrees(turns[load, place]):.4g}° off the direction{allowed}")
    where = ", ".join(f"{x / unit.size:.4g}" for x in point)
    count = f"{int(reached.all(axis=0).sum()):,} of {counted(len(target.points), 'place')} reached"
    text = f"{count}; place {place + 1} at ({where}) {unit.name} is "
    if gap > length + float(np.linalg.norm(point - made.arm.base.position)) - 1e-9:
        text += f"not held{laden}: no stable equilibrium"
    else:
        text += f"{' and '.join(missed)}{laden}"
        if far:
            more = advice(rules[load].arm, point, made.poses[load, own][place], unit)
    pairs = zip(made.payloads, reached, strict=True)
    if held := [payload for payload, row in pairs if payload is not None and row.all()]:
        more += f"; all reached with {max(held):.4g} kg"
    return Finding(target.name, "reach", "missed", excess, text + more)


def _cover_findings(made: Check) -> Iterator[Finding]:
    for target, _ in made.requirements.regions:
        own = [each for each in made.coverages if each.name == target.name]
        worst = min(own, key=lambda each: each.share)
        # Where every place is reached that was tried, no share is left to be in doubt.
        error = worst.error if worst.share < 1.0 else 0.0
        verdict = verdict_of(worst.share - target.share, error)
        covered = f"{100 * worst.share:.2f} ± {100 * worst.error:.2g} % covered"
        text = f"{covered} of at least {100 * target.share:.4g} %{_under(worst.payload)}"
        yield Finding(target.name, "cover", verdict, max(target.share - worst.share, 0.0), text)


def _keep_findings(made: Check, posed: Posed, rules: Sequence[PoseRules]) -> Iterator[Finding]:
    column = 0
    for keep in made.requirements.keeps:
        if keep.when == "always" or not made.requirements.targets:
            worst: list[tuple[float, float, float, str]] = []
            for payload, own in zip(made.payloads, rules, strict=True):
                gamma, judged = replace(own, keeps=(keep,), limits={}).worst_pose()
                inputs = ", ".join(f"{x:.4g}" for x in gamma)
                where = f"in the worst pose found, ({inputs}){_under(payload)}"
                value, excess, error = (float(column[0, 0]) for column in judged)
                worst.append((value, error, excess, where))
            yield _kept(keep, *max(worst), made.arm.length_unit)
            continue
        value, error, excess = (x[..., column] for x in (posed.value, posed.error, posed.excess))
        column += 1
        if not value.size:
            yield Finding(keep.name, keep.kind, "met", 0.0, "counted in what is covered")
            continue
        decides = value if value.max() > 0.0 or (value + error).max() <= 0.0 else value + error
        load, place = _largest(decides)
        most, off = float(value[load, place]), float(error[load, place])
        where = f"at place {place + 1}{_under(made.payloads[load])}"
        yield _kept(keep, most, off, float(excess.max()), where, made.arm.length_unit)


def _kept(
    keep: Keep, value: float, error: float, excess: float, where: str, unit: LengthUnit
) -> Finding:
    close = error if keep.of == "arm" else np.nan
    verdict = "missed" if excess > 0.0 else verdict_of(max(-value, 0.0), error)
    text = f"the {keep.of} has a margin of {unit.text(0.0 - value, error=close)} {where}"
    if excess > 0.0:
        beyond = "outside" if keep.inside else "inside or too near"
        text = f"the {keep.of} is {unit.text(value, error=close)} {beyond} {where}"
    elif not np.isfinite(value):
        text = "no pose to judge"
    return Finding(keep.name, keep.kind, verdict, excess, text)


def _limit_findings(made: Check, posed: Posed, rules: Sequence[PoseRules]) -> Iterator[Finding]:
    for column, (name, most) in enumerate(rules[0].limits.items(), len(rules[0].keeps)):
        values = posed.value[..., column]
        if values.size:
            load, place = _largest(values)
            value = float(values[load, place])
            where = f", at place {place + 1}{_under(made.payloads[load])}"
        elif made.requirements.targets:
            value, where = 0.0, ", counted in what is covered"
        else:
            value, exact = max(each.of_bounds(name) for each in rules)
            where = ", over all bounds" + ", by search" * (not exact)
        yield limit_finding(name, value if np.isfinite(value) else 0.0, most, made.arm, where)
