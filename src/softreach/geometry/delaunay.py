"""The Delaunay triangulation of a cloud, exact whatever the points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from softreach.geometry.surface import unit_scale
from softreach.kernels.points.bowyer_watson import triangulate
from softreach.kernels.points.spatial_sort import insertion_order
from softreach.support.arguments import as_one_of
from softreach.support.arrays import Points, as_points

_SAMPLED = 512
_NEIGHBORS = 16
_FEW = 1000  # of which even those on a curve are soon triangulated
METHODS = ("auto", "numba", "qhull")


def delaunay(points: np.ndarray, method: Literal["auto", "numba", "qhull"] = "auto") -> Delaunay:
    """Triangulate a cloud of points.

    ``"numba"`` (which ``"auto"`` means) inserts one point after the other with exact predicates
    and is right for any input, see `softreach.kernels.points.bowyer_watson`. ``"qhull"`` is
    SciPy's, several
    times slower; among near-duplicate or cospherical points it may leave some out.

    Coordinates smaller than 2^-200 of the largest count as zero.

    Args:
        points: Positions [m], shape (n, 3).
        method: Who triangulates.

    Raises:
        InvalidInput: Points of another shape, or not finite; an unknown method.
    """
    points = as_points("points", points)
    as_one_of("method", method, METHODS)
    build = _by_qhull if method == "qhull" else _by_insertion
    tetrahedra, neighbors, duplicate_of = build(unit_scale(points)[0])
    return Delaunay(
        points=points, tetrahedra=tetrahedra, neighbors=neighbors, duplicate_of=duplicate_of
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Delaunay:
    """Tetrahedra whose circumscribed spheres hold no other point.

    Points in one plane, on one line or fewer than four give no tetrahedra at all; nor do more than
    some hundreds on a curve in space, of which nearly every pair would have an edge.
    """

    points: Points
    """Positions [m], shape (n, 3)."""
    tetrahedra: np.ndarray
    """Vertices as indices of points, positively oriented, shape (m, 4)."""
    neighbors: np.ndarray
    """Neighbor i shares the face opposite vertex i; -1 outside the hull. Shape (m, 4)."""
    duplicate_of: np.ndarray
    """For each point itself, or the equal point that stands for it; shape (n,)."""


def lies_on_curve(points: Points) -> bool:
    """True if neighbors of points are strung along a line, as the tips of one bundle are."""
    return local_dimension(points) < 1.5


def local_dimension(points: Points) -> float:
    """The power with which the number of neighbors grows with distance: 1 on a curve, 2, 3.

    The estimate of largest likelihood over the 16 nearest others of 512 points at most; its
    standard error is some percent. Bends and borders make it smaller, noise larger.

    Args:
        points: Positions, shape (n, 3); equal ones count once.

    Returns:
        The dimension [-]; 0 for fewer than 17 different points.

    References:
        Levina, Bickel (2004), Maximum likelihood estimation of intrinsic dimension, NIPS 17.
        MacKay, Ghahramani (2005), Comments on it: likelihoods are multiplied, not estimates added.
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


def _by_insertion(points: Points) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Our own triangulation; points enter it in an order that keeps the work local."""
    if len(points) < 4:
        return *_nothing(), _first_equal(points)
    order = insertion_order(points)
    cells, neighbors, same = triangulate(points[order], partial(lies_on_curve, points))
    if len(cells) == 0:
        return *_nothing(), _first_equal(points)
    duplicate_of = np.empty(len(points), np.int64)
    duplicate_of[order] = order[same]
    return order.astype(np.int32)[cells], neighbors, duplicate_of


def _by_qhull(points: Points) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """SciPy's triangulation of the distinct points, its cells turned to positive orientation."""
    from scipy.spatial import Delaunay as Qhull  # lazily
    from scipy.spatial import QhullError

    duplicate_of = _first_equal(points)
    distinct = np.unique(duplicate_of)
    if len(distinct) < 4 or (len(distinct) > _FEW and lies_on_curve(points)):
        return *_nothing(), duplicate_of
    inner = points[distinct] - points[distinct].mean(axis=0)
    try:
        triangulation = Qhull(inner, qhull_options="Qbb Qc Qz Q12")
    except QhullError:  # flat
        return *_nothing(), duplicate_of
    cells, neighbors = _positively_oriented(inner, triangulation.simplices, triangulation.neighbors)
    return distinct.astype(np.int32)[cells], neighbors, duplicate_of


def _positively_oriented(
    points: Points, cells: np.ndarray, neighbors: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Copies with two vertices exchanged where det[b-a, c-a, d-a] < 0."""
    corners = points[cells]
    negative = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    swap = np.array([1, 0, 2, 3])
    cells, neighbors = cells.copy(), neighbors.copy()
    cells[negative] = cells[negative][:, swap]
    neighbors[negative] = neighbors[negative][:, swap]
    return cells, neighbors


def _nothing() -> tuple[np.ndarray, np.ndarray]:
    """No cells and no neighbors."""
    return np.empty((0, 4), np.int32), np.empty((0, 4), np.int32)


def _first_equal(points: Points) -> np.ndarray:
    """For each point the first that equals it."""
    _, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    return first[inverse.reshape(-1)] if len(points) else np.empty(0, np.int64)
