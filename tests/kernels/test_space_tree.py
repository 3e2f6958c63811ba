"""The octree over images: nothing that may cover a place is missing from its list."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from softreach.inverse.cells import image_tree
from softreach.kernels.branches.space_tree import SpaceTree, leaf_at
from tests.kernels.maps import mesh_of, random_quadratic, sampled

SEEDS = st.integers(0, 2**32 - 1)


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
