"""Edits of an arm: actuators, rings and solids beside it, added, removed and changed."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from softreach.arm.actuators import (
    Chamber,
    FiberArchitecture,
    ObliqueMuscle,
    RadialMuscle,
    SectorActuator,
    Tendon,
)
from softreach.arm.manipulator import Manipulator
from softreach.arm.obstacles import Obstacle
from softreach.arm.section import Ring
from softreach.geometry.meshes import Mesh, MeshFile
from softreach.geometry.region_tables import SHAPES
from softreach.geometry.regions import Box, Cylinder, HalfSpace, Region, Sphere, Tube
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput

ACTUATOR_KINDS = ("fiber", "oblique muscle", "radial muscle", "tendon", "chamber")
SOLID_KINDS = ("box", "sphere", "cylinder", "tube", "plane")

_EXTENT = np.radians(40)
_GRID = 9  # digits after the point of places in m: no rounding shows in files
_TURN = 2.0  # bending of a new actuator at its bound, over the arm [rad]


def with_actuator(arm: Manipulator, kind: str) -> Manipulator:
    """The arm with one more actuator of one of `ACTUATOR_KINDS`, where there is most room."""
    name = _new_name(kind, [actuator.name for actuator in arm.actuators])
    angles = np.sort(np.mod(arm.outline([0.0]).center[0], 2 * np.pi))
    gaps = np.diff(angles, append=angles[0] + 2 * np.pi)
    widest = int(np.argmax(gaps))  # between bundles at the base, in whose middle it goes
    offset = float(np.mod(angles[widest] + gaps[widest] / 2, 2 * np.pi))
    where: dict[str, Any] = {"name": name, "offset": offset}
    radius, bending = float(arm.profile.radius(0.0)), arm.section.stiffness_at(arm.profile, 0.0)
    moment = _TURN * float(bending.bending) / arm.length  # which turns the arm by that in all
    if kind == "fiber":
        actuator = FiberArchitecture(helical_angle=0.0, extent=_EXTENT, **where)
    elif kind == "oblique muscle":
        actuator = ObliqueMuscle(helical_angle=np.radians(30), extent=_EXTENT, **where)
    elif kind == "radial muscle":
        actuator = RadialMuscle(name=name, extent=2 * np.pi, activation_bounds=(-1.0, 0.0))
    elif kind == "tendon":
        bounds = (0.0, _rounded(moment / (0.8 * radius)))
        actuator = Tendon(distance_ratio=0.8, activation_bounds=bounds, **where)
    else:
        bounds = (0.0, _rounded(moment / (0.5 * radius * np.pi * (0.25 * radius) ** 2)))
        ratios = {"distance_ratio": 0.5, "radius_ratio": 0.25}
        actuator = Chamber(activation_bounds=bounds, **ratios, **where)
    return arm.replace(actuators=(*arm.actuators, actuator))


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")


def without_actuator(arm: Manipulator, name: str) -> Manipulator:
    """The arm without one of its actuators, which must not be the last."""
    others = tuple(actuator for actuator in arm.actuators if actuator.name != name)
    if not others:
        raise InvalidInput("actuators", name, "one of several: the last one cannot be removed")
    return arm.replace(actuators=others)


def with_changed_actuator(arm: Manipulator, name: str, /, **changes: Any) -> Manipulator:
    """The arm with other values of one of its actuators, such as its name or its ring."""
    parts = (part.replace(**changes) if part.name == name else part for part in arm.actuators)
    return arm.replace(actuators=tuple(parts))


def with_ring(arm: Manipulator) -> Manipulator:
    """The arm with one more ring, inside the innermost or in its inner half; it comes last."""
    section = arm.section
    first = min(section.rings, key=lambda ring: ring.inner_ratio)
    room = section.inner_ratio - section.bore_ratio
    low, high = section.inner_ratio - 0.5 * room, section.inner_ratio
    if room <= 0:
        low, high = first.inner_ratio, 0.5 * (first.inner_ratio + first.outer_ratio)
    name = _new_name("ring", [ring.name for ring in section.rings])
    ring = Ring(inner_ratio=low, outer_ratio=high, material=section.core_material, name=name)
    return _with_rings(arm, (*section.rings, ring))


def without_ring(arm: Manipulator, index: int) -> Manipulator:
    """The arm without one of its rings, not the last; actuators in the others stay in theirs."""
    rings, label = arm.section.rings, ring_label(arm, index)
    if len(rings) == 1:
        raise InvalidInput("rings", label, "one of several: the last one cannot be removed")
    sectors = [part for part in arm.actuators if isinstance(part, SectorActuator)]
    inside = [part.name for part in sectors if arm.section.ring_index(part.ring) == index]
    if inside:
        hint = f"move or remove {', '.join(inside)} first"
        raise InvalidInput("rings", label, "a ring without actuators", hint)
    moved: dict[int | str, int] = {k: k - 1 for k in range(index + 1, len(rings))}
    return _with_rings(arm, rings[:index] + rings[index + 1 :], moved)


def with_changed_ring(arm: Manipulator, index: int, **changes: Any) -> Manipulator:
    """The arm with other values of one of its rings, such as its material; actuators stay in it."""
    rings, old = [*arm.section.rings], arm.section.rings[index]
    rings[index] = old.replace(**changes)
    return _with_rings(arm, rings, {} if rings[index].name == old.name else {old.name: index})


def _with_rings(
    arm: Manipulator, rings: Sequence[Ring], moved: Mapping[int | str, int] = {}
) -> Manipulator:
    """The arm with other rings; of actuators, `moved` has the new ring by the old index or name."""
    actuators = tuple(
        part.replace(ring=moved[part.ring])
        if isinstance(part, SectorActuator) and part.ring in moved
        else part
        for part in arm.actuators
    )
    return arm.replace(section=arm.section.replace(rings=tuple(rings)), actuators=actuators)


def with_core(arm: Manipulator, material: str) -> Manipulator:
    """The arm with a core of a named material; "" for that of the innermost ring."""
    return arm.replace(section=arm.section.replace(core=material or None))


def ring_label(arm: Manipulator, index: int) -> str:
    """Label of a ring: its index, and its name if it has one."""
    name = arm.section.rings[index].name
    return f"ring {index} ({name})" if name else f"ring {index}"


def with_solid(arm: Manipulator, kind: str) -> Manipulator:
    """The arm with one more solid to keep clear of, of one of `SOLID_KINDS`, beside it.

    A plane is behind the base.
    """
    size = _rounded(0.1 * arm.length)
    middle = np.round(arm.base.to_world([5.0 * size, 0.0, 5.0 * size]), _GRID)
    up = np.array([0.0, 0.0, 2.0 * size])
    low, high = (tuple((middle + side * up).tolist()) for side in (-1.0, 1.0))
    if kind == "box":
        region: Region = Box(*(tuple((middle + side * size).tolist()) for side in (-1.0, 1.0)))
    elif kind == "sphere":
        region = Sphere(tuple(middle.tolist()), size)
    elif kind == "cylinder":
        region = Cylinder(low, high, 0.5 * size)
    elif kind == "tube":
        region = Tube(low, high, size, 0.9 * size)
    else:
        behind = arm.base.to_world([0.0, 0.0, -size])
        away = np.subtract(arm.base.position, behind)
        region = HalfSpace(tuple(np.round(behind, _GRID).tolist()), tuple(away.tolist()))
    solid = Obstacle(region=region, name=_new_name(kind, [one.name for one in arm.surroundings]))
    return arm.replace(surroundings=(*arm.surroundings, solid))


def with_changed_solid(arm: Manipulator, index: int, **changes: Any) -> Manipulator:
    """The arm with other values of one of its surroundings, such as its region."""
    solids = [*arm.surroundings]
    solids[index] = solids[index].replace(**changes)
    return arm.replace(surroundings=tuple(solids))


def without_solid(arm: Manipulator, index: int) -> Manipulator:
    """The arm without one of its surroundings."""
    return arm.replace(surroundings=arm.surroundings[:index] + arm.surroundings[index + 1 :])


def moved(region: Region, by: Array) -> Region:
    """A region that is moved [m], shape (3,); the mesh of a file becomes one without a file."""
    solid: Any = region.mesh if isinstance(region, MeshFile) else region
    numbers = next(numbers for kind, numbers in SHAPES.values() if type(solid) is kind)
    places = {name: getattr(solid, name) for name, unit in numbers.items() if unit == "m"}
    changes: dict[str, Any] = {
        name: np.round(np.add(place, by), _GRID) for name, place in places.items() if np.ndim(place)
    }
    changes |= {"source": ""} if isinstance(solid, Mesh) else {}
    return replace(solid, **changes)  # pyright: ignore[reportArgumentType]


def _new_name(kind: str, taken: Sequence[str]) -> str:
    names = (f"{kind} {number}" for number in itertools.count(1))
    return next(name for name in names if name not in taken)
