"""Alpha shapes against their definition, and against SciPy."""

from collections import Counter
from unittest.mock import ANY

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from softreach.geometry import alpha_shape
from softreach.geometry.alpha_shape import AlphaComplex, alpha_hull, delaunay
from softreach.geometry.hull import Hull, convex_hull
from softreach.geometry.surface import enclosed_volume
from tests.geometry.clouds import DEGENERATE, FLAT, arc_tips, random_points
from tests.geometry.exact import rational
from tests.oracles import qhull


@pytest.fixture(scope="module")
def arm_shape() -> AlphaComplex:
    return alpha_complex(arc_tips(3000))


def alpha_complex(points: np.ndarray) -> AlphaComplex:
    return AlphaComplex(triangulation=delaunay(points))


def regions_by_scipy(shape: AlphaComplex, kept: np.ndarray) -> int:
    """Connected components of the kept cells."""
    t, i = np.nonzero(shape.triangulation.neighbors >= 0)
    u = shape.triangulation.neighbors[t, i]
    both = kept[t] & kept[u]
    graph = coo_array((np.ones(both.sum()), (t[both], u[both])), shape=(len(kept), len(kept)))
    _, labels = connected_components(graph, directed=False)
    return len(np.unique(labels[kept]))


def lattice_of_octahedra(k: int) -> np.ndarray:
    """Face-centered cubes: the centers of octahedra have the coordinates of points."""
    points = np.stack(np.meshgrid(*[np.arange(float(k))] * 3), axis=-1).reshape(-1, 3)
    return points[points.sum(axis=1) % 2 == 0]


BOXED = {
    **DEGENERATE,
    **FLAT,
    "arm": arc_tips(700),
    "centers on borders": lattice_of_octahedra(7),
    "clusters": np.concatenate([0.05 * random_points(90, k) + k % 3 for k in range(6)]),
}


def assert_equal_hulls(hull: Hull, other: Hull) -> None:
    """Every number and every corner, to the last bit."""
    for name in ("vertices", "faces", "volume", "area", "alpha", "regions", "n"):
        np.testing.assert_array_equal(getattr(hull, name), getattr(other, name), err_msg=name)


def encloses_all_as_one(shape: AlphaComplex, alpha: float) -> bool:
    """The definition of a radius at which one region covers every point."""
    kept = shape.radii <= alpha
    cells = shape.triangulation.tetrahedra
    covered = len(np.unique(cells[kept])) == len(np.unique(cells))
    return covered and regions_by_scipy(shape, kept) == 1


def test_circumscribed_spheres_pass_through_their_corners(arm_shape):
    """The center solves 2 (p_i - p_0) · x = |p_i|² - |p_0|²."""
    corners = arm_shape.triangulation.points[arm_shape.triangulation.tetrahedra]
    edges = corners[:, 1:] - corners[:, :1]
    good = np.linalg.cond(edges) < 1e5
    right = (edges[good] ** 2).sum(axis=2)[..., None] / 2.0
    centers = np.linalg.solve(edges[good], right)[..., 0]
    np.testing.assert_allclose(arm_shape.radii[good], np.linalg.norm(centers, axis=1), rtol=1e-8)
    volumes = np.abs(np.linalg.det(edges)) / 6.0
    np.testing.assert_allclose(arm_shape.volumes, volumes, rtol=1e-6, atol=1e-17)


def test_radii_of_almost_flat_cells_keep_their_digits():
    """A unit circle at z = 0 and a fourth point (x, y, h): the center is at height z."""
    for h in 2.0 ** -np.arange(10, 60, 7):
        points = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0.28, 0.96, h]])
        x, y, h = rational(points[3])
        z = (x * x + y * y + h * h - 1) / (2 * h)
        shape = alpha_complex(points)
        assert shape.radii == pytest.approx([np.sqrt(float(1 + z * z))], rel=1e-8)
        assert shape.volumes == pytest.approx([float(h) / 3.0], rel=1e-14, abs=0)


@pytest.mark.parametrize("alpha", [0.01, 0.03, 0.1, 0.3, np.inf])
def test_volumes_and_regions_equal_those_of_scipy(alpha):
    points = arc_tips(1500, seed=5)
    ours, scipys = alpha_complex(points), AlphaComplex(triangulation=qhull.delaunay(points))
    assert ours.volume(alpha) == pytest.approx(scipys.volume(alpha), rel=1e-9, abs=1e-15)
    assert ours.regions(alpha) == scipys.regions(alpha)
    assert ours.regions(alpha) == regions_by_scipy(ours, ours.radii <= alpha)
    assert ours.hull(alpha).area == pytest.approx(scipys.hull(alpha).area, rel=1e-9)


