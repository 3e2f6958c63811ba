"""A closed surface around a cloud, with the volume inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.geometry.surface import compact_surface, enclosed_volume, surface_area, unit_scale
from softreach.support.arrays import Faces, Points
from softreach.support.quantity import quantity
from softreach.support.versions import versions

if TYPE_CHECKING:
    import xarray as xr


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

    @property
    def bias(self) -> float | None:
        """Estimated error of the volume [m³], below zero if it is too small."""
        return None if self.volume_corrected is None else self.volume - self.volume_corrected

    def _repr_html_(self) -> str:
        from softreach.picture import Skin, html_card

        return html_card(repr(self), Skin(self.vertices, self.faces))

    def to_dataset(self) -> xr.Dataset:
        """`vertices` (vertex, axis) [m], `faces` (face, corner) and the numbers as variables."""
        import xarray as xr

        numbers = {
            "volume": ("m3", "volume"),
            "area": ("m2", "area of the surface, inner walls included"),
            "alpha": ("m", "radius of the alpha shape"),
            "regions": ("1", "parts connected through faces"),
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
    return Hull(
        vertices=vertices,
        faces=faces,
        volume=enclosed_volume(vertices, faces),
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
