"""Laws of regions: signed distances, places inside, sections of an arm."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.requirements import Box, Cylinder, HalfSpace, Mesh, Sphere, Tube
from softreach.support.errors import InvalidInput, NotPossible

RNG = np.random.default_rng(3)
BOX = Box((-0.3, 0.1, -0.2), (0.5, 0.4, 0.9))
BALL = Sphere((0.1, -0.2, 0.3), 0.4)
PLANE = HalfSpace((0.0, 0.1, 0.2), (1.0, -2.0, 0.5))


def box_mesh(box: Box) -> Mesh:
    corners = np.array(list(np.ndindex(2, 2, 2)))
    faces = []
    for axis in range(3):
        for side in (0, 1):
            square = [k for k, corner in enumerate(corners) if corner[axis] == side]
            a, b, c, d = square
            for triangle in ((a, b, c), (b, d, c)):
                p, q, r = corners[list(triangle)].astype(float)
                outward = np.cross(q - p, r - p)[axis] * (2 * side - 1) > 0
                faces.append(triangle if outward else triangle[::-1])
    return Mesh(box.bounds[corners, range(3)], faces)


def star() -> Mesh:
    """A mesh that is not convex: a sphere of triangles with spikes and dents."""
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(2)
    radius = 0.5 + 0.3 * np.sin(5 * ball.vertices[:, 0]) * np.cos(4 * ball.vertices[:, 2])
    return Mesh(ball.vertices * radius[:, None], ball.faces)


def winding(mesh: Mesh, points):
    """Solid angle of the mesh over 4π: 1 inside, 0 outside."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - points[:, None] for k in range(3))
    u, v, w = (np.linalg.norm(x, axis=2) for x in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=2)
    other = u * v * w + (a * b).sum(2) * w + (b * c).sum(2) * u + (c * a).sum(2) * v
    return np.arctan2(volume, other).sum(axis=1) / (2 * np.pi)


def test_the_mesh_of_a_box_has_the_distances_of_the_box():
    points = RNG.uniform(-2, 2, (4000, 3))
    mesh = box_mesh(BOX)
    np.testing.assert_allclose(mesh.distance(points), BOX.distance(points), atol=1e-14)
    assert mesh.volume == pytest.approx(BOX.volume)
    np.testing.assert_allclose(mesh.bounds, BOX.bounds)


def test_a_point_is_inside_a_mesh_that_is_not_convex_where_it_winds_around_it():
    mesh = star()
    points = RNG.uniform(-1, 1, (3000, 3))
    inside = winding(mesh, points) > 0.5
    distance = mesh.distance(points)
    assert 100 < inside.sum() < 2900
    assert ((distance < 0) == inside).all()
    # Dense places on the surface are never nearer, and come near.
    weights = RNG.dirichlet((1, 1, 1), (200, len(mesh.faces)))
    surface = np.einsum("nfk,fkx->nfx", weights, mesh.vertices[mesh.faces]).reshape(-1, 3)
    near = np.array([np.linalg.norm(surface - p, axis=1).min() for p in points[:200]])
    assert (np.abs(distance[:200]) <= near + 1e-12).all()
    assert (np.abs(distance[:200]) >= near - 0.02).all()


@pytest.mark.parametrize(
    "region", [BOX, BALL, PLANE, box_mesh(BOX)], ids=lambda r: type(r).__name__
)
def test_distances_are_signed_and_grow_no_faster_than_way(region):
    points, steps = RNG.uniform(-1, 1, (500, 3)), RNG.normal(0, 0.1, (500, 3))
    here, there = region.distance(points), region.distance(points + steps)
    assert (np.abs(here - there) <= np.linalg.norm(steps, axis=1) + 1e-12).all()
    assert (here < 0).any()
    assert (here > 0).any()


