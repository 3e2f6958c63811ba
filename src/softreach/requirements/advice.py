"""Advice for a place that is missed: bounds that bind, wider ones, a longer arm."""

from __future__ import annotations

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array
from softreach.support.units import LengthUnit

_AT_BOUND = 1e-6  # of the range
_NEWTON_STEPS = 12
_LONGEST_STEP = 0.3  # of the ranges
_WIDEST = 1.0  # ranges by which a bound may move for it to be worth saying
_ARRIVED = 1e-6  # of the length
_ALONG = 0.97  # cosine between what is missing and the tip's direction


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
        name, unit = arm.input_names[k], _unit(arm, int(k))
        for end, bound, sign in (("lower", box.low[k], -1.0), ("upper", box.high[k], 1.0)):
            if abs(gamma[k] - bound) <= _AT_BOUND * box.widths[k] and sign * pull[k] > 0.0:
                texts.append(f"the {end} bound of {name} ({bound:.4g}{unit})")
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
        low = x[0, k] < box.low[k]
        end, bound = ("a lower", box.low[k]) if low else ("an upper", box.high[k])
        value, unit = x[0, k], _unit(arm, int(k))
        name = arm.input_names[k]
        texts.append(f"{end} bound of {name} at {value:.4g} instead of {bound:.4g}{unit}")
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
