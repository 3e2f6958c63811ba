"""The sliders of a design: its parameters in the units that a person reads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import Parameter, parameters

__all__ = ["Control", "controls"]

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

    @property
    def shown(self) -> float:
        """The value on the slider."""
        return round(self.value / self.scale, 6)

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
_OF_ACTUATOR = {
    "bundles": _Slider("bundles of {owner}", 1, 6, 1),
    "offset": _Slider("offset of {owner} [deg]", 0, 360, 1),
}


def controls(arm: Manipulator) -> list[Control]:
    """The sliders of a design, those of the whole arm first."""
    known = parameters(arm)
    owners = dict.fromkeys(one.owner for one in known.values())
    return [
        _control(arm, known[name], slider)
        for owner in owners
        for field, slider in (_OF_ACTUATOR if owner else _OF_ARM).items()
        if (name := f"{owner}.{field}" if owner else field) in known
        and _is_offered(arm, known, known[name])
    ]


def _is_offered(arm: Manipulator, known: Mapping[str, Parameter], one: Parameter) -> bool:
    """Only what is helical has a revolution to change; only what is not, its number of bundles."""
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
    )
