"""A closed surface around a cloud, with the volume inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softreach.arrays import Faces, Points
from softreach.geometry.delaunay import finite_points, unit_scale

__all__ = ["Hull", "convex_hull", "enclosed_volume", "surface_area"]


@dataclass(frozen=True, kw_only=True, eq=False)
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
    """Number of parts that hang together by faces."""
    n: int
    """Number of points N of the cloud."""
    volume_corrected: float | None = None
    """2 V(N) - V(N/4) [m³], an estimate of the volume of infinitely many points.

    The volume of a random cloud falls short by an amount that shrinks as N^-1/2. None if not asked
    for, or if the quarter is too sparse for the radius.
    """

    @property
    def spacing(self) -> float:
        """Mean distance between neighboring points, (V/N)^(1/3) [m]."""
        return float(np.cbrt(self.volume / self.n)) if self.n else 0.0

    @property
    def bias(self) -> float | None:
        """By how much the volume is estimated to be off [m³], below zero if it is too small."""
        return None if self.volume_corrected is None else self.volume - self.volume_corrected

    def __repr__(self) -> str:
        shape = "convex hull" if np.isinf(self.alpha) else f"alpha shape of {self.alpha:.4g} m"
        size = f"volume {self.volume:.6g} m³, area {self.area:.6g} m²"
        parts = f"{self.regions} region{'s' * (self.regions != 1)}, {len(self.faces)} faces"
        return f"<Hull: {shape} around {self.n} points, {size}, {parts}>"

    def _repr_html_(self) -> str:
        """What `repr` says below a small picture, for notebooks."""
        from softreach.picture import Skin, html_card

        return html_card(repr(self), Skin(self.vertices, self.faces))


def convex_hull(points: np.ndarray) -> Hull:
    """The convex hull of a cloud by Qhull.

    Points in one plane, on one line or fewer than four have volume 0 and no faces.

    Args:
        points: Positions [m], shape (n, 3).

    Raises:
        InvalidInput: Points of another shape, or not finite.
    """
    points = finite_points(points)
    vertices, faces = _convex_surface(points)
    volume = enclosed_volume(vertices, faces)
    return Hull(
        vertices=vertices,
        faces=faces,
        volume=volume,
        area=surface_area(vertices, faces),
        alpha=np.inf,
        regions=int(len(faces) > 0),
        n=len(points),
    )


def _convex_surface(points: Points) -> tuple[Points, Faces]:
    """Corners and outward faces; none if the cloud is flat."""
    from scipy.spatial import ConvexHull, QhullError  # lazily

    scaled, _ = unit_scale(points)
    if len(points) < 4:
        return np.empty((0, 3)), np.empty((0, 3), np.int32)
    try:
        hull = ConvexHull(scaled - scaled.mean(axis=0))
    except QhullError:
        return np.empty((0, 3)), np.empty((0, 3), np.int32)
    corners = hull.points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("fi,fi->f", normals, hull.equations[:, :3]) < 0
    faces = hull.simplices.copy()
    faces[inward] = faces[inward][:, ::-1]
    return compact_surface(points, faces)


def compact_surface(points: Points, faces: Faces) -> tuple[Points, Faces]:
    """The points that faces use, and the faces in their numbering."""
    used = np.zeros(len(points), bool)
    used[faces] = True
    number = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return points[used], number[faces]


def enclosed_volume(vertices: Points, faces: Faces) -> float:
    """Volume inside an oriented closed surface [m³] by the divergence theorem."""
    if len(faces) == 0:
        return 0.0
    scaled, exponent = unit_scale(vertices)
    a, b, c = np.moveaxis((scaled - scaled.mean(axis=0))[faces], 1, 0)
    return float(np.ldexp(np.einsum("fi,fi->", a, np.cross(b, c)) / 6.0, 3 * exponent))


def surface_area(vertices: Points, faces: Faces) -> float:
    """Area of a surface [m²]."""
    scaled, exponent = unit_scale(vertices)  # squares of squares overflow early
    a, b, c = np.moveaxis(scaled[faces], 1, 0)
    twice = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    return float(np.ldexp(twice / 2.0, 2 * exponent))
