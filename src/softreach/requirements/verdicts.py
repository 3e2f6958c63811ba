"""Findings of a check: what is met or missed at all places, in words and by how much."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from softreach.requirements.advice import advice
from softreach.requirements.check_result import TOL, Check
from softreach.requirements.chosen_poses import Posed
from softreach.requirements.findings import (
    Finding,
    design_limits,
    limit_finding,
    places_text,
    verdict_of,
)
from softreach.requirements.parts import Keep
from softreach.requirements.poses import PoseRules, worst_pose
from softreach.rod.bending import bending_over_bounds
from softreach.support.arrays import Array
from softreach.support.units import LengthUnit

__all__ = ["verdicts"]


def verdicts(made: Check, posed: Posed, rules: Sequence[PoseRules]) -> Iterator[Finding]:
    """Targets, regions and limits, each met or missed.

    Args:
        made: The check, whose findings these become.
        posed: Poses under all payloads, stacked along a first axis.
        rules: Rules of poses under each payload.
    """
    yield from _reach_findings(made, rules)
    yield from _cover_findings(made)
    yield from _keep_findings(made, posed, rules)
    yield from _limit_findings(made, posed, rules)


def _under(payload: float | None) -> str:
    return "" if payload is None else f" with {payload:.4g} kg"


def _reach_findings(made: Check, rules: Sequence[PoseRules]) -> Iterator[Finding]:
    length, unit = made.arm.length, made.arm.length_unit
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
            text = f"{met} reached{near}, effort up to {effort:.3g}"
            yield Finding(target.name, "reach", "met", 0.0, text)
            continue
        gap, number = float(gaps[load, place]), int(np.flatnonzero(own)[place])
        excess = max(gap - target.within, TOL * length) / length
        where = ", ".join(f"{x / unit.size:.4g}" for x in target.places[place])
        text = f"{met} reached; place {place + 1} at ({where}) {unit.name}"
        more, laden = "", _under(made.payloads[load])
        away = float(np.linalg.norm(target.places[place] - made.arm.base.position))
        if gap > length + away - 1e-9:
            text += f" is not held{laden}: no stable equilibrium"
        else:
            text += f" is missed by {_length(gap - target.within, unit)}{laden}"
            pose = made.poses[load, number]
            more = advice(rules[int(load)].arm, target.places[place], pose, unit)
        pairs = zip(made.payloads, reached, strict=True)
        held = [payload for payload, row in pairs if payload is not None and row.all()]
        if held:
            more += f"; all reached with {max(held):.4g} kg"
        yield Finding(target.name, "reach", "missed", excess, text + more)


def _length(value: float, unit: LengthUnit, digits: int = 4) -> str:
    return f"{value / unit.size + 0.0:.{digits}g} {unit.name}"  # + 0.0: no minus before 0


def _cover_findings(made: Check) -> Iterator[Finding]:
    for target in made.requirements.targets:
        if target.region is None:
            continue
        own = [each for each in made.coverages if each.name == target.name]
        worst = min(own, key=lambda each: each.share)
        # Where every place is reached that was tried, no share is left to be in doubt.
        error = worst.error if worst.share < 1.0 else 0.0
        verdict = verdict_of(worst.share - target.share, error)
        text = (
            f"{100 * worst.share:.2f} ± {100 * worst.error:.2g} % covered of at least "
            f"{100 * target.share:.4g} %{_under(worst.payload)}"
        )
        yield Finding(target.name, "cover", verdict, max(target.share - worst.share, 0.0), text)


def _keep_findings(made: Check, posed: Posed, rules: Sequence[PoseRules]) -> Iterator[Finding]:
    at_targets = bool(made.requirements.targets)
    column = 0
    for keep in made.requirements.keeps:
        if keep.when == "targets" and at_targets:
            values = posed.value[..., column], posed.error[..., column]
            excess = posed.excess[..., column]
            column += 1
            yield _kept_at_targets(made, keep, *values, excess)
        else:
            yield _kept_always(made, keep, rules)


def _kept_at_targets(made: Check, keep: Keep, value: Array, error: Array, excess: Array) -> Finding:
    unit = made.arm.length_unit
    if not value.size:
        return Finding(keep.name, keep.kind, "met", 0.0, "counted in what is covered")
    decides = value if value.max() > 0.0 or (value + error).max() <= 0.0 else value + error
    load, place = np.unravel_index(int(decides.argmax()), value.shape)
    where = f"at place {place + 1}{_under(made.payloads[load])}"
    most, off = float(value[load, place]), float(error[load, place])
    return _kept(keep, most, off, float(excess.max()), where, unit)


def _kept_always(made: Check, keep: Keep, rules: Sequence[PoseRules]) -> Finding:
    """A region that every pose must keep to, by a search for the worst."""
    worst: list[tuple[float, float, float, str]] = []
    for payload, own in zip(made.payloads, rules, strict=True):
        gamma, judged = worst_pose(replace(own, keeps=(keep,), limits={}))
        inputs = ", ".join(f"{x:.4g}" for x in gamma)
        where = f"in the worst pose found, ({inputs}){_under(payload)}"
        value, excess, error = (float(column[0, 0]) for column in judged)
        worst.append((value, error, excess, where))
    value, error, excess, where = max(worst)
    return _kept(keep, value, error, excess, where, made.arm.length_unit)


def _kept(
    keep: Keep, value: float, error: float, excess: float, where: str, unit: LengthUnit
) -> Finding:
    """Distance by which a region is missed, or kept to."""
    of = "the tip" if keep.of == "tip" else "the arm"
    close = f" (to {_length(error, unit, 2)})" if keep.of == "arm" else ""
    verdict = "missed" if excess > 0.0 else verdict_of(max(-value, 0.0), error)
    if excess > 0.0:
        beyond = "outside" if keep.inside else "inside or too near"
        text = f"{of} is {_length(value, unit)}{close} {beyond} {where}"
    elif not np.isfinite(value):
        text = "no pose to judge"
    else:
        text = f"{of} keeps {_length(-value, unit)}{close} to spare {where}"
    return Finding(keep.name, keep.kind, verdict, excess, text)


def _limit_findings(made: Check, posed: Posed, rules: Sequence[PoseRules]) -> Iterator[Finding]:
    needs = made.requirements
    yield from design_limits(made.arm, needs)
    for column, (name, most) in enumerate(rules[0].limits.items(), len(rules[0].keeps)):
        values = posed.value[..., column]
        if values.size:
            load, place = np.unravel_index(int(values.argmax()), values.shape)
            value = float(values[load, place])
            where = f", at place {place + 1}{_under(made.payloads[load])}"
        elif needs.targets:
            value, where = 0.0, ", counted in what is covered"
        elif name == "bending":
            bending = [bending_over_bounds(each.arm) for each in rules]
            value = max(each.sharpest.value for each in bending)
            where = ", over all bounds" + ", by search" * (not bending[0].exact)
        else:
            value = max(each.of_bounds(name) for each in rules)
            where = ", over all bounds, by search"
        yield limit_finding(name, value if np.isfinite(value) else 0.0, most, made.arm, where)
