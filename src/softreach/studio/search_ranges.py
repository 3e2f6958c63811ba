"""Free numbers of a search as they are typed, with ranges in the units of the sliders."""

from __future__ import annotations

from typing import Any

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import find_parameter
from softreach.studio.shown_parameters import ShownParameter, named_parameters, slider_parameters
from softreach.studio.widgets import number_of
from softreach.support.errors import InvalidInput

__all__ = ["ranges_of", "slider_range"]

_INSET = 0.01  # of a slider, from an end that the parameter may not be at


def ranges_of(text: str, arm: Manipulator) -> dict[str, Any]:
    """Parameter -> range in its SI unit, or text that ties it to another.

    Args:
        text: Parts such as "taper = 0:3", "taper" for the range of its slider, and
            "right.revolution = -left.revolution", separated by commas.
        arm: The design.

    Raises:
        InvalidInput: A range of other than two numbers, or none for what has no slider.
    """
    sliders = {slider.name: slider for slider in slider_parameters(arm)}
    known = {**{each.name: each for each in named_parameters(arm)}, **sliders}
    ranges: dict[str, Any] = {}
    for part in (part.strip() for part in text.split(",")):
        if not part:
            continue
        name, _, ends = (word.strip() for word in part.partition("="))
        if name in ranges:
            raise InvalidInput("free", name, "given once")
        if not ends and name in sliders:
            ends = slider_range(arm, name)
        if not ends and name in known:
            raise InvalidInput("free", name, f"with a range, such as {name} = 0:1")
        ranges[name] = _ends(name, ends, known.get(name)) if ":" in ends or not ends else ends
    return ranges


def _ends(name: str, text: str, shown: ShownParameter | None) -> tuple[float, float]:
    low, _, high = text.partition(":")
    ends = number_of(low or "0"), number_of(high or "1")
    if ends[0] is None or ends[1] is None:
        raise InvalidInput(f"free {name}", repr(text), "a range such as 0:3")
    scale = 1.0 if shown is None else shown.scale
    return ends[0] * scale, ends[1] * scale


def slider_range(arm: Manipulator, name: str) -> str:
    """The range of a slider as it is typed, a little narrower where its ends are not allowed."""
    slider = next(each for each in slider_parameters(arm) if each.name == name)
    allowed = find_parameter(arm, name).range._replace(whole=False)
    low, high = slider.limits
    inset = _INSET * (high - low)
    low, high = max(low, allowed.low / slider.scale), min(high, allowed.high / slider.scale)
    low += inset * (not allowed.admits(low * slider.scale))
    high -= inset * (not allowed.admits(high * slider.scale))
    return f"{low:.6g}:{high:.6g}"
