"""Laws of loaded arms whose sections have two bending stiffnesses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import softreach as sr
from softreach.arm import Loads, Marker, Measured, PointLoad, Tendon
from softreach.arm.parameters import changed
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import LoadTables
from softreach.rod.tip_map import TipStatus
from tests.bodies import oracle_rod, posture_shapes
from tests.laws import differences
from tests.oracles import loaded_rod

LENGTH, WEAK, STIFF, TORSION, ANGLE = 0.3, 0.01, 0.04, 0.008, 0.5
GAMMA = np.array([[0.5, 0.3, 0.9], [0.2, 0.1, 0.4]])
ACROSS = Loads(gravity=(2.0, 1.0, -3.0), tip_force=(0.05, 0.1, -0.05))
ONE_WAY = Loads(gravity=(4.0, 2.0, -3.0), payload=0.02, payload_arm=(0.01, 0.02, 0.03))
KINDS = {
    "one direction": ONE_WAY,
    "oblique": ACROSS,
    "following": Loads(
        follower_force=(0.05, 0.1, -0.1),
        tip_moment=(0.01, 0.0, 0.02),
        point_loads=(PointLoad(station=0.2, force=(0.0, 0.1, 0.1)),),
    ),
}
of_kinds = pytest.mark.parametrize("loads", [pytest.param(v, id=k) for k, v in KINDS.items()])


def strip(loads, bending=(WEAK, STIFF), angle=ANGLE, turn=0.0, tendons=True, **own):
    pull = Tendon(
        bundles=3, distance=0.02, offset=0.3 + turn, revolution=1.0, activation_bounds=(0.0, 1.0)
    )
    numbers = {"axial_stiffness": 200.0, "torsion_stiffness": TORSION, "mass_per_length": 0.05}
    measured = Measured(bending_stiffness=bending, angle=angle, **numbers | own)
    return sr.Manipulator(
        profile=sr.LinearTaper(length=LENGTH, outer_radius=0.01),
        section=sr.Section(rings=(sr.Ring(inner_ratio=0.0),), measured=measured),
        actuators=(pull,) if tendons else (),
        loads=loads,
    )


def rod(loads, **own) -> LoadedRod:
    return LoadedRod(strip(loads, **own), 1e-10, 24)


@of_kinds
def test_two_bending_stiffnesses_that_are_one_are_those_of_a_round_arm(loads):
    """Those that differ by a rounding are computed by the kernels of flat sections."""
    single, pair, near = (
        rod(loads, bending=bending) for bending in (0.02, (0.02, 0.02), (0.02, 0.02 * (1 + 4e-16)))
    )
    assert near.tables.is_flat
    assert not pair.tables.is_flat
    np.testing.assert_array_equal(pair.tips(GAMMA), single.tips(GAMMA))
    known, found = single.equilibria(GAMMA), near.equilibria(GAMMA)
    np.testing.assert_allclose(found.tips, known.tips, atol=1e-12 * LENGTH)
    np.testing.assert_allclose(found.margin, known.margin, rtol=1e-12)
    np.testing.assert_allclose(near.compliance(GAMMA), single.compliance(GAMMA), atol=1e-12)
    np.testing.assert_allclose(
        near.tips_and_slopes(GAMMA)[1], single.tips_and_slopes(GAMMA)[1], atol=1e-12
    )


@of_kinds
def test_a_shooting_from_the_base_finds_the_same_strip(loads):
    """The force bends it about both axes, out of every plane, and so twists it."""
    found, stations = rod(loads), np.array([0.1, LENGTH])
    shapes = posture_shapes(Solver(found.tables, found.steps, 1e-10), GAMMA, stations)
    for k, one in enumerate(GAMMA):
        expected = loaded_rod.equilibrium(*oracle_rod(found.arm, one, loads), stations)
        moment = np.einsum("sd,sdc->sc", shapes.moment[k], shapes.directors[k])
        np.testing.assert_allclose(shapes.position[k], expected.place, atol=1e-10)
        np.testing.assert_allclose(shapes.directors[k], expected.frame, atol=1e-9)
        np.testing.assert_allclose(moment, expected.moment, atol=1e-10)
    assert np.ptp(found.tips(GAMMA) - rod(loads, bending=0.02).tips(GAMMA)) > 0.01


@of_kinds
def test_turning_a_strip_with_its_tendons_and_loads_turns_its_tips(loads):
    """By a right angle with stiffnesses that change their places, by others with the angle."""
    expected = rod(loads).tips(GAMMA)
    for turn, swaps in ((np.pi / 2, True), (0.7, False)):
        cos, sin = np.cos(turn), np.sin(turn)
        about = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        dead = {n: tuple(about @ getattr(loads, n)) for n in ("gravity", "tip_force", "tip_moment")}
        dead |= {n: tuple(about @ getattr(loads, n)) for n in ("payload_arm", "follower_force")}
        points = [p.replace(force=tuple(about @ p.force)) for p in loads.point_loads]
        turned = loads.replace(point_loads=tuple(points), **dead)
        angle, bending = (ANGLE, (STIFF, WEAK)) if swaps else (ANGLE + turn, (WEAK, STIFF))
        found = rod(turned, bending=bending, angle=angle, turn=turn).tips(GAMMA)
        np.testing.assert_allclose(found, expected @ about.T, atol=1e-9 * LENGTH)


def margin_of_strip(force, ratio=1e5, torsion=TORSION) -> float:
    """Of a straight strip pushed at its tip along its stiff plane; it bends by 1/ratio."""
    stiff = {"axial_stiffness": 1e9, "torsion_stiffness": torsion, "mass_per_length": 0.0}
    pushed = Loads(gravity=(0.0, 0.0, 0.0), tip_force=(0.0, force, 0.0))
    arm = strip(pushed, (ratio * WEAK, WEAK), 0.0, tendons=False, **stiff)
    return Solver(LoadTables(arm=arm), 24, 1e-10).search(np.zeros((1, 0)), None).margin[0]


@pytest.mark.parametrize("torsion", [TORSION, 0.03])
def test_a_strip_pushed_in_its_stiff_plane_buckles_at_prandtls_force(torsion):
    """F = 4.0126 √(K2 K3)/L², L. Prandtl, Kipp-Erscheinungen, 1899."""
    prandtl = 4.0126 * np.sqrt(WEAK * torsion) / LENGTH**2
    critical = brentq(lambda f: margin_of_strip(f, torsion=torsion), 0.5 * prandtl, 1.5 * prandtl)
    assert critical == pytest.approx(prandtl, rel=1e-4)


def test_beyond_prandtls_force_a_strip_leans_to_either_side():
    force = 1.1 * 4.0126 * np.sqrt(WEAK * TORSION) / LENGTH**2
    pushed = Loads(gravity=(0.0, 0.0, 0.0), tip_force=(0.0, force, 0.0))
    arm = strip(pushed, (100 * WEAK, WEAK), 0.0)
    found = sr.equilibria(arm, [0.0, 0.0, 0.0])
    left, right, straight = found.tips
    np.testing.assert_allclose(left, right * [-1.0, 1.0, 1.0], atol=1e-6 * LENGTH)
    assert abs(left[0]) > 0.1 * LENGTH
    assert abs(straight[0]) < 1e-9 * LENGTH
    assert found.status.tolist() == [TipStatus.STABLE, TipStatus.STABLE, TipStatus.UNSTABLE]
    assert found.followed in (0, 1)


def test_steps_of_strips_are_of_order_eight():
    found = rod(ACROSS)
    tables, counts = found.tables, (4, 8)
    known = Solver(tables, 64, 1e-14).near(GAMMA, found.equilibria(GAMMA))
    errors = [np.abs(Solver(tables, n, 1e-14).near(GAMMA, known).tips - known.tips) for n in counts]
    assert errors[1].max() < 1e-6
    assert np.log2(errors[0].max() / errors[1].max()) > 7.0


@of_kinds
def test_derivatives_of_strips_are_the_differences_of_their_tips(loads):
    found = rod(loads)
    expected = differences(found.tips, GAMMA, step=1e-4)
    np.testing.assert_allclose(found.tips_and_slopes(GAMMA)[1], expected, atol=1e-7)
    yields = []
    for force in 1e-5 * np.eye(3):
        ends = [
            rod(loads.replace(tip_force=tuple(np.array(loads.tip_force) + sign * force)))
            for sign in (1, -1)
        ]
        yields.append((ends[0].tips(GAMMA[:1]) - ends[1].tips(GAMMA[:1])) / 2e-5)
    np.testing.assert_allclose(found.compliance(GAMMA[:1]), np.stack(yields, axis=-1), atol=1e-6)


def test_curvatures_are_those_of_moments_about_the_axes_of_the_section():
    """m at a station is that of the tip force on its lever: theory (58), without tendons."""
    force, z = np.array([0.1, 0.2, -0.05]), np.linspace(0.0, LENGTH, 5)
    found = rod(Loads(gravity=(0.0, 0.0, 0.0), tip_force=tuple(force)), tendons=False)
    shapes = found.shapes(np.zeros((1, 0)), z, z)
    lever = shapes.position[0, -1] - shapes.position[0]
    moment = np.einsum("sab,sb->sa", shapes.directors[0], np.cross(lever, force))
    first = np.array([np.cos(ANGLE), np.sin(ANGLE), 0.0])
    second = np.array([-np.sin(ANGLE), np.cos(ANGLE), 0.0])
    turn = shapes.curvature[0] * shapes.extension[0, :, None]  # η is 1
    for axis, stiffness in ((first, WEAK), (second, STIFF), (np.array([0.0, 0.0, 1.0]), TORSION)):
        np.testing.assert_allclose(stiffness * turn @ axis, moment @ axis, atol=1e-10)


def test_markers_move_by_the_linear_response_of_both_stiffnesses():
    arm = strip(ACROSS).replace(markers=(Marker(name="half", station_over_length=0.6),))
    found = LoadedRod(arm.at_point("half"), 1e-10, 24)
    expected = differences(found.tips, GAMMA, step=1e-4)
    np.testing.assert_allclose(found.tips_and_slopes(GAMMA)[1], expected, atol=1e-7)


def test_both_stiffnesses_and_their_angle_are_found_in_measured_places_under_loads():
    true = strip(ACROSS)
    inputs = np.random.default_rng(0).uniform(0.0, 1.0, (6, 3))
    data = {f"{name}_n": inputs[:, k] for k, name in enumerate(true.input_names)}
    tips = sr.tip_positions(true, inputs, tol=1e-9)
    data |= {f"{axis}_m": tips[:, k] for k, axis in enumerate("xyz")}
    names = [f"measured.bending_stiffness[{k}]" for k in (0, 1)] + ["measured.angle"]
    start = changed(true, dict(zip(names, (0.013, 0.03, 0.4), strict=True)))
    fit = sr.calibrate(start, data, free=names, rivals=False)
    found = [fit.values[name] for name in names]
    np.testing.assert_allclose(found, [WEAK, STIFF, ANGLE], rtol=1e-5)
