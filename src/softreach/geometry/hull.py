"""Hulls of points in space and in a plane: volumes, areas, the plane that holds them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.surface import compact_surface, enclosed_volume, surface_area, unit_scale
from softreach.support.arrays import Array, Faces, Index, Mask, Points
from softreach.support.lazy import lazy
from softreach.support.quantity import quantity
from softreach.support.versions import versions

if TYPE_CHECKING:
    import xarray as xr

    from softreach.geometry.meshes import Mesh


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Hull:
    """Triangles around a cloud, the volume that they enclose, and how far to trust it."""

    vertices: Points
    """Corners of the surface [m], shape (v, 3)."""
    faces: Faces
    """Indices into vertices, normals outwards, shape (f, 3)."""
    volume: float
    """Volume [m³], summed over tetrahedra."""
    area: float
    """Area of the surface [m²], inner walls included."""
    alpha: float
    """Radius of the alpha shape [m]; inf for the convex hull."""
    regions: int
    """Number of parts that are connected through faces."""
    largest_region: float
    """Volume of the largest of these [m³]."""
    n: int
    """Number of points N of the cloud."""
    volume_corrected: float | None = None
    """2 V(N) - V(N/4) [m³], an estimate of the volume of infinitely many points.

    The volume of a random cloud falls short by an amount that shrinks as N^-1/2. Gaps narrower than
    twice the radius stay bridged, so that the estimate is too large for what has them. None if not
    asked for, or if the quarter is too sparse for the radius.
    """

    @property
    def spacing(self) -> float:
        """Mean distance between neighboring points, (V/N)^(1/3) [m]; NaN without points."""
        return float(np.cbrt(self.volume / self.n)) if self.n else np.nan

    def contains(self, places: ArrayLike) -> Mask:
        """Mask of places [m], shape (k, 3), that are inside or, to rounding, on the surface.

        Raises:
            NotPossible: There is no volume.
        """
        return self.solid.distance(places) <= 1e-12 * np.abs(self.vertices).max()

    @lazy
    def solid(self) -> Mesh:
        """The space inside."""
        from softreach.geometry.meshes import Mesh
        from softreach.geometry.surface import parted

        vertices, faces = parted(self.vertices, self.faces)
        return Mesh(vertices, faces.astype(np.int64))

    def to_dataset(self) -> xr.Dataset:
        """`vertices` (vertex, axis) [m], `faces` (face, corner) and the numbers as variables."""
        import xarray as xr

        numbers = {
            "volume": ("m3", "volume"),
            "area": ("m2", "area of the surface, inner walls included"),
            "alpha": ("m", "radius of the alpha shape"),
            "regions": ("1", "parts connected through faces"),
            "largest_region": ("m3", "volume of the largest of these"),
            "n": ("1", "points of the cloud"),
            "volume_corrected": ("m3", "volume without sampling bias (estimate)"),
        }
        variables: dict[str, Any] = {
            name: ((), value, {"units": unit, "long_name": meaning})
            for name, (unit, meaning) in numbers.items()
            if (value := getattr(self, name)) is not None
        }
        variables["vertices"] = (("vertex", "axis"), self.vertices, {"units": "m"})
        variables["faces"] = (("face", "corner"), self.faces, {"units": "1"})
        return xr.Dataset(variables, {"axis": list("xyz")}, versions())

    def __repr__(self) -> str:
        regions = f"{self.regions:,} region" + ("s" if self.regions != 1 else "")
        bias, shape = "", "convex hull"
        if self.volume_corrected is not None:
            bias = f" (without sampling bias about {self.volume_corrected:.4g} m³)"
        if np.isfinite(self.alpha):
            ratio = f" ({self.alpha / self.spacing:.2g} mean spacings)" if self.volume > 0 else ""
            shape = f"alpha shape, alpha = {self.alpha:.4g} m{ratio},"
        return (
            f"Hull: volume {quantity(self.volume, 'm³')}{bias}, "
            f"area {quantity(self.area, 'm²')}, {regions}, {len(self.faces):,} triangles\n"
            f"  {shape} of {self.n:,} points"
        )


def convex_hull(points: np.ndarray) -> Hull:
    """The convex hull of a cloud (n, 3) [m] by Qhull; without faces if it is flat."""
    vertices, faces = compact_surface(points, convex_faces(points))
    volume = enclosed_volume(vertices, faces)
    return Hull(
        vertices=vertices,
        faces=faces,
        volume=volume,
        largest_region=volume,
        area=surface_area(vertices, faces),
        alpha=np.inf,
        regions=int(len(faces) > 0),
        n=len(points),
    )


def convex_faces(points: Points) -> Faces:
    """Outward faces of the convex hull, as numbers of the points; none if the cloud is flat."""
    scaled, _ = unit_scale(points)
    if len(points) < 4:
        return np.empty((0, 3), np.int32)
    from scipy.spatial import ConvexHull, QhullError  # lazily

    try:
        hull = ConvexHull(scaled - scaled.mean(axis=0))
    except QhullError:
        return np.empty((0, 3), np.int32)
    a, b, c = np.moveaxis(hull.points[hull.simplices], 1, 0)
    inward = np.einsum("fi,fi->f", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces = hull.simplices.copy()
    faces[inward] = faces[inward][:, ::-1]
    return faces


class Plane(NamedTuple):
    """A plane in space with axes of its own: x and y in it, z its normal."""

    origin: Array  # [m], (3,)
    rotation: Array  # its axes as rows, a rotation, (3, 3)
    sides: Array  # extents of the points along its axes [m], (3,)

    def coordinates(self, points: Points) -> Points:
        """Points [m] in these axes, shape (n, 3)."""
        return (points - self.origin) @ self.rotation.T

    def places(self, coordinates: Points) -> Points:
        """The points back in space [m], shape (n, 3)."""
        return self.origin + coordinates @ self.rotation


def plane_of(points: Points, thickness: float) -> Plane | None:
    """The plane that points (n, 3) lie in to a thickness [m], its axes their principal ones."""
    origin = points.mean(axis=0)
    rotation = np.linalg.svd(points - origin, full_matrices=len(points) < 3)[2]
    rotation[2] *= np.sign(np.linalg.det(rotation))
    sides = np.ptp((points - origin) @ rotation.T, axis=0)
    return Plane(origin, rotation, sides) if sides[2] <= thickness else None


def convex_edges(points: Points) -> Index:
    """Edges of the convex hull of points in the plane z = 0, counterclockwise, shape (e, 2)."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners = ConvexHull(points[:, :2]).vertices
    except (QhullError, ValueError):  # on one line, or too few
        return np.empty((0, 2), np.intp)
    return np.stack([corners, np.roll(corners, -1)], axis=1).astype(np.intp)


