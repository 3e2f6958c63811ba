"""Patterns of rings: sheets to cut, which lie around the arm where its fibers and muscles are.

A sheet lies in the middle of its ring, and is unrolled cone by cone without any strain.
"""

from dataclasses import dataclass
from functools import partial
from html import escape
from itertools import pairwise

import numpy as np

from softreach.arm.actuators import SectorActuator
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.models.solids import traced
from softreach.support.arguments import as_one_of
from softreach.support.arrays import Array
from softreach.support.errors import NotPossible

_COLORS = {"cut": "#e00000", "ring": "#000000", "marks": "#0050d0"}
_GAP, _LETTERS = 0.005, 0.002  # between sheets, and height of letters [m]
_CORNERS = np.arange(5)  # of a sheet and its bundles, from base to tip and back


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern:
    """Unrolled rings with their outside in sight: x runs from base to tip."""

    lines: tuple[tuple[str, Array], ...]
    """Layer and points of each line [m], (point, 2): edges of bundles ("cut"), edges of sheets
    ("ring"), middle lines of bundles, and marks at base and tip at polar angle 0 ("marks")."""
    labels: tuple[tuple[str, Array], ...]
    """Name of each bundle, and the point where its middle line begins [m]."""

    def svg(self) -> str:
        """The drawing as text of an SVG file, 1:1."""
        every = np.concatenate([points for _, points in self.lines])
        (left, low), (width, height) = every.min(axis=0) - _GAP, np.ptp(every, axis=0) + 2.0 * _GAP
        box = f"{_mm(left)} {_mm(-low - height)} {_mm(width)} {_mm(height)}"
        size = f'width="{_mm(width)}mm" height="{_mm(height)}mm" viewBox="{box}"'
        rows = [f'<svg xmlns="http://www.w3.org/2000/svg" {size}>']
        for layer, points in self.lines:
            corners = " ".join(f"{_mm(x)},{_mm(-y)}" for x, y in points)
            look = f'class="{layer}" fill="none" stroke="{_COLORS[layer]}" stroke-width="0.1"'
            rows.append(f'<polyline {look} points="{corners}"/>')
        for text, (x, y) in self.labels:
            look = f'font-size="{_mm(_LETTERS)}" fill="{_COLORS["marks"]}"'
            rows.append(f'<text {look} x="{_mm(x)}" y="{_mm(-y)}">{escape(text)}</text>')
        return "\n".join([*rows, "</svg>", ""])

    def dxf(self) -> str:
        """The drawing as text of a DXF file (R12), in mm."""
        codes: list[tuple[int, object]] = [(0, "SECTION"), (2, "ENTITIES")]
        for layer, points in self.lines:
            codes += [(0, "POLYLINE"), (8, layer), (66, 1)]
            for x, y in points:
                codes += [(0, "VERTEX"), (8, layer), (10, _mm(x)), (20, _mm(y))]
            codes += [(0, "SEQEND")]
        for text, (x, y) in self.labels:
            codes += [(0, "TEXT"), (8, "marks"), (10, _mm(x)), (20, _mm(y)), (40, _mm(_LETTERS))]
            codes += [(1, text)]
        codes += [(0, "ENDSEC"), (0, "EOF")]
        return "".join(f"{code}\n{value}\n" for code, value in codes)


def _mm(length: float) -> str:
    return f"{1e3 * length:.9f}"


