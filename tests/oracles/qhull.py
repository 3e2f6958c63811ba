"""Delaunay triangulations by Qhull, through SciPy."""

import numpy as np

from softreach.geometry.alpha_shape import Delaunay
from softreach.geometry.surface import unit_scale

EXCHANGED = np.array([1, 0, 2, 3])


def delaunay(points: np.ndarray) -> Delaunay:
    """The triangulation of points none of which are equal, its cells positively oriented."""
    from scipy.spatial import Delaunay as Qhull  # lazily

    scaled = unit_scale(points)[0]
    mesh = Qhull(scaled - scaled.mean(axis=0), qhull_options="Qbb Qc Qz Q12")
    cells, neighbors = mesh.simplices.copy(), mesh.neighbors.copy()
    corners = mesh.points[cells]
    negative = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    cells[negative] = cells[negative][:, EXCHANGED]
    neighbors[negative] = neighbors[negative][:, EXCHANGED]
    return Delaunay(points=points, tetrahedra=cells, neighbors=neighbors)