def enclosed_area(points: Points, edges: Faces) -> float:
    """Area inside of closed curves in the plane z = 0 [m²], counterclockwise ones above 0."""
    if not len(edges):
        return 0.0
    a, b = np.moveaxis((points - points.mean(axis=0))[edges], 1, 0)
    return 0.5 * float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


def are_inside(points: Points, edges: Array) -> Mask:
    """Mask of points inside of closed curves in the plane z = 0, of edges (e, 2, 3)."""
    odd = np.zeros(len(points), bool)
    for (x, y, _), (u, v, _) in edges:
        if y != v:
            crossed = (points[:, 1] < y) != (points[:, 1] < v)
            odd[crossed] ^= points[crossed, 0] < x + (points[crossed, 1] - y) / (v - y) * (u - x)
    return odd


def alpha_area(points: Points, alpha: float) -> float:
    """Area [m²] of the α-shape, of a radius α [m], of points in the plane z = 0, by triangles."""
    from scipy.spatial import Delaunay, QhullError

    try:
        triangles = Delaunay(points[:, :2]).simplices
    except (QhullError, ValueError):  # on one line, or too few
        return 0.0
    a, b, c = np.moveaxis(points[triangles][..., :2], 1, 0)
    (x, y), (u, v) = (b - a).T, (c - a).T
    area = 0.5 * np.abs(x * v - y * u)
    sides = np.prod([np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return float(area[sides < 4.0 * alpha * area].sum())
