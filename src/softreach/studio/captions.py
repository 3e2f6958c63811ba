"""Captions: the numbers of a reach, the legend of its marks, the place of a tip, as text."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.plot.coloring import UNSTABLE
from softreach.rod.tip_map import TipStatus
from softreach.studio.found import Found
from softreach.studio.markup import Bad, Part, Swatch, Term
from softreach.studio.reach import Reach, Size
from softreach.studio.scene.colors import FAINT
from softreach.studio.state import StudioState

UNREACHABILITY = "UNR [%]: share of the convex hull of all tips that no activation reaches"
_ABOUT_SIZE = "Volume, area or length of all places that the tip reaches, its error beside it"
_FINEST = 1e-6  # [L^power]: the error of a size that is told at least
_GAP = "\N{EN SPACE} "
_MARKS = {
    TipStatus.UNSTABLE: " unstable: {} of the samples",
    TipStatus.SNAPS: "snaps on the way, not shown: {}",
    TipStatus.NO_EQUILIBRIUM: "no equilibrium, not shown: {}",
    TipStatus.UNDECIDED: "undecided, not shown: {}",
}
_POSTURES = {
    TipStatus.STABLE: "a stable equilibrium",
    TipStatus.UNSTABLE: "an unstable equilibrium: a real arm leaves it",
    TipStatus.NO_EQUILIBRIUM: "the loads shorten the arm to nothing: it is not drawn",
    TipStatus.UNDECIDED: "the search for an equilibrium gave up: the arm is not drawn",
    TipStatus.SNAPS: "the arm snaps on the way from rest to here: it is not drawn",
}


def size_text(size: Size, arm: Manipulator) -> str:
    """Size with its error in the unit of the arm, to the first digit of the error."""
    if size.power == 0:
        return size.name
    text = arm.length_unit.text(size.value, size.power, told_error(size, arm))
    return f"{size.name} {text}"


def told_error(size: Size, arm: Manipulator) -> float:
    """Error of a size as it is told: no smaller than a millionth of L, L² or L³."""
    return max(size.error, _FINEST * arm.length**size.power)


def place_text(place: Iterable[float], arm: Manipulator, decimals: int = 4) -> str:
    """A place [L] in the unit of the arm, to so many digits of L after the point."""
    unit = arm.length_unit
    scale = arm.length / unit.size
    digits = max(0, decimals - math.floor(math.log10(scale * (1 + 1e-9))))
    return f"({', '.join(f'{scale * x + 0.0:.{digits}f}' for x in place)}) {unit.name}"


def reach_text(reach: Reach, share: str = "") -> list[Part]:
    """The numbers of a reach in one line; `share` says how its size compares with another."""
    parts: list[Part] = []
    if reach.size is not None:
        parts += [Term(size_text(reach.size, reach.arm), _ABOUT_SIZE), f"{share} · "]
    if not math.isnan(reach.unreachability):
        parts += [Term(f"UNR {100 * reach.unreachability:.2f} %", UNREACHABILITY), " · "]
    if reach.exact is not None and reach.exact.lost_share:
        parts.append(f"{_percent(reach.exact.lost_share)} of the activations left out · ")
    parts.append(f"{reach.samples:,} samples")
    if reach.fine and reach.samples < reach.wanted:
        parts.append(f" of {reach.wanted:,}")
    return parts


def legend_text(reach: Reach, *, free: bool) -> list[Part]:
    """Legend of the marks: how many samples of a loaded arm have each, or are left out."""
    if reach.arm.loads is None:
        return []
    parts: list[Part] = []
    for status, words in _MARKS.items():
        if share := reach.share(status):
            marked = [Swatch(UNSTABLE)] if status == TipStatus.UNSTABLE else []
            parts += [*marked, f"{words.format(_percent(share))} {_GAP}"]
    if not parts:
        parts.append(f"every sample rests in a stable equilibrium {_GAP}")
    return [*parts, Swatch(FAINT), " without loads"] if free else parts


def loaded_share(found: Found, design: Manipulator) -> str:
    """Share of the reach without loads that is left; nothing for an arm without loads."""
    reach, free = found.reach, found.free
    if reach is None or reach.arm.loads is None or reach.arm != design or free is None:
        return ""
    if reach.size is None or free.size is None or free.size.value <= 0:
        return ""
    share = f"{100 * reach.size.value / free.size.value:.0f} %"
    whole = design.length_unit.rounded(free.size.value, free.size.power)
    return f" under loads, {share} of {whole} without"


def tip_text(state: StudioState, found: Found) -> list[Part]:
    """Place and direction of the tip, and whether a loaded arm rests there."""
    texts = []
    if found.tip is not None:
        place = place_text(found.tip, state.design, 6)
        pointing = ", ".join(f"{x + 0.0:.3f}" for x in np.round(found.pointing, 3))
        texts.append(f"tip at {place}, pointing along ({pointing})")
    if found.posture is not None:
        texts.append(_POSTURES[found.posture])
    return [" · ".join(texts)] if texts else []


def clearance_text(state: StudioState, found: Found) -> list[Part]:
    """The clearance of the arm as it is, in red where it is too near to something."""
    near, unit = found.clearance, state.design.length_unit
    if near is None or not math.isfinite(near.value):
        return [f"No clearance: {near.refusal}."] if near is not None and near.refusal else []
    where = f"{near.name} at Z = {unit.rounded(near.station, digits='.3g')}"
    if near.value > 0.0:
        return [f"clearance {unit.rounded(near.value, digits='.3g')} from {where}"]
    return [Bad(f"clearance {unit.rounded(near.value, digits='.3g')}: too near to {where}")]


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"
