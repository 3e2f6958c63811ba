"""Laws of the tip's compliance: closed forms, differences of tips, and what its ellipsoids say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

import softreach as sr
from softreach.arm.loads import Loads
from softreach.rod.free import FreeRod
from softreach.rod.rods import tip_map
from softreach.rod.view import free_bundles
from softreach.stiffness import (
    cloud_compliance,
    principal_compliances,
    stiffness_along,
    tip_compliance,
)
from softreach.support.errors import InvalidDesign, InvalidInput
from tests.bodies import rubber

TRUNK = sr.designs.minimal_trunk()
GAMMA = np.array([[-1.2, -0.3, -0.8], [-0.2, -1.5, 0.0], [0.0, 0.0, -0.4]])
SIDE = (9.81, 0.0, 0.0)

LOADS = {
    "none": None,
    "gravity": Loads(gravity=SIDE),
    "payload with a lever": Loads(gravity=SIDE, payload=0.5, payload_arm=(0.05, 0.02, 0.1)),
    "forces in several directions": Loads(gravity=SIDE, tip_force=(0.0, 3.0, -2.0)),
    "force that follows": Loads(gravity=SIDE, follower_force=(1.0, 2.0, -2.0)),
    "moments": Loads(gravity=SIDE, tip_moment=(0.2, 0.3, -0.4), follower_moment=(0.1, 0.2, 0.1)),
}
CONSERVATIVE = {"none", "gravity", "payload with a lever", "forces in several directions"}
of_loads = pytest.mark.parametrize("name", LOADS)
WITHIN_OTHERS = {
    "gravity",
    "forces in several directions",
    "force that follows",
}  # kinds of load that others have too


def forced(loads, force):
    """The loads with a force more on the tip."""
    loads = loads or Loads(gravity=(0.0, 0.0, 0.0))
    return loads.replace(tip_force=tuple(np.add(loads.tip_force, force)))


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.large] if name in WITHIN_OTHERS else [])
        for name in LOADS
    ],
)
def test_compliance_is_the_difference_of_tips_by_a_small_force(name):
    found, force = tip_compliance(rubber(TRUNK, LOADS[name]), GAMMA, tol=1e-9), (6e-3, -5e-3, 7e-3)
    there, back = (
        sr.tip_positions(
            rubber(TRUNK, forced(LOADS[name], np.multiply(sign, force))), GAMMA, tol=1e-9
        )
        for sign in (1, -1)
    )
    np.testing.assert_allclose(found @ force, (there - back) / 2, atol=2e-8)


@of_loads
def test_compliance_is_symmetric_just_where_loads_have_a_potential(name):
    found = tip_compliance(rubber(TRUNK, LOADS[name]), GAMMA, tol=1e-9)
    apart = np.abs(found - np.swapaxes(found, 1, 2)).max()
    assert (apart < 1e-8) == (name in CONSERVATIVE)


@pytest.mark.parametrize("taper", [0.0, 0.03])
def test_a_straight_cantilever_yields_by_its_integrals(taper):
    arm = rubber(sr.designs.minimal_trunk(taper=taper), None)
    length = arm.length

    def stiffness(z):
        return arm.section.stiffness(arm.profile.radius(np.array([z])))

    across = quad(lambda z: (length - z) ** 2 / stiffness(z).bending[0], 0, length)[0]
    along = quad(lambda z: 1.0 / stiffness(z).axial[0], 0, length)[0]
    if taper == 0.0:
        at_base = stiffness(0.0)
        assert across == pytest.approx(length**3 / (3 * at_base.bending[0]), rel=1e-12)
        assert along == pytest.approx(length / at_base.axial[0], rel=1e-12)
    found = tip_compliance(arm, [[0.0, 0.0, 0.0]], tol=1e-10)[0]
    np.testing.assert_allclose(found, np.diag([across, across, along]), rtol=1e-8, atol=1e-14)


def test_an_arm_without_loads_yields_as_one_under_loads_of_zero():
    zero = rubber(TRUNK, Loads(gravity=(0.0, 0.0, 0.0)))
    free = rubber(TRUNK, None)
    np.testing.assert_array_equal(tip_compliance(free, GAMMA), tip_compliance(zero, GAMMA))
    np.testing.assert_array_equal(tip_compliance(tip_map(free), GAMMA), tip_compliance(zero, GAMMA))


def test_an_arm_without_modulus_is_refused_by_the_name_of_the_material():
    with pytest.raises(InvalidDesign, match=r"^rings\[0\].material.young_modulus: must be given"):
        tip_compliance(TRUNK, GAMMA)


def test_a_map_of_other_activations_than_the_arm_has_is_refused():
    held = rubber(TRUNK, None).with_bounds([(-1.0, 0.0), (0.0, 0.0), (-1.0, 0.0)])
    with pytest.raises(InvalidInput, match="tip map that it has"):
        tip_compliance(free_bundles(FreeRod(held)), [[0.0, 0.0]])


def test_a_force_along_a_principal_direction_moves_the_tip_along_its_partner():
    for name in ("gravity", "force that follows"):
        found = tip_compliance(rubber(TRUNK, LOADS[name]), GAMMA)
        axes = principal_compliances(found)
        moved = np.einsum("nab,nkb->nka", found, axes.forces)
        expected = axes.values[..., None] * axes.displacements
        np.testing.assert_allclose(moved, expected, atol=1e-12)
        assert (np.diff(axes.values, axis=1) <= 0).all()


def test_no_direction_of_a_force_yields_more_or_less_than_the_principal_ones():
    found = tip_compliance(rubber(TRUNK, LOADS["gravity"]), GAMMA)
    forces = np.random.default_rng(1).normal(size=(500, 3))
    forces /= np.linalg.norm(forces, axis=1, keepdims=True)
    size = np.linalg.norm(np.einsum("nab,kb->nka", found, forces), axis=2)
    axes = principal_compliances(found)
    assert (size.max(axis=1) <= axes.largest * (1 + 1e-12)).all()
    assert (size.min(axis=1) >= axes.smallest * (1 - 1e-12)).all()
    assert (size.max(axis=1) > 0.9 * axes.largest).all()


def test_stiffness_along_a_principal_direction_is_one_over_its_compliance():
    found = tip_compliance(rubber(TRUNK, LOADS["gravity"]), GAMMA)
    axes = principal_compliances(found)
    for k in range(3):
        along = stiffness_along(found, 7.0 * axes.displacements[:, k])
        np.testing.assert_allclose(along, 1.0 / axes.values[:, k], rtol=1e-5)
    with pytest.raises(InvalidInput, match="longer than 0"):
        stiffness_along(found, (0.0, 0.0, 0.0))


def test_a_cloud_has_the_compliance_of_each_sample_and_none_where_nothing_rests():
    arm = sr.designs.lce_arm().replace(loads=Loads(gravity=SIDE, payload=0.02))
    cloud = sr.compute_cloud(arm, n=2000)
    found = cloud_compliance(cloud)
    expected = tip_compliance(arm, cloud.activation.values)
    np.testing.assert_array_equal(found.compliance.values, expected)
    lost = cloud.status.values == 2
    assert lost.any()
    np.testing.assert_array_equal(np.isnan(found.largest_compliance.values), lost)
    axes = principal_compliances(expected)
    np.testing.assert_array_equal(found.largest_compliance.values, axes.largest)
    assert found.largest_compliance.attrs["units"] == "m/N"


def test_a_cloud_is_colored_by_compliance_in_ratios_where_these_are_large():
    coloring = pytest.importorskip("softreach.plot.coloring")
    cloud = sr.compute_cloud(rubber(TRUNK, None), n=500)
    soft = cloud_compliance(cloud).largest_compliance
    values = soft.values.copy()
    values[:] = np.geomspace(0.01, 1.0, 500)
    wide = coloring.color_samples(cloud, soft.copy(data=values))
    assert wide.key.label == "largest compliance [m/N]"
    assert wide.key.logarithmic
    table = coloring.color_map(wide.key).to_rgba(values, bytes=True)[:, :3].astype(int)
    assert np.abs(table - wide.rgb).max() <= 4
    narrow = coloring.color_samples(cloud, soft.copy(data=np.linspace(0.5, 1.0, 500)))
    assert not narrow.key.logarithmic


def test_the_ellipse_drawn_is_the_outline_of_where_forces_move_the_tip():
    plot = pytest.importorskip("softreach.plot")
    arm = rubber(TRUNK, LOADS["gravity"])
    found, shapes = tip_compliance(arm, GAMMA[:1]), sr.configuration(arm, GAMMA[:1])
    for view, columns in (("front", [0, 2]), ("top", [0, 1]), ("back", [0, 2])):
        ax = plot.plot_compliance(arm, shapes, found, view=view, force=0.1)
        outline = ax.lines[-1].get_xydata() * arm.length
        forces = np.random.default_rng(0).normal(size=(4000, 3))
        forces *= 0.1 / np.linalg.norm(forces, axis=1, keepdims=True)
        moved = (sr.tip_positions(arm, GAMMA[:1]) + forces @ found[0].T)[:, columns]
        np.testing.assert_allclose(outline.min(axis=0), moved.min(axis=0), atol=2e-4)
        np.testing.assert_allclose(outline.max(axis=0), moved.max(axis=0), atol=2e-4)
    with pytest.raises(InvalidInput, match="one each of 1"):
        plot.plot_compliance(arm, shapes, np.repeat(found, 2, axis=0))


def test_the_command_line_colors_a_cloud_by_compliance(tmp_path):
    from softreach.cli.app import run

    out = tmp_path / "soft.png"
    assert run(["show", "lce_arm", "--n", "500", "--color", "compliance", "--out", str(out)]) == 0
    assert out.stat().st_size > 10_000