@pytest.mark.parametrize("name", ["cube corners", "on a sphere", "moment curve", "five points"])
def test_of_infinite_radius_it_is_the_convex_hull(name):
    points = DEGENERATE[name]
    hull, convex = alpha_complex(points).hull(np.inf), convex_hull(points)
    assert hull.volume == pytest.approx(convex.volume, rel=1e-12)
    assert hull.area == pytest.approx(convex.area, rel=1e-9)
    assert hull.regions == 1
    assert {*map(tuple, convex.vertices)} <= {*map(tuple, hull.vertices)}


def test_of_a_random_cloud_of_infinite_radius_it_has_the_faces_of_the_convex_hull():
    points = random_points(300)
    hull, convex = alpha_complex(points).hull(np.inf), convex_hull(points)
    ours, qhulls = ({frozenset(map(tuple, f)) for f in h.vertices[h.faces]} for h in (hull, convex))
    assert ours == qhulls


@given(st.floats(0.005, 2.0), st.integers(0, 20))
def test_the_surface_is_closed_and_encloses_the_volume_of_the_tetrahedra(alpha, seed):
    """Along every edge as many faces run one way as the other."""
    hull = alpha_complex(arc_tips(400, seed)).hull(alpha)
    enclosed = enclosed_volume(hull.vertices, hull.faces)
    assert enclosed == pytest.approx(hull.volume, rel=1e-12, abs=1e-17)
    pairs = zip(
        hull.faces.ravel().tolist(), np.roll(hull.faces, -1, 1).ravel().tolist(), strict=True
    )
    runs = Counter(pairs)
    assert all(runs[b, a] == count for (a, b), count in runs.items())


def test_the_curve_passes_through_the_volume_of_every_hull(arm_shape):
    alphas = np.geomspace(0.003, 3.0, 12)
    hulls = [arm_shape.hull(alpha).volume for alpha in alphas]
    np.testing.assert_allclose(arm_shape.volume(alphas), hulls, rtol=1e-12, atol=1e-17)


def test_a_cell_belongs_to_the_shape_of_exactly_its_radius(arm_shape):
    radius = np.median(arm_shape.radii)
    below = radius * (1.0 - 1e-9)
    step = arm_shape.volumes[arm_shape.radii == radius].sum()
    assert arm_shape.volume(radius) - arm_shape.volume(below) == pytest.approx(step)


@given(st.integers(5, 40), st.integers(0, 2**32 - 1))
def test_the_critical_radius_is_the_smallest_of_all_that_will_do(n, seed):
    shape = alpha_complex(random_points(n, seed))
    suitable = [a for a in np.unique(shape.radii) if encloses_all_as_one(shape, a)]
    assert shape.critical_alpha() == suitable[0]


def voxels(h: float, shift: float, jitter: float, copies: int) -> np.ndarray:
    """Centers of 6 x 6 x 6 voxels."""
    grid = shift + h * np.stack(np.meshgrid(*[np.arange(6)] * 3), axis=-1).reshape(-1, 3)
    rng = np.random.default_rng(0)
    return np.concatenate([grid + jitter * h * rng.normal(size=grid.shape) for _ in range(copies)])


@pytest.mark.parametrize(
    ("h", "shift", "jitter", "copies"),
    [(0.05, 0, 0, 1), (1.0, 0.123456789, 0, 2), (0.02, 1e3, 0, 1), (0.1, 0, 1e-12, 2)],
)
def test_voxels_are_one_block_from_half_the_diagonal_of_a_voxel_on(h, shift, jitter, copies):
    """All corners of a voxel lie on one sphere; below its radius there are flat cells only."""
    points = voxels(h, shift, jitter, copies)
    shape, radius = alpha_complex(points), h * np.sqrt(3) / 2
    critical = shape.critical_alpha()
    assert jitter > 0 or critical == pytest.approx(radius, rel=1e-8)  # thin duplicates have others
    for alpha in (critical, radius, 1.5 * radius):
        hull = alpha_hull(points, alpha, boxes=3)[0]
        assert hull.volume == shape.hull(alpha).volume
        assert shape.volume(np.array([alpha])) == pytest.approx(hull.volume, rel=1e-12)
        assert hull.volume == pytest.approx((5 * h) ** 3, rel=1e-8)
        assert (hull.regions, len(hull.faces)) == (1, 2 * 6 * 25 if copies == 1 else ANY)
        assert hull.area == pytest.approx(6 * (5 * h) ** 2, rel=1e-8)
    hull = shape.hull(0.9 * radius)
    assert jitter > 0 or (hull.volume, hull.regions, len(hull.faces)) == (0.0, 0, 0)


