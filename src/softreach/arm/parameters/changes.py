"""Parameters found by name, and the arm that has other values of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.parameters.draft import Draft
from softreach.arm.parameters.of_arm import by_ring_name, parameters
from softreach.arm.parameters.parameter import Parameter
from softreach.arm.parameters.unknown import unknown_parameter
from softreach.support.arguments import checked, instance, plain, text
from softreach.support.errors import Fault, InvalidInput, in_short

__all__ = ["changed", "find_parameter", "find_parameters", "parameters_by_every_name"]


def parameters_by_every_name(arm: Manipulator) -> dict[str, Parameter]:
    """As `parameters`, and again by the names of rings: `rings[skin].inner_ratio`."""
    known = parameters(arm)
    return known | {
        name: _renamed(known[listed], name) for name, listed in by_ring_name(arm, known).items()
    }


@checked(arm=a_manipulator, name=text)
def find_parameter(arm: Manipulator, name: str) -> Parameter:
    """The parameter of this name.

    Args:
        arm: Whose it is.
        name: As `parameters` has it; a ring may be called by its name too, as in
            `rings[skin].inner_ratio`.

    Raises:
        InvalidInput: The arm has no such parameter.
    """
    return find_parameters(arm, (name,))[name]


@checked(arm=a_manipulator, names=instance((Mapping, list, tuple), "names of parameters"))
def find_parameters(
    arm: Manipulator, names: Mapping[str, object] | tuple[str, ...]
) -> dict[str, Parameter]:
    """The parameters of these names, in the order in which they are applied: whole arm first.

    Raises:
        InvalidInput: The arm has no such parameter, or two names are of one.
    """
    known = parameters(arm)
    listed = {name: name for name in known} | by_ring_name(arm, known)
    asked: dict[str, str] = {}
    for name in names:
        if not isinstance(name, str) or name not in listed:
            raise unknown_parameter(in_short(name), known)
        if (first := asked.setdefault(listed[name], name)) != name:
            raise InvalidInput("parameter", name, "given once", f"{first} is the same")
    return {asked[one]: _renamed(known[one], asked[one]) for one in known if one in asked}


@checked(arm=a_manipulator, values=instance(Mapping, "a dictionary of parameters"))
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
    draft = Draft(arm)
    for name, parameter in find_parameters(arm, tuple(values)).items():
        value = plain(values[name])
        if isinstance(value, int | float) and not isinstance(value, bool):
            parameter.change(draft, value)
        else:
            draft.refuse(Fault(name, value, parameter.variable.allowed))
    return draft.made() if values else arm


def _renamed(parameter: Parameter, name: str) -> Parameter:
    if name == parameter.name:
        return parameter
    owner = name.removesuffix(f".{parameter.field}")
    return replace(parameter, name=name, owner=owner)
