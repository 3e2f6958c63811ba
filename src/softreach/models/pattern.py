"""Patterns of rings: sheets to cut, which lie around the arm where its fibers and muscles are."""

from functools import partial
from html import escape

import numpy as np

from softreach.arm.actuators import SectorActuator
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.models.solids import traced
from softreach.support.arguments import as_one_of
from softreach.support.arrays import Array
from softreach.support.errors import NotPossible

Lines = list[tuple[str, str, Array]]  # Layer, name where it begins, and points of each

_COLORS = {"cut": "#e00000", "ring": "#000000", "marks": "#0050d0"}
_GAP, _LETTERS = 0.005, 0.002  # between sheets, and height of letters [m]
_CORNERS = range(5)  # of a sheet and of bundles, from base to tip and back


def pattern(arm: Manipulator, *, format: str = "svg") -> str:
    """Unrolled rings of fibers or muscles, 1:1 in mm, to cut bundles out of sheets.

    A sheet lies in the middle of its ring and goes around once, along its fibers. One sees its
    outside, with x from base to tip and y = 0 in the middle of the first sheet at the base; others
    are below it. Edges of bundles are in the layer "cut", those of sheets in "ring", middle lines
    and names of bundles in "marks", with two short lines where the polar angle is 0. Chords keep
    within a thousandth of the least radius of the arm.

    Args:
        arm: The design.
        format: "svg", or "dxf" for DXF R12.

    Returns:
        The text of the file.

    Raises:
        InvalidInput: Another format.
        NotPossible: The arm has no such pattern; the sentence says why.
    """
    write = {"svg": _svg, "dxf": _dxf}[as_one_of("format", format, ("svg", "dxf"))]
    arm = a_manipulator("arm", arm)
    parts = [part for part in arm.actuators if isinstance(part, SectorActuator)]
    if not parts or not arm.rest.is_straight:
        raise NotPossible("only rings with fibers or muscles in an arm that is straight unroll")
    sheets = [_sheet(arm, part) for part in parts]
    heights = np.concatenate([points[:, 1] for sheet in sheets for *_, points in sheet])
    below = np.array([0.0, np.ptp(heights) + _GAP])
    lines = [(x, name, p - k * below) for k, sheet in enumerate(sheets) for x, name, p in sheet]
    return write(lines)


def _sheet(arm: Manipulator, part: SectorActuator) -> Lines:
    """Lines of the ring of an actuator, the middle lines of its bundles first.

    A place at θ from the middle of the sheet is at ψ = θ sin φ about the apex of the cone.
    """
    (start, end), profile, ring = part.span(arm.length), arm.profile, arm.section.ring(part.ring)
    z, ratio = np.linspace(start, end, 65), 0.5 * (ring.inner_ratio + ring.outer_ratio)
    slope, turned = ratio * profile.slope(z[1:-1]), part.rotation(profile, ring, z)
    if np.ptp(slope) > 1e-9:
        raise NotPossible("a ring unrolls where its profile is one cone: make that a LinearTaper")
    sine = (slope := slope[0]) / np.hypot(1.0, slope)
    if abs(sine) * (np.ptp(turned) + 2.0 * np.pi) >= 2.0 * np.pi:
        raise NotPossible(f"{part.name} winds over itself once it is unrolled")
    seam = part.start_angles[0] - np.pi / part.bundles

    def flat(z: Array, aside: Array) -> Array:
        theta = part.rotation(profile, ring, z) - turned[0] + aside
        along, radius = (z - start) * np.hypot(1.0, slope), ratio * profile.radius(z)
        bulge = 0.5 * ratio * profile.radius(start) * sine * theta**2
        x = along * np.cos(sine * theta) + bulge * np.sinc(0.5 * sine * theta / np.pi) ** 2
        return np.stack([x, -radius * theta * np.sinc(sine * theta / np.pi)], axis=1)

    def edge(middle: float, half: float, corner: Array) -> Array:
        z = np.interp(corner, _CORNERS, [start, end, end, start, start])
        return flat(z, middle + half * np.interp(corner, _CORNERS, [-1, -1, 1, 1, -1]))

    lines, middles = Lines(), (part.start_angles - seam) % (2.0 * np.pi) - np.pi
    for name, middle in zip(part.bundle_names, middles, strict=True):
        lines.append(("marks", name, traced(arm, partial(edge, middle, 0.0), [0, 1])))
        lines.append(("cut", "", traced(arm, partial(edge, middle, 0.5 * part.extent), _CORNERS)))
    lines.append(("ring", "", traced(arm, partial(edge, 0.0, np.pi), _CORNERS)))
    zeros = flat(z[[0, -1]], (-seam - turned[[0, -1]]) % (2.0 * np.pi) - np.pi)
    for zero, inward in zip(zeros, (_LETTERS, -_LETTERS), strict=True):
        lines.append(("marks", "", zero + [[0.0, 0.0], [inward, 0.0]]))
    return lines


def _svg(lines: Lines) -> str:
    every = np.concatenate([points for *_, points in lines])
    (left, low), (width, height) = every.min(axis=0) - _GAP, np.ptp(every, axis=0) + 2.0 * _GAP
    box = f"{_mm(left)} {_mm(-low - height)} {_mm(width)} {_mm(height)}"
    size = f'width="{_mm(width)}mm" height="{_mm(height)}mm" viewBox="{box}"'
    look = f'font-size="{_mm(_LETTERS)}" fill="{_COLORS["marks"]}"'
    rows = [f'<svg xmlns="http://www.w3.org/2000/svg" {size} {look}>']
    for layer, name, points in lines:
        corners = " ".join(f"{_mm(x)},{_mm(-y)}" for x, y in points)
        look = f'class="{layer}" fill="none" stroke="{_COLORS[layer]}" stroke-width="0.1"'
        rows.append(f'<polyline {look} points="{corners}"/>')
        if name:
            x, y = points[0]
            rows.append(f'<text x="{_mm(x)}" y="{_mm(-y)}">{escape(name)}</text>')
    return "\n".join([*rows, "</svg>", ""])


def _dxf(lines: Lines) -> str:
    codes = [(0, "SECTION"), (2, "HEADER"), (9, "$INSUNITS"), (70, "4"), (0, "ENDSEC")]
    codes += [(0, "SECTION"), (2, "ENTITIES")]
    for layer, name, points in lines:
        corners = [[(8, layer), (10, _mm(x)), (20, _mm(y))] for x, y in points]
        codes += [(0, "POLYLINE"), (8, layer), (66, "1")]
        codes += [code for corner in corners for code in [(0, "VERTEX"), *corner]]
        codes += [(0, "SEQEND")]
        if name:
            codes += [(0, "TEXT"), *corners[0], (40, _mm(_LETTERS)), (1, name)]
    return "".join(f"{code}\n{value}\n" for code, value in [*codes, (0, "ENDSEC"), (0, "EOF")])


def _mm(length: float) -> str:
    return f"{1e3 * length:.9f}"
