"""Alpha shapes of every radius from one triangulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from softreach.geometry.delaunay import Delaunay
from softreach.geometry.hull import Hull
from softreach.geometry.surface import compact_surface, surface_area, unit_scale
from softreach.kernels.points import alpha as kernels
from softreach.kernels.points.expansions import scratch
from softreach.support import parallel
from softreach.support.lazy import lazy

__all__ = ["AlphaComplex"]

BLOCK = 200_000  # cells measured by one thread at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class AlphaComplex:
    """A triangulation with the radius from which on each tetrahedron belongs to the shape.

    The alpha shape of radius α is the union of the tetrahedra whose circumscribed sphere has a
    radius R <= α (Edelsbrunner and Mücke 1994): what is left of the convex hull after a ball of
    that radius has scooped out everything it can reach without enclosing a point.
    """

    triangulation: Delaunay
    radii: np.ndarray = field(init=False, repr=False)
    """Circumscribed radii [m], shape (m,)."""
    volumes: np.ndarray = field(init=False, repr=False)
    """Volumes of the tetrahedra [m³], shape (m,)."""

    def __post_init__(self) -> None:
        """Measure the tetrahedra."""
        radii, volumes = _measure(self.triangulation)
        object.__setattr__(self, "radii", radii)
        object.__setattr__(self, "volumes", volumes)

    @lazy
    def _curve(self) -> tuple[np.ndarray, np.ndarray]:
        """Radii in increasing order, and the volumes summed up to each."""
        order = np.argsort(self.radii)
        return self.radii[order], np.cumsum(self.volumes[order])

    def volume_curve(self) -> tuple[np.ndarray, np.ndarray]:
        """Every radius at which the volume steps [m], and the volume from there on [m³]."""
        radii, volumes = self._curve
        return radii.copy(), volumes.copy()

    def volume(self, alpha: float | np.ndarray) -> float | np.ndarray:
        """Volume [m³] of the shape at one radius or at an array of radii [m]."""
        if np.ndim(alpha) == 0:  # one sum takes a fiftieth of the time of the sorted curve
            return float(self.volumes[self.radii <= alpha].sum())
        radii, volumes = self._curve
        steps = np.searchsorted(radii, alpha, side="right")
        return np.where(steps > 0, volumes[steps - 1], 0.0) if len(volumes) else 0.0 * steps

    def regions(self, alpha: float) -> int:
        """Number of parts of the shape that are connected through faces."""
        return self._joined(alpha)[1]

    def critical_alpha(self) -> float:
        """The smallest radius [m] at which one region covers all points; inf for a flat cloud.

        The true smallest: below the radius that covers every point no radius will do, and from
        there on the tetrahedra are added one by one. The number of regions is not monotone in the
        radius, so a bisection over it can settle on a larger one. Neither this radius nor the
        volume there converges as a random cloud grows: its most isolated point decides.
        """
        mesh = self.triangulation
        if len(mesh.tetrahedra) == 0:
            return np.inf
        least = np.full(len(mesh.points), -1.0)
        kernels.least_radii(mesh.tetrahedra, self.radii, least)
        covering = least.max()
        parent, regions = self._joined(covering)
        if regions == 1:
            return float(covering)
        later = np.flatnonzero(self.radii > covering)
        order = later[np.argsort(self.radii[later])]
        return float(
            kernels.radius_of_one_region(mesh.neighbors, self.radii, parent, regions, order)
        )

    def _joined(self, alpha: float) -> tuple[np.ndarray, int]:
        """Forest for `kernels.join_regions` to add further tetrahedra, and the number of parts."""
        parent = np.full(len(self.radii), -1, np.int32)
        neighbors = self.triangulation.neighbors
        return parent, int(kernels.join_regions(neighbors, self.radii <= alpha, parent))

    def _boundary(self, kept: np.ndarray) -> np.ndarray:
        """The faces between kept tetrahedra and the rest, normals outwards, shape (f, 3)."""
        cells, neighbors = self.triangulation.tetrahedra, self.triangulation.neighbors
        faces = np.empty((0, 3), cells.dtype)
        count = kernels.boundary_faces(cells, neighbors, kept, faces)
        faces = np.empty((count, 3), cells.dtype)
        kernels.boundary_faces(cells, neighbors, kept, faces)
        return faces

    def hull(self, alpha: float) -> Hull:
        """The shape of one radius [m]: surface, volume, area and regions."""
        mesh, kept = self.triangulation, self.radii <= alpha
        vertices, faces = compact_surface(mesh.points, self._boundary(kept))
        return Hull(
            vertices=vertices,
            faces=faces,
            volume=float(self.volumes[kept].sum()),
            area=surface_area(vertices, faces),
            alpha=float(alpha),
            regions=self.regions(alpha),
            n=len(mesh.points),
        )


def _measure(mesh: Delaunay) -> tuple[np.ndarray, np.ndarray]:
    """Radii [m] and volumes [m³] of all tetrahedra, on all threads."""
    points, exponent = unit_scale(mesh.points)
    radii, volumes = np.empty((2, len(mesh.tetrahedra)))

    def task(part: slice) -> Callable[[], object]:
        return partial(
            kernels.measure_cells,
            points,
            mesh.tetrahedra[part],
            scratch(),
            radii[part],
            volumes[part],
        )

    parallel.run(task(part) for part in parallel.blocks(len(radii), BLOCK))
    return np.ldexp(radii, exponent), np.ldexp(volumes, 3 * exponent)
