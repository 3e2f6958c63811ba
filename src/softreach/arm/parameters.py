"""Design parameters: the numbers of an arm that a sweep, a slider or an optimizer varies.

A parameter is a number of a part, one that several parts share, or a law that several follow.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Self

from softreach.arm.actuators import FiberArchitecture
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.number import Number, alternatives, fields_of, unit_suffix
from softreach.arm.part import AlongArm, gathered
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Material, Ring
from softreach.support.arguments import as_instance, as_text, plain
from softreach.support.errors import Fault, InvalidDesign, InvalidInput, Range, did_you_mean
from softreach.support.quantity import read_quantity, unit_names

PartKey = tuple[str | int, ...]
"""("profile",), ("rings", 0, "material"), ("core",), ("actuators", "left"), ("loads",), ..."""

Address = tuple[PartKey, str]  # A part, and the name of one of its numbers there
Rule = Callable[[float], float]  # New value from the old one
_ROUNDING = 1e-12  # of an angle that follows from another one
_FEW = 12
_ELEMENT = re.compile(r"(.*)\[(\d+)\]$")
_ACTIVATIONS = ("activation", "force", "pressure", "tension")
"""Names under which activations are looked for among the parameters of an actuator."""
_BOUNDS = {"actuators": "activation_bounds", "drives": "bounds"}  # Fields of `lower` and `upper`
_ABSENT = {
    "loads": "the arm has no loads: give it some first",
    "base": "the arm stands upright at the origin: give it another base first",
    "measured": "nothing was measured on the arm: give its section measured=Measured() first",
}


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A number in which designs can differ: one of a part, or one that several parts share."""

    name: str
    """`taper`, `left.offset`, or `rings[0].material.young_modulus`."""
    owner: str = ""
    """The part that it belongs to, such as `left` or `rings[0].material`; "" for the whole arm."""
    number: Number
    """Declaration of the number."""
    places: tuple[Address, ...] = ()
    """The numbers of parts that it is."""
    read: Callable[[Manipulator], tuple[float, ...]] | None = None
    """Law by which its values follow from an arm; by default they are those at its places."""
    write: Callable[[Manipulator, Rule], dict[Address, float]] | None = None
    """Law by which numbers of parts follow it; by default those at its places have its value."""

    @property
    def unit(self) -> str:
        """Unit of its values: "m", "rad", "Pa", "kg/m³", "N", or "1"."""
        return self.number.unit or "1"

    @property
    def symbol(self) -> str:
        """Symbol in formulas."""
        return self.number.symbol

    @property
    def meaning(self) -> str:
        """Meaning in a few words."""
        return self.number.meaning

    @property
    def range(self) -> Range:
        """Values that it may have."""
        return self.number.allowed

    @property
    def whole(self) -> bool:
        """True if it counts something."""
        return self.range.whole

    @property
    def field(self) -> str:
        """The name without its owner."""
        return self.name.removeprefix(f"{self.owner}.") if self.owner else self.name

    @property
    def part(self) -> PartKey | None:
        """The part that alone has it; None of what several may share."""
        key = self.places[0][0] if self.places else None
        return key if key and (self.owner or key[0] in ("profile", "section")) else None

    def value(self, arm: Manipulator) -> float:
        """Its value on an arm [unit].

        NaN where the arm does not give it as one number: a modulus that is left out, an angle that
        changes along the arm, or what differs between the parts that share it. It can be set all
        the same.
        """
        first, *others = self.values(arm)
        for other in others:
            if not math.isclose(first, other, rel_tol=_ROUNDING):
                return math.nan
        return first

    def values(self, arm: Manipulator) -> tuple[float, ...]:
        """Its value in each part that shares it, and of each bundle that a bound is of [unit]."""
        if self.read is not None:
            return self.read(arm)
        values: list[float] = []
        for place in self.places:
            values += _values(arm, place)
        return tuple(values)

    def edits(self, arm: Manipulator, new: Rule) -> dict[Address, float]:
        """New values of numbers of parts by which each of its values becomes new(value)."""
        if self.write is not None:
            return self.write(arm, new)
        edits: dict[Address, float] = {}
        for part, called in self.places:
            values = [new(value) for value in _values(arm, (part, called))]
            if all(value == values[0] for value in values[1:]):
                edits[part, called] = values[0]
            else:
                edits |= {(part, f"{called}[{k}]"): value for k, value in enumerate(values)}
        return edits


def _values(arm: Manipulator, place: Address) -> tuple[float, ...]:
    part, called = place
    return part_of(arm, part).values_of(called, arm.profile, arm.section)


# Laws of parameters that are no numbers of parts.


