"""Laws of the tip's compliance: closed forms, differences of tips, and what its ellipsoids say."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.integrate import quad

import softreach as sr
from softreach.arm import Loads, Manipulator, designs
from softreach.arm.actuators import Chamber
from softreach.arm.body import load_number
from softreach.arm.parameters import changed, find_parameters
from softreach.cli.app import run
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.dexterity import dexterity, solution_measure
from softreach.inverse import solve_inverse
from softreach.rod.free import FreeRod
from softreach.rod.kinematics import tip_jacobian, tip_positions
from softreach.rod.rest import rest
from softreach.rod.rods import as_tip_map, free_bundles
from softreach.rod.tip_map import TipStatus
from softreach.stiffness import principal_compliances, tip_compliance
from softreach.support.arrays import Array
from softreach.support.errors import InvalidDesign, InvalidInput, SoftreachWarning
from softreach.workspace import reachable_set
from softreach.workspace.tip_derivatives import TipDerivatives, shifts_along
from tests.bodies import rubber
from tests.laws import arms, differences, large

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
WITHIN_OTHERS = "gravity", "forces in several directions", "force that follows"
ALONE = "payload with a lever", "moments"  # kinds of load that no other case has


def forced(loads, force):
    loads = loads or Loads(gravity=(0.0, 0.0, 0.0))
    return loads.replace(tip_force=tuple(np.add(loads.tip_force, force)))


@pytest.mark.parametrize("name", ["none", *ALONE, *large(*WITHIN_OTHERS)])
def test_compliance_is_the_difference_of_tips_by_a_small_force(name):
    found, force = tip_compliance(rubber(TRUNK, LOADS[name]), GAMMA, tol=1e-9), (6e-3, -5e-3, 7e-3)
    loads = (forced(LOADS[name], np.multiply(sign, force)) for sign in (1, -1))
    there, back = (sr.tip_positions(rubber(TRUNK, each), GAMMA, tol=1e-9) for each in loads)
    np.testing.assert_allclose(found @ force, (there - back) / 2, atol=2e-8)


@pytest.mark.parametrize("name", LOADS)
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
    of_map = tip_compliance(as_tip_map(free), GAMMA)
    np.testing.assert_array_equal(of_map, tip_compliance(zero, GAMMA))


def test_an_arm_without_modulus_and_a_map_of_other_activations_are_refused():
    with pytest.raises(InvalidDesign, match=r"^rings\[0\].material.young_modulus: must be given"):
        tip_compliance(TRUNK, GAMMA)
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


def test_a_cloud_has_the_compliance_of_each_sample_and_none_where_nothing_rests():
    arm = sr.designs.lce_arm().replace(loads=Loads(gravity=SIDE, payload=0.005))
    cloud = sr.compute_cloud(arm, n=3000)
    found = sr.stiffness.cloud_compliance(cloud)
    expected = tip_compliance(arm, cloud.activation.values)
    np.testing.assert_array_equal(found.compliance.values, expected)
    lost = cloud.status.values == TipStatus.SNAPS
    assert lost.any()
    np.testing.assert_array_equal(np.isnan(found.largest_compliance.values), lost)
    axes = principal_compliances(expected)
    np.testing.assert_array_equal(found.largest_compliance.values, axes.largest)
    assert found.largest_compliance.attrs["units"] == "m/N"


def test_a_cloud_is_colored_by_compliance_in_ratios_where_these_are_large():
    coloring = pytest.importorskip("softreach.plot.coloring")
    cloud = sr.compute_cloud(rubber(TRUNK, None), n=500)
    soft = sr.stiffness.cloud_compliance(cloud).largest_compliance
    values = soft.values.copy()
    values[:] = np.geomspace(0.01, 1.0, 500)
    wide = coloring.color_samples(cloud, soft.copy(data=values))
    assert wide.key.label == "largest compliance [m/N]"
    assert wide.key.logarithmic
    table = coloring.color_map(wide.key).to_rgba(values, bytes=True)[:, :3].astype(int)
    assert np.abs(table - wide.rgb).max() <= 4
    narrow = coloring.color_samples(cloud, soft.copy(data=np.linspace(0.5, 1.0, 500)))
    assert not narrow.key.logarithmic


def test_the_command_line_colors_a_cloud_by_compliance(folder):
    asked = "show lce_arm --n 500 --color compliance --out soft.png"
    assert run(asked.split()) == 0
    assert (folder / "soft.png").stat().st_size > 10_000


# Dexterity of clouds


def slopes(arm, cloud):
    """Differences of the tips of a cloud, shape (n, 3, m)."""
    return differences(lambda gamma: tip_positions(arm, gamma), cloud.activation.values)


@pytest.mark.parametrize("design", [designs.minimal_trunk, designs.redundant_trunk])
def test_manipulability_is_the_root_of_det_of_j_times_its_transpose(design):
    arm = design(np.radians(36), np.radians(3))
    cloud = compute_cloud(arm, n=300)
    found, slope = dexterity(cloud), slopes(arm, cloud)
    gram = slope @ slope.transpose(0, 2, 1)
    expected = np.sqrt(np.maximum(np.linalg.det(gram), 0))
    assert np.allclose(found.manipulability, expected, rtol=1e-4, atol=1e-7)
    well = found.condition.values < 1e3
    assert np.allclose(found.condition[well], np.linalg.cond(slope[well]), rtol=1e-3)


def test_both_orientations_occur_where_the_map_folds():
    arm = designs.minimal_trunk(np.radians(36), np.radians(3))
    cloud = compute_cloud(arm, n=2000)
    found = dexterity(cloud)
    signs = np.sign(np.linalg.det(slopes(arm, cloud)))
    sure = found.manipulability.values > 1e-5
    assert np.array_equal(found.orientation.values[sure], signs[sure])
    assert {-1, 1} == set(found.orientation.values)


def test_fewer_bundles_have_an_area_or_a_length_and_no_orientation(trunk):
    for kept in (1, 2):
        arm = trunk.replace(actuators=trunk.actuators[:kept])
        cloud = compute_cloud(arm, n=50)
        found, slope = dexterity(cloud), slopes(arm, cloud)
        gram = slope.transpose(0, 2, 1) @ slope
        assert np.allclose(found.manipulability, np.sqrt(np.linalg.det(gram)), rtol=1e-5)
        assert "orientation" not in found


def test_manipulability_and_families_have_the_units_of_their_inputs(trunk):
    def units(arm):
        cloud = compute_cloud(arm, n=8, sampler="sobol")
        found = [dexterity(cloud).manipulability.attrs["units"]]
        if arm.bundles > 2:
            found.append(solution_measure(cloud, cell=arm.length).solution_measure.attrs["units"])
        return found

    robot = designs.three_tendon_robot()
    tendons = robot.actuators[0]
    chamber = Chamber(distance=0.001, radius=1e-3, activation_bounds=(0, 1e3))
    mixed = robot.replace(actuators=(tendons, chamber))
    assert units(trunk) == ["m3", "1"]
    assert units(robot) == ["m3/N3", "1"]
    assert units(robot.replace(actuators=(replace(tendons, bundles=2),))) == ["m2/N2"]
    assert units(robot.replace(actuators=(replace(tendons, bundles=5),))) == ["m3/N3", "N2"]
    assert units(mixed) == ["m3/mixed", "mixed"]
    fewer = robot.replace(actuators=(replace(tendons, bundles=1), mixed.actuators[1]))
    assert units(fewer) == ["m2/(N Pa)"]


def position_slope(arm, gamma):
    """Tip and ∂r/∂γ of one activation."""
    tip, twist = tip_positions(arm, [gamma])[0], tip_jacobian(arm, [gamma])[0]
    return tip, twist[:3] + np.cross(twist[3:], tip[:, None], axis=0)


def solution_curve(arm, target, start, step=0.04):
    """Points every `step` along the curve of activations of one tip through `start`."""
    curve = [start]
    for sense in (1, -1):
        gamma, way = start, sense * np.linalg.svd(position_slope(arm, start)[1])[2][3]
        while True:
            ahead = gamma + step * way
            for _ in range(2):
                tip, slope = position_slope(arm, ahead)
                ahead = ahead + np.linalg.pinv(slope) @ (target - tip)
            if not ((arm.bounds[:, 0] <= ahead) & (ahead <= arm.bounds[:, 1])).all():
                break
            new = np.linalg.svd(slope)[2][3]
            gamma, way = ahead, new * np.sign(new @ way)
            curve.append(gamma)
    return np.array(curve)


@pytest.mark.large
def test_with_four_bundles_the_measure_is_the_length_of_the_curve_of_solutions():
    arm, step = designs.redundant_trunk(), 0.1
    cloud = compute_cloud(arm, n=1 << 19, sampler="sobol")
    measure = solution_measure(cloud, cell=0.2).solution_measure
    for place in ([0.1, -0.3, 0.5], [-0.1, 0.3, 0.7]):  # cells that lie inside
        found = float(measure.sel(dict(zip("xyz", place, strict=True)), method="nearest"))
        targets = place + np.random.default_rng(0).uniform(-0.1, 0.1, (80, 3))
        total = 0.0
        for solution in solve_inverse(arm, targets, family=6):
            known = np.full((1, 4), np.inf)
            for start in solution.activations:
                if np.linalg.norm(known - start, axis=1).min() > step:
                    curve = solution_curve(arm, solution.target, start, step)
                    total += step * len(curve)  # half a step is lost at each end
                    known = np.vstack([known, curve])
        # Both are means over the cell, of standard errors about 0.02 and 0.03.
        assert found == pytest.approx(total / len(targets), rel=0.1)


@pytest.mark.large
def test_with_three_bundles_the_measure_is_the_number_of_activations(trunk):
    cloud = compute_cloud(trunk, n=1 << 17, sampler="sobol")
    measure = solution_measure(cloud, cell=0.1).solution_measure
    reached = reachable_set(trunk)
    centers = np.stack(np.meshgrid(measure.x, measure.y, measure.z, indexing="ij"), -1)
    depth = reached.distance(centers.reshape(-1, 3)).reshape(measure.shape)
    inner = measure.values[depth < -0.1]
    assert len(inner) > 100
    assert inner.mean() == pytest.approx(1.0, abs=5e-3)
    assert inner.std() < 0.12  # some 190 samples in each cell
    total = float(measure.sum()) * 0.1**3
    assert total == pytest.approx(reached.volume, rel=2e-3)


def test_measures_of_many_clouds_scatter_by_their_standard_error(trunk):
    clouds = [compute_cloud(trunk, n=4096, seed=seed, tol=1e-4) for seed in range(60)]
    inner = {"x": 0.1, "y": 0.3, "z": 0.5}
    measures = [solution_measure(cloud, cell=0.2) for cloud in clouds]
    values, errors = np.array([x.sel(inner, method="nearest").to_array() for x in measures]).T
    assert errors.mean() == pytest.approx(values.std(), rel=0.25)


def test_the_measure_asks_for_an_even_cloud_of_three_bundles_or_more(trunk):
    with pytest.raises(InvalidInput, match="cloud"):
        dexterity(compute_cloud(trunk, n=10).drop_vars("tip"))
    for sampler, n in (("boundary", 100), ("grid", 125)):
        with pytest.raises(InvalidInput, match=f"sampler = {sampler}: must be one of uniform"):
            solution_measure(compute_cloud(trunk, n=n, sampler=sampler))
    flat = trunk.replace(actuators=trunk.actuators[:2])
    with pytest.raises(InvalidInput, match="bundles = 2: must be 3 or more"):
        solution_measure(compute_cloud(flat, n=100))
    fixed = trunk.with_bounds(((-1, 0), (-1, 0), (-1, -1)))
    with pytest.raises(InvalidInput, match="must be lower < upper for every bundle"):
        solution_measure(compute_cloud(fixed, n=100))
    with pytest.raises(InvalidInput, match="cell = 0: must be"):
        solution_measure(compute_cloud(trunk, n=100), cell=0)


# Derivatives of tips by parameters of the design: against differences, and in closed form


NAMES = ("taper", "outer_radius", "extent", "lower")


def derivatives(arm: Manipulator, names: tuple[str, ...], tol: float) -> TipDerivatives:
    return TipDerivatives(as_tip_map(arm, tol), list(find_parameters(arm, names).values()))


def places(arm: Manipulator, n: int = 40) -> Array:
    return np.random.default_rng(0).random((n, as_tip_map(arm).box.dimension))


def by_six_neighbors(arm: Manipulator, name: str, cube: Array, tol: float, step: float) -> Array:
    shifts = shifts_along(arm, find_parameters(arm, (name,))[name], 3, step)
    rods = [as_tip_map(each, tol) for each in shifts.arms]
    tips = [rod.tips(rod.box.from_free_cube(cube)) for rod in rods]
    return np.tensordot(shifts.weights, tips, 1)


@settings(max_examples=3)
@given(arms())
def test_two_neighbors_in_equal_steps_tell_what_six_of_finer_steps_tell(arm):
    free = arm.bounds[:, 1] > arm.bounds[:, 0]
    names = tuple(find_parameters(arm, NAMES if free.all() else NAMES[:3]))
    cube, found = places(arm), derivatives(arm, names, 1e-9)
    for k, (name, value) in enumerate(zip(names, found.at(cube).T, strict=True)):
        expected = by_six_neighbors(arm, name, cube, 1e-11, 2e-3).T
        assert np.abs(value - expected).max() < 1e-6 * np.abs(expected).max() + found.error[k]


def test_under_loads_they_are_as_good_as_equilibria_are_found():
    arm = designs.lce_arm().replace(loads=Loads(gravity=(0, 0, 9.81)))
    cube, found = places(arm, 20), derivatives(arm, ("taper", "upper"), 1e-9)
    for k, name in enumerate(("taper", "upper")):
        expected = by_six_neighbors(arm, name, cube, 1e-11, 1e-2)
        assert found.at(cube)[:, :, k] == pytest.approx(expected, abs=2e-5 * np.abs(expected).max())


def test_by_a_bound_the_tip_moves_as_its_activation_does():
    arm = designs.minimal_trunk()
    rod, cube = as_tip_map(arm, 1e-9), places(arm)
    found = derivatives(arm, ("left.lower", "right.upper"), 1e-9).at(cube)
    slopes = rod.tips_and_slopes(rod.box.from_free_cube(cube))[1]
    left, right = map(arm.bundle_names.index, ("left", "right"))
    expected = [
        (1 - cube[:, left, None]) * slopes[:, :, left],
        cube[:, right, None] * slopes[:, :, right],
    ]
    assert found == pytest.approx(np.stack(expected, axis=2), abs=1e-7)


def test_all_actuators_turned_turn_the_tip_about_the_axis():
    arm = changed(designs.minimal_trunk(), {"left.offset": 0.3})
    names = tuple(f"{actuator.name}.offset" for actuator in arm.actuators)
    rod, cube = as_tip_map(arm), places(arm)
    tips = rod.tips(rod.box.from_free_cube(cube))
    found = derivatives(arm, names, 1e-6).at(cube).sum(axis=2)
    assert found == pytest.approx(np.cross([0.0, 0.0, 1.0], tips), abs=1e-5)


# The arm at rest under its loads


def at_load_number(number: float, direction: tuple[float, float, float]) -> sr.Manipulator:
    """A cylinder under as much gravity as gives this load number."""
    unit = rubber(sr.designs.minimal_trunk(taper=0.0), sr.Loads(gravity=(1.0, 0.0, 0.0)))
    return unit.replace(loads=sr.Loads(gravity=number / load_number(unit) * np.array(direction)))


def test_a_light_arm_held_sideways_sags_by_w_l4_over_8_ei():
    found = rest(at_load_number(1e-3, (1, 0, 0)))
    assert found.status == TipStatus.STABLE
    assert found.sag_over_length == pytest.approx(4e-3 / 8, rel=1e-3)
    assert found.sag == found.sag_over_length * sr.designs.minimal_trunk().length


@pytest.mark.parametrize(("share", "status"), [(0.97, "STABLE"), (1.03, "UNSTABLE")])
def test_an_upright_cylinder_at_rest_is_stable_up_to_the_load_of_greenhill(share, status):
    """Up to a share for the compression by its own weight."""
    found = rest(at_load_number(share * 7.83734744 / 4, (0, 0, -1)))
    assert found.status.name == status


def test_it_is_where_the_tip_map_puts_the_tip_without_activation():
    arm = sr.designs.lce_arm().replace(loads=sr.Loads(gravity=SIDE, payload=0.002))
    found = rest(arm)
    np.testing.assert_array_equal(found.activation, 0.0)
    np.testing.assert_allclose(
        found.tip, as_tip_map(arm).tips(np.zeros((1, arm.bundles)))[0], atol=2e-6 * arm.length
    )
    free = np.array([0.0, 0.0, arm.length])
    assert found.sag == pytest.approx(math.dist(found.tip, free), rel=1e-9)


def test_where_zero_is_out_of_bounds_the_nearest_activation_is_rest_of_arms_with_loads(trunk):
    with pytest.raises(sr.InvalidInput, match="loads = None: must be given"):
        rest(trunk)
    arm = sr.designs.lce_arm().replace(loads=sr.Loads())
    found = rest(arm.with_bounds([(-3.0, -1.0), *arm.bounds[1:]]))
    np.testing.assert_array_equal(found.activation, [-1.0, 0.0, 0.0])
    assert found.status == TipStatus.STABLE


def test_a_tip_map_beyond_the_verified_loads_warns_and_one_within_does_not():
    with pytest.warns(SoftreachWarning, match="load number is above 12"):
        as_tip_map(at_load_number(12.5, (0, 0, 1)))
    as_tip_map(at_load_number(11.9, (0, 0, 1)))