@given(seed=st.integers(0, 10_000))
def test_distances_of_sections_bound_those_of_their_points(seed):
    rng = np.random.default_rng(seed)
    center, radius = rng.uniform(-1, 1, 3), rng.uniform(0.01, 0.3)
    normal, first = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    second = np.cross(normal, first)
    angle, share = rng.uniform(0, 2 * np.pi, 400), np.sqrt(np.append(rng.random(300), np.ones(100)))
    spread = radius * share[:, None]
    disk = center + spread * (np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second))
    for region in (BOX, BALL, PLANE, box_mesh(BOX)):
        least, most = region.section_distances(center, normal, np.array(radius))
        inside = region.distance(disk)
        assert least <= inside.min() + 1e-12
        # Outside a box, its largest distance is that by faces, which is smaller beside corners.
        beyond = most >= inside.max() - 1e-12
        assert beyond or (region is BOX and most > 0 and inside.max() > 0)
        if region in (BALL, PLANE):
            assert inside.min() - least < 0.1 * radius
            assert most - inside.max() < 0.1 * radius


def test_sections_on_a_table_do_not_reach_into_it():
    """An arm may stand upright on a box, on a plane, or inside one on its floor."""
    center, normal, radius = np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array(0.05)
    table = Box((-1, -1, -0.1), (1, 1, 0))
    assert table.section_distances(center, normal, radius)[0] == 0.0
    floor = HalfSpace((0, 0, 0), (0, 0, 1))
    assert floor.section_distances(center, normal, radius)[0] == pytest.approx(0.0, abs=1e-15)
    cell = Box((-1, -1, 0), (1, 1, 2))
    assert cell.section_distances(center, normal, radius)[1] == 0.0


@pytest.mark.parametrize("region", [BOX, BALL, box_mesh(BOX)], ids=lambda r: type(r).__name__)
def test_places_lie_inside_and_are_spread_as_the_volume_is(region):
    places = region.places(2000)
    assert places.shape == (2000, 3)
    assert (region.distance(places) <= 0).all()
    np.testing.assert_array_equal(region.places(500), places[:500])
    low, high = region.bounds
    half = places[:, 2] < (low[2] + high[2]) / 2
    assert half.mean() == pytest.approx(0.5, abs=0.01)
    fine = (places[:, :2] < (low + high)[:2] / 2).all(axis=1)
    assert fine.mean() == pytest.approx(0.25, abs=0.01)


def test_places_of_a_half_space_and_of_next_to_nothing_are_refused():
    with pytest.raises(InvalidInput, match="no end"):
        PLANE.places(3)
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    sliver = Mesh([[0, 0, 0], [1, 1, 1], [1, 1, 1.000001], [1, 1.000001, 1]], faces)
    with pytest.raises(NotPossible, match="too thin"):
        sliver.places(3)


def test_faces_that_look_inward_are_turned():
    mesh = box_mesh(BOX)
    turned = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    assert turned.distance([[0.1, 0.2, 0.3]])[0] < 0
    assert turned.volume == pytest.approx(BOX.volume)


@pytest.mark.parametrize(
    "region",
    [
        BOX,
        BALL,
        PLANE,
        Cylinder((0.1, 0, -0.2), (0.4, 0.3, 0.5), 0.2),
        Tube((0.1, 0, -0.2), (0.4, 0.3, 0.5), 0.3, 0.2),
        box_mesh(BOX),
    ],
    ids=lambda region: type(region).__name__,
)
def test_gradients_are_unit_vectors_along_which_distances_grow(region):
    points = RNG.uniform(-1, 1, (3000, 3))
    distance, gradient = region.nearest(points)
    np.testing.assert_allclose(distance, region.distance(points), atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(gradient, axis=1), 1.0, atol=1e-9)
    feet = points - distance[:, None] * gradient  # lie on the boundary
    np.testing.assert_allclose(region.distance(feet), 0.0, atol=1e-9)
    if np.isfinite(region.volume):
        share = (region.distance(RNG.uniform(-1, 1, (100_000, 3))) < 0).mean()
        inside = np.clip(region.bounds, -1, 1) == region.bounds
        assert not inside.all() or 8 * share == pytest.approx(region.volume, rel=0.1)


def test_cylinders_and_tubes_without_a_size_are_refused():
    with pytest.raises(InvalidInput, match=r"end = .* another place than start"):
        Cylinder((0, 0, 0), (0, 0, 0), 1.0)
    with pytest.raises(InvalidInput, match="inner_radius = 1"):
        Tube((0, 0, 0), (0, 0, 1), 1.0, 1.0)