def _tapered(arm: Manipulator, new: Rule) -> dict[Address, float]:
    """Revolutions stay, and helical angles follow, but for those given along the arm."""
    revolutions = {
        (("actuators", fiber.name), "revolution"): fiber.revolution_on(arm.profile, arm.section)
        for fiber in arm.fibers
        if fiber.helical_angle and not isinstance(fiber.helical_angle, AlongArm)
    }
    taper = ("profile",), "taper"
    return {taper: new(_values(arm, taper)[0]), **revolutions}


def _outer_radius(arm: Manipulator) -> tuple[float, ...]:
    return (float(arm.profile.radius(0.0)),)


def _scaled(arm: Manipulator, new: Rule) -> dict[Address, float]:
    """All radii of a profile that is given by radii keep their proportions."""
    first, *others = getattr(arm.profile, "radii")  # noqa: B009
    value = new(_outer_radius(arm)[0])
    scaled = [value, *(radius * value / first for radius in others)]
    return {(("profile",), f"radii[{k}]"): radius for k, radius in enumerate(scaled)}


def _revolutions(arm: Manipulator) -> dict[Address, float]:
    """Ω of all that is helical by a single number other than 0 [rad]."""
    turns: dict[Address, float] = {}
    for actuator in arm.actuators:
        numbers = fields_of(type(actuator))
        along = [field for field in numbers if isinstance(getattr(actuator, field), AlongArm)]
        if not along and "revolution" in numbers and numbers["revolution"].unit == "rad":
            place = ("actuators", actuator.name), "revolution"
            turns[place] = _values(arm, place)[0]
    return {place: turn for place, turn in turns.items() if turn}


def _sizes_of_revolutions(arm: Manipulator) -> tuple[float, ...]:
    return tuple(map(abs, _revolutions(arm).values())) or (0.0,)


def _revolved(arm: Manipulator, new: Rule) -> dict[Address, float]:
    """Each keeps its sense."""
    turns = _revolutions(arm).items()
    return {place: math.copysign(new(abs(turn)), turn) for place, turn in turns}


# The list.


def parts(arm: Manipulator) -> Mapping[PartKey, Any]:
    """Every part that has numbers, by its key; kept with the arm."""
    if (known := vars(arm).get("_parts")) is None:
        known = vars(arm)["_parts"] = _keyed(arm)
    return known


def _keyed(arm: Manipulator) -> dict[PartKey, Any]:
    section = arm.section
    keyed: dict[PartKey, Any] = {("profile",): arm.profile, ("section",): section}
    given = {
        "loads": arm.loads is not None,
        "base": not arm.base.is_identity,
        "rest": not arm.rest.is_straight,
        "stations": bool(arm.stations),
    }
    keyed |= {(name,): getattr(arm, name) for name, is_given in given.items() if is_given}
    keyed |= {("rigid_pieces", k): piece for k, piece in enumerate(arm.rigid_pieces)}
    keyed |= {("markers", marker.name): marker for marker in arm.markers}
    for k, ring in enumerate(section.rings):
        keyed |= {("rings", k): ring, ("rings", k, "material"): ring.material}
    inside = {("core",): section.core, ("measured",): section.measured}
    keyed |= {key: part for key, part in inside.items() if part is not None}
    keyed |= {("drives", drive.name): drive for drive in arm.drives}
    return keyed | {("actuators", actuator.name): actuator for actuator in arm.actuators}


def part_of(arm: Manipulator, key: PartKey) -> Any:
    """The part of a key, as `parts` has it."""
    for each in arm.actuators:  # whose most parameters are
        if key == ("actuators", each.name):
            return each
    return arm.profile if key == ("profile",) else parts(arm)[key]