@pytest.mark.parametrize(("n", "radius"), [(200, 0.3), (2000, 1.0)])
def test_points_of_a_sphere_are_its_inscribed_polyhedron(n, radius):
    """Every tetrahedron has the sphere itself as circumscribed sphere."""
    points = np.random.default_rng(0).normal(size=(n, 3))
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    shape, right = alpha_complex(points), convex_hull(points)
    assert shape.critical_alpha() == pytest.approx(radius, rel=1e-9)
    for alpha in (shape.critical_alpha(), radius):
        hull = shape.hull(alpha)
        assert hull.regions == 1
        assert hull.volume == pytest.approx(right.volume, rel=1e-12)
        assert hull.area == pytest.approx(right.area, rel=1e-9)
    assert shape.volume(radius * (1.0 - 1e-6)) < 1e-3 * right.volume


@pytest.mark.parametrize("name", FLAT)
def test_flat_clouds_have_no_volume_at_any_radius(name):
    shape = alpha_complex(FLAT[name])
    assert shape.volume(1.0) == 0.0
    assert shape.volume(np.array([0.1, np.inf])).tolist() == [0.0, 0.0]
    assert shape.critical_alpha() == np.inf
    hull = shape.hull(np.inf)
    assert (hull.volume, hull.area, hull.regions, len(hull.faces)) == (0.0, 0.0, 0, 0)


@pytest.mark.parametrize("scale", [1e-80, 1e-3, 1e60])
def test_scaling_the_cloud_scales_radii_areas_and_volumes(scale):
    shape, scaled = alpha_complex(random_points(60)), alpha_complex(scale * random_points(60))
    assert scaled.critical_alpha() == pytest.approx(
        scale * shape.critical_alpha(), rel=1e-12, abs=0
    )
    small, large = shape.hull(0.4), scaled.hull(0.4 * scale)
    assert large.volume == pytest.approx(scale**3 * small.volume, rel=1e-12, abs=0)
    assert large.area == pytest.approx(scale**2 * small.area, rel=1e-12, abs=0)


@pytest.mark.parametrize("name", BOXED)
def test_box_by_box_the_shape_is_that_of_the_whole_triangulation(name, monkeypatch):
    """Radii from where it falls apart to beyond all, and some that cells have exactly."""
    monkeypatch.setattr(alpha_shape, "WORTHWHILE", np.inf)
    shape = alpha_complex(BOXED[name])
    radii = np.unique(shape.radii[np.isfinite(shape.radii)]) if len(shape.radii) else [1.0]
    for alpha in (*np.quantile(radii, [0.2, 0.6], method="nearest"), 2 * radii[-1]):
        for boxes in (1, 2, 5):
            hull, _ = alpha_hull(BOXED[name], alpha, boxes=boxes)
            assert_equal_hulls(hull, shape.hull(alpha))


@pytest.mark.parametrize("boxes", [1, 3])
@pytest.mark.parametrize("count", [0, 3, 5, 500, 2000])
def test_a_part_measured_on_the_way_has_the_volume_that_it_has_alone(count, boxes):
    points = arc_tips(2000)
    part = np.random.default_rng(1).permutation(2000) < count
    for alpha in (0.05, 0.2) if boxes > 1 else (0.05, 0.2, np.inf):
        hull, volume = alpha_hull(points, alpha, part=part, boxes=boxes)
        assert volume == alpha_complex(points[part]).hull(alpha).volume
        assert_equal_hulls(hull, alpha_complex(points).hull(alpha))


def test_a_flat_part_has_no_volume():
    points = np.concatenate([random_points(40) * [1, 1, 0], random_points(40)])
    assert alpha_hull(points, 9.0, part=points[:, 2] == 0)[1] == 0.0


def test_a_curve_has_no_volume_in_boxes_either():
    turn = np.linspace(0.0, 40.0, 3000)
    helix = np.stack([np.cos(turn), np.sin(turn), 0.01 * turn**1.5], axis=1)
    assert alpha_hull(helix, 0.1, boxes=3)[0].volume == alpha_hull(helix, 0.1)[0].volume == 0.0
