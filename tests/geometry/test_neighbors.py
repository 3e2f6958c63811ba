"""Means over balls equal a loop over all pairs, whatever the cloud and the radius."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.geometry import neighbors
from softreach.geometry.alpha_shape import AlphaComplex, delaunay
from softreach.geometry.neighbors import mean_value_distance
from softreach.geometry.surface import Surface, enclosed_volume, parted, plane_cut, volume_beyond
from softreach.kernels.points.neighbor_sums import stable_order
from softreach.support import parallel
from softreach.support.errors import InvalidInput


def by_all_pairs(points, values, radius, queries=None):
    """The definition, one point after the other."""
    queries = np.arange(len(points)) if queries is None else queries
    means, counts = np.full(len(queries), np.nan), np.zeros(len(queries), int)
    for row, i in enumerate(queries):
        near = ((points - points[i]) ** 2).sum(axis=1) <= radius**2
        near[i] = False
        counts[row] = near.sum()
        if counts[row]:
            means[row] = np.linalg.norm(values[near] - values[i], axis=1).mean()
    return means, counts


def assert_same(found, wanted):
    np.testing.assert_array_equal(found[1], wanted[1])
    np.testing.assert_allclose(found[0], wanted[0], rtol=1e-12, atol=1e-12)


def uneven(n, m, seed=0):
    """A cloud with a dense core, a thin halo, duplicates and one point far away."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3)) * rng.random((n, 1)) ** 3
    points[n // 2 : n // 2 + n // 20] = points[: n // 20]
    points[-1] = [40.0, -30.0, 20.0]
    return points, rng.normal(size=(n, m))


@pytest.mark.parametrize("m", [1, 4])
@pytest.mark.parametrize("radius", [0.0, 1e-9, 0.2, 200.0, np.inf])
def test_equals_a_loop_over_all_pairs(m, radius):
    points, values = uneven(2000, m)
    assert_same(mean_value_distance(points, values, radius), by_all_pairs(points, values, radius))


@given(
    st.integers(1, 40),
    st.floats(-8, 8),
    st.floats(-1e9, 1e9),
    st.floats(0, 2),
    st.integers(0, 2),
    st.integers(0, 99),
)
def test_scale_offset_and_flatness_do_not_matter(n, decade, offset, share, flat, seed):
    rng = np.random.default_rng(seed)
    size = 10.0**decade
    points = np.round(rng.random((n, 3)) * 6) * size
    points[:, :flat] = 0.0
    points += offset
    radius = 6 * size * share
    values = rng.normal(size=(n, 3))
    # a point on the sphere may fall to either side by rounding: compare between lattice radii
    squares = ((points[:, None] - points) ** 2).sum(axis=2)
    if (np.abs(squares - radius**2) > 1e-9 * (radius**2 + np.abs(points).max() ** 2)).all():
        assert_same(
            mean_value_distance(points, values, radius), by_all_pairs(points, values, radius)
        )


def test_the_ball_is_closed():
    lattice = np.stack(np.meshgrid(*3 * [np.arange(11.0)]), axis=-1).reshape(-1, 3)
    values = np.random.default_rng(1).normal(size=(len(lattice), 2))
    for radius in (1.0, 3.0, 5.0):  # with 3-4-5 triangles; all of it exact in binary
        found = mean_value_distance(lattice, values, radius)
        assert_same(found, by_all_pairs(lattice, values, radius))
    center = int(np.flatnonzero((lattice == 5.0).all(axis=1))[0])
    assert mean_value_distance(lattice, values, 1.0)[1][center] == 6


def test_another_point_at_the_place_is_counted_and_an_isolated_one_has_no_mean():
    points, values = np.array([[0.0] * 3] * 3 + [[1.0] * 3]), np.array([[0.0], [1.0], [3.0], [7.0]])
    mean, count = mean_value_distance(points, values, 0.0)
    np.testing.assert_array_equal(count, [2, 2, 2, 0])
    np.testing.assert_allclose(mean, [2.0, 1.5, 2.5, np.nan])


@pytest.mark.parametrize("radius", [0.0, 0.02, 200.0, np.inf])
@pytest.mark.parametrize("flat", [False, True])
def test_a_few_queries_of_many_points_equal_a_loop_over_all_pairs(radius, flat):
    points, values = uneven(120_000, 3)
    points[:, 1] *= not flat
    queries = np.array([119_999, 3, 700, 700, 0, 63_000])
    found = mean_value_distance(points, values, radius, queries)
    assert_same(found, by_all_pairs(points, values, radius, queries))


@given(st.lists(st.integers(0, 2**62) | st.integers(0, 3), min_size=1, max_size=60))
def test_keys_are_put_in_order_and_equal_ones_stay_in_theirs(numbers):
    keys = np.array(numbers)
    order = np.empty(len(keys), np.int64)
    stable_order(keys, order)
    np.testing.assert_array_equal(order, np.argsort(keys, kind="stable"))


def test_no_queries_and_no_points_give_nothing():
    points, values = uneven(100, 3)
    nothing = np.empty(0, np.intp)
    for found in (
        mean_value_distance(points, values, 0.1, nothing),
        mean_value_distance(np.empty((0, 3)), np.empty((0, 3)), 0.1),
    ):
        assert found[0].shape == found[1].shape == (0,)


def test_blocks_and_threads_change_no_bit(monkeypatch):
    points, values = uneven(2000, 3)
    whole = mean_value_distance(points, values, 0.1)[0]
    monkeypatch.setattr(neighbors, "BLOCK", 37)
    monkeypatch.setattr(parallel, "thread_count", lambda: 5)
    np.testing.assert_array_equal(mean_value_distance(points, values, 0.1)[0], whole)


def test_rows_that_are_not_finite_are_refused():
    points, values = uneven(50, 3)
    points[7, 1] = np.nan
    with pytest.raises(InvalidInput, match=r"points\[7\] = .*must be finite numbers"):
        mean_value_distance(points, values, 0.1)
    with pytest.raises(InvalidInput, match=r"values\[7\] = .*must be finite numbers"):
        mean_value_distance(values, points, 0.1)


# Surfaces that touch themselves along edges: parted, closed, and of the same volume


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


@pytest.mark.parametrize("at", [-0.25, 0.0, 0.1, 0.31])
def test_the_volume_of_a_torus_beyond_a_plane_is_that_of_its_rings(at):
    """4π ∫ √(r² - z²) dz from there to r."""
    low = min(at, 0.3)
    right = 2 * np.pi * (0.3**2 * np.arccos(low / 0.3) - low * np.sqrt(0.3**2 - low**2))
    whole = 2 * np.pi**2 * 0.3**2
    assert volume_beyond(torus(), 2, at) == pytest.approx(right, abs=3e-3 * whole)
    both = volume_beyond(torus(), 2, at) + volume_beyond(torus(), 2, at, side=-1)
    assert both == pytest.approx(torus().volume, rel=1e-12)


def test_a_plane_beside_a_surface_cuts_nothing():
    assert plane_cut(torus(), 2, 0.31) == []


def test_the_cut_of_a_sheet_is_open_and_runs_from_edge_to_edge():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    sheet = Surface(vertices=vertices, faces=np.array([[0, 1, 2], [0, 2, 3]]))
    (curve,) = plane_cut(sheet, 0, 0.25)
    assert sorted(curve[[0, -1], 1]) == [0.0, 1.0]
    np.testing.assert_allclose(curve[:, 0], 0.25)
