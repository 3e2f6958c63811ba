"""How far an image may lie from its linear interpolant: what "every branch" rests on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach import designs
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import extension_range
from softreach.inverse.cells import activation_cells
from softreach.kernels.image.activation_mesh import ActivationMesh, face_planes
from softreach.rod import tip_map, tip_positions
from tests.kernels.maps import Quadratic, mesh_of, random_quadratic, sampled
from tests.laws import arm_of

SEEDS = st.integers(0, 2**32 - 1)
CELLS, TOL = 32, 1e-9


def random_arm(rng: np.random.Generator) -> Manipulator:
    """Three bundles of any kind, nearly all with folds."""
    while True:
        fibers = (
            FiberArchitecture(
                revolution=rng.uniform(-4, 4),
                offset=rng.uniform(-3, 3),
                extent=rng.uniform(0.2, 1.0),
            )
            for _ in range(3)
        )
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
    mesh, _ = activation_cells(tip_map(arm, TOL), CELLS)
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
