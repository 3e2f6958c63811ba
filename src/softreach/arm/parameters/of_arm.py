"""All parameters of an arm by name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from softreach.arm.actuator_checks import FIBER_RANGES
from softreach.arm.actuators import Actuator
from softreach.arm.checks import MATERIAL_RANGES, PROFILE_RANGES, RING_RANGES
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.parameters.parameter import (
    BoundParameter,
    ElementParameter,
    FieldParameter,
    Parameter,
    SharedParameter,
)
from softreach.arm.parameters.parts import parts, prefix_of, series_of
from softreach.arm.parameters.whole import OuterRadius, Revolution, Taper
from softreach.arm.variable import Variable
from softreach.support.arguments import checked
from softreach.support.errors import Range

__all__ = ["by_ring_name", "parameters"]

_RADIUS = Variable(
    "outer_radius", "R2(0)", "outer radius at the base", PROFILE_RANGES["outer_radius"]
)
_RATIO = Variable("radius_ratio", "R1/R2", "inner over outer radius", RING_RANGES["inner_ratio"])
_POISSON = Variable("poisson_ratio", "ν", "Poisson's ratio", MATERIAL_RANGES["poisson_ratio"])
_REVOLUTION = Variable(
    "revolution",
    "Ω",
    "revolution of all that is helical, each in its own sense",
    FIBER_RANGES["revolution"],
)
_BOUNDS = {
    "lower": ("min", "lowest activation"),
    "upper": ("max", "highest activation"),
}


@checked(arm=a_manipulator)
def parameters(arm: Manipulator) -> dict[str, Parameter]:
    """Every parameter of an arm by its name.

    Those of the whole arm come first: fields of profile and section, `revolution` (of all that is
    helical, each in its own sense), `radius_ratio` where all rings begin at one, `poisson_ratio` of
    all materials; `extent`, `lower` and `upper` (the bounds of activations) of all actuators that
    have them. Then come those of single parts, by their path: `profile.radii[1]`,
    `rings[0].inner_ratio`, `rings[0].material.young_modulus`, `core.density`, and of actuators by
    their name: `left.offset`, `left.helical_angle.values[2]`, `left.lower[1]`.
    """
    own = [one for key, part in parts(arm).items() for one in _of_part(key, part)]
    plain = [one for one in own if not one.owner]
    every = [*_of_arm(arm, plain, own), *(one for one in own if one.owner)]
    return {one.name: one for one in every}


def by_ring_name(arm: Manipulator, known: dict[str, Parameter]) -> dict[str, str]:
    """Further names of parameters, `rings[skin].inner_ratio` for `rings[0].inner_ratio`."""
    found: dict[str, str] = {}
    for k, ring in enumerate(arm.section.rings):
        if ring.name:
            path, named = f"rings[{k}]", f"rings[{ring.name}]"
            own = (one.name for one in known.values() if _key(one).startswith(path))
            found |= {named + name.removeprefix(path): name for name in own}
    return {name: known_as for name, known_as in found.items() if name not in known}


def _of_arm(arm: Manipulator, plain: list[Parameter], own: list[Parameter]) -> Iterator[Parameter]:
    if any(one.field == "revolution" for one in own):
        yield Revolution(name="revolution", variable=_REVOLUTION)
    of_whole = {one.name: one for one in plain}
    if (taper := of_whole.pop("taper", None)) is not None:
        assert isinstance(taper, FieldParameter)
        yield Taper(name="taper", variable=taper.variable, key=taper.key)
    begins = [one for one in own if _is_of_ring(one) and one.field == "inner_ratio"]
    if len({one.value(arm) for one in begins}) == 1:
        yield SharedParameter(name="radius_ratio", variable=_RATIO, parts=tuple(begins))
    if "outer_radius" not in of_whole and hasattr(arm.profile, "radii"):
        yield OuterRadius(name="outer_radius", variable=_RADIUS)
    yield from of_whole.values()
    of_materials = tuple(
        one for one in own if _is_of_material(one) and one.field == "poisson_ratio"
    )
    yield SharedParameter(name="poisson_ratio", variable=_POISSON, parts=of_materials)
    of_actuators = [one for one in own if _key(one).startswith("actuators[")]
    for field in ("extent", *_BOUNDS):
        yield from _shared(field, tuple(one for one in of_actuators if one.field == field))


def _shared(field: str, of: tuple[Parameter, ...]) -> Iterator[Parameter]:
    """One parameter for all actuators that have such a field, if it has the same unit in all."""
    if len({one.unit for one in of}) == 1:
        yield SharedParameter(name=field, variable=of[0].variable, parts=of)


def _key(one: Parameter) -> str:
    return getattr(one, "key", "")


def _is_of_ring(one: Parameter) -> bool:
    return _key(one).startswith("rings[")


def _is_of_material(one: Parameter) -> bool:
    return _key(one) == "core" or (_is_of_ring(one) and _key(one).endswith(".material"))


def _of_part(key: str, part: Any) -> Iterator[Parameter]:
    """Its variables, its series, and the bounds of an actuator."""
    series = list(series_of(part))
    tuples = {one.path for one in series}
    for variable in part.variables:
        if variable.field not in tuples:
            yield FieldParameter(**_called(key, variable.field), variable=variable, key=key)
    for path, variable, places in series:
        for k in places:
            element = variable._replace(
                field=f"{path}[{k}]",
                symbol=f"{variable.symbol}[{k}]",
                meaning=f"{variable.meaning}, number {k}",
            )
            named = _called(key, element.field, path)
            yield ElementParameter(**named, variable=element, key=key, series=path, place=k)
    if isinstance(part, Actuator):
        yield from _bounds(key, part)


def _called(key: str, field: str, path: str = "") -> dict[str, str]:
    """Name and owner of a parameter."""
    prefix = prefix_of(key, path)
    return {"name": prefix + field, "owner": prefix.removesuffix(".")}


def _bounds(key: str, actuator: Actuator) -> Iterator[Parameter]:
    unit = "" if actuator.unit == "1" else actuator.unit
    bundles = (None, *range(actuator.bundles)) if actuator.bundles > 1 else (None,)
    for side, (field, (end, meaning)) in enumerate(_BOUNDS.items()):
        for bundle in bundles:
            whose = "" if bundle is None else f"[{bundle}]"
            symbol = f"{end} {actuator.symbol}{whose}"
            variable = Variable(field, symbol, meaning, Range(unit=unit))
            named = _called(key, field + whose)
            yield BoundParameter(**named, variable=variable, key=key, side=side, bundle=bundle)
