"""What arms that move in one plane reach: a region with an area, of any number of bundles."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.base import Base
from softreach.geometry.flat import Plane, are_inside, convex_edges, enclosed_area, plane_of
from softreach.geometry.surface import Surface, compact_surface
from softreach.rod.rods import ArmMap
from softreach.rod.tip_map import TipMap
from softreach.sampling import cube_blocks
from softreach.support.arrays import Array, Index, as_points
from softreach.support.errors import MissingExtra
from softreach.support.progress import Progress
from softreach.workspace.convex import HullCorners, climbed_hull
from softreach.workspace.flux import box_slopes
from softreach.workspace.grid import cube_grid
from softreach.workspace.image import Lattice
from softreach.workspace.measure import Estimate
from softreach.workspace.redundant import (
    CLIMBERS,
    cloud_on_faces,
    flooded,
    lost_share,
    shifted_lattice,
)
from softreach.workspace.search import ENOUGH, Flood
from softreach.workspace.thin import ReachableSurface, by_nodes, threads
from softreach.workspace.wrap import DISTANCE, drawn_tight

_SAMPLES = 256  # of the box, that tell whether all tips lie in one plane
_FLAT = 4.0  # tolerances of a tip: what is no thicker is flat
_RULE = 2.5  # cells along the mean side, times the root of the accuracy
_FEWEST = 24.0
_MOST = 1024.0  # cells along the longer side
_FINER = 1.5
_SIGNS = 16  # cells of the grid that tells whether two bundles fold


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ReachableRegion(ReachableSurface):
    """A region of a plane, which has an area, each place counted once, and no volume."""

    _stored: ClassVar[tuple[str, ...]] = "area", "convex_area", "convex_volume", "unreachability"

    convex_area: float
    """Area of the convex hull [m²]."""
    convex_area_error: float
    """Half of what is between two bounds [m²]."""
    outline: Surface = field(repr=False)
    """Closed curves of tips around the region and its holes [m]: lines from tip to tip, as
    triangles that repeat a corner. Parts of them may enclose nothing."""

    def distance(self, points: ArrayLike) -> Array:
        """Distance of points to the region [m], never negative."""
        return np.minimum(
            super().distance(points), self.outline.distance(as_points("points", points))
        )

    def _sizes(self) -> tuple[float, float, float, float]:
        return self.area, self.area_error, self.convex_area, self.convex_area_error

    def _lines(self) -> list[str]:
        size, hull = super()._lines()
        return [f"{size} in one {'plane' if self.convex_area else 'line'}", hull]


class _FlatCorners(HullCorners):
    """Corners of a convex hull in the plane z = 0, with edges for faces and an area for volume."""

    __slots__ = ()
    hull_of = staticmethod(convex_edges)

    @property
    def facets(self) -> Array:
        a, b = np.moveaxis(self.tips[self.faces], 1, 0)
        x, y = (b - a)[:, :2].T
        return np.stack([y, -x, np.zeros_like(x)], axis=1)

    @property
    def volume(self) -> float:
        return enclosed_area(self.tips, self.faces)


def plane_of_tips(tip_map: TipMap) -> Plane | None:
    """The plane in which all tips lie to their tolerance; None if there is none."""
    (cube,) = cube_blocks("sobol", _SAMPLES, tip_map.box.dimension, 0, _SAMPLES)
    tips = tip_map.tips(tip_map.box.from_free_cube(np.concatenate([cube, np.rint(cube)])))
    tips = tips[np.isfinite(tips[:, 0])]
    return plane_of(tips, _FLAT * tip_map.tol * tip_map.length) if len(tips) > 2 else None


def planar_set(
    tip_map: TipMap, plane: Plane, accuracy: float, progress: Progress
) -> ReachableRegion:
    """The region that a tip map reaches in a plane, as `searched_set` finds volumes in space.

    Args:
        tip_map: The tip map, of two free bundles or more.
        plane: The plane in which its tips lie.
        accuracy: Relative error asked of the area.
        progress: Called with the number of centers searched since its last call.

    Raises:
        MissingExtra: scikit-image is not installed.
    """
    turned = Base(
        points=tuple(map(tuple, plane.rotation.tolist())),  # pyright: ignore[reportArgumentType]
        position=tuple((-plane.rotation @ plane.origin).tolist()),  # pyright: ignore[reportArgumentType]
    )
    flat = ArmMap.of(tip_map, turned)  # in the axes of the plane
    cloud = gamma, tips = cloud_on_faces(flat, 0)
    sides = np.ptp(tips[:, :2], axis=0)
    mean = float(np.sqrt(np.prod(sides)))
    edge = max(min(np.sqrt(accuracy) / _RULE, 1.0 / _FEWEST) * mean, float(sides.max()) / _MOST)

    def outline(edge: float) -> _Outline:
        x, y, _ = (lattice := shifted_lattice(tips, edge)).shape
        layers = Lattice(np.array([*lattice.origin[:2], -2.0 * edge]), edge, (x, y, 5))
        return _Outline.of(flooded(Flood(flat, layers, progress, is_flat=True), *cloud))

    coarse = outline(_FINER * edge)
    while True:
        found = outline(edge)
        slack = found.length * (ENOUGH * edge + tip_map.tol * tip_map.length)
        area = Estimate(found.area, abs(found.area - coarse.area) + slack)
        if area.error <= accuracy * area.value or edge / _FINER < sides.max() / _MOST:
            break
        edge, coarse = edge / _FINER, found
    area = _smooth(tip_map, flat, area)
    cube = tip_map.box.to_cube(np.concatenate([gamma[:CLIMBERS], found.gamma]))[:, tip_map.box.free]
    convex = climbed_hull(flat, cube, accuracy, _FlatCorners).volume
    return ReachableRegion(
        tip_map=tip_map,
        area=area.value,
        area_error=area.error,
        convex_area=convex.value,
        convex_area_error=convex.error,
        lost_share=lost_share(tip_map),
        outline=threads(plane.places(found.tips), found.edges),
        mapped_grid=_mesh(found, plane),
    )


class _Outline(NamedTuple):
    """Closed curves of tips around a region."""

    tips: Array
    """Shape (n, 3)."""
    gamma: Array
    """Activations that lead to them, shape (n, bundles)."""
    edges: Index
    """From each tip to the next of its curve, shape (e, 2)."""
    centers: Array
    """Of cells that are reached [m], shape (c, 3)."""

    @classmethod
    def of(cls, flood: Flood) -> _Outline:
        """The level set of the distances, drawn tight."""
        try:
            from skimage.measure import find_contours
        except ImportError as error:
            raise MissingExtra(("scikit-image", "surface")) from error
        curves = find_contours(flood.distances[:, :, 2], DISTANCE, positive_orientation="low")
        at = np.insert(np.concatenate([np.empty((0, 2)), *curves]), 2, 2.0, axis=1)
        first = np.delete(np.arange(len(at)), np.cumsum([len(curve) for curve in curves]) - 1)
        gamma, tips, _ = drawn_tight(flood, at)
        edges = np.stack([first, first + 1], axis=1)
        return cls(tips, gamma, edges, flood.centers(np.flatnonzero(flood.gap == 0.0)))

    @property
    def area(self) -> float:
        return enclosed_area(self.tips, self.edges)

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.diff(self.tips[self.edges], axis=1), axis=2).sum())


def _smooth(tip_map: TipMap, flat: TipMap, area: Estimate) -> Estimate:
    """The area of two bundles that do not fold by Gauss nodes, as far as the outline agrees."""
    if tip_map.box.dimension != 2 or tip_map.supports_unstable or not tip_map.is_smooth:
        return area
    grid = cube_grid(_SIGNS)[:, :2]
    sign = np.linalg.det(box_slopes(flat, grid)[1][:, :2])
    smooth = by_nodes(tip_map)
    folds = sign.min() * sign.max() <= 0.0 or abs(smooth.value - area.value) > area.error
    return area if folds else smooth


def _mesh(outline: _Outline, plane: Plane) -> Surface:
    """Triangles of the region: those of its outline and of centers inside."""
    from scipy.spatial import Delaunay

    points = np.concatenate([outline.tips, outline.centers])
    if len(points) < 3 or not outline.area > 0.0:
        return Surface(vertices=np.empty((0, 3)), faces=np.empty((0, 3), np.int32))
    points = np.unique(points, axis=0)
    faces = Delaunay(points[:, :2], qhull_options="QJ Pp").simplices
    kept = are_inside(points[faces].mean(axis=1), outline.tips[outline.edges])
    vertices, faces = compact_surface(plane.places(points), faces[kept].astype(np.int32))
    return Surface(vertices=vertices, faces=faces)
