"""The sliders of a design: its parameters in the units that a person reads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

from softreach.arm.file import in_file_terms
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import Parameter, parameters
from softreach.support.errors import Fault, InvalidDesign, Range

__all__ = ["Control", "Shown", "controls", "hint", "refusal"]

_DEG = math.radians(1)


class Control(NamedTuple):
    """One slider."""

    name: str
    """Of the parameter."""
    label: str
    value: float
    """In the unit of the parameter."""
    low: float
    """In the unit that is shown, like all that follow."""
    high: float
    step: float
    scale: float
    """Units of the parameter per shown unit."""
    hint: str = ""
    """Symbol, unit and meaning."""

    @property
    def shown(self) -> float:
        """The value on the slider."""
        return float(f"{self.value / self.scale:.12g}")

    @property
    def limits(self) -> tuple[float, float]:
        """Ends of the slider: wide enough for a design from a file."""
        return min(self.low, self.shown), max(self.high, self.shown)


class _Slider(NamedTuple):
    label: str
    low: float
    high: float
    step: float


_OF_ARM = {
    "revolution": _Slider("revolution Ω [deg]", 1, 360, 1),
    "taper": _Slider("taper φ [deg]", -2, 5, 0.05),
    "radius_ratio": _Slider("inner / outer radius", 0, 1, 0.01),
    "outer_radius": _Slider("outer radius / L", 0.02, 0.12, 5e-4),
    "extent": _Slider("extent σ [deg]", 2, 120, 1),
    "lower": _Slider("lowest γ", -4, 0, 0.01),
    "upper": _Slider("highest γ", -1, 2, 0.01),
}
_OF_PART = {
    "bundles": _Slider("bundles of {owner}", 1, 6, 1),
    "offset": _Slider("offset of {owner} [deg]", 0, 360, 1),
    "distance_ratio": _Slider("distance of {owner} / outer radius", 0, 1, 0.01),
    "radius_ratio": _Slider("radius of {owner} / outer radius", 0.01, 0.5, 0.005),
}
_AROUND_VALUE = ("lower", "upper", "young_modulus")
"""Fields of any magnitude: their sliders end at multiples of what the design has."""


@lru_cache(maxsize=16)
def controls(arm: Manipulator) -> tuple[Control, ...]:
    """The sliders of a design, those of the whole arm first.

    What the design leaves open, such as a modulus that cancels, has none.
    """
    known = parameters(arm)
    found: list[Control] = []
    for owner in dict.fromkeys(one.owner for one in known.values()):
        for field in dict.fromkeys((*(_OF_PART if owner else _OF_ARM), *_AROUND_VALUE)):
            one = known.get(f"{owner}.{field}" if owner else field)
            if one is not None and _is_offered(arm, known, one):
                slider = _slider(one, one.value(arm))
                found += [_control(arm, one, slider)] if slider else []
    return tuple(found)


def _slider(one: Parameter, value: float) -> _Slider | None:
    """Ends and label; None for what the design leaves open, or for a zero of unknown size."""
    fixed = (_OF_PART if one.owner else _OF_ARM).get(one.field)
    outside_arm = one.field == "distance_ratio" and value > 1
    if fixed and one.unit in ("1", "rad", "m") and not outside_arm:
        return fixed if math.isfinite(value) else None
    return None if value == 0 or math.isnan(value) else _around(one, value)


def _around(one: Parameter, value: float) -> _Slider:
    """From zero, or near it where it is not allowed, to twice the value."""
    owner = f" of {one.owner.removesuffix('.material')}" if one.owner else ""
    unit = f" [{one.unit}]" if one.unit != "1" else ""
    ends = (0.01 if one.field == "young_modulus" else 0.0) * value, 2 * value
    return _Slider(f"{one.symbol}{owner}{unit}", min(ends), max(ends), abs(value) / 100)


def _is_offered(arm: Manipulator, known: Mapping[str, Parameter], one: Parameter) -> bool:
    """Whether it changes this arm, and no other slider does the same.

    Only what is helical has a revolution to change; only what is not, its number of bundles.
    """
    if one.owner and one.field in ("lower", "upper"):
        return one.field not in known
    if one.field == "revolution":
        return one.value(arm) != 0
    turn = known.get(f"{one.owner}.revolution")
    return one.field != "bundles" or turn is None or turn.value(arm) == 0


def _control(arm: Manipulator, parameter: Parameter, slider: _Slider) -> Control:
    return Control(
        name=parameter.name,
        label=slider.label.replace("{owner}", parameter.owner),
        value=parameter.value(arm),
        low=slider.low,
        high=slider.high,
        step=slider.step,
        scale={"rad": _DEG, "m": arm.length}.get(parameter.unit, 1.0),
        hint=hint(parameter, _SHOWN_UNITS.get(parameter.unit, parameter.unit)),
    )


def hint(parameter: Parameter, unit: str) -> str:
    """Symbol, unit and meaning of a parameter, and what sweeps call it.

    Args:
        parameter: What is explained.
        unit: That it is shown in; "1" for none.
    """
    what = f"{parameter.symbol} [{unit}]" if unit != "1" else parameter.symbol
    more = f"; {_MORE[parameter.field]}" if parameter.field in _MORE else ""
    return f"{what}: {parameter.meaning}{more} (parameter {parameter.name})"


class Shown(NamedTuple):
    """How a parameter appears in a panel."""

    label: str
    scale: float
    """Units of the parameter per shown unit."""


def refusal(error: InvalidDesign, shown: Mapping[str, Shown]) -> str:
    """What is wrong with a design, each number by the label and in the unit of its field.

    Args:
        error: What is wrong.
        shown: The fields of a panel by the parameters that they are for.
    """
    return "\n".join(_line(fault, shown.get(fault.path)) for fault in error.faults)


def _line(fault: Fault, control: Shown | None) -> str:
    if control is None or not isinstance(fault.value, int | float):
        return str(in_file_terms(InvalidDesign([fault]), ""))
    allowed = fault.allowed
    if isinstance(allowed, Range):
        scaled = {end: getattr(allowed, end) / control.scale for end in ("low", "high")}
        allowed = allowed._replace(unit="", **scaled)
    return str(Fault(control.label, fault.value / control.scale, allowed))


_SHOWN_UNITS = {"rad": "deg", "m": "L"}
_MORE = {
    "extent": "σ is the angle of the cross-section that the bundle covers",
    "offset": "the angle around the axis at which the bundle starts at the base",
    "revolution": "the angle that a fiber turns around the axis from base to tip",
    "taper": "the angle between the axis and the side of the body",
    "bundles": "how many equal bundles stand around the axis, each with its own activation",
    "lower": "the most that a bundle contracts",
    "upper": "the most that a bundle extends",
}
