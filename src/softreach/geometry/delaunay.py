"""The Delaunay triangulation of a cloud, exact whatever the points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from softreach.geometry.surface import unit_scale
from softreach.kernels.points.bowyer_watson import insertion_order, triangulate
from softreach.support.arrays import Points

_SAMPLED = 512
_NEIGHBORS = 16


def delaunay(points: np.ndarray) -> Delaunay:
    """Triangulate finite points (n, 3) [m], by exact predicates and so right for any input.

    Coordinates smaller than 2^-200 of the largest count as zero.
    """
    scaled, _ = unit_scale(points)
    tetrahedra = neighbors = np.empty((0, 4), np.int32)
    if len(points) >= 4:
        order = insertion_order(scaled)  # keeps the work local
        cells, neighbors, _ = triangulate(scaled[order], partial(lies_on_curve, scaled))
        tetrahedra = order.astype(np.int32)[cells]
    return Delaunay(points=points, tetrahedra=tetrahedra, neighbors=neighbors)


@dataclass(frozen=True, kw_only=True, eq=False)
class Delaunay:
    """Tetrahedra whose circumscribed spheres hold no other point; of equal points one is a vertex.

    Points in one plane, on one line or fewer than four give no tetrahedra at all; nor do more than
    some hundreds on a curve in space, of which nearly every pair would have an edge.
    """

    points: Points  # positions [m], (n, 3)
    tetrahedra: np.ndarray  # vertices as indices of points, positively oriented, (m, 4)
    neighbors: np.ndarray  # number i shares the face opposite vertex i; -1 outside the hull, (m, 4)


def lies_on_curve(points: Points) -> bool:
    """True if neighbors of points are strung along a line, as the tips of one bundle are."""
    return local_dimension(points) < 1.5


def local_dimension(points: Points) -> float:
    """The power with which the number of neighbors grows with distance: 1 on a curve, 2, 3.

    The estimate of largest likelihood over the 16 nearest others of 512 points at most (Levina,
    Bickel 2004, NIPS 17; likelihoods multiplied: MacKay, Ghahramani 2005), to some percent; 0 for
    fewer than 17 different points.
    """
    from scipy.spatial import KDTree  # lazily

    distinct = np.unique(points, axis=0)
    if len(distinct) <= _NEIGHBORS:
        return 0.0
    count = min(_SAMPLED, len(distinct))
    chosen = np.random.default_rng(0).choice(len(distinct), count, replace=False)
    distance = np.asarray(KDTree(distinct).query(distinct[chosen], k=_NEIGHBORS + 1)[0])[:, 1:]
    growth = np.log(distance[:, -1:] / distance[:, :-1]).sum()
    return float(count * (_NEIGHBORS - 1) / growth) if growth > 0 else 0.0  # one sets the scale