def owner_of(key: PartKey) -> str:
    """Start of names of numbers of a part; "" for profile and section."""
    kind, *path = key
    if kind in ("actuators", "drives"):
        return str(path[0])
    if kind in ("profile", "section"):
        return ""
    steps = (f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return "".join((str(kind), *steps))


def parameters(arm: Manipulator) -> dict[str, Parameter]:
    """Every parameter of an arm by its name.

    Those of the whole arm come first: fields of profile and section, `revolution` (of all that is
    helical, each in its own sense), `radius_ratio` where all rings begin at one, `poisson_ratio` of
    all materials; `extent`, `lower` and `upper` (the bounds of activations) of all actuators that
    have them. Then come those of single parts, by their path: `profile.radii[1]`,
    `rings[0].inner_ratio`, `rings[0].material.young_modulus`, `core.density`, and of actuators by
    their name: `left.offset`, `left.helical_angle.values[2]`, `left.lower[1]`.
    """
    arm = a_manipulator("arm", arm)
    if (known := vars(arm).get("_parameters")) is None:
        known = vars(arm)["_parameters"] = _listed(arm)
    return dict(known)


def _listed(arm: Manipulator) -> dict[str, Parameter]:
    own: dict[Address, Parameter] = {}
    for key, part in parts(arm).items():
        for called, number in part.numbers.items():
            owner = "profile" if key == ("profile",) and "[" in called else owner_of(key)
            name = f"{owner}.{called}" if owner else called
            places = ((key, called),)
            own[key, called] = Parameter(name=name, owner=owner, number=number, places=places)
    every = [*_of_arm(arm, own), *(each for each in own.values() if each.owner)]
    return {each.name: each for each in every}


def _of_arm(arm: Manipulator, own: Mapping[Address, Parameter]) -> Iterator[Parameter]:
    alone = {each.name: each.number for each in own.values() if not each.owner}
    if any(called == "revolution" and each.unit == "rad" for (_, called), each in own.items()):
        meaning = "revolution of all that is helical, each in its own sense"
        number = dataclasses.replace(fields_of(FiberArchitecture)["revolution"], meaning=meaning)
        laws = {"read": _sizes_of_revolutions, "write": _revolved}
        yield Parameter(name="revolution", number=number, **laws)
    if number := alone.pop("taper", None):
        places = ((("profile",), "taper"),)
        yield Parameter(name="taper", number=number, places=places, write=_tapered)
    ratios = _places(own, "inner_ratio", "rings")
    if len({value for place in ratios for value in _values(arm, place)}) == 1:
        ratio = fields_of(Ring)["inner_ratio"]
        number = dataclasses.replace(ratio, meaning="inner over outer radius")
        yield Parameter(name="radius_ratio", number=number, places=ratios)
    if "outer_radius" not in alone and isinstance(getattr(arm.profile, "radii", None), tuple):
        number = fields_of(LinearTaper)["outer_radius"]
        yield Parameter(name="outer_radius", number=number, read=_outer_radius, write=_scaled)
    yield from (each for each in own.values() if each.name in alone)
    places = _places(own, "poisson_ratio", "rings", "core")
    number = fields_of(Material)["poisson_ratio"]
    yield Parameter(name="poisson_ratio", number=number, places=places)
    for called in ("extent", "lower", "upper"):
        shared = _places(own, called, "actuators")
        if len({own[place].unit for place in shared}) == 1:
            yield Parameter(name=called, number=own[shared[0]].number, places=shared)


def _places(own: Iterable[Address], called: str, *kinds: str) -> tuple[Address, ...]:
    return tuple(place for place in own if place[1] == called and place[0][0] in kinds)


def parameters_by_every_name(arm: Manipulator) -> dict[str, Parameter]:
    """As `parameters`, and again by the names of rings: `rings[skin].inner_ratio`."""
    known = parameters(arm)
    again: dict[str, Parameter] = {}
    for k, ring in enumerate(arm.section.rings):
        for name, each in known.items() if ring.name else ():
            if name.startswith(f"rings[{k}]"):
                owner = each.owner.replace(f"[{k}]", f"[{ring.name}]", 1)
                name = f"{owner}.{each.field}"
                again[name] = dataclasses.replace(each, name=name, owner=owner)
    return known | again


def find_parameter(arm: Manipulator, name: str) -> Parameter:
    """The parameter of this name.

    Args:
        arm: Whose it is.
        name: As `parameters` has it, or with the name of a ring: `rings[skin].inner_ratio`.

    Raises:
        InvalidInput: The arm has no such parameter.
    """
    return find_parameters(arm, (as_text("name", name),))[name]


def find_parameters(
    arm: Manipulator, names: Mapping[str, object] | tuple[str, ...]
) -> dict[str, Parameter]:
    """The parameters of these names, those of the whole arm first.

    Raises:
        InvalidInput: The arm has no such parameter, or two names are of one.
    """
    as_instance("names", names, (Mapping, list, tuple), "names of parameters")
    known, taken = parameters_by_every_name(arm), {}
    for name in names:
        if not isinstance(name, str) or name not in known:
            raise unknown_parameter(str(name), parameters(arm))
        same = known[name].places or name, bool(known[name].owner)
        if (first := taken.setdefault(same, name)) != name:
            raise InvalidInput("parameter", name, "given once", f"{first} is the same")
    whole_arm_first = sorted(known, key=lambda name: bool(known[name].owner))
    return {name: known[name] for name in whole_arm_first if name in taken.values()}


# Arms with other values.


_Edits = dict[PartKey, dict[str, tuple[float, Parameter]]]
"""New values of numbers of parts, each with the parameter that led to it."""


def changed(arm: Manipulator, values: Mapping[str, float]) -> Manipulator:
    """The design with these parameters, everything else unchanged.

    They are applied together, as one may be valid only with another; a part's own parameter wins
    over one of the whole arm. When the taper changes, revolutions stay and helical angles follow,
    but for angles that are given along the arm; a new outer radius keeps the ratio of the radii.

    Args:
        arm: The design to start from.
        values: Name of a parameter -> value in its unit.

    Raises:
        InvalidInput: An unknown parameter, or one that is given under two names.
        InvalidDesign: No such arm can exist; the error names every fault.

    Examples:
        >>> from softreach.arm.parameters import changed
        >>> arm = changed(sr.designs.minimal_trunk(), {"length": 0.3, "taper": 0.02})
        >>> arm.length, arm.profile.taper
        (0.3, 0.02)
    """
    as_instance("values", values, Mapping, "a dictionary of parameters")
    known = find_parameters(a_manipulator("arm", arm), tuple(values))
    return with_values(arm, {each: values[name] for name, each in known.items()})


def with_values(arm: Manipulator, values: Mapping[Parameter, float]) -> Manipulator:
    """As `changed`, with parameters that were found before, those of the whole arm first."""
    new = {each: plain(value) for each, value in values.items()}
    new |= {
        each: int(value)
        for each, value in new.items()
        if each.whole and isinstance(value, float) and value.is_integer()
    }
    judged = [(each, value, each.number.refusal(value)) for each, value in new.items()]
    if faults := [Fault(each.name, value, limits) for each, value, limits in judged if limits]:
        raise InvalidDesign(faults)
    edits: _Edits = {}
    for each, value in new.items():
        _add_edits(edits, arm, each, lambda _, value=value: value)
    named = {each.name: value for each, value in new.items()}
    return _made(arm, edits, lambda: named) if edits else arm


def shifted(arm: Manipulator, parameter: Parameter, amount: float) -> Manipulator:
    """The design with an amount [unit] added to one parameter, in each part to its own value."""
    edits: _Edits = {}
    _add_edits(edits, arm, parameter, lambda old: old + amount)
    return _made(arm, edits, lambda: {parameter.name: parameter.value(arm) + amount})


def _add_edits(edits: _Edits, arm: Manipulator, by: Parameter, new: Rule) -> None:
    """A part's own parameter wins over those of the whole arm that were there before."""
    for (key, called), value in by.edits(arm, new).items():
        numbers = edits.setdefault(key, {})
        if not by.owner:
            numbers.setdefault(called, (value, by))
            continue
        other = alternatives(type(part_of(arm, key))).get(called, "")
        if other in numbers and not numbers[other][1].owner:
            del numbers[other]
        numbers[called] = value, by


def _made(arm: Manipulator, edits: _Edits, given: Callable[[], Mapping[str, float]]) -> Manipulator:
    """The arm with changed parts; faults under the names and with the values that were given."""
    new, faults = dict(parts(arm)), list[Fault]()
    changes = {key: {name: x for name, (x, _) in each.items()} for key, each in edits.items()}
    inside = changes.pop(("section",), {})
    for key, values in changes.items():
        part = new[key]
        if "bundles" in values and values["bundles"] != part.bundles:  # all have the first's bounds
            values = dict(zip(("lower", "upper"), part.bounds[0].tolist(), strict=True)) | values
        with gathered(faults, owner_of(key)):
            new[key] = part.replace(**values)
    if not faults:
        with gathered(faults):
            return _assembled(arm, new, changes, inside)
    values = given()
    named = [_as_given(fault, edits, values) for fault in faults]
    raise InvalidDesign([*{(fault.path, str(fault.allowed)): fault for fault in named}.values()])


def _assembled(
    arm: Manipulator,
    new: Mapping[PartKey, Any],
    changed: Iterable[PartKey],
    inside: Mapping[str, float],
) -> Manipulator:
    kinds, changes = {str(key[0]) for key in changed}, dict[str, Any]()
    if inside or kinds & {"rings", "core", "measured"}:
        rings = tuple(
            new["rings", k].replace(material=new["rings", k, "material"])
            for k in range(len(arm.section.rings))
        )
        own = {name: new[name,] for name in ("core", "measured") if (name,) in new}
        changes["section"] = arm.section.replace(rings=rings, **own, **inside)
    alone = {"profile", "loads", "base", "rest", "stations"}
    changes |= {name: new[name,] for name in kinds & alone}
    for kind in kinds & {"rigid_pieces", "markers", "drives", "actuators"}:
        changes[kind] = tuple([part for key, part in new.items() if key[0] == kind])
    return arm.replace(**changes)


def _as_given(fault: Fault, edits: _Edits, given: Mapping[str, float]) -> Fault:
    names = {
        by.name: None
        for path in fault.path.split(", ")
        for key, numbers in edits.items()
        for called, (_, by) in numbers.items()
        if path in _paths(key, called)
    }
    if not names:
        return fault
    value = given[next(iter(names))] if len(names) == 1 else fault.value
    return Fault(", ".join(names), value, fault.allowed)


def _paths(key: PartKey, called: str) -> tuple[str, ...]:
    """Paths that faults of a number may have: its own, that of its series, and of its bounds."""
    owner, series = owner_of(key), _ELEMENT.sub(r"\1", called)
    fields = [called, series] + ([_BOUNDS[str(key[0])]] if series in ("lower", "upper") else [])
    return tuple(f"{owner}.{field}".lstrip(".") for field in fields)


def unknown_parameter(name: str, known: Mapping[str, Parameter]) -> InvalidInput:
    """The error for a name that no parameter has, in one line.

    It lists those of the part that the name begins with, or of the whole arm, by their names in
    `known`, and suggests the closest one.
    """
    owners = list(dict.fromkeys(parameter.owner for parameter in known.values() if parameter.owner))
    meant = max((own for own in owners if name.startswith(f"{own}.")), key=len, default="")
    own = [key for key, parameter in known.items() if parameter.owner == meant]
    hint = did_you_mean(name, own if meant else known, 0.5)
    if name.rpartition(".")[2] in _ACTIVATIONS:
        bound = f"{meant}.lower" if f"{meant}.lower" in known else "lower"
        hint = f"activations are given to commands; their bounds are {bound} and {bound[:-5]}upper"
    part = name.partition(".")[0]
    if part in _ABSENT and not any(key.startswith(f"{part}.") for key in known):
        hint = _ABSENT[part]
    runs = itertools.groupby(own, lambda key: _ELEMENT.sub(r"\1[", key))
    series = [(base, *same) for base, same in runs]  # of which `radii[0] to [2]` is listed
    ends = [each[1] + (f" to {each[-1][len(each[0]) - 1 :]}" * (len(each) > 2)) for each in series]
    allowed = f"one of {', '.join(ends)}"
    if owners and not meant:
        listed = ", ".join(owners[:_FEW]) + (", ..." if len(owners) > _FEW else "")
        example = next(key for key, parameter in known.items() if parameter.owner)
        allowed += f", or of one part ({listed}), such as {example}"
    return InvalidInput("parameter", name, allowed, hint)


# Parameters as files and the command line write them: the unit in the name, angles in degrees.


def written_name(name: str, unit: str) -> str:
    """A name with its unit: `taper_deg`, `left.helical_angle.values_deg[2]`."""
    return with_suffix(name, unit_suffix(unit))


def with_suffix(name: str, suffix: str) -> str:
    """The name with a suffix, which stands before the place in a series."""
    return re.sub(r"(\[\d+\])?$", lambda place: suffix + place[0], name, count=1)


class Written:
    """Parameters by every name, with and without units, and values as people write them."""

    def __init__(self, plain: Mapping[str, Parameter]) -> None:
        self.written = {written_name(name, p.unit): p for name, p in plain.items()}
        self.by_key = {**self.written, **plain}
        self._with_unit = self.written.keys() - plain.keys()

    @classmethod
    def of(cls, arm: Manipulator) -> Self:
        """Those of an arm."""
        return cls(parameters_by_every_name(arm))

    def number(self, key: str, value: object, unit: str | None = None) -> float:
        """A value in SI: a number under a key with its unit, or text with it; else ValueError."""
        unit = self.by_key[key].unit if unit is None else unit
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(value)
        if key in self._with_unit:
            return from_written(read_quantity(str(value), "1"), unit)
        if not isinstance(value, str) and value != 0 and unit != "1":
            raise ValueError(value)
        return read_quantity(str(value), unit)

    def allowed(self, key: str, unit: str | None = None) -> str:
        """Kind of value allowed under a key, in words."""
        unit = self.by_key[key].unit if unit is None else unit
        if key in self._with_unit:
            return "a finite number without a unit, which the name holds"
        units = ", ".join(unit_names(unit))
        if not units:
            return "a finite number without a unit"
        under = f", or a number under {written_name(key, unit)}" if key in self.by_key else ""
        return f"a finite number with its unit ({units}){under}"


def from_written(value: float, unit: str) -> float:
    """A value in SI units, from degrees where these are radians."""
    return math.radians(value) if unit == "rad" else value
