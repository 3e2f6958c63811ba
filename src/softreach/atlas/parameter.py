"""What may vary between the designs of an atlas: names, units, and the design that follows."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm import designs
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.manipulator import Manipulator
from softreach.arm.profile import LinearTaper
from softreach.errors import InvalidInput

__all__ = ["changed", "parameter_units"]

_ARM = {
    "revolution": "rad",
    "taper": "rad",
    "radius_ratio": "1",
    "outer_radius": "m",
    "length": "m",
    "poisson_ratio": "1",
    "extent": "rad",
    "lower": "1",
    "upper": "1",
}
_FIBER = {
    "revolution": "rad",
    "helical_angle": "rad",
    "offset": "rad",
    "extent": "rad",
    "bundles": "1",
    "lower": "1",
    "upper": "1",
}


def parameter_units(base: Manipulator) -> dict[str, str]:
    """Every parameter of an arm and its unit.

    `revolution` turns all helical fibers, each in its own sense; `extent`, `lower` and `upper` (the
    bounds of γ) belong to all fibers. One fiber's own parameters carry its name: `offset_left`.
    """
    own = {f"{field}_{key}": unit for key in _keys(base) for field, unit in _FIBER.items()}
    return _ARM | own


def changed(base: Manipulator, values: Mapping[str, float]) -> Manipulator:
    """The design with these parameters, everything else as in `base`.

    When the taper changes, revolutions stay and helical angles follow; a new outer radius keeps the
    ratio of the radii.

    Args:
        base: The design to start from.
        values: Parameter -> value in SI units.

    Raises:
        InvalidInput: An unknown parameter.
        InvalidDesign: No such arm can exist.
    """
    known = parameter_units(base)
    for name in values:
        if name not in known:
            raise InvalidInput("parameter", name, f"one of {', '.join(known)}")
    fibers = tuple(_fibers(base, values))
    # All at once: a valid design may lie behind an invalid one.
    tube = {name: values.get(name, value) for name, value in _tube(base).items()}
    ratio = tube.pop("radius_ratio")
    arm = type(base).tapered(**tube, inner_radius=ratio * tube["outer_radius"], actuators=fibers)
    return arm.replace(section=arm.section.with_inner(ratio)).with_bounds(
        _bounds(base, fibers, values)
    )


def _keys(base: Manipulator) -> list[str]:
    """The fibers' names as identifiers."""
    names = [fiber.name or f"fiber {k + 1}" for k, fiber in enumerate(base.fibers)]
    return [re.sub(r"\W+", "_", name) for name in names]


def _tube(base: Manipulator) -> dict[str, float]:
    assert isinstance(base.profile, LinearTaper)
    return {
        "length": base.profile.length,
        "outer_radius": base.profile.outer_radius,
        "taper": base.profile.taper,
        "radius_ratio": base.section.rings[0].inner_ratio,
        "poisson_ratio": base.section.rings[0].material.poisson_ratio,
    }


def _fibers(base: Manipulator, values: Mapping[str, float]) -> Iterator[FiberArchitecture]:
    winding = {"revolution", "taper"} & values.keys()
    wound = designs.varied(base, revolution=values.get("revolution")) if winding else base
    for key, fiber in zip(_keys(base), wound.fibers, strict=True):
        changes: dict[str, Any] = {"extent": values["extent"]} if "extent" in values else {}
        for field in ("revolution", "helical_angle", "offset", "extent", "bundles"):
            if (name := f"{field}_{key}") in values:
                changes[field] = int(values[name]) if field == "bundles" else values[name]
        yield fiber.replace(**changes)


def _bounds(
    base: Manipulator, fibers: tuple[FiberArchitecture, ...], values: Mapping[str, float]
) -> ArrayLike:
    """Bounds as they were, unless they or the number of bundles they belong to change."""
    ends = [name for name in values if name.startswith(("lower", "upper"))]
    recounted = [fiber.bundles for fiber in fibers] != [fiber.bundles for fiber in base.fibers]
    if not ends and not (recounted and len(set(map(tuple, base.bounds.tolist()))) > 1):
        pairs = base.bounds.tolist()
        return pairs[0] if all(pair == pairs[0] for pair in pairs) else pairs
    first = np.cumsum([0, *(fiber.bundles for fiber in base.fibers)])[:-1].tolist()
    pairs = [
        _pair(base.bounds[j].tolist(), key, values)
        for j, key in zip(first, _keys(base), strict=True)
    ]
    return tuple(p for p, fiber in zip(pairs, fibers, strict=True) for _ in range(fiber.bundles))


def _pair(old: list[float], key: str, values: Mapping[str, float]) -> tuple[float, float]:
    low, high = (
        values.get(f"{end}_{key}", values.get(end, was))
        for end, was in zip(("lower", "upper"), old, strict=True)
    )
    return low, high
