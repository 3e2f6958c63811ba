"""Where Newton's method starts: at every root of a map that is affine or quadratic."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softreach.inverse.prepared import ImageLeaves, image_tree
from softreach.kernels.branches import candidates, newton
from softreach.kernels.branches.candidates import MOST_STARTS, SpaceTree, find_starts, leaf_at
from softreach.kernels.image.activation_mesh import ActivationMesh
from tests.kernels.maps import Quadratic, mesh_of, random_fold, random_quadratic, sampled

SEEDS = st.integers(0, 2**32 - 1)
LOW, HIGH = np.full(3, -1.0), np.full(3, 1.0)


def starts_in(mesh: ActivationMesh, tree: SpaceTree, targets: np.ndarray, with_root: bool = True):
    """Number of the target, cell, activation and inverse of the Jacobian of every start."""
    room = MOST_STARTS * (1 + len(targets))
    out = np.empty(room, int), np.empty(room, int), np.empty((room, 3)), np.empty((room, 3, 3))
    done, count = find_starts(mesh, tree, targets, LOW, HIGH, with_root, *out)
    assert done == len(targets)
    return [values[:count] for values in out]


def starts_of(f: Quadratic, targets: np.ndarray, cells: int, with_root: bool = True):
    """Number of the target, activation and inverse of the Jacobian of every start."""
    mesh = mesh_of(f, cells)
    mesh = mesh._replace(remainder=np.maximum(mesh.remainder, 1e-14))  # rounding, if f is affine
    target, _, start, inverse = starts_in(mesh, image_tree(mesh), targets, with_root)
    return target, start, inverse


@given(seed=SEEDS, with_root=st.booleans())
@settings(max_examples=5)
def test_the_root_of_an_affine_map_is_found_exactly(seed, with_root):
    rng = np.random.default_rng(seed)
    b = np.linalg.qr(rng.normal(size=(3, 3)))[0] @ np.diag(rng.uniform(0.1, 1, 3))
    f = Quadratic(rng.normal(size=3), b, np.zeros((3, 3, 3)))
    gamma = rng.uniform(-1, 1, (60, 3))
    target, start, _ = starts_of(f, f.values(gamma), 4, with_root)
    assert set(target) == set(range(60))
    assert start == pytest.approx(gamma[target], abs=1e-10)


@given(seed=SEEDS)
@settings(max_examples=5)
def test_starts_do_not_depend_on_how_space_is_divided(seed):
    rng = np.random.default_rng(seed)
    f = random_quadratic(rng, bend=0.1)
    mesh, targets = mesh_of(f, 6), f.values(rng.uniform(-1.1, 1.1, (40, 3)))
    trees = image_tree(mesh), ImageLeaves(mesh).around(targets)
    assert [len(tree.child) > 1 for tree in trees] == [True, False]
    first, second = (starts_in(mesh, tree, targets) for tree in trees)
    assert all(map(np.array_equal, first, second))


@given(seed=SEEDS)
@settings(max_examples=5)
def test_a_start_knows_the_inverse_of_the_jacobian_there(seed):
    f = random_quadratic(np.random.default_rng(seed), bend=0.02)
    gamma = np.random.default_rng(seed).uniform(-1, 1, (60, 3))
    _, start, inverse = starts_of(f, f.values(gamma), 4)
    product = np.einsum("nij,njk->nik", inverse, f.slopes(start))
    assert np.median(np.abs(product - np.eye(3)).max(axis=(1, 2))) < 1e-3


@given(seed=SEEDS)
@settings(max_examples=5)
def test_both_roots_of_a_fold_have_a_start(seed):
    rng = np.random.default_rng(seed)
    fold = random_fold(rng)
    f, y = fold.quadratic(), rng.uniform(-0.2, 0.2, (60, 3))
    y[:, 0] += np.where(y[:, 0] < 0, -0.25, 0.25)
    gamma = y @ fold.r  # inside the box, and so are the mirror images
    target, start, _ = starts_of(f, f.values(gamma), 5)
    for roots in (gamma, fold.mirrored(gamma)):
        apart = np.abs(start - roots[target]).max(axis=1)
        nearest = np.full(60, np.inf)
        np.minimum.at(nearest, target, apart)
        assert np.median(nearest) < 1e-4
        # a start that another one stands for is as near to it as that, in widths of cells
        assert nearest.max() <= candidates._DISTINCT * (2 / 5) + 1e-3


def test_a_target_out_of_reach_has_no_start():
    f = Quadratic(np.zeros(3), np.eye(3), np.zeros((3, 3, 3)))
    target, *_ = starts_of(f, np.array([[1.1, 0.0, 0.0], [0.0, -2.0, 0.0], [9.0, 9.0, 9.0]]), 4)
    assert len(target) == 0


# The octree over images: nothing that may cover a place is missing from its list


def listed(tree: SpaceTree, point: np.ndarray) -> np.ndarray:
    """Tetrahedra listed at the leaf that holds a point."""
    shape = (tree.low, tree.size, tree.child, tree.first, tree.length)
    begin, end = leaf_at(*shape, tuple(point))
    return tree.item[begin:end]


@given(seed=SEEDS)
@settings(max_examples=5)
def test_the_tetrahedron_of_every_activation_is_listed_where_its_tip_is(seed):
    rng = np.random.default_rng(seed)
    f = random_quadratic(rng, bend=0.05)
    mesh = mesh_of(f, 4)
    tree = image_tree(mesh)
    assert len(tree.child) > 100  # deep enough to mean something
    tetrahedron, _, _, gamma = sampled(mesh, 300, rng)
    for k, tip in zip(tetrahedron, f.values(gamma), strict=True):
        assert k in listed(tree, tip)


@given(seed=SEEDS)
@settings(max_examples=5)
def test_every_inflated_image_that_holds_a_place_is_listed_there(seed):
    rng = np.random.default_rng(seed)
    mesh = mesh_of(random_quadratic(rng, bend=0.05), 4)
    tree = image_tree(mesh)
    images = mesh.tip[np.repeat(mesh.corner, 6, axis=0)]
    error = np.repeat(mesh.interpolation_error, 6)[:, None]
    low, high = images.min(axis=1) - error, images.max(axis=1) + error
    for point in rng.uniform(low.min(axis=0), high.max(axis=0), (100, 3)):
        covering = (tree.planes[:, :, :3] @ point >= tree.planes[:, :, 3]).all(axis=1)
        covering &= ((low <= point) & (point <= high)).all(axis=1)
        assert np.isin(np.flatnonzero(covering), listed(tree, point)).all()


def test_outside_the_root_nothing_is_listed(rng):
    tree = image_tree(mesh_of(random_quadratic(rng), 2))
    for axis in range(3):
        for side in (-1e-6, tree.size + 1e-6):
            point = tree.low + 0.5 * tree.size
            point[axis] = tree.low[axis] + side
            assert len(listed(tree, point)) == 0
    assert len(listed(tree, np.array([np.nan, 0.0, 0.0]))) == 0


# The second preimage near a fold, in closed form


FAR = np.full(3, 100.0)
OVERSHOOT = 2.8


def second_preimages(mesh, f, gamma, reach, low=-FAR, high=FAR):
    slope = f.slopes(gamma)
    smallest = np.linalg.svd(slope, compute_uv=False)[:, 2]
    start, near = np.full_like(gamma, np.nan), np.zeros(len(gamma), bool)
    cell = np.zeros(len(gamma), np.int64)
    bounds = low, high
    newton.second_preimages(
        mesh, cell, gamma, slope, smallest, reach, OVERSHOOT, *bounds, start, near
    )
    return start, near


@given(seed=st.integers(0, 2**32 - 1), kappa=st.floats(0.1, 2.0), side=st.sampled_from([-1, 1]))
def test_on_a_fold_the_start_lies_beyond_the_mirror_image_by_the_overshoot(seed, kappa, side):
    rng = np.random.default_rng(seed)
    fold = random_fold(rng, side * kappa)
    f, y = fold.quadratic(), rng.uniform(-0.3, 0.3, (40, 3))
    y[:, 0] = rng.choice([-1, 1], 40) * rng.uniform(1e-4, 5e-3, 40) / kappa  # σ = κ |y0|
    gamma = y @ fold.r
    start, near = second_preimages(mesh_of(f, 1), f, gamma, reach=10.0)
    assert near.all()
    share = 0.5 * OVERSHOOT
    assert start == pytest.approx(gamma + share * (fold.mirrored(gamma) - gamma), abs=1e-9)


def test_a_second_preimage_out_of_reach_or_far_out_of_bounds_is_left_out(rng):
    fold = random_fold(rng)._replace(r=np.eye(3))
    f = fold.quadratic()
    mesh = mesh_of(f, 1)  # one cell of width 2
    gamma = np.array([[0.1, 0.0, 0.0], [0.5, 0.0, 0.0]])
    assert second_preimages(mesh, f, gamma, reach=0.3)[1].tolist() == [True, False]
    low = np.array([0.4, -1.0, -1.0])
    start, near = second_preimages(mesh, f, gamma, reach=10.0, low=low)
    assert near.all()
    assert (start >= low).all()
    low[0] = 3.0
    assert not second_preimages(mesh, f, gamma, reach=10.0, low=low)[1].any()