def pattern(arm: Manipulator, actuator: str | None = None) -> Pattern:
    """Unrolled rings with fibers or muscles: bundles to cut out of sheets.

    A sheet goes around once, along its fibers, and ends at kinks of the profile. At the base, y = 0
    is in its middle; the next sheet is below it. Chords keep within a thousandth of the least
    radius of the arm.

    Args:
        arm: The design.
        actuator: Name of the only fiber or muscle to unroll; None for all.

    Raises:
        InvalidInput: No fiber or muscle has this name.
        NotPossible: The arm has no such pattern; the sentence says why.
    """
    arm = a_manipulator("arm", arm)
    named = {part.name: part for part in arm.actuators if isinstance(part, SectorActuator)}
    if actuator is not None:
        named = {actuator: named[as_one_of("actuator", actuator, named)]}
    if not named or not arm.rest.is_straight:
        raise NotPossible("only rings with fibers or muscles in an arm that is straight unroll")
    lines, labels, top = list[tuple[str, Array]](), list[tuple[str, Array]](), np.inf
    for part in named.values():
        start, end = part.span(arm.length)
        kinks = [z for z in arm.profile.breakpoints if start < z < end]
        for piece in pairwise([start, *kinks, end]):
            sheet = _sheet(arm, part, *piece)
            highest = max(points[:, 1].max() for _, points in sheet)
            shift = np.array([0.0, min(0.0, top - _GAP - highest)])
            sheet = [(layer, points + shift) for layer, points in sheet]
            middles = [points[0] for layer, points in sheet if layer == "marks"]
            labels += zip(part.bundle_names, middles, strict=False)
            lines += sheet
            top = min(points[:, 1].min() for _, points in sheet)
    return Pattern(lines=tuple(lines), labels=tuple(labels))


def _sheet(
    arm: Manipulator, part: SectorActuator, start: float, end: float
) -> list[tuple[str, Array]]:
    """Lines of a ring from one station to another, between which the profile is a cone.

    A place at θ from the middle of the sheet is ψ = θ sin φ about the apex from there.
    """
    profile, ring, z = arm.profile, arm.section.ring(part.ring), np.linspace(start, end, 65)
    ratio, tangent = 0.5 * (ring.inner_ratio + ring.outer_ratio), profile.slope(z[1:-1])
    slope = ratio * tangent[0]
    sine, turned = slope / np.hypot(1.0, slope), part.rotation(profile, ring, z)
    if np.ptp(tangent) > 1e-9:
        raise NotPossible(
            "a profile that is curved along the arm does not unroll: make it of cones"
        )
    if abs(sine) * (np.ptp(turned) + 2.0 * np.pi) >= 2.0 * np.pi:
        raise NotPossible(f"{part.name} winds over itself once it is unrolled")
    angles = np.sort(part.start_angles % (2.0 * np.pi))
    gaps = np.diff(angles, append=angles[0] + 2.0 * np.pi)
    seam = angles[gaps.argmax()] + 0.5 * gaps.max()

    def flat(z: Array, aside: Array) -> Array:
        theta = part.rotation(profile, ring, z) - turned[0] + aside
        along, radius = (z - start) * np.hypot(1.0, slope), ratio * profile.radius(z)
        bulge = 0.5 * ratio * profile.radius(start) * sine * theta**2
        x = along * np.cos(sine * theta) + bulge * np.sinc(0.5 * sine * theta / np.pi) ** 2
        return np.stack([x, -radius * theta * np.sinc(sine * theta / np.pi)], axis=1)

    def edge(middle: float, half: float, corner: Array) -> Array:
        z = np.interp(corner, _CORNERS, [start, end, end, start, start])
        return flat(z, middle + half * np.interp(corner, _CORNERS, [-1, -1, 1, 1, -1]))

    middles = (part.start_angles - seam) % (2.0 * np.pi) - np.pi
    lines = [("marks", traced(arm, partial(edge, each, 0.0), 0, 1)) for each in middles]
    lines.append(("ring", traced(arm, partial(edge, 0.0, np.pi), *_CORNERS)))
    for each in middles:
        lines.append(("cut", traced(arm, partial(edge, each, 0.5 * part.extent), *_CORNERS)))
    zeros = flat(z[[0, -1]], (-seam - turned[[0, -1]]) % (2.0 * np.pi) - np.pi)
    for zero, inward in zip(zeros, (_LETTERS, -_LETTERS), strict=True):
        lines.append(("marks", zero + [[0.0, 0.0], [inward, 0.0]]))
    return lines
