"""An arm as closed solids, to be printed or cast: its materials, and what is hollow in it.

The walls are facets between sections. Their corners stand out as far as their middles lie within,
so that every section has its true area. Manifold (Apache 2.0) cuts the hollows out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np

from softreach.arm.base import UPRIGHT
from softreach.arm.lines import line_places
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.section import Layer, Material, Section
from softreach.arm.skin import Centerline
from softreach.geometry.surface import Surface, tube_surface
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.support.arguments import as_number
from softreach.support.arrays import Array
from softreach.support.errors import NotPossible, Range, check_installed
from softreach.support.lazy import lazy

_SHARES = 0.5, 0.3, 0.7071  # of a piece: no number of whole turns hides from all
_FEWEST_SIDES, _LINES = 12, 8  # of sections; lines along the surface that chords must follow
_SHORTEST = 0.01  # of the tolerance: edges that would close in single precision
_PLACES = 129  # along the arm, at which it is checked
_SAME = 1e-9  # of the length


def solids(
    arm: Manipulator, *, channel_diameter: float | None = None, tolerance: float | None = None
) -> dict[str, Surface]:
    """The arm at rest as closed solids, upright on its base: what to print, and cores of a mold.

    First come the parts of the body, one a material and under its name, from which bore, channels
    and chambers are cut. Then these as solids: `bore`, and each tendon and chamber under the name
    of its bundle. A channel is round about the line of its tendon. Where it reaches the surface it
    is a groove, and where it lies outside there is none. What begins or ends inside of the arm is
    closed there. Disks, loads and activations have no part in this.

    Args:
        arm: The design.
        channel_diameter: Diameter of the channels of tendons [m]; None for a tenth of the least
            diameter of the arm.
        tolerance: Largest distance of facets from the true walls [m]; None for a thousandth of the
            least radius of the arm.

    Returns:
        Surfaces by name, with vertices in m.

    Raises:
        InvalidInput: An argument is out of its range.
        NotPossible: Different materials share a place, a chamber breaks out, the rest shape bends
            the arm into itself, or its section is not round.
        MissingExtra: `softreach[export]` is not installed.
    """
    arm = a_manipulator("arm", arm)
    sizes = Range(0.0, 2.0 * least_radius(arm), unit="m", open_low=True)
    diameter = 0.2 * least_radius(arm) if channel_diameter is None else channel_diameter
    diameter = as_number("channel_diameter", diameter, sizes)
    tolerance = tolerance_of(arm, tolerance)
    _check(arm)
    check_installed("manifold3d")
    return _Solids(arm, 0.5 * diameter, tolerance).parts()


def least_radius(arm: Manipulator) -> float:
    """The least R2 [m]."""
    return float(arm.profile.radius(_places(arm)).min())


def tolerance_of(arm: Manipulator, tolerance: float | None) -> float:
    """A tolerance [m] in its range; for None a thousandth of the least radius."""
    least = least_radius(arm)
    allowed = Range(1e-4 * least, 0.1 * least, unit="m")
    return as_number("tolerance", 1e-3 * least if tolerance is None else tolerance, allowed)


def stations_within(
    curves: Callable[[Array], Array], knots: Sequence[float], tolerance: float
) -> Array:
    """Knots, and stations between them such that chords of curves keep a tolerance [m].

    Curves make of stations (n,) places of shape (n, ..., axis).
    """
    z = np.array(knots, float)
    while True:
        points, apart = curves(z), np.zeros(len(z) - 1)
        for share in _SHARES:
            chords = (1.0 - share) * points[:-1] + share * points[1:]
            off = curves((1.0 - share) * z[:-1] + share * z[1:]) - chords
            gaps = np.linalg.norm(off, axis=-1).reshape(len(apart), -1)
            apart = np.maximum(apart, gaps.max(axis=1))
        if (apart <= tolerance).all():
            return z
        z = np.sort(np.append(z, 0.5 * (z[1:] + z[:-1])[apart > tolerance]))


def _places(arm: Manipulator) -> Array:
    return np.union1d(np.linspace(0.0, arm.length, _PLACES), arm.breakpoints)


def _check(arm: Manipulator) -> None:
    """Refuse what has no such solids."""
    if arm.section.bending_ratio != 1.0:
        raise NotPossible(
            "two measured bending stiffnesses say that the section is not round, but not what it "
            "is: leave them out of a copy of the design"
        )
    z = _places(arm)
    bend = np.linalg.norm(arm.rest.curvature(z / arm.length)[:, :2], axis=1)
    if (bend * arm.profile.radius(z) >= 1.0).any():
        raise NotPossible("the rest shape bends the arm into itself, by more than 1/R2")
    outline, bore = arm.outline(z), arm.section.bore_ratio
    breaks = (outline.outer_ratio >= 1.0) | ((outline.inner_ratio <= bore) & (bore > 0.0))
    for k, name in enumerate(arm.bundle_names):
        out = z[breaks[:, k] & outline.acts[:, k]]
        if outline.shape[k] == "lumen" and len(out):
            raise NotPossible(
                f"{name} breaks through a wall at Z = {out[0]:.4g} m: make it thinner"
            )


def _annuli(section: Section) -> dict[Material, list[Layer]]:
    """Places of each material in the section, neighbors made one."""
    annuli: dict[Material, list[Layer]] = {}
    for inner, outer in pairwise(sorted({edge for layer in section.layers for edge in layer[:2]})):
        here = [x for x in section.layers if x.inner_ratio < outer and x.outer_ratio > inner]
        if not here:
            continue
        material = here[0].material
        if not all(material.same_matter(other.material) for other in here):
            raise NotPossible(
                f"different materials share the place from {inner:g} to {outer:g} R2: give these "
                "rings one material in a copy of the design, so that it can be made"
            )
        own = annuli.setdefault(material, [])
        start = own.pop().inner_ratio if own and own[-1].outer_ratio == inner else inner
        own.append(Layer(start, outer, material))
    return annuli


@dataclass(frozen=True, eq=False)
class _Solids:
    """Solids of an arm by facets within a tolerance."""

    arm: Manipulator
    channel_radius: float
    tolerance: float

    def parts(self) -> dict[str, Surface]:
        """All that are not empty, each under a name of its own."""
        shapes = zip(self.arm.bundle_names, self.arm.outline(0.0).shape, strict=True)
        hollows = [
            (name, self._hollow(k, shape))
            for k, (name, shape) in enumerate(shapes)
            if shape != "sector"
        ]
        cut, solids = _union([solid for _, solid in hollows]), list[tuple[str, Any]]()
        for material, annuli in _annuli(self.arm.section).items():
            solid = _union([self._annulus(annulus) for annulus in annuli])
            solids.append((material.name or "body", solid - cut))
        if bore := self.arm.section.bore_ratio:
            hollows.insert(0, ("bore", self._core(bore)))
        solids += [(name, self._whole ^ solid) for name, solid in hollows]
        parts: dict[str, Surface] = {}
        for name, solid in solids:
            if not solid.is_empty():
                mesh = solid.simplify(_SHORTEST * self.tolerance).to_mesh64()
                vertices, faces = mesh.vert_properties[:, :3], mesh.tri_verts.astype(np.int64)
                name = f"{name} ({len(parts) + 1})" if name in parts else name
                parts[name] = Surface(vertices=vertices, faces=faces)
        return parts

    def _annulus(self, layer: Layer) -> Any:
        inner, outer = layer.inner_ratio, layer.outer_ratio
        solid = self._whole if outer == 1.0 else self._whole ^ self._core(outer)
        return solid - self._core(inner) if inner else solid

    @lazy
    def _whole(self) -> Any:
        return self._core(1.0, beyond=False)

    def _core(self, ratio: float, *, beyond: bool = True) -> Any:
        """What lies within a ratio of R2."""
        radius = ratio * self.arm.profile.radius(self._stations)
        return self._tube(self._at_rest(self._stations), radius, beyond=beyond)

    def _hollow(self, k: int, shape: str) -> Any:
        """The channel or the chamber of a bundle."""
        arm, (start, end) = self.arm, self.arm.bundle_actuators[k].span(self.arm.length)

        def line(z: Array) -> Centerline:
            axis = self._at_rest(z)
            offset = np.einsum("ks,skx->sx", line_places(arm, z)[..., k], axis.directors[:, :2])
            return replace(axis, position=axis.position + offset)

        breaks = self._stations if shape == "lumen" else arm.breakpoints
        knots = [start, *(z for z in breaks if start < z < end), end]
        z = stations_within(lambda z: line(z).position, knots, self.tolerance)
        if shape == "lumen":
            outline = arm.outline(z)
            ratio = 0.5 * (outline.outer_ratio - outline.inner_ratio)[:, k]
            return self._tube(line(z), ratio * arm.profile.radius(z))
        channel = _mitered(line(z), self.channel_radius)
        if channel is None:
            name = arm.bundle_names[k]
            raise NotPossible(f"{name} winds too sharply for its channel: make that narrower")
        return self._tube(channel, np.full(len(z), self.channel_radius))

    def _at_rest(self, z: Array) -> Centerline:
        if self.arm.rest.is_straight:
            return Centerline.unactivated(z, UPRIGHT)
        frames = self._bare.frames(np.empty((1, 0)), z)
        return Centerline(z=z, position=frames.position[0], directors=frames.directors[0])

    @lazy
    def _bare(self) -> TipMap:
        without = dict.fromkeys(("actuators", "drives", "markers", "surroundings"), ())
        return as_tip_map(self.arm.replace(**without, loads=None, point=None, base=UPRIGHT))

    @lazy
    def _stations(self) -> Array:
        """Z of the sections of the body [m]."""
        angles = 2.0 * np.pi * np.arange(_LINES) / _LINES
        around = np.stack([np.cos(angles), np.sin(angles)], axis=1)

        def lines(z: Array) -> Array:
            axis, radius = self._at_rest(z), self.arm.profile.radius(z)[:, None, None]
            return axis.position[:, None] + radius * (around @ axis.directors[:, :2])

        return stations_within(lines, [0.0, *self.arm.breakpoints, self.arm.length], self.tolerance)

    def _tube(self, line: Centerline, radius: Array, *, beyond: bool = True) -> Any:
        """A tube about a line, which goes on beyond the ends of the arm where it meets them."""
        sides = math.ceil(2.0 * np.pi * math.sqrt(radius.max() / (12.0 * self.tolerance)))
        turn = 2.0 * np.pi / (sides := max(_FEWEST_SIDES, sides))
        near, ends = _SAME * self.arm.length, [0, -1]
        meets = beyond and line.z[0] <= near, beyond and line.z[-1] >= self.arm.length - near
        section = np.pad(np.arange(len(line.z)), [*map(int, meets)], mode="edge")
        center, radius, ahead = line.position[section], radius[section], line.directors[ends, 2]
        upright = np.sum(ahead * self._at_rest(line.z[ends]).directors[:, 2], axis=1)
        reach = 2.0 * radius[ends] / upright * meets * [-1.0, 1.0]
        center[ends] += reach[:, None] * ahead
        d1, d2 = line.directors[section, 0], line.directors[section, 1]
        radius = radius * math.sqrt(turn / math.sin(turn))  # of the area of the circle
        tube = tube_surface(center, d1, d2, radius, sides)
        library = import_module("manifold3d")
        return library.Manifold(library.Mesh64(tube.vertices, tube.faces.astype(np.uint64)))


def _union(solids: list[Any]) -> Any:
    library = import_module("manifold3d")
    return library.Manifold.batch_boolean(solids, library.OpType.Add)


def _mitered(line: Centerline, radius: float) -> Centerline | None:
    """With sections that make cylinders of a radius about the chords; None where these fold."""
    steps = np.diff(line.position, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    chords = steps / lengths[:, None]
    normals = np.concatenate([chords[:1], chords[1:] + chords[:-1], chords[-1:]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cos = np.sum(normals[:-1] * chords, axis=1), np.sum(normals[1:] * chords, axis=1)
    lost = [radius * np.sqrt(1.0 / each**2 - 1.0) for each in np.minimum(cos, 1.0)]
    if (sum(lost) >= lengths).any():
        return None
    first = np.cross(line.directors[0, 1], chords[0])
    first /= np.linalg.norm(first)
    sections = [np.stack([first, np.cross(chords[0], first)])]
    for chord, normal in zip(chords, normals[1:], strict=True):  # along the chord, onto the next
        ahead = sections[-1] @ normal / (chord @ normal)
        sections.append(sections[-1] - ahead[:, None] * chord)
    return replace(line, directors=np.concatenate([sections, normals[:, None]], axis=1))
