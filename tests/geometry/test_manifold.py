"""Surfaces that touch themselves along edges: parted, closed, and of the same volume."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.geometry.alpha_shape import AlphaComplex
from softreach.geometry.delaunay import delaunay
from softreach.geometry.manifold import parted
from softreach.geometry.surface import Surface, enclosed_volume, plane_cut


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


# Curves in which a plane cuts a surface


SIDES = 96


def torus(large: float = 1.0, small: float = 0.3) -> Surface:
    """Around z, of even quadrilaterals cut in two."""
    turn = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    u, v = (grid.ravel() for grid in np.meshgrid(turn, turn, indexing="ij"))
    away = large + small * np.cos(v)
    vertices = np.stack([away * np.cos(u), away * np.sin(u), small * np.sin(v)], axis=1)
    i, j = (grid.ravel() for grid in np.meshgrid(*[np.arange(SIDES)] * 2, indexing="ij"))
    a, b = i * SIDES + j, (i + 1) % SIDES * SIDES + j
    c, d = (i + 1) % SIDES * SIDES + (j + 1) % SIDES, i * SIDES + (j + 1) % SIDES
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Surface(vertices=vertices, faces=faces)


@pytest.mark.parametrize("at", [0.0, 0.1, -0.25])
def test_a_plane_across_the_axis_of_a_torus_cuts_two_circles(at):
    curves = plane_cut(torus(), 2, at)
    half = np.sqrt(0.3**2 - at**2)
    radii = sorted(float(np.linalg.norm(curve[:, :2], axis=1).mean()) for curve in curves)
    assert radii == pytest.approx([1 - half, 1 + half], abs=2e-3)
    for curve in curves:
        np.testing.assert_array_equal(curve[0], curve[-1])
        np.testing.assert_array_equal(curve[:, 2], at)


def test_a_plane_through_the_axis_of_a_torus_cuts_its_tube_twice():
    curves = plane_cut(torus(), 0, 0.0)
    assert len(curves) == 2
    for curve in curves:
        away = np.hypot(np.abs(curve[:, 1]) - 1.0, curve[:, 2])
        np.testing.assert_allclose(away, 0.3, atol=2e-3)


def test_a_plane_beside_a_surface_cuts_nothing():
    assert plane_cut(torus(), 2, 0.31) == []


def test_the_cut_of_a_sheet_is_open_and_runs_from_edge_to_edge():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    sheet = Surface(vertices=vertices, faces=np.array([[0, 1, 2], [0, 2, 3]]))
    (curve,) = plane_cut(sheet, 0, 0.25)
    assert sorted(curve[[0, -1], 1]) == [0.0, 1.0]
    np.testing.assert_allclose(curve[:, 0], 0.25)
