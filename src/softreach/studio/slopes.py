"""Change of the reachable volume by each slider of a design, on one scale for all of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
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
from softreach.support.units import LengthUnit
from softreach.workspace import ReachableSolid
from softreach.workspace.gradient import gradient_of

__all__ = ["NO_BAR", "PART", "Slope", "VolumeSlopes", "slope_bars", "volume_slopes"]

PART = 0.01
"""Part of the range of a slider over which the change of the volume is told."""
NO_BAR = markup.bar(0.0, "\N{NO-BREAK SPACE}", "not known yet", faded=True)
"""Room for a bar."""
_FINEST = 1e-3  # [%] of V: more digits tell nobody more


class Slope(NamedTuple):
    """∂V/∂p for one slider."""

    value: float
    """[m³] per unit of the slider."""
    error: float
    """Its error, likewise."""


class VolumeSlopes(NamedTuple):
    """Slopes of all sliders of a design."""

    arm: Manipulator
    volume: float
    """[m³]."""
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
    if (
        not isinstance(solid, ReachableSolid)
        or solid.lost_share
        or solid.is_torn
        or not solid.volume > 0
    ):
        return found  # what remains are differences between neighbors, which take minutes
    scale = {
        slider.name: slider.scale
        for slider in slider_parameters(arm)
        if not known[slider.name].whole
    }

    budget = Budget(check, quality.most_seconds)

    def slopes_by(*names: str) -> dict[str, Slope]:
        budget()
        with no_warnings(), undivided():  # other cores are for who moves a slider
            gradient = gradient_of(solid, names, quality.fine_accuracy, budget)
        rows = zip(names, gradient.volume, gradient.volume_error, strict=True)
        return {
            name: Slope(float(value) * scale[name], float(error) * scale[name])
            for name, value, error in rows
        }

    try:
        return found._replace(slopes=slopes_by(*scale) if scale else {})
    except SoftreachError:  # one of them, such as a bound at which a bundle is held
        return found._replace(slopes=_one_by_one(slopes_by, scale))
    except (OverBudget, MemoryError):
        return found


def _one_by_one(
    slopes_by: Callable[[str], dict[str, Slope]], names: Iterable[str]
) -> dict[str, Slope]:
    slopes = dict[str, Slope]()
    for name in names:
        try:
            slopes |= slopes_by(name)
        except SoftreachError:
            continue
        except (OverBudget, MemoryError):
            break
    return slopes


def slope_bars(
    found: VolumeSlopes, sliders: Mapping[str, tuple[ShownParameter, float]], *, old: bool
) -> dict[str, str]:
    """A bar for each slider as HTML: by how much V changes over `PART` of its range.

    Args:
        found: Slopes of a design.
        sliders: By names of parameters, with their ranges.
        old: Whether they are of the design before.
    """
    changes = {
        name: (100 * PART * ends / found.volume) * found.slopes[name].value
        for name, (_, ends) in sliders.items()
        if name in found.slopes
    }
    most = max(map(abs, changes.values()), default=0.0) or 1.0
    return {
        name: markup.bar(
            change / most,
            _change_text(change, found.slopes[name], found.volume, sliders[name][1]),
            _meaning(found.slopes[name], *sliders[name], found.arm.length_unit, old=old),
            faded=old,
        )
        for name, change in changes.items()
    }


def _change_text(change: float, slope: Slope, volume: float, ends: float) -> str:
    error = 100 * PART * ends / volume * slope.error
    text = quantity(change, "%", max(error, _FINEST))
    return f"+{text}" if change > 0 else text.replace("-", "\N{MINUS SIGN}")


def _meaning(
    slope: Slope, slider: ShownParameter, ends: float, lengths: LengthUnit, *, old: bool
) -> str:
    unit, volumes = unit_in(slider.label), lengths.symbol(3)
    per = f"{volumes} per {unit}" if unit else volumes
    step = f"{PART * ends:.3g} {unit}".rstrip()
    before = "of the design before; " if old else ""
    error = slope.error if math.isfinite(slope.error) else math.nan
    value, error = slope.value / lengths.scale(3), error / lengths.scale(3)
    return (
        f"{before}change of V over one hundredth of this slider, {step}; "
        f"∂V/∂({slider.name}) = {quantity(value, per, error)}"
    )
