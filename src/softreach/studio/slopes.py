"""Change of the reachable volume by each slider of a design, on one scale for all of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import parameters
from softreach.studio import markup
from softreach.studio.reach import Quality, Reach
from softreach.studio.shown_parameters import ShownParameter, slider_parameters
from softreach.studio.widgets import unit_in
from softreach.studio.work import Budget, OverBudget, StaleCheck
from softreach.support.errors import SoftreachError, no_warnings
from softreach.support.parallel import undivided
from softreach.support.quantity import quantity
from softreach.workspace.gradient import gradient_of

PART = 0.01
"""Part of the range of a slider over which the change of the volume is told."""
NO_BAR = markup.bar(0.0, "\N{NO-BREAK SPACE}", "not known yet", faded=True)
"""Room for a bar."""
_FINEST = 1e-3  # [%] of V: more digits tell nobody more


class Slope(NamedTuple):
    """∂V/∂p for one slider, and its error [m³ per unit of the slider]."""

    value: float
    error: float


class VolumeSlopes(NamedTuple):
    """Slopes of all sliders of a design."""

    arm: Manipulator
    volume: float  # [m³]
    slopes: Mapping[str, Slope]
    """By names of parameters; none where there is no volume, or loads tear the set."""


def volume_slopes(reach: Reach, quality: Quality, check: StaleCheck) -> VolumeSlopes:
    """Slopes of a design whose set is known, for as many sliders as can be moved continuously.

    Args:
        reach: Of the design.
        quality: How accurate the set is, and how long its derivatives may take.
        check: Called often; raises to stop.
    """
    arm, solid, known = reach.arm, reach.exact, parameters(reach.arm)
    found = VolumeSlopes(arm, reach.volume, {})
    if solid is None or solid.dimension < 3 or not solid.volume > 0:
        return found
    if solid.lost_share or solid.is_torn:
        return found  # what remains are differences between neighbors, which take minutes
    sliders = slider_parameters(arm)
    scale = {each.name: each.scale for each in sliders if not known[each.name].whole}
    budget, slopes = Budget(check, quality.most_seconds), dict[str, Slope]()
    groups = [tuple(scale)] if scale else []
    while groups:
        names = groups.pop()
        try:
            budget()
            with no_warnings(), undivided():  # other cores are for who moves a slider
                gradient = gradient_of(solid, names, quality.fine_accuracy, budget)
        except SoftreachError:  # of one of them, such as a bound at which a bundle is held
            groups += [(name,) for name in names if len(names) > 1]
        except (OverBudget, MemoryError):
            break
        else:
            for name, *row in zip(names, gradient.volume, gradient.volume_error, strict=True):
                slopes[name] = Slope(*(float(value) * scale[name] for value in row))
    return found._replace(slopes=slopes)


def slope_bars(
    found: VolumeSlopes, sliders: Mapping[str, tuple[ShownParameter, float]], *, old: bool
) -> dict[str, str]:
    """A bar for each slider as HTML: by how much V changes over `PART` of its range.

    Args:
        found: Slopes of a design.
        sliders: By names of parameters, with their ranges.
        old: Whether they are of the design before.
    """
    part = {name: PART * ends for name, (_, ends) in sliders.items() if name in found.slopes}
    changes = {
        name: 100 * step / found.volume * found.slopes[name].value for name, step in part.items()
    }
    most, unit = max(map(abs, changes.values()), default=0.0) or 1.0, found.arm.length_unit
    bars = {}
    for name, change in changes.items():
        slope, label = found.slopes[name], unit_in(sliders[name][0].label)
        error = 100 * part[name] / found.volume * slope.error
        text = quantity(change, "%", max(error, _FINEST))
        text = f"+{text}" if change > 0 else text.replace("-", "\N{MINUS SIGN}")
        per = f"{unit.symbol(3)} per {label}" if label else unit.symbol(3)
        own = slope.error / unit.scale(3) if math.isfinite(slope.error) else math.nan
        meaning = (
            f"{'of the design before; ' if old else ''}change of V over one hundredth of this "
            f"slider, {f'{part[name]:.3g} {label}'.rstrip()}; "
            f"∂V/∂({name}) = {quantity(slope.value / unit.scale(3), per, own)}"
        )
        bars[name] = markup.bar(change / most, text, meaning, faded=old)
    return bars
