"""All places where a map of the sphere takes a value: maps whose places are known."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from softreach.geometry.alpha_shape import AlphaComplex, Delaunay, delaunay
from softreach.geometry.sphere_maps import (
    icosphere,
    is_axisymmetric,
    pole_rings,
    quartered,
    sphere_roots,
)
from softreach.geometry.surface import unit_scale
from softreach.kernels.points.bowyer_watson import triangulate
from softreach.kernels.points.predicates import (
    collinear,
    insphere,
    insphere_exact,
    insphere_filter,
    orient,
    orient_exact,
    orient_filter,
    scratch,
)
from softreach.kernels.points.triangulation import FACES, FEW
from tests.geometry.clouds import DEGENERATE, FLAT, arc_tips, random_points
from tests.geometry.exact import exact_insphere, exact_orient, rational
from tests.oracles import qhull

POLE = np.array([0.0, 0.0, 1.0])
NOWHERE = np.empty((0, 3))
VALUE = np.array([0.48, 0.6, 0.64])


def plane(points):
    """Stereographic coordinates as complex numbers; the south pole is 0."""
    x, y, z = points.T
    return (x + 1j * y) / np.maximum(1 - z, 1e-300)


def sphere(w):
    size = np.abs(w) ** 2
    return np.stack([2 * w.real, 2 * w.imag, size - 1], axis=1) / (1 + size)[:, None]


def roots(image, value=VALUE, levels=4):
    return sphere_roots(image, value, levels=levels, caution=1.0, starts=NOWHERE)


@pytest.mark.parametrize("power", [1, 2, 5])
def test_a_power_takes_every_value_as_often_as_its_exponent(power):
    found, settled = roots(lambda points: sphere(plane(points) ** power))
    assert settled
    assert len(found.points) == power
    assert (found.determinants > 0).all()
    np.testing.assert_allclose(sphere(plane(found.points) ** power), [VALUE] * power, atol=1e-10)


def folded(amount):
    """Of degree 1, the more folded the larger the amount: longitudes swing with the latitude."""

    def image(points):
        x, y, z = points.T
        polar, around = np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
        leaning = polar + amount * np.sin(polar) * np.cos(around) * np.sin(3 * polar)
        ring = np.sin(leaning)
        return np.stack([ring * np.cos(around), ring * np.sin(around), np.cos(leaning)], axis=1)

    return image


@pytest.mark.parametrize("amount", [0.3, 1.0, 2.5])
def test_however_folded_the_signs_add_up_to_the_degree(amount):
    for value in np.random.default_rng(3).normal(size=(6, 3)):
        found, _ = roots(folded(amount), value / np.linalg.norm(value))
        assert np.sign(found.determinants).sum() == 1


@pytest.mark.parametrize("shift", [0.1, 1e-3, 1e-5])
def test_what_is_left_of_a_ring_is_found(shift):
    """The ring of a map about the pole shrinks to two points when the value moves off it."""
    value = np.array([np.sin(shift), 0.0, np.cos(shift)])
    found, _ = roots(overturned, value)
    assert len(found.points) == 3
    assert np.sign(found.determinants).sum() == 1
    np.testing.assert_allclose(overturned(found.points), [value] * 3, atol=1e-10)


def overturned(points):
    """The latitude runs past the pole and back: one ring goes there."""
    x, y, z = points.T
    polar, ring = np.arctan2(np.hypot(x, y), z), np.maximum(np.hypot(x, y), 1e-300)
    leaning = polar - 1.5 * np.sin(polar)
    along = np.sin(leaning) / ring
    return np.stack([along * x, along * y, np.cos(leaning)], axis=1)


def test_rings_are_where_the_meridian_passes_the_pole():
    assert is_axisymmetric(overturned, POLE, 1e-12)
    assert not is_axisymmetric(folded(0.5), POLE, 1e-3)
    rings = pole_rings(overturned, POLE, np.array([0.0, 1.0, 0.0]))
    assert rings.complete
    assert (rings.pole_sign, rings.signs.tolist()) == (-1, [1])
    polar = np.arccos(rings.points[0] @ POLE)
    assert polar == pytest.approx(1.5 * np.sin(polar), abs=1e-12)
    assert rings.points[0, 0] == pytest.approx(0.0, abs=1e-12)


# Laws of meshes of the sphere


def solid_angle(corners):
    """Signed, of triangles (n, 3, 3) of unit vectors."""
    a, b, c = np.moveaxis(corners, 1, 0)
    volume = np.einsum("nc,nc->n", a, np.cross(b, c))
    sides = 1 + (a * b).sum(1) + (b * c).sum(1) + (c * a).sum(1)
    return 2 * np.arctan2(volume, sides)


def test_triangles_cover_the_sphere_once_and_face_outward():
    for levels in range(4):
        points, triangles = icosphere(levels)
        assert triangles.shape == (20 * 4**levels, 3)
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0)
        angles = solid_angle(points[triangles])
        assert angles.min() > 0
        np.testing.assert_allclose(angles.sum(), 4 * np.pi)


def test_four_parts_cover_what_was_cut():
    points, triangles = icosphere(1)
    finer, parts = quartered(points, triangles[:7])
    np.testing.assert_array_equal(finer[: len(points)], points)
    whole = solid_angle(points[triangles[:7]]).sum()
    np.testing.assert_allclose(solid_angle(finer[parts]).sum(), whole)


# Every sign equals that of rational arithmetic

WORK = scratch()


def uniform(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-1.0, 1.0, (5, 3))


def almost_coplanar(rng: np.random.Generator) -> np.ndarray:
    points, (s, t) = uniform(rng), rng.random(2)
    points[3] = points[0] + s * (points[1] - points[0]) + t * (points[2] - points[0])
    return points / 4.0


def almost_cospherical(rng: np.random.Generator) -> np.ndarray:
    x = rng.normal(size=(5, 3))
    return x / np.linalg.norm(x, axis=1, keepdims=True) / 2.0


def almost_equal(rng: np.random.Generator) -> np.ndarray:
    points = uniform(rng)
    points[3:] = points[:2] + 1e-15 * rng.integers(-3, 4, (2, 3))
    return points


KINDS = {
    "general": uniform,
    "lattice": lambda rng: rng.integers(-3, 4, (5, 3)) / 8.0,
    "rounded": lambda rng: np.round(uniform(rng), 1),
    "almost coplanar": almost_coplanar,
    "almost cospherical": almost_cospherical,
    "almost equal": almost_equal,
    "unit in the last place": lambda rng: 0.5 + rng.integers(-4, 5, (5, 3)) * 2.0**-53,
    "widely scaled": lambda rng: np.round(uniform(rng) * 2.0 ** rng.integers(-150, 0, (5, 3)), 60),
}


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_signs_equal_those_of_rational_arithmetic(kind, rng):
    for _ in range(150):
        points = kind(rng)
        exact = [rational(p) for p in points]
        side = exact_orient(*exact[:4])
        assert orient(points, 0, 1, 2, 3, WORK) == side
        assert orient_exact(points, 0, 1, 2, 3, WORK) == side
        inside = exact_insphere(*exact)
        assert insphere(points, 0, 1, 2, 3, 4, WORK) == inside
        assert insphere_exact(points, 0, 1, 2, 3, 4, WORK) == inside


grid_points = arrays(np.float64, (5, 3), elements=st.integers(-(2**30), 2**30).map(float))


@given(grid_points)
def test_the_filter_never_contradicts_the_exact_sign(points):
    points = points * 2.0**-30
    exact = [rational(p) for p in points]
    assert orient_filter(points, 0, 1, 2, 3) in (0, exact_orient(*exact[:4]))
    assert insphere_filter(points, 0, 1, 2, 3, 4) in (0, exact_insphere(*exact))


def test_three_points_are_collinear_only_exactly(rng):
    a, step = rng.integers(-8, 9, (2, 3)) / 16.0
    step[0] += 1 / 16
    line = np.stack([a, a + step, a + 3 * step])
    assert collinear(line, 0, 1, 2, WORK)
    line[2, 1] = np.nextafter(line[2, 1], 2.0)
    assert not collinear(line, 0, 1, 2, WORK)


# What makes a triangulation Delaunay, checked exactly on clouds of every kind


every_degenerate = pytest.mark.parametrize("name", DEGENERATE)


def cells_of(mesh: Delaunay) -> set[tuple[int, ...]]:
    """Cells as sets of vertices."""
    return set(map(tuple, np.sort(mesh.tetrahedra, axis=1).tolist()))


def opposite(mesh: Delaunay, t: int, u: int) -> int:
    """The vertex of cell u that cell t does not share; asserts that they are neighbors."""
    (slot,) = np.flatnonzero(mesh.neighbors[u] == t)
    return int(mesh.tetrahedra[u, slot])


def assert_adjacency(mesh: Delaunay) -> None:
    """Neighbors know each other and share the face opposite the vertex they are named after."""
    for t, i in np.argwhere(mesh.neighbors >= 0):
        u = mesh.neighbors[t, i]
        other = opposite(mesh, t, u)
        face = set(mesh.tetrahedra[t][FACES[i]])
        assert face == set(mesh.tetrahedra[u]) - {other}


def assert_delaunay(mesh: Delaunay) -> None:
    """Positive cells, none of whose spheres holds the vertex beyond any of its faces.

    For a triangulation of the convex hull this local law implies the global one (Delaunay 1934).
    """
    points, _ = unit_scale(mesh.points)
    for t, cell in enumerate(mesh.tetrahedra):
        assert orient(points, *cell, WORK) == 1
        for u in mesh.neighbors[t]:
            if u >= 0:
                assert insphere(points, *cell, opposite(mesh, t, u), WORK) <= 0


def six_volumes(mesh: Delaunay) -> Fraction:
    """Six times the exact sum of the volumes."""
    exact = [rational(p) for p in mesh.points]
    total = Fraction(0)
    for cell in mesh.tetrahedra:
        a, b, c, d = (exact[v] for v in cell)
        x, y, z = ([q - p for p, q in zip(a, corner, strict=True)] for corner in (b, c, d))
        total += sum(x[i] * (y[i - 2] * z[i - 1] - y[i - 1] * z[i - 2]) for i in range(3))
    return total


def six_hull_volumes(mesh: Delaunay) -> Fraction:
    """Six times the exact volume inside the faces without a neighbor, by the divergence theorem."""
    exact = [rational(p) for p in mesh.points]
    total = Fraction(0)
    for t, i in np.argwhere(mesh.neighbors < 0):
        x, y, z = (exact[v] for v in mesh.tetrahedra[t][FACES[i]])
        total += sum(x[i] * (y[i - 2] * z[i - 1] - y[i - 1] * z[i - 2]) for i in range(3))
    return total


@pytest.mark.parametrize("walls", [FEW - 2, FEW, FEW + 2, 4 * FEW])
def test_the_last_point_inside_a_sphere_of_points_joins_all_faces_of_their_hull(walls):
    # n points have 2n - 4 faces, all of them walls of one cavity, however its cells are tied
    sphere = np.random.default_rng(walls).normal(size=((walls + 4) // 2, 3))
    points = np.vstack([sphere / np.linalg.norm(sphere, axis=1)[:, None], np.zeros(3)])
    cells, neighbors, _ = triangulate(points, lambda: False)
    mesh = Delaunay(points=points, tetrahedra=cells, neighbors=neighbors)
    assert len(cells) == walls
    assert (cells == len(points) - 1).any(axis=1).all()
    assert_adjacency(mesh)
    assert_delaunay(mesh)


@pytest.mark.parametrize("points", [random_points(400), arc_tips(700)], ids=["cube", "arm"])
def test_cells_equal_those_of_qhull_where_they_are_unique(points):
    assert cells_of(delaunay(points)) == cells_of(qhull.delaunay(points))


@given(st.integers(5, 60), st.integers(0, 2**32 - 1))
def test_cells_of_small_random_clouds_equal_those_of_qhull(n, seed):
    points = random_points(n, seed)
    assert cells_of(delaunay(points)) == cells_of(qhull.delaunay(points))


@every_degenerate
def test_degenerate_clouds_give_an_exact_delaunay_triangulation_of_their_hull(name):
    """Every distinct point is a vertex, none is beyond an outer face, and volumes sum up."""
    mesh = delaunay(DEGENERATE[name])
    assert_adjacency(mesh)
    assert_delaunay(mesh)
    assert len(np.unique(mesh.tetrahedra)) == len(np.unique(mesh.points, axis=0))
    points, _ = unit_scale(mesh.points)
    for t, i in np.argwhere(mesh.neighbors < 0):
        a, b, c = mesh.tetrahedra[t][FACES[i]]
        assert all(orient(points, a, b, c, d, WORK) <= 0 for d in range(len(points)))
    assert six_volumes(mesh) == six_hull_volumes(mesh) > 0


@every_degenerate
def test_radii_and_volumes_do_not_depend_on_the_order_of_the_points(name):
    points = DEGENERATE[name]
    shuffled = points[np.random.default_rng(0).permutation(len(points))]
    first, second = (AlphaComplex(triangulation=delaunay(p)) for p in (points, shuffled))
    assert first.volumes.sum() == pytest.approx(second.volumes.sum(), rel=1e-12, abs=0)
    assert first.critical_alpha() == pytest.approx(second.critical_alpha(), rel=1e-7, abs=0)


@pytest.mark.parametrize("name", FLAT)
def test_flat_clouds_have_no_cells(name):
    mesh = delaunay(FLAT[name])
    assert mesh.tetrahedra.shape == mesh.neighbors.shape == (0, 4)


def test_duplicates_are_not_inserted():
    points = random_points(30)
    mesh = delaunay(np.concatenate([points, points[:7], points[:7]]))
    original = np.concatenate([np.arange(30), np.arange(7), np.arange(7)])
    renamed = np.sort(original[mesh.tetrahedra], axis=1)
    assert set(map(tuple, renamed.tolist())) == cells_of(delaunay(points))


def test_a_cloud_far_larger_than_its_first_room_grows():
    """All of n²/4 cells of two skew lines: the mesh has to be enlarged on the way."""
    t = np.linspace(0.1, 1.0, 60)
    zero = np.zeros_like(t)
    points = np.concatenate([np.stack([t, zero, zero], 1), np.stack([zero, t, zero + 1], 1)])
    mesh = delaunay(points)
    assert len(mesh.tetrahedra) == 59 * 59
    assert_adjacency(mesh)
