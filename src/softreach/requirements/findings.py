"""Findings about a design: what it misses and by how much, proofs made at once, its numbers."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from softreach.arm.body import load_number, mass
from softreach.arm.driving import inner_arm
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.tables import ends_over, quadrature, tables
from softreach.atlas.metrics import Intermediates, Need, known_metric
from softreach.requirements.parts import LIMIT_UNITS
from softreach.requirements.requirements import Requirements, with_payload
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.support.arguments import as_instance
from softreach.support.arrays import Array
from softreach.support.errors import no_warnings
from softreach.support.quantity import quantity
from softreach.support.units import LengthUnit
from softreach.workspace import ReachableSet

Verdict = Literal["met", "missed", "undecided"]  # Undecided: the margin is below its error

_SAMPLES, _FEWER = 2**15, 8
"""Samples of clouds, and how many times fewer another has, which is farther off by as much at least
as this one is: errors of extents and hulls fall with the cube root of their number or faster."""
_PIECES = 8
_ROUNDING = 1e-9
_WORDS = {"load_number": "load number", "bending": "bending κR2"}
_AT_BOUND = 1e-6  # of the range
_NEWTON_STEPS = 12
_LONGEST_STEP = 0.3  # of the ranges
_WIDEST = 1.0  # ranges by which a bound may move for it to be worth saying
_ARRIVED = 1e-6  # of the length
_ALONG = 0.97  # cosine between what is missing and the tip's direction


@dataclass(frozen=True)
class Finding:
    """One requirement: met, missed or undecided, and by how much."""

    name: str
    """The target, region, limit or measure."""
    kind: str
    """"reach", "cover", "stay_inside", "avoid", "limit" or "measure"."""
    verdict: Verdict
    """"met", "missed" or "undecided"."""
    excess: float
    """0 where it is met; else gaps and distances over L, angles beyond cones [rad], and limits by
    their share [-]. Where it is undecided, what is missed if there were no error."""
    text: str
    """The finding in words, with units."""

    @property
    def met(self) -> bool:
        """True where it is met by more than the error."""
        return self.verdict == "met"

    @property
    def word(self) -> str:
        """The verdict, large where it is not "met"."""
        return self.verdict if self.met else self.verdict.upper()

    def __str__(self) -> str:
        return f"{self.word}  {self.name}: {self.text}"


def verdict_of(margin: float, error: float = 0.0) -> Verdict:
    """Met by a margin of 0 or more, missed by one below; undecided where its error is larger."""
    if abs(margin) < error:
        return "undecided"
    return "met" if margin >= 0.0 else "missed"


def share_error(share: Any, count: int) -> Any:
    """Standard error of a share of so many; of 0 or 1, what one more or less makes of it."""
    return np.sqrt(np.maximum(share * (1.0 - share), 1.0 / count) / count)


def quick_excess(arm: Manipulator, requirements: Requirements) -> tuple[Finding, ...]:
    """Proved lower bounds of what a design misses, in a few milliseconds; `check` finds no less.

    Places farther from the base than the longest arm that its bounds allow, ∫ max ζ dZ, as long as
    nothing loads it; limits that follow from the design alone. Nothing in it says that a
    requirement is met.

    Args:
        arm: The design.
        requirements: The requirements.

    Returns:
        What is missed, with lower bounds of the excess; empty where nothing is proved.
    """
    arm = a_manipulator("arm", arm)
    needs = as_instance("requirements", requirements, Requirements, "Requirements")
    return (*_too_far(arm, needs), *(f for f in design_limits(arm, needs) if not f.met))


def _too_far(arm: Manipulator, needs: Requirements) -> Iterator[Finding]:
    if arm.loads is not None or any(needs.payloads) or not needs.targets:
        return
    inner = inner_arm(arm)
    z, weights, _ = quadrature(inner, _PIECES)
    most = ends_over(tables(inner, z).extension, inner.bounds)[:, 1]
    longest = float(weights @ (1.0 + most)) * (1.0 + 1e-6)  # more than the error of the quadrature
    for target in needs.targets:
        room, text = longest + target.within, "farther from the base than the arm is ever long"
        if target.region is None:
            away = np.linalg.norm(target.points - arm.base.position, axis=1)
            gap = float(away.max()) - room
            kind, excess = "reach", gap / arm.length
            text = f"{arm.length_unit.text(gap)} {text}"
        else:
            gap = float(target.region.distance([arm.base.position])[0]) - room
            kind, excess = "cover", target.share
        if gap > 1e-6 * arm.length:
            yield Finding(target.name, kind, "missed", excess, text)


def limit_finding(name: str, value: float, most: float, arm: Manipulator, where: str) -> Finding:
    """A limit against its value."""

    def text(x: float) -> str:
        if name in ("actuators", "shortening"):
            return f"{x:g}" if name == "actuators" else f"{100 * x:.3g} %"
        symbol = LIMIT_UNITS[name]
        return arm.length_unit.text(x) if symbol == "m" else f"{x:.4g} {symbol}".strip()

    excess = max(value - most, 0.0) / (most or 1.0)
    excess = excess if excess > _ROUNDING else 0.0
    said = f"{text(value)} of at most {text(most)}{where}"
    return Finding(_WORDS.get(name, name), "limit", verdict_of(-excess), excess, said)


def design_limits(arm: Manipulator, needs: Requirements) -> Iterator[Finding]:
    """Limits that follow from the design alone."""
    heaviest = max(needs.payloads, default=None)
    movable = int(np.less(*arm.input_bounds.T).sum())
    numbers: dict[str, Callable[[], float]] = {"actuators": lambda: movable}
    numbers["mass"] = lambda: mass(arm)
    numbers["load_number"] = lambda: load_number(with_payload(arm, heaviest))
    for name, value in numbers.items():
        if name in needs.limits.given:
            yield limit_finding(name, value(), needs.limits.given[name], arm, "")


def measure_findings(
    arm: Manipulator, needs: Requirements, accuracy: float, known: Callable[[], ReachableSet]
) -> Iterator[Finding]:
    """Measures against their least and largest values, of the design with its own loads."""
    if not needs.measures:
        return
    metrics = [metric for name in needs.measures if (metric := known_metric(name))]
    if any(Need.REACHABLE_SET in metric.needs for metric in metrics):
        known()  # with its warnings
    with no_warnings():
        counts = (_SAMPLES, _SAMPLES // _FEWER)
        fine, coarse = (Intermediates.of_one(arm, count, accuracy, known) for count in counts)
        for metric in metrics:
            value, name = float(metric.value(fine, {})), metric.name
            if Need.REACHABLE_SET in metric.needs:  # of which 0 stands for no error that is known
                size = known().volume if name == "multiplicity" else 1.0
                own = "multiplicity" if name == "multiple_volume" else name.removeprefix("exact_")
                error = getattr(known(), f"{own}_error", 0.0) / size
            else:
                error = abs(value - float(metric.value(coarse, {})))
            error = float(np.nan_to_num(error))
            yield _measure(name, metric.unit, value, error, needs.measures[name])


def _measure(
    name: str, unit: str, value: float, error: float, ends: tuple[float | None, float | None]
) -> Finding:
    texts, margin, excess = [], np.inf, 0.0
    for words, end, sign in zip(("at least", "at most"), ends, (1.0, -1.0), strict=True):
        if end is not None:
            texts.append(f"{words} {end:.6g} {unit}".removesuffix(" 1"))
            own, size = sign * (value - end), abs(end) or 1.0
            margin = min(margin, own if own < -_ROUNDING * size else max(own, 0.0))
            excess = max(excess, -own / size)
    if np.isnan(value):
        margin, excess = -np.inf, 1.0
    excess = excess if excess > _ROUNDING else 0.0
    shown = quantity(value, "" if unit == "1" else unit, error)
    text = f"{shown}, {' and '.join(texts) or 'anything allowed'}"
    return Finding(name, "measure", verdict_of(margin, error), excess, text)


def advice(arm: Manipulator, place: Array, gamma: Array, unit: LengthUnit) -> str:
    """Sentences on what keeps the tip from a place [m], and what would bring it there.

    `gamma` are the inputs of the nearest pose, shape (inputs,).
    """
    rod = as_tip_map(arm)
    tip, slope = (each[0] for each in rod.tips_and_slopes(gamma[None]))
    if not np.isfinite(tip).all():
        return ""
    near = ", ".join(f"{x / unit.size:.4g}" for x in tip)
    texts = [f"nearest ({near}) {unit.name}"]
    if binding := _binding(arm, rod, gamma, slope, place - tip):
        texts.append(f"held back by {', '.join(binding)}")
    if wider := _wider(arm, rod, gamma, place):
        texts.append(f"it would take {' and '.join(wider)}")
    elif longer := _longer(rod, gamma, place - tip):
        texts.append(f"it would take an arm longer by about {longer / unit.size:.3g} {unit.name}")
    return "; " + "; ".join(texts)


def _binding(arm: Manipulator, rod: TipMap, gamma: Array, slope: Array, miss: Array) -> list[str]:
    """Bounds beyond which the tip would come nearer."""
    box, pull = rod.box, miss @ slope
    texts = []
    for k in box.free:
        for end, bound, sign in (("lower", box.low[k], -1.0), ("upper", box.high[k], 1.0)):
            if abs(gamma[k] - bound) <= _AT_BOUND * box.widths[k] and sign * pull[k] > 0.0:
                at = f"{bound:.4g}{_unit(arm, int(k))}"
                texts.append(f"the {end} bound of {arm.input_names[k]} ({at})")
    return texts


def _wider(arm: Manipulator, rod: TipMap, gamma: Array, place: Array) -> list[str]:
    """Bounds that lead to the place by Newton's method; empty where it does not arrive."""
    box, x = rod.box, gamma[None].copy()
    for _ in range(_NEWTON_STEPS):
        tips, slopes = rod.tips_and_slopes(x)
        miss = place - tips[0]
        if not (np.isfinite(miss).all() and np.isfinite(slopes).all()):
            return []
        if np.linalg.norm(miss) <= _ARRIVED * rod.length:
            break
        scales = np.where(box.is_free, box.scales, 0.0)
        step = np.linalg.pinv(slopes[0] * scales, rcond=1e-3) @ miss
        size = float(np.abs(step).max(initial=0.0))
        x = x + scales * (step * min(1.0, _LONGEST_STEP / max(size, 1e-300)))
        if box.excess(x).max() > _WIDEST or not rod.has_arm(x).all():
            return []
    else:
        return []
    texts = []
    for k in np.flatnonzero(box.excess(x)[0] > _AT_BOUND):
        low, unit = x[0, k] < box.low[k], _unit(arm, int(k))
        end, bound = ("a lower", box.low[k]) if low else ("an upper", box.high[k])
        name = f"{end} bound of {arm.input_names[k]}"
        texts.append(f"{name} at {x[0, k]:.4g} instead of {bound:.4g}{unit}")
    return texts


def _longer(rod: TipMap, gamma: Array, miss: Array) -> float:
    """Length [m] to be added at the tip where that leads straight to the place; else 0."""
    direction = rod.tip_directions(gamma[None])[0]
    gap = float(np.linalg.norm(miss))
    if not gap or float(miss @ direction) < _ALONG * gap:
        return 0.0
    extension = float(rod.strains(gamma[None], [rod.length]).extension[0, 0])
    return gap / extension


def _unit(arm: Manipulator, k: int) -> str:
    unit = arm.input_units[k]
    return "" if unit == "1" else f" {unit}"
