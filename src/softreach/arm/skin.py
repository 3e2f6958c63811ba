"""Skins of an arm on a centerline: its body, and a surface for each bundle where it acts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.actuators import Tendon
from softreach.arm.base import Base
from softreach.arm.body import Body
from softreach.arm.stations import Marker
from softreach.geometry.surface import Surface, grid_faces, joined, ribbon_surface, tube_surface
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr


_LINE = 1 / 400  # radius of a line, in L: what shows in small pictures
_DISK = 1 / 150  # thickness of disks, in L
_LINE_SIDES, _LUMEN_SIDES = 8, 24
_THICKNESS = 0.04  # of closed bands, in R2
_SAME = 1e-9  # of the length, or of R2


@dataclass(frozen=True, kw_only=True, eq=False)
class Centerline:
    """Sections of an arm in one configuration."""

    z: Array  # Stations before activation [m], ascending, shape (station,)
    position: Array  # Their centers [m], shape (station, 3)
    directors: Array  # d1, d2, d3 of each, shape (station, 3, 3)

    @classmethod
    def unactivated(cls, z: Array, base: Base) -> Self:
        """Straight from a base, directors along the axes of that."""
        position = base.to_world(np.column_stack([0 * z, 0 * z, z]))
        directors = base.directions_to_world(np.tile(np.eye(3), (len(z), 1, 1)))
        return cls(z=z, position=position, directors=directors)

    @classmethod
    def of(cls, shape: xr.Dataset | Centerline) -> Centerline:
        """That of one configuration; raises InvalidInput for several, or one without length."""
        if isinstance(shape, Centerline):
            return shape
        if not (least := float(shape["extension"].min())) > 0.0:
            hint = "ask for the configuration of activations within the bounds of the design"
            given, allowed = f"with extension ζ = {least:.4g}", "of an arm that has a length, ζ > 0"
            raise InvalidInput("configuration", given, allowed, hint)
        if "sample" in shape.dims:
            count = shape.sizes["sample"]
            hint = "choose one with configuration.isel(sample=0)"
            raise InvalidInput("configuration.sizes['sample']", count, "absent: one shape", hint)
        return cls(
            z=shape["Z"].values,
            position=shape["position"].transpose("station", "axis").values,
            directors=shape["directors"].transpose("station", "director", "axis").values,
        )

    def with_stations(self, more: ArrayLike) -> Self:
        """The same line with more stations; those that it has, or that lie beyond it, are left."""
        candidates, ends = np.asarray(more, float), self.z[[0, -1]]
        apart = np.abs(candidates[:, None] - self.z).min(axis=1, initial=np.inf)
        within = (candidates > ends[0]) & (candidates < ends[1])
        new = candidates[within & (apart > _SAME * np.ptp(ends))]
        if not len(new):
            return self
        place = np.searchsorted(self.z, new)
        position, directors = self._between(place, new)
        return type(self)(
            z=np.insert(self.z, place, new),
            position=np.insert(self.position, place, position, axis=0),
            directors=np.insert(self.directors, place, directors, axis=0),
        )

    def _between(self, place: NDArray[np.intp], z: Array) -> tuple[Array, Array]:
        """Centers by the cubic with the tangents of its ends, directors turned evenly."""
        low, high = place - 1, place
        s = ((z - self.z[low]) / (self.z[high] - self.z[low]))[:, None]
        p, t = self.position, self.directors[:, 2]
        chord = np.linalg.norm(p[high] - p[low], axis=1, keepdims=True)
        middle = (1 - s) ** 2 * (1 + 2 * s) * p[low] + s**2 * (3 - 2 * s) * p[high]
        middle += s * (1 - s) * chord * ((1 - s) * t[low] - s * t[high])
        d1, d2 = ((1 - s) * self.directors[low, k] + s * self.directors[high, k] for k in (0, 1))
        d1 = _unit(d1)
        d2 = _unit(_across(d2, d1))
        return middle, np.stack([d1, d2, np.cross(d1, d2)], axis=1)


Shape: TypeAlias = "xr.Dataset | Centerline"


class _Span(NamedTuple):
    """Stretch of an arm on which one bundle acts without a gap: stations along the first axis."""

    extent: float
    z: Array
    held: Array  # Z of guides between which a line is straight; none if it follows the arm
    position: Array
    directors: Array
    center: Array
    inner_ratio: Array
    outer_ratio: Array
    arm_radius: Array

    def points(self, angles: Array, radius: Array) -> Array:
        """At polar angles (station, across) and radii (station,), shape (station, across, 3)."""
        d1, d2 = self.directors[:, None, 0], self.directors[:, None, 1]
        spokes = np.cos(angles)[..., None] * d1 + np.sin(angles)[..., None] * d2
        return self.position[:, None] + radius[:, None, None] * spokes

    def curve(self) -> Array:
        """The middle of a line or a lumen, shape (station, 3)."""
        radius = 0.5 * (self.inner_ratio + self.outer_ratio) * self.arm_radius
        curve = self.points(self.center[:, None], radius)[:, 0]
        if not len(self.held):
            return curve
        at = np.abs(self.z - self.held[:, None]).argmin(axis=1)
        return np.column_stack([np.interp(self.z, self.z[at], x[at]) for x in curve.T])

    def band(self, lift: float, step: float) -> Array:
        """Points over the outer radius, `lift` R2 above it, shape (station, across, 3)."""
        across = 2 + int(self.extent / step)
        angles = self.center[:, None] + np.linspace(-self.extent / 2, self.extent / 2, across)
        return self.points(angles, (self.outer_ratio + lift) * self.arm_radius)


def arm_surface(arm: Body, shape: Shape, sides: int = 32) -> Surface:
    """The body of an arm in one configuration with so many sides: a closed tube, the last part.

    Its sections are flat where two bending stiffnesses were measured. Before it come disks that
    stand out of it and hold tendons.
    """
    line = _drawn_line(arm, shape)
    d1, d2 = line.directors[:, 0], line.directors[:, 1]
    if angle := arm.section.bending_angle:
        cos, sin = np.cos(angle), np.sin(angle)
        d1, d2 = cos * d1 + sin * d2, cos * d2 - sin * d1
    first, second = arm.half_axes
    radius = arm.profile.radius(line.z)
    tube = tube_surface(line.position, first * d1, second * d2, radius, sides)
    return joined([*_disk_surfaces(arm, line, sides), tube])


def _disk_surfaces(arm: Body, line: Centerline, sides: int) -> Iterator[Surface]:
    wider = arm.disks.radius > (1.0 + _SAME) * arm.profile.radius(arm.disks.station)
    for z, radius in np.unique(np.column_stack(arm.disks[:2])[wider], axis=0):
        k = int(np.abs(line.z - z).argmin())
        d1, d2, d3 = np.repeat(line.directors[k, :, None], 2, axis=1)
        faces = line.position[k] + np.array([[-0.5], [0.5]]) * _DISK * arm.length * d3
        yield tube_surface(faces, d1, d2, radius, sides)


def bundle_skins(
    arm: Body, shape: Shape, *, lift: float = 0.0, step: float = np.pi / 32
) -> list[Surface]:
    """A surface for each bundle where it acts: bands, thin tubes for lines, tubes for lumens.

    Bands are open, lie `lift` R2 above the outside of their ring, and have a point every `step`
    [rad] across; their points are (stations, across).
    """

    def sector(span: _Span) -> Surface:
        band = span.band(lift, step)
        # along x across is d3 x e_θ = -e_R: turned, so that faces point outwards
        return Surface(vertices=band.reshape(-1, 3), faces=grid_faces(*band.shape[:2])[:, ::-1])

    return _skins(arm, shape, sector)


def bundle_surfaces(arm: Body, shape: Shape) -> list[Surface]:
    """Every bundle as a closed surface; bands are half sunk into the outside of their ring."""

    def sector(span: _Span) -> Surface:
        # along x across is d3 x e_θ = -e_R: the inner patch is the upper one
        upper, lower = (span.band(lift, np.pi / 32) for lift in (_THICKNESS / 2, -_THICKNESS / 2))
        return ribbon_surface(upper, lower)

    return _skins(arm, shape, sector)


def marker_points(markers: Sequence[Marker], shape: Shape) -> Array:
    """Places [m] of markers, between the stations of a configuration for pictures, (marker, 3)."""
    if not markers:
        return np.empty((0, 3))
    line = Centerline.of(shape)
    stations = np.array([marker.station_at("station", line.z[-1]) for marker in markers])
    line = line.with_stations(np.unique(stations))
    section = np.abs(line.z - stations[:, None]).argmin(axis=1)
    offsets = np.array([marker.offset for marker in markers])
    return line.position[section] + np.einsum("mk,mkx->mx", offsets, line.directors[section])


def inside(arm: Body) -> tuple[bool, ...]:
    """Bundles of which the body of the arm hides some part."""
    z = np.union1d(np.linspace(0.0, arm.length, 101), arm.breakpoints)
    outline = arm.outline(z)
    sector = np.array([shape == "sector" for shape in outline.shape])
    place = np.where(sector, outline.outer_ratio, outline.middle_ratio)
    hidden = (place < 1.0 - _SAME) & outline.acts
    return tuple(bool(hidden[:, k].any()) for k in range(arm.bundles))


def _drawn_line(arm: Body, shape: Shape) -> Centerline:
    return Centerline.of(shape).with_stations(arm.breakpoints)


def _skins(arm: Body, shape: Shape, sector: Callable[[_Span], Surface]) -> list[Surface]:
    line, width = _drawn_line(arm, shape), _LINE * arm.length
    outline, radius = arm.outline(line.z), arm.profile.radius(line.z)
    acts = arm.outline(0.5 * (line.z[1:] + line.z[:-1])).acts
    make = {"sector": sector, "line": lambda span: _line_tube(span, width), "lumen": _lumen}

    def span(k: int, part: slice) -> _Span:
        along = (outline.center, outline.inner_ratio, outline.outer_ratio)
        center, inner, outer = (values[part, k] for values in along)
        section = line.position[part], line.directors[part]
        tendon, held = arm.bundle_actuators[k], np.empty(0)
        if isinstance(tendon, Tendon) and tendon.has_guides:
            held = tendon.held_at(arm.length)
        extent, z = float(outline.extent[k]), line.z[part]
        return _Span(extent, z, held, *section, center, inner, outer, radius[part])

    surfaces: list[Surface] = []
    change = np.diff(np.pad(acts.astype(np.int8), ((1, 1), (0, 0))), axis=0)
    for k, kind in enumerate(outline.shape):  # from start to end of each run of pieces that act
        ends = zip(np.flatnonzero(change[:, k] > 0), np.flatnonzero(change[:, k] < 0), strict=True)
        runs = [slice(int(start), int(end) + 1) for start, end in ends]
        surfaces.append(joined([make[kind](span(k, run)) for run in runs]))
    return surfaces


def _line_tube(span: _Span, radius: float) -> Surface:
    curve = span.curve()
    along = _unit(np.gradient(curve, axis=0))
    spoke = span.points(span.center[:, None], np.ones(len(curve)))[:, 0] - span.position
    normal = _unit(_across(spoke, along))
    return tube_surface(curve, normal, np.cross(along, normal), radius, _LINE_SIDES)


def _lumen(span: _Span) -> Surface:
    radius = 0.5 * (span.outer_ratio - span.inner_ratio) * span.arm_radius
    d1, d2 = span.directors[:, 0], span.directors[:, 1]
    return tube_surface(span.curve(), d1, d2, radius, _LUMEN_SIDES)


def _across(vector: Array, along: Array) -> Array:
    return vector - np.sum(vector * along, axis=1, keepdims=True) * along


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector, axis=1, keepdims=True)
