"""Coverage of mapped boxes: every place counted as often as it is covered, to the last bit."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach import designs
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.driving import extension_range
from softreach.arm.manipulator import Manipulator
from softreach.inverse.prepared import Seeds, activation_cells
from softreach.kernels.image import raster
from softreach.kernels.image.activation_mesh import (
    ActivationMesh,
    chains,
    corner_bits,
    corner_steps,
    face_planes,
    kuhn_simplices,
    strides,
)
from softreach.rod import as_tip_map, tip_positions
from softreach.support.arrays import rows
from tests.inverse.test_many_bundles import six_bundles
from tests.kernels.maps import Quadratic, mesh_of, random_quadratic, sampled
from tests.laws import arm_of

UNIT = 64.0


def grid(cells: tuple[int, ...]) -> np.ndarray:
    """Whole coordinates of the vertices, in C order."""
    return np.array(list(itertools.product(*(range(n + 1) for n in cells))), float)


def critical(vertices: np.ndarray, cells: tuple[int, ...], stretches: np.ndarray) -> np.ndarray:
    star = raster.stars(cells)
    out = np.empty((len(vertices) * len(star.triangles), 5), np.int64)
    whole = np.zeros(len(vertices), bool)
    part = np.array(cells), whole, 0, len(vertices)
    return out[: raster.critical_triangles(vertices, stretches, *part, star, out)]


def counts(vertices: np.ndarray, cells: tuple[int, ...], size: int) -> tuple[np.ndarray, ...]:
    """Cover counts and degrees at the centers UNIT · (i, j, k), i, j, k < size."""
    stretches = raster.stretches(vertices, np.array(cells))
    triangles = critical(vertices, cells, stretches)
    out = raster.empty_crossings(raster.most_crossings(vertices, triangles, UNIT, 0, 1))
    used = raster.crossings(vertices, triangles, UNIT, 2, size, out)
    cover, degree = np.zeros((2, size * size, size), np.int32)
    raster.add_counts(rows(out, slice(used)), cover, degree)
    return cover.reshape((size,) * 3), degree.reshape((size,) * 3)


def tetrahedra(cells: tuple[int, ...]) -> np.ndarray:
    """All tetrahedra of the triangulation, vertex by vertex."""
    steps = corner_steps(cells)
    places, faces = grid(cells), chains(3, 3)
    fits = ((places[:, None] + corner_bits(3)[faces[:, -1]]) <= np.array(cells)).all(axis=2)
    base, which = np.nonzero(fits)
    return base[:, None] + steps[faces[which]]


def holders(vertices, cells, point) -> list[tuple[np.ndarray, int]]:
    """The tetrahedra that hold a point, by barycentric coordinates in exact integers.

    Returns:
        Vertices of each, and 1 if the map keeps its orientation, else -1.
    """
    found = []
    for tet in tetrahedra(cells):
        corners = [[int(x) for x in vertices[v]] for v in tet]
        p = [int(x) for x in point]
        whole = _volume(*corners)
        parts = [_volume(*[p if k == i else c for k, c in enumerate(corners)]) for i in range(4)]
        if whole != 0 and all(part * whole > 0 for part in parts):
            before = _volume(*([int(x) for x in grid(cells)[v]] for v in tet))
            found.append((tet, 1 if whole * before > 0 else -1))
    return found


def _volume(a, b, c, d) -> int:
    u, v, w = ([y - x for x, y in zip(a, q, strict=True)] for q in (b, c, d))
    return (
        u[0] * (v[1] * w[2] - v[2] * w[1])
        - u[1] * (v[0] * w[2] - v[2] * w[0])
        + u[2] * (v[0] * w[1] - v[1] * w[0])
    )


@pytest.mark.parametrize("m", [1, 2, 3])
def test_the_simplices_of_a_cube_fill_it(m):
    corners = corner_bits(m)[kuhn_simplices(m)]
    volumes = np.abs(np.linalg.det(np.diff(corners, axis=1).astype(float)))
    assert len(corners) == math.factorial(m)
    assert volumes == pytest.approx(1.0)


def test_every_tetrahedron_is_listed_once():
    cells = (2, 2, 2)
    faces = np.sort(tetrahedra(cells), axis=1)
    assert len(np.unique(faces, axis=0)) == len(faces)
    # each simplex of each cell is among them
    base = np.flatnonzero((grid(cells) < 2).all(axis=1))
    simplices = base[:, None, None] + corner_steps(cells)[kuhn_simplices(3)]
    wanted = np.sort(simplices.reshape(-1, 4), axis=1)
    assert {tuple(f) for f in faces} == {tuple(f) for f in wanted}


def test_strides_count_vertices_in_c_order():
    cells = (2, 3, 4)
    assert (grid(cells) @ strides(cells) == np.arange(3 * 4 * 5)).all()


@given(seed=st.integers(0, 2**32 - 1), ties=st.booleans())
def test_a_one_to_one_image_covers_every_center_once(seed, ties):
    rng = np.random.default_rng(seed)
    cells = (3, 2, 4)
    # Vertices on centers, edges and faces through centers: every tie there is.
    spacing = 2 * UNIT if ties else 117.0
    vertices = UNIT * 3 + spacing * grid(cells)
    inner = ((grid(cells) > 0) & (grid(cells) < cells)).all(axis=1)
    shake = rng.integers(-1, 2, (inner.sum(), 3)) * (UNIT / 2 if ties else 17.0)
    vertices[inner] += shake
    cover, degree = counts(vertices, cells, 16)
    low, high = 3, (3 * UNIT + spacing * np.array(cells)) / UNIT
    centers = np.stack(np.indices((16, 16, 16)), axis=-1)
    inside = ((centers >= low) & (centers < high)).all(axis=-1)
    assert (cover == inside).all()
    assert (degree == inside).all()


@given(seed=st.integers(0, 2**32 - 1))
def test_any_map_covers_what_its_tetrahedra_hold_less_those_turned_against_the_stretches(seed):
    rng = np.random.default_rng(seed)
    cells = tuple(rng.integers(1, 3, 3).tolist())
    vertices = rng.integers(64, 700, (int(np.prod(np.add(cells, 1))), 3)).astype(float)
    stretches = rng.integers(-1000, 1001, len(vertices)).astype(float)
    triangles = critical(vertices, cells, stretches)
    where = rng.integers(0, 768, (5, 3)).astype(float)  # seldom on a face
    members, starts = raster.bin_triangles(vertices, triangles, UNIT, (12, 12))
    found = np.empty(5, np.int64)
    raster.cover_at(vertices, triangles, UNIT, (12, 12), members, starts, where, found)
    for point, count in zip(where, found, strict=True):
        held = holders(vertices, cells, point)
        assert count == sum(k if stretches[tet].sum() > 0 else -k for tet, k in held)


@given(seed=st.integers(0, 2**32 - 1))
def test_points_and_centers_of_any_map_are_counted_alike(seed):
    rng = np.random.default_rng(seed)
    cells = (2, 2, 1)
    vertices = rng.integers(64, 700, (18, 3)).astype(float)
    cover, degree = counts(vertices, cells, 12)
    triangles = critical(vertices, cells, raster.stretches(vertices, np.array(cells)))
    at = rng.integers(0, 12, (9, 3))
    members, starts = raster.bin_triangles(vertices, triangles, UNIT, (12, 12))
    found = np.empty(9, np.int64)
    raster.cover_at(vertices, triangles, UNIT, (12, 12), members, starts, UNIT * at, found)
    assert (found == cover[tuple(at.T)]).all()
    off = UNIT * at + [1e-3, 1e-6, 0.0]  # as a center counts: never on a face
    held = [holders(1e6 * vertices, cells, np.rint(1e6 * p)) for p in off]
    assert degree[tuple(at.T)].tolist() == [sum(k for _, k in tets) for tets in held]


def test_stretches_are_the_determinant_of_a_quadratic_map():
    cells = (3, 1, 2)
    x, y, z = grid(cells).T
    vertices = np.column_stack([8 * x + 3 * x * x, 5 * y - x, 7 * z - 2 * z * z + y])
    expected = (8 + 6 * x) * 5 * (7 - 4 * z)
    assert raster.stretches(vertices, np.array(cells)) == pytest.approx(8 * expected)


# Starts among seeds with tips near a target, against the same choice in NumPy


@pytest.fixture(scope="module")
def seeds() -> Seeds:
    rod = as_tip_map(six_bundles(), tol=1e-3)
    gamma = np.random.default_rng(0).uniform(rod.box.low, rod.box.high, (20_000, rod.box.bundles))
    return Seeds(gamma, rod.tips(gamma), rod)


def reference(seeds, target, near, count, most, least_distance, *, moves):
    """The choice for one target: from the bins around it, least change first, apart."""
    columns, _, (corner, width, shape) = seeds._bins
    m = len(near)
    gamma, tip, slope, half = np.split(columns.astype(float), [m, m + 3, 4 * m + 3], axis=1)
    slope, inverse = slope.reshape(-1, 3, m), half[:, [[0, 1, 3], [1, 2, 4], [3, 4, 5]]]
    target = (target - corner) / width
    place, goal = (np.clip(x // 1, 0, np.array(shape) - 1) for x in (tip, target))
    shell = np.abs(place - goal).max(axis=1)
    looked_at = np.flatnonzero(shell <= max(1, np.sort(shell)[count - 1]))
    stride = 1 + len(looked_at) // 1024  # of more, some are left out
    looked_at = looked_at[stride - 1 :: stride]
    gamma, way, slope = gamma[looked_at], target - tip[looked_at], slope[looked_at]
    low, high = seeds._coarse.box.low, seeds._coarse.box.high
    ends, key = gamma, np.zeros(len(gamma))
    if moves:
        step = np.einsum("nij,nik,nk->nj", slope, inverse[looked_at], way)
        ends = np.clip(gamma + seeds.scales * step, low, high)
        step = (ends - gamma) / seeds.scales
        left = way - np.einsum("nij,nj->ni", slope, step)
        missed = (left**2).sum(axis=1) > 0.1 * (way**2).sum(axis=1)
        key[missed | (np.abs(step).max(axis=1) > 0.4)] = 1e6
    key += ((ends - near) ** 2).sum(axis=1)
    chosen = np.empty((0, len(near)))
    for end in ends[key.argsort()]:
        apart = (np.abs(chosen - end) / seeds.scales).max(axis=1, initial=0.0) > least_distance
        if len(chosen) < most and apart.all():
            chosen = np.concatenate([chosen, end[None]])
    return chosen


def test_starts_are_those_of_the_reference(seeds):
    rng, box = np.random.default_rng(1), seeds._coarse.box
    activations, near = rng.uniform(box.low, box.high, (2, 20, box.bundles))
    targets = seeds._coarse.tips(activations)
    targets[-1] += 2.0  # beyond all bins
    owner, starts = seeds.near(targets, near, 200, 7, 0.15)
    for row, (target, at) in enumerate(zip(targets, near, strict=True)):
        both = [reference(seeds, target, at, 200, 7, 0.15, moves=moves) for moves in (True, False)]
        wanted = np.concatenate(both)
        np.testing.assert_allclose(starts[owner == row], wanted, atol=1e-6)


def test_moved_seeds_come_nearer_to_their_targets(seeds):
    rng, box = np.random.default_rng(2), seeds._coarse.box
    targets = seeds._coarse.tips(rng.uniform(box.low, box.high, (50, box.bundles)))
    near = np.zeros((50, box.bundles))
    owner, starts = seeds.near(targets, near, 200, 3, 0.15)
    gaps = np.linalg.norm(seeds._coarse.tips(starts) - targets[owner], axis=1).reshape(50, 2, 3)
    assert gaps[:, 0].mean() < 0.3 * gaps[:, 1].mean()


# How far an image may lie from its linear interpolant: what "every branch" rests on

SEEDS = st.integers(0, 2**32 - 1)
CELLS, TOL = 32, 1e-9


def random_arm(rng: np.random.Generator) -> Manipulator:
    """Three bundles of any kind, nearly all with folds."""
    while True:
        fibers = [
            FiberArchitecture(revolution=turn, offset=offset, extent=extent)
            for turn, offset, extent in rng.uniform((-4, -3, 0.2), (4, 3, 1.0), (3, 3))
        ]
        taper = rng.uniform(0, 0.8) / 16
        arm = arm_of(*fibers, taper=taper, activation_bounds=(-5 / 3, 0.0))
        if extension_range(arm)[0] > 0:
            return arm


def any_arm(name: int | tuple[int, int]) -> Manipulator:
    if isinstance(name, int):
        return random_arm(np.random.default_rng(name))
    return designs.minimal_trunk(*np.radians(name))


def planes_of(mesh: ActivationMesh) -> np.ndarray:
    planes = np.empty((6 * len(mesh.corner), 4, 4))
    face_planes(mesh, 1e-9, planes)
    return planes


def depth(planes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """How far inside the inflated images points lie, (n,) for planes (n, 4, 4)."""
    inside = np.einsum("nij,nj->ni", planes[:, :, :3], points) - planes[:, :, 3]
    return inside.min(axis=1)


@pytest.mark.parametrize("name", [(108, 2), (36, 3), (0, 0), *range(6)])
def test_no_tip_is_farther_from_its_linear_interpolant_than_estimated(name):
    arm, rng = any_arm(name), np.random.default_rng(0)
    mesh, _ = activation_cells(as_tip_map(arm, TOL), CELLS)
    tetrahedron, v, weights, gamma = sampled(mesh, 30_000, rng)
    tip = tip_positions(arm, gamma, TOL)
    error = np.linalg.norm(tip - np.einsum("ni,nik->nk", weights, mesh.tip[v]), axis=1)
    share = error / mesh.interpolation_error[tetrahedron // 6]
    assert share.max() <= 1.0
    assert share.max() >= 0.4  # nor is the estimate far too large
    assert depth(planes_of(mesh)[tetrahedron], tip).min() >= 0.0


@given(seed=SEEDS)
def test_for_quadratic_maps_the_estimate_is_a_bound_with_a_quarter_to_spare(seed):
    rng = np.random.default_rng(seed)
    f = random_quadratic(rng)
    mesh = mesh_of(f, 2)
    tetrahedron, v, weights, gamma = sampled(mesh, 500, rng)
    tip = f.values(gamma)
    error = np.linalg.norm(tip - np.einsum("ni,nik->nk", weights, mesh.tip[v]), axis=1)
    assert (1.25 * error <= mesh.interpolation_error[tetrahedron // 6]).all()
    assert depth(planes_of(mesh)[tetrahedron], tip).min() >= 0.0


@given(seed=SEEDS)
def test_for_a_parabolic_cylinder_the_largest_error_is_8_15_of_the_estimate(seed):
    """½ (w·x)² d is off by |d| (w·e)²/8 at the middle of the edge e on which w·x grows most."""
    rng = np.random.default_rng(seed)
    w, d = rng.normal(size=(2, 3))
    f = Quadratic(np.zeros(3), np.zeros((3, 3)), np.einsum("i,j,k->ijk", d, w, w))
    mesh = mesh_of(f, 1)
    x = mesh.gamma[mesh.corner[0]]
    edges = [(a, b) for a in range(8) for b in range(a + 1, 8) if a & b == a]
    middle = [f.values(0.5 * (x[a] + x[b])[None])[0] for a, b in edges]
    linear = [0.5 * (f.values(x[[a]])[0] + f.values(x[[b]])[0]) for a, b in edges]
    largest = np.linalg.norm(np.subtract(middle, linear), axis=1).max()
    assert largest == pytest.approx(8 / 15 * mesh.interpolation_error[0], abs=1e-8)
