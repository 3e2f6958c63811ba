"""Strains along rods: linear in the activations, within the range that is stated."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from softreach.arm.tables import tables
from softreach.rod.rods import refined, tip_map
from tests.kinds import any_arms, fibers_and_a_tendon
from tests.laws import arms, in_box


def stations(arm):
    return arm.length * np.array([0.0, 0.3, 0.9, 1.0])


@given(arm=arms())
def test_strains_are_the_tables_times_the_activations(arm):
    z, gamma = stations(arm), in_box(arm, 20)
    table, (curvature, extension) = tables(arm, z), tip_map(arm).strains(gamma, z)
    scale = np.abs(table.curvature).max()
    assert table.growth is table.extension
    u = np.einsum("scb,nb->nsc", table.curvature, gamma)
    np.testing.assert_allclose(curvature, u, rtol=1e-12, atol=1e-13 * scale)
    np.testing.assert_allclose(extension, 1 + gamma @ table.extension.T, rtol=1e-12)


def test_a_force_leaves_curvature_per_length_at_rest_and_fibers_take_it_along():
    """dᵢ' = η Uγ × dᵢ = ζ u × dᵢ with η of the fibers alone."""
    arm = fibers_and_a_tendon()
    z, gamma = stations(arm), in_box(arm, 20)
    table, (curvature, extension) = tables(arm, z), tip_map(arm).strains(gamma, z)
    np.testing.assert_allclose(extension, 1 + gamma @ table.extension.T, rtol=1e-12)
    eta = 1 + gamma[:, :2] @ table.extension[:, :2].T
    rate = eta[..., None] * np.einsum("scb,nb->nsc", table.curvature, gamma)
    np.testing.assert_allclose(curvature * extension[..., None], rate, rtol=1e-12, atol=1e-12)


def test_a_sample_has_the_same_strains_to_the_last_bit_whatever_is_beside_it(trunk):
    gamma = in_box(trunk, 1000)
    strains = tip_map(trunk).strains_at(stations(trunk))
    whole = strains(gamma)
    for part in (slice(0, 1), slice(3, 500), slice(7, 1000, 13)):
        np.testing.assert_array_equal(strains(gamma[part]).curvature, whole.curvature[part])
        np.testing.assert_array_equal(strains(gamma[part]).extension, whole.extension[part])


@given(arm=arms())
def test_the_range_of_the_box_holds_all_strains_and_its_corners_reach_it(arm):
    z, rod = stations(arm), tip_map(arm)
    inside, corners = rod.strains(in_box(arm, 50), z), rod.strains(rod.box.corners(), z)
    for name, ends in rod.strain_range(z)._asdict().items():
        slack = 1e-12 * max(1.0, np.abs(ends).max())
        values, extremes = quantities(inside)[name], quantities(corners)[name]
        assert (values >= ends[:, 0] - slack).all()
        assert (values <= ends[:, 1] + slack).all()
        np.testing.assert_allclose(extremes.max(axis=0), ends[:, 1], rtol=2e-5, atol=slack)
        if name != "bending":  # which is convex: its smallest value lies inside the box
            np.testing.assert_allclose(extremes.min(axis=0), ends[:, 0], rtol=1e-9, atol=slack)


@given(arm=any_arms())
def test_the_range_of_the_box_holds_all_strains_of_fibers_and_forces(arm):
    z, rod = stations(arm), tip_map(arm, 1e-4)
    gamma = np.concatenate([in_box(arm, 50), rod.box.corners()])
    for name, ends in rod.strain_range(z)._asdict().items():
        slack, values = (
            1e-12 * max(1.0, np.abs(ends).max()),
            quantities(rod.strains(gamma, z))[name],
        )
        assert (values >= ends[:, 0] - slack).all()
        assert (values <= ends[:, 1] + slack).all()


def quantities(strains):
    u = strains.curvature
    bending = np.hypot(u[..., 0], u[..., 1])
    return {"bending": bending, "torsion": u[..., 2], "extension": strains.extension}


def test_a_refined_map_is_as_near_as_asked_and_a_coarser_one_is_not_made(trunk):
    rod = tip_map(trunk, 1e-4)
    assert refined(rod, 1e-3) is rod
    fine = refined(rod, 1e-9)
    assert (fine.arm, fine.tol) == (trunk, 1e-9)
    gamma = in_box(trunk, 100)
    assert np.linalg.norm(fine.tips(gamma) - rod.tips(gamma), axis=1).max() < 1e-4
    assert refined(fine, 1e-6).tol == pytest.approx(1e-9)
