"""Laws of forward kinematics: closed forms, symmetries, oracles."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import designs
from softreach.arm.tables import tables
from softreach.kernels.rod import reference
from softreach.rod.free import FreeRod
from softreach.rod.rods import as_tip_map
from softreach.support.errors import InvalidInput
from tests.kinds import fibers_and_a_tendon
from tests.laws import arm_of, arms, in_box, integrated_tip, single


def nodes_of(arm, tol):
    """Tables at the nodes of the steps that `tol` needs."""
    rod = FreeRod(arm, tol)
    return rod.rule.nodes(np.linspace(0.0, arm.profile.slender_length, rod.steps + 1))


def test_an_arm_at_rest_stands_straight(trunk):
    tips = sr.tip_positions(trunk, np.zeros((1, 3)))
    np.testing.assert_allclose(tips, [[0, 0, trunk.length]], atol=1e-15)


def test_a_longitudinal_fiber_bends_a_circular_arc():
    arm = single()
    gamma = np.array([[-0.8]])
    table = tables(arm, [0.0])
    stretch = 1 + table.extension[0, 0] * gamma[0, 0]
    kappa = np.linalg.norm(table.curvature[0, :, 0] * gamma[0, 0])
    angle = kappa * stretch * arm.length
    reach, height = (1 - np.cos(angle)) / kappa, np.sin(angle) / kappa
    tip = sr.tip_positions(arm, gamma, tol=1e-12)[0]
    np.testing.assert_allclose([np.hypot(*tip[:2]), tip[2]], [reach, height], atol=1e-12)
    # It bends toward the contracting fiber.
    np.testing.assert_allclose(np.arctan2(tip[1], tip[0]), 0.7, atol=1e-12)


@pytest.mark.parametrize("revolution", [0.5, -2.0])
def test_a_single_helical_fiber_without_taper_makes_a_circular_helix(revolution):
    arm = single(revolution)
    shape = sr.configuration(arm, [-0.9], stations=401, tol=1e-12)
    bend = np.hypot(*shape.curvature.values[:, :2].T)
    zeta, tangent = float(shape.extension[0]), np.tan(sr.describe(arm).helical_angles[0])
    # Torsion: u3 plus the turning of (u1, u2) in the cross-section, per activated arclength.
    torsion = float(shape.curvature[0, 2]) + tangent / (zeta * arm.profile.outer_radius)
    d = np.gradient(shape.position.values, zeta * shape.Z.values, axis=0, edge_order=2)
    for k in range(2):
        d = (
            np.stack([d, np.gradient(d, zeta * shape.Z.values, axis=0, edge_order=2)])
            if not k
            else d
        )
    first, second = d
    third = np.gradient(second, zeta * shape.Z.values, axis=0, edge_order=2)
    inside = slice(20, -20)
    normal = np.cross(first, second)[inside]
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), bend[inside], rtol=1e-3)
    measured = np.sum(normal * third[inside], axis=1) / np.sum(normal**2, axis=1)
    np.testing.assert_allclose(measured, torsion, rtol=3e-3)


def test_equal_helical_activations_keep_the_tip_in_the_plane_of_symmetry(trunk):
    gamma = in_box(trunk, 200)
    gamma[:, 1] = gamma[:, 0]
    assert np.abs(sr.tip_positions(trunk, gamma)[:, 0]).max() < 1e-12


def test_exchanging_the_helical_activations_mirrors_the_tip(trunk):
    gamma = in_box(trunk, 200)
    mirrored = sr.tip_positions(trunk, gamma[:, [1, 0, 2]]) * [-1, 1, 1]
    np.testing.assert_allclose(mirrored, sr.tip_positions(trunk, gamma), atol=1e-12)


@given(arm=arms(), angle=st.floats(-4, 4))
def test_rotating_all_offsets_rotates_the_cloud(arm, angle):
    turned = arm.replace(actuators=tuple(f.replace(offset=f.offset + angle) for f in arm.fibers))
    gamma = in_box(arm, 20)
    x, y, z = sr.tip_positions(arm, gamma, tol=1e-9).T
    c, s = np.cos(angle), np.sin(angle)
    expected = np.stack([c * x - s * y, s * x + c * y, z], axis=1)
    tips = sr.tip_positions(turned, gamma, tol=1e-9)
    np.testing.assert_allclose(tips, expected, atol=3e-9 * arm.length)


@given(arm=arms(), factor=st.floats(0.01, 100))
def test_scaling_length_and_radii_scales_the_cloud(arm, factor):
    lengths = {name: factor * getattr(arm.profile, name) for name in ("length", "outer_radius")}
    scaled = arm.replace(profile=arm.profile.replace(**lengths))
    gamma = in_box(arm, 20)
    tips = factor * sr.tip_positions(arm, gamma, tol=1e-9)
    np.testing.assert_allclose(
        sr.tip_positions(scaled, gamma, tol=1e-9), tips, atol=3e-9 * scaled.length
    )


@given(arm=arms())
def test_a_rotation_by_one_sector_permutes_the_activations(arm):
    fiber = arm.fibers[0].replace(bundles=3, extent=0.4)
    arm = arm.replace(actuators=(fiber,)).with_bounds((-0.5, 0.0))
    gamma = in_box(arm, 20)
    x, y, z = sr.tip_positions(arm, gamma, tol=1e-9).T
    c, s = np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3)
    turned = np.stack([c * x - s * y, s * x + c * y, z], axis=1)
    permuted = sr.tip_positions(arm, np.roll(gamma, 1, axis=1), tol=1e-9)
    np.testing.assert_allclose(permuted, turned, atol=3e-9 * arm.length)


@given(arm=arms())
def test_no_tip_is_farther_from_the_base_than_the_stretched_length(arm):
    gamma = in_box(arm, 50)
    zeta = 1 + gamma @ tables(arm, [0.0]).extension[0]
    reach = np.linalg.norm(sr.tip_positions(arm, gamma), axis=1)
    assert (reach <= zeta * arm.length * (1 + 1e-6)).all()


@settings(max_examples=10)
@given(arm=arms())
def test_tips_equal_an_independent_integrator(arm):
    gamma = in_box(arm, 3)
    expected = [integrated_tip(arm, g) for g in gamma]
    tips = sr.tip_positions(arm, gamma, tol=1e-9)
    np.testing.assert_allclose(tips, expected, atol=1e-9 * arm.length)


@given(arm=arms() | st.just(fibers_and_a_tendon()))
def test_kernels_equal_the_reference(arm):
    gamma = in_box(arm, 5)
    nodes = nodes_of(arm, 1e-9)
    expected = np.array([reference.tip(*nodes, g) for g in gamma])
    tips = sr.tip_positions(arm, gamma, tol=1e-9)
    np.testing.assert_allclose(tips, expected, atol=1e-12 * arm.length)


@given(arm=arms() | st.just(fibers_and_a_tendon()))
def test_derivatives_are_the_complex_step_derivatives_of_the_reference(arm):
    gamma = in_box(arm, 2)
    nodes = nodes_of(arm, 1e-6)
    jacobian, (_, slopes) = sr.tip_jacobian(arm, gamma), as_tip_map(arm).tips_and_slopes(gamma)
    scale = np.array([1, 1, 1, 1 / arm.length, 1 / arm.length, 1 / arm.length])[:, None]
    for sample, bundle in itertools.product(range(2), range(arm.bundles)):
        stepped = gamma[sample].astype(complex)
        stepped[bundle] += 1e-30j
        frame = reference.frames(*nodes, stepped)[-1]
        twist = (frame.imag / 1e-30) @ np.linalg.inv(frame.real)
        vee = np.array([*twist[:3, 3], twist[2, 1], twist[0, 2], twist[1, 0]])
        error = (jacobian[sample, :, bundle] - vee) / scale[:, 0]
        allowed = 1e-11 * arm.length * max(1, np.abs(vee / scale[:, 0]).max())
        assert np.abs(error).max() < allowed
        assert np.abs(slopes[sample, :, bundle] - frame[:3, 3].imag / 1e-30).max() < allowed


def test_the_jacobian_moves_the_tip_by_v_plus_omega_cross_p(trunk):
    gamma, step = in_box(trunk, 20), 1e-3
    tips = sr.tip_positions(trunk, gamma, tol=1e-11)
    twist = sr.tip_jacobian(trunk, gamma, tol=1e-11)
    for bundle in range(3):
        e = step * np.eye(3)[bundle]
        near, far = (
            sr.tip_positions(trunk, gamma + k * e, tol=1e-11)
            - sr.tip_positions(trunk, gamma - k * e, tol=1e-11)
            for k in (1, 2)
        )
        velocity = (8 * near - far) / (12 * step)  # fourth-order central difference
        expected = twist[:, :3, bundle] + np.cross(twist[:, 3:, bundle], tips)
        np.testing.assert_allclose(velocity, expected, atol=1e-9)


@pytest.mark.parametrize("singular", ["taper = 0", "angle = 0", "angle = taper"])
def test_tips_are_continuous_where_the_printed_closed_forms_are_singular(singular, trunk):
    gamma = in_box(trunk, 50)

    def tips(offset):
        angle = {"angle = 0": 0.0, "angle = taper": 0.03}.get(singular, 0.08) + offset
        taper = (0.0 if singular == "taper = 0" else 0.03) + (singular == "taper = 0") * offset
        profile = trunk.profile.replace(taper=taper)
        fibers = tuple(
            f.replace(helical_angle=sign * angle)
            for f, sign in zip(trunk.fibers, (-1, 1, 0), strict=True)
        )
        arm = trunk.replace(profile=profile, actuators=fibers)
        return sr.tip_positions(arm, gamma, tol=1e-11)

    at = tips(0.0)
    for offset in (1e-4, 1e-7, 1e-10, 1e-13, 1e-300):
        for sign in (-1, 1):
            assert np.abs(tips(sign * offset) - at).max() <= 100 * offset + 1e-10


def test_a_sample_does_not_depend_on_its_neighbors_or_on_threads(trunk, monkeypatch):
    gamma = in_box(trunk, 20_011)
    whole = sr.tip_positions(trunk, gamma)
    np.testing.assert_array_equal(sr.tip_positions(trunk, gamma[5000:5007]), whole[5000:5007])
    monkeypatch.setenv("SOFTREACH_NUM_THREADS", "1")
    np.testing.assert_array_equal(sr.tip_positions(trunk, gamma), whole)


@given(arm=arms())
def test_directors_are_orthonormal_and_the_last_station_is_the_tip(arm):
    gamma = in_box(arm, 4)
    shape = sr.configuration(arm, gamma, stations=[0.0, 0.31 * arm.length, arm.length], tol=1e-9)
    directors = shape.directors.values
    gram = directors @ np.swapaxes(directors, -1, -2)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(3), gram.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(directors), 1.0, atol=1e-12)
    tips = sr.tip_positions(arm, gamma, tol=1e-9)
    np.testing.assert_allclose(shape.position.values[:, -1], tips, atol=3e-9 * arm.length)
    np.testing.assert_array_equal(shape.position.values[:, 0], 0.0)


def test_one_activation_gives_one_shape_without_a_sample_axis(trunk):
    shape = sr.configuration(trunk, [-1, 0, -0.5], stations=11)
    assert shape.position.dims == ("station", "axis")
    assert shape.sizes["station"] == 11
    np.testing.assert_allclose(shape.radius, trunk.profile.radius(shape.Z))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda a: sr.tip_positions(a, np.zeros((2, 4))), r"shape = \(2, 4\).*\(n, 3\)"),
        (lambda a: sr.tip_positions(a, np.zeros(4)), "one column per bundle"),
        (lambda a: sr.tip_positions(a, [[0, np.nan, 0]]), r"activations\[0\].*finite"),
        (
            lambda a: sr.tip_positions(a, np.zeros((1, 3)), tol=1e-15),
            "tol = 1e-15: must be .* 1e-12",
        ),
        (lambda a: sr.configuration(a, [0, 0]), r"shape = \(1, 2\).*\(n, 3\)"),
        (lambda a: sr.configuration(a, np.zeros((1, 1, 3))), r"shape = \(1, 1, 3\)"),
        (lambda a: sr.configuration(a, [0, 0, 0], stations=1), "stations = 1: must be 2 or more"),
        (lambda a: sr.configuration(a, [0, 0, 0], stations=[0.5, 0.2]), "ascending"),
        (lambda a: sr.configuration(a, [0, 0, 0], stations=[0.5, 1.2]), r"within \[0, 1\] m"),
    ],
)
def test_bad_arguments_are_named_with_what_is_allowed(trunk, call, message):
    with pytest.raises(InvalidInput, match=message):
        call(trunk)


def test_no_activations_give_no_tips(trunk):
    assert sr.tip_positions(trunk, np.empty((0, 3))).shape == (0, 3)
    assert sr.tip_jacobian(trunk, np.empty((0, 3))).shape == (0, 6, 3)
    assert sr.configuration(trunk, np.empty((0, 3)), 5).sizes["sample"] == 0


def test_an_arm_that_an_activation_would_shorten_to_nothing_has_no_tips(trunk):
    arm = trunk.with_bounds((-9.0, 0.0))
    for call in (sr.tip_positions, sr.tip_jacobian, sr.configuration):
        with pytest.raises(sr.InvalidDesign, match=r"reaches extension ζ = -0.5\d+; must keep"):
            call(arm, np.zeros((1, 3)))


def test_a_tip_map_may_stand_for_its_arm(trunk):
    gamma = in_box(trunk, 10)
    rod = as_tip_map(trunk, 1e-9)
    np.testing.assert_array_equal(sr.tip_positions(rod, gamma), rod.tips(gamma))
    np.testing.assert_array_equal(sr.tip_jacobian(rod, gamma), rod.tip_twists(gamma)[1])
    assert sr.configuration(rod, gamma, 7).identical(sr.configuration(trunk, gamma, 7, tol=1e-9))


def test_many_bundles_are_as_good_as_few():
    """Twelve bundles of which three act are the arm of these three."""
    wide = arm_of(*(f.replace(bundles=4, extent=0.3) for f in designs.minimal_trunk().fibers))
    few = arm_of(*(f.replace(extent=0.3) for f in designs.minimal_trunk().fibers))
    gamma = in_box(few, 10)
    padded = np.zeros((10, 12))
    padded[:, [0, 4, 8]] = gamma
    np.testing.assert_allclose(
        sr.tip_positions(wide, padded, tol=1e-11),
        sr.tip_positions(few, gamma, tol=1e-11),
        atol=1e-11,
    )
