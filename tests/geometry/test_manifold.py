"""Surfaces that touch themselves along edges: parted, closed, and of the same volume."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.geometry.alpha_shape import AlphaComplex
from softreach.geometry.delaunay import delaunay
from softreach.geometry.manifold import parted
from softreach.geometry.surface import enclosed_volume


def faces_at_edges(faces) -> np.ndarray:
    """The number of faces at each edge, one for either direction of it."""
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    return np.unique(sides, axis=0, return_counts=True)[1]


def wedges(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Tetrahedra around the edge from (0, 0, 0) to (0, 0, 1), which they share."""
    vertices, faces = [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)], []
    for k in range(count):
        turn = 2 * np.pi * k / count + np.array([0.0, 0.9])
        vertices += [(np.cos(angle), np.sin(angle), 0.5) for angle in turn]
        c, d = len(vertices) - 2, len(vertices) - 1
        faces += [(0, c, d), (1, d, c), (0, 1, c), (1, 0, d)]
    return np.array(vertices), np.array(faces)[:, ::-1]


@pytest.mark.parametrize("count", [2, 3, 5])
def test_tetrahedra_around_an_edge_come_apart_there(count):
    vertices, faces = wedges(count)
    assert enclosed_volume(vertices, faces) > 0
    assert faces_at_edges(faces).max() == count
    points, triangles = parted(vertices, faces)
    assert (faces_at_edges(triangles) == 1).all()
    assert len(points) == len(vertices) + count
    volume = enclosed_volume(vertices, faces)
    assert volume * 0.995 < enclosed_volume(points, triangles) < volume


def test_one_tetrahedron_is_as_it_was():
    vertices, faces = wedges(1)
    points, triangles = parted(vertices, faces)
    assert points is vertices
    np.testing.assert_array_equal(triangles, faces)


def test_alpha_shapes_full_of_holes_come_apart_too(rng):
    shape = AlphaComplex(triangulation=delaunay(rng.random((1500, 3))))
    hull = shape.hull(0.09)
    assert faces_at_edges(hull.faces).max() > 1
    points, triangles = parted(hull.vertices, hull.faces)
    assert (faces_at_edges(triangles) == 1).all()
    assert enclosed_volume(points, triangles) == pytest.approx(hull.volume, rel=1e-3)
    assert np.isfinite(points).all()


def test_an_open_surface_is_as_it_was():
    vertices, faces = wedges(2)
    assert len(parted(vertices, faces[:-1])[1]) == len(faces) - 1
