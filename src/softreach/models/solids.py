"""An arm as closed solids, to be printed or cast: its materials, and what is hollow in it.

The library Manifold (Apache 2.0) cuts what is hollow out of the straight arm, whose vertices then
go where the rest shape has them. Facets have the area of the circles that they stand for.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from softreach.arm.base import UPRIGHT
from softreach.arm.lines import line_places
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.section import Material
from softreach.geometry.surface import Surface, tube_surface
from softreach.rod.rods import as_tip_map
from softreach.support.arguments import as_number
from softreach.support.arrays import Array, Points
from softreach.support.errors import NotPossible, Range, check_installed

Curve = Callable[[Array], Array]  # Places (n, axis) at n stations

_ASIDE = 0.382  # place in a piece where its chord is checked: whole turns cannot hide there


def solids(arm: Manipulator, *, channel_diameter: float | None = None) -> dict[str, Surface]:
    """The arm at rest as closed solids, upright on its base: parts to print, and cores of molds.

    The body comes first, a part a material and under its name. Bore, chambers and the channels of
    tendons are cut out of it and follow as solids, the last two under the names of their bundles.
    A channel is round about the line of its tendon: a groove where it reaches the surface, nothing
    where it lies outside. What ends inside of the arm is closed there. Where rings overlap, the
    first has the place. Disks are left out. Facets keep within a thousandth of the least radius.

    Args:
        arm: The design.
        channel_diameter: Diameter of the channels [m]; None for a tenth of the least diameter of
            the arm.

    Returns:
        Surfaces by name, vertices in m.

    Raises:
        InvalidInput: The diameter is out of its range.
        NotPossible: The arm has no such solids; the sentence says why.
        MissingExtra: `softreach[export]` is not installed.
    """
    arm = a_manipulator("arm", arm)
    check_installed("manifold3d")
    if arm.section.bending_ratio != 1.0:
        raise NotPossible("a section of two bending stiffnesses is not round, its shape unknown")
    least, empty = 1e3 * facet_tolerance(arm), import_module("manifold3d").Manifold()
    given = 0.2 * least if channel_diameter is None else channel_diameter
    diameter = as_number("channel_diameter", given, Range(0.01 * least, least, unit="m"))
    lines = [k for k, shape in enumerate(arm.outline(0.0).shape) if shape != "sector"]
    hollows = [(arm.bundle_names[k], _hollow(arm, k, 0.5 * diameter)) for k in lines]
    taken, rings = sum((solid for _, solid in hollows), empty), dict[Material, Any]()
    for inner, outer, material in arm.section.layers:
        rings[material] = rings.get(material, empty) + _ring(arm, inner, outer)
    parts = list[tuple[str, Any]]()
    for material, ring in rings.items():
        parts.append((material.name or "body", ring - taken))
        taken += ring
    if arm.section.bore_ratio:
        parts.append(("bore", _ring(arm, 0.0, arm.section.bore_ratio)))
    parts += [(name, solid ^ _ring(arm, 0.0, 1.0)) for name, solid in hollows]
    surfaces: dict[str, Surface] = {}
    for name, solid in parts:
        solid = solid.trim_by_plane((0, 0, 1), 0.0).trim_by_plane((0, 0, -1), -arm.length)
        if not solid.is_empty():
            name = f"{name} ({len(surfaces) + 1})" if name in surfaces else name
            mesh = _at_rest(arm, solid.simplify(1e-2 * facet_tolerance(arm))).to_mesh64()
            vertices, faces = mesh.vert_properties[:, :3].copy(), mesh.tri_verts.astype(np.int64)
            surfaces[name] = Surface(vertices=vertices, faces=faces)
    return surfaces


def facet_tolerance(arm: Manipulator) -> float:
    """Largest distance of facets and chords from what is round [m], a thousandth of R2."""
    return 1e-3 * float(arm.profile.radius(_along(arm)).min())


def traced(arm: Manipulator, curve: Curve, knots: Sequence[float]) -> Array:
    """Places (n, axis) on a curve, at knots from first to last and where its chords need more."""
    at = np.unique(np.clip(knots, knots[0], knots[-1]))
    while True:
        places, between = curve(at), curve(at[:-1] + _ASIDE * np.diff(at))
        gaps = np.linalg.norm(places[:-1] + _ASIDE * np.diff(places, axis=0) - between, axis=1)
        if not (wide := gaps > facet_tolerance(arm)).any():
            return places
        at = np.sort(np.append(at, 0.5 * (at[1:] + at[:-1])[wide]))


def _along(arm: Manipulator) -> Array:
    return np.union1d(np.linspace(0.0, arm.length, 129), arm.breakpoints)


def _ring(arm: Manipulator, inner: float, outer: float) -> Any:
    """What lies between two ratios of R2, and beyond both ends."""

    def wall(ratio: float, z: Array) -> Array:
        return np.stack([0.0 * z, 0.0 * z, z, ratio * arm.profile.radius(z)], axis=1)

    solid, *bore = (_tube(arm, partial(wall, x), (0.0, arm.length)) for x in (outer, inner) if x)
    return solid - bore[0] if bore else solid


def _hollow(arm: Manipulator, k: int, channel_radius: float) -> Any:
    """The channel or the chamber of a bundle."""
    span, is_line = arm.bundle_actuators[k].span(arm.length), arm.outline(0.0).shape[k] == "line"

    def line(z: Array) -> Array:
        outline, (x, y), outer = arm.outline(z), line_places(arm, z)[..., k], arm.profile.radius(z)
        radius = 0.5 * outer * (outline.outer_ratio - outline.inner_ratio)[:, k]
        if not is_line and (np.hypot(x, y) + radius >= outer).any():
            raise NotPossible(f"{arm.bundle_names[k]} breaks through the surface: make it narrower")
        return np.stack([x, y, z, channel_radius + 0.0 * z if is_line else radius], axis=1)

    return _tube(arm, line, span, is_line=is_line)


def _tube(arm: Manipulator, curve: Curve, span: tuple[float, float], is_line: bool = False) -> Any:
    """A tube by x, y, z and radius at z; its sections are across its line, or across the arm."""
    (start, end), library = span, import_module("manifold3d")
    *axis, radius = traced(arm, curve, [start, *arm.breakpoints, end]).T
    axis = np.stack(axis, axis=1)
    sections = _mitered(axis) if is_line else np.tile(np.eye(3)[:2], (len(axis), 1, 1))
    sides = max(12, math.ceil(np.pi * math.sqrt(radius.max() / (3.0 * facet_tolerance(arm)))))
    turn, aside, ends = 2.0 * np.pi / sides, 1e-9 * arm.length, [0, -1]
    meets = start <= aside, end >= arm.length - aside  # where it goes on beyond the arm
    station = np.pad(np.arange(len(axis)), [*map(int, meets)], mode="edge")
    ahead = np.diff(axis, axis=0)[ends]
    reach = 2.0 * radius[ends] / ahead[:, 2] * meets * [-1.0, 1.0]
    axis, radius = axis[station], radius[station] * math.sqrt(turn / math.sin(turn))
    axis[ends] += reach[:, None] * ahead
    first, second = sections[station].swapaxes(0, 1)
    tube = tube_surface(axis, first, second, radius, sides)
    return library.Manifold(library.Mesh64(tube.vertices, tube.faces.astype(np.uint64)))


def _mitered(line: Points) -> Array:
    """Sections that make cylinders about chords, (station, 2, 3), for a radius of 1."""
    steps = np.diff(line, axis=0)
    chords = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    normals = np.concatenate([chords[1:] + chords[:-1], chords[-1:]])
    first = np.cross([0.0, 1.0, 0.0], chords[0])
    first /= np.linalg.norm(first)
    sections = [np.stack([first, np.cross(chords[0], first)])]
    for chord, normal in zip(chords, normals, strict=True):  # along the chord, onto the next plane
        ahead = sections[-1] @ normal / (chord @ normal)
        sections.append(sections[-1] - ahead[:, None] * chord)
    return np.array(sections)


def _at_rest(arm: Manipulator, solid: Any) -> Any:
    """A solid of the straight arm where the rest shape has it."""
    if arm.rest.is_straight:
        return solid
    turn, radius = arm.rest.curvature(_along(arm) / arm.length), arm.profile.radius(_along(arm))
    room = 1.0 - np.linalg.norm(turn[:, :2], axis=1) * radius
    if (room <= 0.0).any():
        raise NotPossible("the rest shape bends the arm into itself, by more than 1/R2")
    sharpest = ((np.linalg.norm(turn, axis=1) + turn[:, 2] ** 2 * radius) / room).max()
    length = math.sqrt(8.0 * facet_tolerance(arm) / sharpest)  # of chords on the surface
    without = dict.fromkeys(("actuators", "drives", "markers", "surroundings"), ())
    bare = as_tip_map(arm.replace(**without, loads=None, point=None, base=UPRIGHT))

    def placed(points: Points) -> Points:
        z, section = np.unique(points[:, 2].round(12).clip(0.0, arm.length), return_inverse=True)
        position, directors = (each[0, section] for each in bare.frames(np.empty((1, 0)), z))
        return position + np.einsum("nk,nkx->nx", points[:, :2], directors[:, :2])

    return solid.refine_to_length(length).warp_batch(placed)
