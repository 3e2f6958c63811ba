"""Parameters found by name, and the arm that has other values of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.parameters.draft import Draft
from softreach.arm.parameters.parameter import OwnParameter, Parameter, parameters
from softreach.support.arguments import as_instance, as_text, plain
from softreach.support.errors import Fault, InvalidInput, did_you_mean

__all__ = [
    "changed",
    "find_parameter",
    "find_parameters",
    "parameters_by_every_name",
    "unknown_parameter",
]

_ELEMENT = re.compile(r"(.*)\[(\d+)\]$")
_FEW = 12
_ACTIVATIONS = ("activation", "force", "pressure", "tension")
"""Names under which activations are looked for among the parameters of an actuator."""


def parameters_by_every_name(arm: Manipulator) -> dict[str, Parameter]:
    """As `parameters`, and again by the names of rings: `rings[skin].inner_ratio`."""
    known = parameters(arm)
    return known | {
        name: _renamed(known[listed], name) for name, listed in _by_ring_name(arm, known).items()
    }


def find_parameter(arm: Manipulator, name: str) -> Parameter:
    """The parameter of this name.

    Args:
        arm: Whose it is.
        name: As `parameters` has it; a ring may be called by its name too, as in
            `rings[skin].inner_ratio`.

    Raises:
        InvalidInput: The arm has no such parameter.
    """
    return find_parameters(arm, (as_text("name", name),))[name]


def find_parameters(
    arm: Manipulator, names: Mapping[str, object] | tuple[str, ...]
) -> dict[str, Parameter]:
    """The parameters of these names, in the order in which they are applied: whole arm first.

    Raises:
        InvalidInput: The arm has no such parameter, or two names are of one.
    """
    as_instance("names", names, (Mapping, list, tuple), "names of parameters")
    known = parameters(arm)
    listed = {name: name for name in known} | _by_ring_name(arm, known)
    aliases: dict[str, str] = {}
    for name in names:
        if not isinstance(name, str) or name not in listed:
            raise unknown_parameter(str(name), known)
        if (first := aliases.setdefault(listed[name], name)) != name:
            raise InvalidInput("parameter", name, "given once", f"{first} is the same")
    return {aliases[key]: _renamed(known[key], aliases[key]) for key in known if key in aliases}


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
    """
    as_instance("values", values, Mapping, "a dictionary of parameters")
    draft = Draft(a_manipulator("arm", arm))
    for name, parameter in find_parameters(arm, tuple(values)).items():
        value = plain(values[name])
        if isinstance(value, int | float) and not isinstance(value, bool):
            parameter.change(draft, value)
        else:
            draft.refuse(Fault(name, value, parameter.range))
    return draft.made() if values else arm


def unknown_parameter(name: str, known: Mapping[str, Parameter]) -> InvalidInput:
    """The error for a name that no parameter has, in one line.

    It lists the parameters of the part that the name begins with, or those of the whole arm, and
    suggests the closest one.

    Args:
        name: The name.
        known: All parameters by what they are called where the name was given.
    """
    owners = list(dict.fromkeys(parameter.owner for parameter in known.values() if parameter.owner))
    meant = max((own for own in owners if name.startswith(f"{own}.")), key=len, default="")
    own = [key for key, parameter in known.items() if parameter.owner == meant]
    hint = did_you_mean(name, own if meant else known, 0.5)
    if name.rpartition(".")[2] in _ACTIVATIONS:
        bound = f"{meant}.lower" if f"{meant}.lower" in known else "lower"
        hint = f"activations are given to commands; their bounds are {bound} and {bound[:-5]}upper"
    if name.startswith("loads.") and not any(key.startswith("loads.") for key in known):
        hint = "the arm has no loads: give it some first"
    if name.startswith("base.") and not any(key.startswith("base.") for key in known):
        hint = "the arm stands upright at the origin: give it another base first"
    if name.startswith("measured.") and not any(key.startswith("measured.") for key in known):
        hint = "nothing was measured on the arm: give its section measured=Measured() first"
    allowed = f"one of {', '.join(_shortened(own))}"
    if owners and not meant:
        parts = ", ".join(owners[:_FEW]) + (", ..." if len(owners) > _FEW else "")
        example = next(key for key, parameter in known.items() if parameter.owner)
        allowed += f", or of one part ({parts}), such as {example}"
    return InvalidInput("parameter", name, allowed, hint)


def _by_ring_name(arm: Manipulator, known: Mapping[str, Parameter]) -> dict[str, str]:
    """Further names of parameters, `rings[skin].inner_ratio` for `rings[0].inner_ratio`."""
    names: dict[str, str] = {}
    for listed, parameter in known.items():
        if isinstance(parameter, OwnParameter) and parameter.path.part[0] == "rings":
            k = parameter.path.part[1]
            ring = arm.section.rings[int(k)].name
            name = f"rings[{ring}]" + listed.removeprefix(f"rings[{k}]")
            if ring and name not in known:
                names[name] = listed
    return names


def _renamed(parameter: Parameter, name: str) -> Parameter:
    if name == parameter.name:
        return parameter
    owner = name.removesuffix(f".{parameter.field}")
    return replace(parameter, name=name, owner=owner)


def _shortened(names: Iterable[str]) -> list[str]:
    places: dict[str, list[str]] = {}
    for name in names:
        element = _ELEMENT.match(name)
        base, place = (element[1], element[2]) if element else (name, "")
        places.setdefault(base, []).append(place)
    return [text for base, each in places.items() for text in _span(base, each)]


def _span(base: str, places: list[str]) -> list[str]:
    alone = [base] if "" in places else []
    elements = [place for place in places if place]
    if len(elements) < 2:
        return alone + [f"{base}[{place}]" for place in elements]
    return [*alone, f"{base}[{elements[0]}] to [{elements[-1]}]"]
