"""Parameters as a person reads them: on the sliders of a design, part by part, and in tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from softreach.arm import edits
from softreach.arm.actuators import SectorActuator
from softreach.arm.design_file import in_file_terms
from softreach.arm.manipulator import Manipulator
from softreach.arm.number import own_fields
from softreach.arm.obstacles import obstacle_names
from softreach.arm.parameters import Parameter, parameters, with_values
from softreach.arm.parameters import parts as parts_of
from softreach.studio.widgets import Ends
from softreach.studio.work import StaleCheck
from softreach.support.bisection import last_value
from softreach.support.errors import Fault, InvalidDesign, Range, SoftreachError
from softreach.support.units import METER, LengthUnit

_Slider = tuple[str, float, float, float]  # label, ends and step
_OF_ARM: dict[str, _Slider] = {
    "revolution": ("revolution Ω [deg]", 1, 360, 1),
    "taper": ("taper φ [deg]", -2, 5, 0.05),
    "radius_ratio": ("inner / outer radius", 0, 1, 0.01),
    "outer_radius": ("outer radius", 0.02, 0.12, 5e-4),  # of L
    "extent": ("extent σ [deg]", 2, 120, 1),
    "lower": ("lowest γ", -4, 0, 0.01),
    "upper": ("highest γ", -1, 2, 0.01),
}
_OF_PART: dict[str, _Slider] = {
    "bundles": ("bundles of {owner}", 1, 6, 1),
    "offset": ("offset of {owner} [deg]", 0, 360, 1),
    "distance_ratio": ("distance of {owner} / outer radius", 0, 1, 0.01),
    "radius_ratio": ("radius of {owner} / outer radius", 0.01, 0.5, 0.005),
    "extent": ("extent of {owner} [deg]", 2, 120, 1),
    "revolution": ("revolution of {owner} [deg]", -360, 360, 1),
}
_ONE_FOR_ALL = ("extent", "revolution", "lower", "upper")
"""Fields that have a slider of their own only where parts differ."""
_AROUND_VALUE = ("lower", "upper", "young_modulus")
"""Fields of any magnitude: their sliders end at multiples of what the design has."""
_WORDS = {
    "L": "length",
    "R0/R2": "bore / outer radius",
    "E": "modulus",
    "ρ": "density",
    "ν": "Poisson's ratio",
    "min τ": "least tension",
    "max τ": "largest tension",
    "min P": "least pressure",
    "max P": "largest pressure",
}


class ShownParameter(NamedTuple):
    """A parameter of a design in the unit that a person reads."""

    name: str
    label: str  # with the unit
    hint: str  # symbol, unit and meaning
    scale: float  # units of the parameter per shown unit
    shown: float  # the value in the shown unit; NaN where the design leaves it out
    low: float = math.nan  # ends of a slider in the shown unit, and its step; NaN without one
    high: float = math.nan
    step: float = math.nan
    whole: bool = False  # it counts something

    @property
    def limits(self) -> Ends:
        """Ends of the slider: wide enough for a design from a file, as a person would type them."""
        return three_digits(min(self.low, self.shown), -1), three_digits(max(self.high, self.shown))

    def read(self, arm: Manipulator) -> float:
        """The value of a design, in the shown unit; 0 where it leaves the number out."""
        value = float(f"{values_of(arm)[self.name] / self.scale:.12g}")
        return 0.0 if math.isnan(value) else value

    def write(self, arm: Manipulator, shown: float) -> Manipulator:
        """The design with another value; InvalidDesign if no such arm can exist."""
        return with_values(arm, {parameters(arm)[self.name]: shown * self.scale})


@lru_cache(maxsize=16)
def values_of(arm: Manipulator) -> dict[str, float]:
    """Values of all parameters by their names; NaN where the design leaves one out."""
    return {name: each.value(arm) for name, each in parameters(arm).items()}


def three_digits(value: float, way: int = 1) -> float:
    """The next number of three digits from here on, upward or, with -1, downward."""
    near = float(f"{value:.3g}")
    if math.isclose(near, value, rel_tol=1e-9) or way * (near - value) > 0:
        return near
    return float(f"{near + way * 10.0 ** (math.floor(math.log10(abs(value))) - 2):.3g}")


def slider_parameters(arm: Manipulator) -> tuple[ShownParameter, ...]:
    """The parameters of a design that have sliders, those of the whole arm first.

    What it leaves open has none; what parts outside softreach declare has one, but for zeros.
    """
    return _slider_parameters(arm, arm.length_unit)


@lru_cache(maxsize=16)
def _slider_parameters(arm: Manipulator, unit: LengthUnit) -> tuple[ShownParameter, ...]:
    del unit  # that of the arm: of equal arms each may have its own
    known, values, arm_parts = parameters(arm), values_of(arm), parts_of(arm)
    own = {  # what a kind of part outside softreach declares
        name
        for name, each in known.items()
        if each.part is not None and each.number.field in own_fields(type(arm_parts[each.part]))
    }
    shown = []
    for owner in dict.fromkeys(parameter.owner for parameter in known.values()):
        fields = (*(_OF_PART if owner else _OF_ARM), *_AROUND_VALUE)
        names = [f"{owner}.{field}" if owner else field for field in fields]
        names += [name for name in known if name in own and known[name].owner == owner]
        for parameter in (known[name] for name in dict.fromkeys(names) if name in known):
            is_own = parameter.name in own
            offered = is_own or _is_offered(arm, values, parameter)
            if offered and not math.isnan(values[parameter.name]):
                shown.append(_on_slider(arm, parameter, is_own=is_own))
    return tuple(slider for slider in shown if slider is not None)


def _on_slider(arm: Manipulator, parameter: Parameter, *, is_own: bool) -> ShownParameter | None:
    slider = None if is_own else _fixed(arm, parameter)
    if (slider := slider or _around_value(arm, parameter)) is None:
        return None
    shown = _shown(arm, parameter, parameter.symbol, "", arm.length_unit)
    label, low, high, step = slider
    label, hint = (
        label.replace("{owner}", parameter.owner),
        f"{shown.label}: {parameter.meaning} (parameter {parameter.name})",
    )
    return shown._replace(label=label, hint=hint, low=low, high=high, step=step)


def _fixed(arm: Manipulator, parameter: Parameter) -> _Slider | None:
    """The slider of the tables, if its unit and its ends suit the number."""
    fixed = (_OF_PART if parameter.owner else _OF_ARM).get(parameter.field)
    outside_arm = parameter.field == "distance_ratio" and values_of(arm)[parameter.name] > 1
    if fixed is None or parameter.unit not in ("1", "rad", "m") or outside_arm:
        return None
    if parameter.unit != "m":
        return fixed
    scale = float(f"{arm.length / arm.length_unit.size:.3g}")
    low, high, step = (scale * end for end in fixed[1:])
    return arm.length_unit.label(fixed[0]), low, high, step


def _around_value(arm: Manipulator, parameter: Parameter) -> _Slider | None:
    """From zero to twice the value, or all angles, within the range; None for a zero of no size."""
    unit, scale = _unit(parameter, arm.length_unit)
    value, allowed = values_of(arm)[parameter.name] / scale, parameter.range
    low, high = allowed.low / scale, allowed.high / scale
    size = float(f"{2 * abs(value):.3g}") or high - low
    ends = (-size if value <= 0 else 0.0, size if value >= 0 else 0.0)
    if parameter.unit == "rad":
        size, ends = 200.0, (-360.0, 360.0)
    if not math.isfinite(size):
        return None
    step = max(1.0, size // 200) if parameter.whole else size / 200
    low, high = low + step * allowed.open_low, high - step * allowed.open_high
    name, label = _word(parameter), owner_label(parameter.owner)
    rings = {f"ring {k}": ring.name for k, ring in enumerate(arm.section.rings)}
    title = f"{name} of {rings.get(label) or label}" if label else name
    return _titled(title, unit), max(ends[0], low), min(ends[1], high), step


def _word(parameter: Parameter) -> str:
    symbol, bracket, element = parameter.symbol.partition("[")
    return f"{_WORDS.get(symbol, symbol)}{bracket}{element}"


def owner_label(path: str) -> str:
    """The part that owns a parameter, by the name that the list of parts has for it."""
    return path.removesuffix(".material").replace("rings[", "ring ").replace("]", "")


def _is_offered(arm: Manipulator, values: Mapping[str, float], parameter: Parameter) -> bool:
    """True if a parameter changes an arm of these values, and no other slider does the same."""
    owner, field = parameter.owner, parameter.field
    if len(arm.section.rings) == 1 and arm.section.core is None:  # the matter is one
        if field == "young_modulus" and arm.loads is None and {*arm.input_units} == {"1"}:
            return False
        if (owner, field) == ("", "radius_ratio"):
            return any(isinstance(each, SectorActuator) for each in arm.actuators)
    if owner and field in _ONE_FOR_ALL and not math.isnan(values.get(field, math.nan)):
        return False
    if field == "revolution":
        return values[parameter.name] != 0
    return field != "bundles" or values.get(f"{owner}.revolution", 0.0) == 0


def slider_ends(arm: Manipulator, before: Mapping[str, Ends], check: StaleCheck) -> dict[str, Ends]:
    """Ends of the sliders of a design: as far as each alone can go, to three digits.

    An end is looked for near that of a design before: each trial makes an arm, in a millisecond.
    """
    known = parameters(arm)

    def end(slider: ShownParameter, which: int) -> float:
        def exists(shown: float) -> bool:
            check()
            try:
                with_values(arm, {known[slider.name]: shown * slider.scale})
            except InvalidDesign:
                return False
            return True

        limit = slider.limits[which]
        near = before[slider.name][which] if slider.name in before else None
        if near == limit:
            return limit
        return three_digits(last_value(slider.shown, limit, near, exists), 1 - 2 * which)

    return {each.name: (end(each, 0), end(each, 1)) for each in slider_parameters(arm)}


class Part(NamedTuple):
    """One thing that an arm consists of."""

    label: str  # name in the list of parts
    owners: tuple[str, ...]  # owners of its parameters
    name: str  # its own name, which may be empty
    ring: int | None = None  # index of a ring; None for all else
    actuator: str = ""  # name of an actuator; "" for all else
    home: int | str | None = None  # the ring that an actuator is in
    solid: int | None = None  # index among the surroundings; None for all else

    def changed(self, arm: Manipulator, **changes: Any) -> Manipulator:
        """The arm with other values of fields of this ring, actuator or solid."""
        if self.solid is not None:
            return edits.with_changed_solid(arm, self.solid, **changes)
        if self.ring is not None:
            return edits.with_changed_ring(arm, self.ring, **changes)
        return edits.with_changed_actuator(arm, self.actuator, **changes)

    def removed(self, arm: Manipulator) -> Manipulator:
        """The arm without this ring, actuator or solid."""
        if self.solid is not None:
            return edits.without_solid(arm, self.solid)
        if self.ring is not None:
            return edits.without_ring(arm, self.ring)
        return edits.without_actuator(arm, self.actuator)


_BODY = Part("body", ("", "profile"), "")


def body_numbers(arm: Manipulator) -> list[ShownParameter]:
    """The parameters of the body that have no slider."""
    slid = {slider.name for slider in slider_parameters(arm)}
    return [each for each in part_parameters(arm, _BODY) if each.name not in slid]


def parts(arm: Manipulator) -> dict[str, Part]:
    """Core, rings, actuators and surroundings of an arm by their labels."""
    listed = [Part("core", ("core",), "")] if arm.section.core is not None else []
    for k, ring in enumerate(arm.section.rings):
        owners = (f"rings[{k}]", f"rings[{k}].material")
        listed.append(Part(edits.ring_label(arm, k), owners, ring.name, ring=k))
    labels = {"body", *(part.label for part in listed)}
    for each in arm.actuators:
        home = each.ring if isinstance(each, SectorActuator) else None
        label = f"{each.name} (actuator)" if each.name in labels else each.name
        listed.append(Part(label, (each.name,), each.name, actuator=each.name, home=home))
    for k, name in enumerate(obstacle_names(arm.surroundings)):
        listed.append(Part(f"solid {k + 1} ({name})", (), arm.surroundings[k].name, solid=k))
    return {part.label: part for part in listed}


def part_parameters(arm: Manipulator, part: Part) -> tuple[ShownParameter, ...]:
    """The parameters of a part in the units in which they are typed."""
    unit = typed_unit(arm)
    return tuple(
        _shown(arm, each, _word(each), f"{each.meaning}: {each.name}", unit)
        for each in parameters(arm).values()
        if each.owner in part.owners and (each.owner or not math.isnan(values_of(arm)[each.name]))
    )


def typed_unit(arm: Manipulator) -> LengthUnit:
    """Unit of lengths that are typed: that of the page, but not L, which may be what is typed."""
    return METER if arm.length_unit.relative else arm.length_unit


def named_parameters(arm: Manipulator) -> list[ShownParameter]:
    """All parameters of an arm under their own names, angles in degrees."""
    return [_shown(arm, one, one.name, one.meaning) for one in parameters(arm).values()]


def _shown(
    arm: Manipulator, parameter: Parameter, name: str, hint: str, lengths: LengthUnit | None = None
) -> ShownParameter:
    unit, scale = _unit(parameter, lengths)
    value, label = float(f"{values_of(arm)[parameter.name] / scale:.12g}"), _titled(name, unit)
    return ShownParameter(parameter.name, label, hint, scale, value, whole=parameter.whole)


def _unit(parameter: Parameter, lengths: LengthUnit | None) -> tuple[str, float]:
    """Unit of a number, and its size: where none of lengths is given, SI but for angles."""
    units = {"rad": ("deg", math.radians(1)), "1": ("", 1.0)}
    units |= {"m": (lengths.name, lengths.size), "Pa": ("kPa", 1e3)} if lengths else {}
    return units.get(parameter.unit, (parameter.unit, 1.0))


def _titled(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def refusal(error: SoftreachError, shown: Iterable[ShownParameter], arm: Manipulator) -> str:
    """An error; of faults of a design each number by the label and in the unit of its field."""
    if not isinstance(error, InvalidDesign):
        return str(error)
    known = {
        parameter.name: parameter._replace(label=f"{parameter.label} of {part.label}")
        for part in (_BODY, *parts(arm).values())
        for parameter in part_parameters(arm, part)
    }
    known |= {parameter.name: parameter for parameter in shown}
    text = "\n".join(_line(fault, known.get(fault.path)) for fault in error.faults)
    return text.replace("R2(L)", "R₂ at the tip").replace("R2(0)", "R₂ at the base")


def _line(fault: Fault, shown: ShownParameter | None) -> str:
    if shown is not None and fault.value is None:
        return str(fault._replace(path=shown.label))
    if shown is None or not isinstance(fault.value, int | float):
        return str(in_file_terms(InvalidDesign([fault]), ""))
    allowed = fault.allowed
    if isinstance(allowed, Range):
        scaled = {end: getattr(allowed, end) / shown.scale for end in ("low", "high")}
        allowed = allowed._replace(unit="", **scaled)
    return str(Fault(shown.label, fault.value / shown.scale, allowed))
