"""Solids around the arm as parts of its design: their numbers, and those of meshes in files."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from softreach.arm import edits
from softreach.arm.manipulator import Manipulator
from softreach.arm.obstacles import Obstacle
from softreach.geometry.meshes import Mesh
from softreach.geometry.region_tables import SHAPES
from softreach.geometry.regions import HalfSpace, Region, Sphere
from softreach.studio.fields import Attribute, Fields, in_unit, of_design
from softreach.studio.shown_parameters import Part, typed_unit
from softreach.studio.state import vector
from softreach.studio.widgets import number_kind, vector_kind
from softreach.support.errors import InvalidInput, NotPossible, SoftreachError

UNITS_OF_MESHES = ("as it says", "m", "cm", "mm", "in")
_ABOUT_PLACE = "Middle of the solid, as x, y, z in the world: it moves as a whole"
_ABOUT_SHAPE = "Places as x, y, z in the world; a normal points out of what is solid"
_MOST_TRIANGLES = 20_000  # of a mesh: they are part of the design, and of the state of a tab


def solid(panel: Fields, part: Part) -> None:
    """Numbers of a solid, and the part of the arm that keeps clear of it."""
    arm, index = panel.session.state.design, part.solid or 0
    first, unit = arm.surroundings[index], typed_unit(arm)

    def here(arm: Manipulator) -> Obstacle:  # until the fields of a removed one are gone, too
        now = arm.surroundings[index] if index < len(arm.surroundings) else first
        return now if type(now.region) is type(first.region) else first

    def number(name: str, size: float = 0.0, **others: Any) -> Attribute:
        write = lambda arm, value: part.changed(arm, **{name: value}, **others)
        return in_unit(lambda arm: getattr(here(arm), name), write, size)

    def of_region(
        read: Callable[[Region], Any], write: Callable[[Region, Any], Region], size: float = 0.0
    ) -> Attribute:
        made = lambda arm, value: part.changed(arm, region=write(here(arm).region, value))
        return in_unit(lambda arm: read(here(arm).region), made, size)

    if not isinstance(first.region, HalfSpace | Sphere):  # which have such a number
        moved = lambda region, to: edits.moved(region, np.subtract(to, _middle(region)))
        panel.typed(unit.label("place"), of_region(_middle, moved), _ABOUT_PLACE, vector_kind)
    for name, symbol in _NUMBERS.get(type(first.region), {}).items():
        read = lambda region, name=name: getattr(region, name)
        write = lambda region, value, name=name: replace(region, **{name: value})
        kind = vector_kind if isinstance(read(first.region), tuple) else number_kind
        label = unit.label(name.replace("_", " ")) if symbol else name
        panel.typed(label, of_region(read, write, 0.0 if symbol else 1.0), _ABOUT_SHAPE, kind)
    keep, from_here = number("clearance"), number("start_over_length", 1.0, start=None)
    panel.typed(unit.label("distance to keep"), keep, "The clearance is the gap beyond it")
    panel.typed("clear from Z / L", from_here, "The arm from here to its tip must keep clear")
    inside = of_design(lambda arm: here(arm).inside, lambda arm, on: part.changed(arm, inside=on))
    panel.checkbox("the arm is inside", inside, "All around is solid, as for an arm in a tank")


_NUMBERS = {kind: numbers for kind, numbers in SHAPES.values() if kind is not Mesh}
"""Numbers of regions that are typed, and their units."""


def _middle(region: Region) -> tuple[float, ...]:
    return vector(region.bounds.mean(axis=0))


def with_mesh(arm: Manipulator, name: str, content: bytes, unit: str) -> Manipulator:
    """The arm with one more solid, from the file of a mesh in a unit of `UNITS_OF_MESHES`."""
    with tempfile.TemporaryDirectory(prefix="softreach-") as folder:
        path = Path(folder) / Path(name).name
        path.write_bytes(content)
        try:
            mesh = Mesh.load(path, unit=None if unit == UNITS_OF_MESHES[0] else unit)
        except SoftreachError as error:
            raise NotPossible(str(error).replace(f"{folder}{os.sep}", "")) from None
    if len(mesh.faces) > _MOST_TRIANGLES:
        allowed = f"at most {_MOST_TRIANGLES:,} in the studio"
        hint = "name the file in the design, or make it coarser"
        raise InvalidInput("triangles", f"{len(mesh.faces):,}", allowed, hint)
    solid = Obstacle(region=edits.moved(mesh, np.zeros(3)), name=Path(name).stem)
    return arm.replace(surroundings=(*arm.surroundings, solid))
