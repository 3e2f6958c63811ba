"""Laws of clearance: against dense sampling, by differences, and of what is refused."""

import numpy as np
import pytest

from softreach.arm import Base, Loads, Marker, Obstacle, designs
from softreach.requirements import Box, Cylinder, HalfSpace, Mesh, Sphere, Tube
from softreach.rod import as_tip_map, compute_clearance
from softreach.rod.clearance import ITSELF, NONE, ClearanceMap
from softreach.support.errors import InvalidDesign, InvalidInput, NotPossible, SoftreachWarning
from tests.requirements.test_regions import box_mesh, winding

TRUNK = designs.minimal_trunk()
SCENES = {
    "table and wall": (
        Obstacle(region=HalfSpace((0, 0, -0.02), (0.1, 0.2, 1)), start_over_length=0.2),
        Obstacle(region=HalfSpace((0.4, 0, 0), (1, 0, 0)), inside=True, clearance=0.01),
    ),
    "box": (Obstacle(region=Box((0.2, -0.3, 0.1), (0.5, 0.3, 0.4))),),
    "spheres": (
        Obstacle(region=Sphere((0.3, 0.1, 0.3), 0.15)),
        Obstacle(region=Sphere((0, 0, 0.3), 0.9), inside=True),
    ),
    "pole in a tank": (
        Obstacle(region=Cylinder((-0.5, 0.3, 0.4), (0.6, 0.3, 0.2), 0.05)),
        Obstacle(region=Cylinder((0, 0, -0.2), (0, 0, 1.1), 0.8), inside=True),
    ),
    "tube": (Obstacle(region=Tube((0, 0, -0.2), (0, 0, 0.5), 0.5, 0.3), end_over_length=0.9),),
}


def in_scene(name, accuracy=1e-3, **options):
    arm = TRUNK.replace(surroundings=SCENES[name])
    return ClearanceMap(as_tip_map(arm), accuracy, **options)


def samples(found, n, seed=0, low=0.0):
    cube = low + (1 - 2 * low) * np.random.default_rng(seed).random((n, found.whole.box.bundles))
    return found.whole.box.from_cube(cube)


def shapes(found, gamma, parts):
    """Centers, radii and Z at stations, from the frames of configurations and R2 ζ^-ν."""
    arm, z = found.arm, np.linspace(0.0, found.arm.length, parts + 1)
    shape = as_tip_map(arm, 1e-9).shapes(gamma, z, z)
    return shape.position, arm.profile.radius(z) * shape.extension**-0.5, z


def dense(found, gamma, parts=400, distances=lambda region, points: region.distance(points)):
    """Least gaps to the surroundings at even stations."""
    places, radius, z = shapes(found, gamma, parts)
    least = np.full(len(gamma), np.inf)
    for each in found.obstacles:
        start, end = each.span(found.arm.length)
        own = (z >= start - 1e-12) & (z <= end + 1e-12)
        distance = distances(each.region, places[:, own].reshape(-1, 3)).reshape(len(gamma), -1)
        gaps = (-distance if each.inside else distance) - radius[:, own] - each.clearance
        least = np.minimum(least, gaps.min(axis=1))
    return least


def folded(found, gamma, parts=200):
    """Least gaps between stations that are apart along the arm, up to half of its width."""
    places, radius, _ = shapes(found, gamma, parts)
    least = np.full(len(gamma), np.inf)
    for i, (line, width) in enumerate(zip(places, radius, strict=True)):
        steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
        along = np.append(0.0, np.cumsum(steps))
        apart = np.linalg.norm(line[:, None] - line, axis=2)
        both, arc = width[:, None] + width, np.abs(along[:, None] - along)
        near = (apart < 2 / np.pi * arc) & (apart < 1.5 * both)
        least[i] = np.where(near, apart - both, np.inf).min()
    return least


@pytest.mark.parametrize("name", SCENES)
def test_gaps_are_those_of_dense_sampling(name):
    found = in_scene(name, itself=False)
    gamma = samples(found, 300)
    value, sampled = found.of(gamma).value, dense(found, gamma)
    # A sampled gap is too large by up to half a spacing, where the arm runs toward the solid.
    assert (value <= sampled + found.error).all()
    assert (value >= sampled - found.error - 0.5 * 1.2 / 400).all()


def test_a_finer_accuracy_finds_the_same_gaps():
    coarse, fine = in_scene("spheres"), in_scene("spheres", 1e-5)
    gamma = samples(coarse, 500)
    few, many = coarse.of(gamma), fine.of(gamma)
    near = (few.which >= 0) & (many.which >= 0)
    assert near.mean() > 0.7
    assert np.abs(few.value - many.value)[near].max() <= coarse.error


def test_the_gap_of_an_arm_to_itself_is_that_of_dense_sampling():
    found = ClearanceMap(as_tip_map(TRUNK))
    gamma = samples(found, 600)
    value = found.of(gamma).value
    near = np.flatnonzero(value < 0.04)
    assert 3 < len(near) < 100
    np.testing.assert_allclose(value[near], folded(found, gamma[near]), atol=2 * found.error)
    wide = np.flatnonzero(np.isinf(value))[:60]
    assert (folded(found, gamma[wide]) > 0.02).all()


def test_a_straight_arm_is_near_nothing():
    found = compute_clearance(TRUNK, [0.0, 0.0, 0.0])
    assert np.isinf(found.clearance).all()
    assert (found.obstacle == -1).all()


def bumpy(size, center=(0.0, 0.0, 0.0), level=3):
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(level)
    bumps = 1 + 0.2 * np.sin(9 * ball.vertices[:, 0]) * np.cos(7 * ball.vertices[:, 2])
    return Mesh(size * ball.vertices * bumps[:, None] + np.array(center), ball.faces)


def solid(kind, *numbers, at=(0.0, 0.0, 0.0), **options):
    """A closed mesh that trimesh makes."""
    trimesh = pytest.importorskip("trimesh")
    made = getattr(trimesh.creation, kind)(*numbers, **options)
    return Mesh(made.vertices + np.array(at), made.faces)


ROOMS = {
    "table": lambda: [Obstacle(region=Box((-2, -2, -1), (2, 2, -0.05)), start_over_length=0.2)],
    "box": lambda: [Obstacle(region=Box((0.2, -0.3, 0.1), (0.5, 0.3, 0.4)))],
    "tank": lambda: [Obstacle(region=solid("icosphere", 1, 0.75, at=(0, 0, 0.35)), inside=True)],
    "tube": lambda: [Obstacle(region=solid("annulus", 0.25, 0.5, 0.4, sections=12), end=0.9)],
    "bumps": lambda: [Obstacle(region=bumpy(0.3, (0.4, 0.1, 0.4), 1))],
    "two bodies": lambda: [
        Obstacle(region=solid("icosphere", 1, at=(0.5, 0.2, 0.4), radius=0.2)),
        Obstacle(region=solid("cone", 0.2, 0.5, at=(-0.4, -0.2, 0.2), sections=12)),
    ],
}


def by_trimesh(region, points):
    """Signed distances without our trees: by every triangle, and by solid angles for the sign."""
    trimesh = pytest.importorskip("trimesh")
    mesh = region if isinstance(region, Mesh) else box_mesh(region)
    body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    found = []
    for some in np.array_split(points, 1 + len(points) // 20_000):
        size = trimesh.proximity.closest_point_naive(body, some)[1]
        found.append(np.where(winding(mesh, some) > 0.5, -size, size))
    return np.concatenate(found)


@pytest.mark.parametrize("n", [100, pytest.param(10_000, marks=pytest.mark.large)])
@pytest.mark.parametrize("name", ROOMS)
def test_no_contact_is_missed(name, n):
    arm = TRUNK.replace(surroundings=tuple(ROOMS[name]()))
    found = ClearanceMap(as_tip_map(arm), itself=False)
    gamma = samples(found, n)
    value, sampled = found.of(gamma).value, dense(found, gamma, 80, by_trimesh)
    assert 0.02 < (sampled < 0).mean() < 0.98
    assert (value <= sampled + found.error).all()
    assert (value >= sampled - found.error - 0.5 * 1.2 / 80).all()


@pytest.mark.parametrize("name", SCENES)
def test_slopes_are_differences(name):
    found, step = in_scene(name, 1e-5, itself=False), 1e-4
    gamma = samples(found, 60, low=0.05)
    value, slopes = found.with_slopes(gamma)
    beside = [[found.of(gamma + s * step * e) for s in (1, -1)] for e in np.eye(3)]
    differences = np.stack([(a.value - b.value) / (2 * step) for a, b in beside], axis=1)
    # Where another obstacle takes over there is a kink, and in the middle of a wall.
    alike = np.all([each.which == value.which for pair in beside for each in pair], axis=0)
    apart = alike & (value.value > 0)
    off = np.abs(slopes - differences).max(axis=1)[apart]
    assert apart.sum() >= 3
    assert np.quantile(off, 0.9) < 2e-3 * np.abs(slopes).max()


def test_the_nearest_of_two_meshes_counts():
    balls = [Obstacle(region=bumpy(0.2, (x, 0.1, 0.4), 2)) for x in (0.5, -0.5)]
    gamma = samples(ClearanceMap(as_tip_map(TRUNK)), 200)

    def clearance(*obstacles):
        arm = TRUNK.replace(surroundings=obstacles)
        return ClearanceMap(as_tip_map(arm), itself=False).of(gamma)

    one, other = (clearance(ball).value for ball in balls)
    both = clearance(*balls)
    np.testing.assert_allclose(both.value, np.minimum(one, other), atol=0.03)
    assert {*both.which} == {0, 1}
    touch = both.value < 0
    np.testing.assert_array_equal(touch, np.minimum(one, other) < 0)


def test_slopes_of_the_gap_to_itself_are_differences():
    found, step = ClearanceMap(as_tip_map(TRUNK), 1e-5), 1e-4
    gamma = samples(found, 1500)
    gamma = gamma[found.of(gamma).value < 0.025]
    value, slopes = found.with_slopes(gamma)
    assert len(gamma) > 2
    assert (value.which == ITSELF).all()
    pairs = [(found.of(gamma + step * e), found.of(gamma - step * e)) for e in np.eye(3)]
    differences = np.stack([(a.value - b.value) / (2 * step) for a, b in pairs], axis=1)
    off = np.abs(slopes - differences).max(axis=1)
    assert np.median(off) < 1e-8
    assert off.max() < 1e-6 * np.abs(slopes).max()


def test_obstacles_stand_in_the_world_whatever_frame_places_have():
    around = (Obstacle(region=HalfSpace((0.2, 0.0, 0.0), (-1.0, 0.0, 0.0))),)
    base = Base(position=(0.1, 0.0, 0.3), points="down")
    arm = designs.minimal_trunk().replace(surroundings=around, base=base)
    gamma = [[-1.0, 0.0, -0.5], [-0.2, -0.9, 0.0]]
    of_base = compute_clearance(as_tip_map(arm, frame="base"), gamma, slopes=True)
    of_world = compute_clearance(arm, gamma, slopes=True)
    for name in ("clearance", "station", "clearance_slope"):
        assert of_base[name].values == pytest.approx(of_world[name].values, abs=1e-12)


def test_a_distance_wanted_is_taken_off_and_an_exempt_part_does_not_count():
    plane = Obstacle(region=HalfSpace((0, 0, -0.05), (0, 0, 1)))
    gamma = samples(ClearanceMap(as_tip_map(TRUNK)), 50)

    def value(**changes):
        arm = TRUNK.replace(surroundings=(plane.replace(**changes),))
        return ClearanceMap(as_tip_map(arm), itself=False).of(gamma).value

    np.testing.assert_allclose(value() - value(clearance=0.02), 0.02, atol=1e-12)
    assert (value(start_over_length=0.5) >= value() - 2e-3).all()
    assert (value(start_over_length=0.5) > value() + 0.01).any()


def test_the_line_to_a_tool_counts_without_width():
    marker = Marker(name="needle", offset=(0.0, 0.0, 0.3))
    ceiling = Obstacle(region=HalfSpace((0, 0, 1.25), (0, 0, -1)))
    ball = Obstacle(region=Sphere((0.1, 0, 1.15), 0.05))
    arm = TRUNK.replace(markers=(marker,), point="needle", surroundings=(ceiling,))
    with pytest.warns(SoftreachWarning, match="at rest the arm is 0.05 m too near to halfspace 1"):
        found = compute_clearance(arm, [0.0, 0.0, 0.0])
    assert found.clearance.item() == pytest.approx(-0.05)
    found = compute_clearance(arm.replace(surroundings=(ball,)), [0.0, 0.0, 0.0])
    assert found.clearance.item() == pytest.approx(0.05, abs=1e-3)


def test_a_loaded_arm_has_the_gaps_of_its_equilibria():
    arm = designs.lce_arm().replace(loads=Loads(payload=0.001))
    ball = Obstacle(region=Sphere((0.05, 0.0, 0.05), 0.02))
    floor = Obstacle(region=HalfSpace((0, 0, -0.02), (0, 0, 1)))
    found = ClearanceMap(as_tip_map(arm.replace(surroundings=(ball, floor))), itself=False)
    gamma = samples(found, 20)
    z = np.linspace(0.0, arm.length, 401)
    shape = found.whole.shapes(gamma, z, z)
    radius = arm.profile.radius(z) * shape.extension**-found.poisson
    gaps = [each.region.distance(shape.position.reshape(-1, 3)) for each in (ball, floor)]
    least = (np.min(gaps, axis=0).reshape(20, -1) - radius).min(axis=1)
    slopes = found.with_slopes(gamma[:3])[1]
    np.testing.assert_allclose(found.of(gamma).value, least, atol=2 * found.error, equal_nan=True)
    step = 1e-3 * found.whole.box.widths[0]
    ends = (found.of(gamma[:3] + sign * step * np.eye(3)[0]).value for sign in (1, -1))
    differences = np.subtract(*ends) / (2 * step)
    scale = np.abs(slopes).max()
    np.testing.assert_allclose(slopes[:, 0], differences, atol=0.1 * scale)


def test_disks_are_as_wide_as_they_are():
    arm = designs.three_tendon_robot()
    tendon = arm.actuators[0].replace(guides=5, disk_radius=0.012)
    arm = arm.replace(actuators=(tendon,))
    at = arm.disks.station[1]
    wall = Obstacle(region=HalfSpace((0.03, 0, 0), (-1, 0, 0)))
    found = compute_clearance(arm.replace(surroundings=(wall,)), np.zeros(arm.inputs))
    assert found.clearance.item() == pytest.approx(0.03 - 0.012, abs=1e-4)
    bar = Obstacle(region=Box((0.01, -1, at - 0.001), (0.02, 1, at + 0.001)))
    with pytest.warns(SoftreachWarning, match="at rest the arm is 0.002 m too near to box 1"):
        compute_clearance(arm.replace(surroundings=(bar,)), np.zeros(arm.inputs))


def test_a_base_inside_of_a_solid_is_refused():
    arm = TRUNK.replace(surroundings=(Obstacle(region=Sphere((0, 0, 0), 0.3), name="lump"),))
    with pytest.raises(NotPossible, match="the base of the arm lies inside lump: move one"):
        compute_clearance(arm, [0, 0, 0])


def test_what_is_no_obstacle_is_refused():
    with pytest.raises(InvalidDesign, match="region = 3: must be a region"):
        Obstacle(region=3)
    with pytest.raises(InvalidInput, match="radius"):
        Sphere((0, 0, 0), np.nan)
    with pytest.raises(InvalidDesign, match=r"surroundings\[0\].start = 3"):
        TRUNK.replace(surroundings=(Obstacle(region=Sphere((0, 0, 0), 1), start=3.0),))
    with pytest.raises(InvalidInput, match="accuracy"):
        compute_clearance(TRUNK, [0, 0, 0], accuracy=np.nan)


def test_a_mesh_in_another_unit_is_warned_of():
    arm = TRUNK.replace(surroundings=(Obstacle(region=bumpy(300, (0, 0, 1000), 1), name="tank"),))
    with pytest.warns(SoftreachWarning, match="tank is .* times as large .*: is its unit right"):
        ClearanceMap(as_tip_map(arm))


def test_a_planet_is_a_plane_and_one_beyond_all_numbers_is_far():
    gamma = samples(ClearanceMap(as_tip_map(TRUNK)), 50)
    planet, plane = Sphere((0, 0, -1e7 - 0.05), 1e7), HalfSpace((0, 0, -0.05), (0, 0, 1))
    each = [TRUNK.replace(surroundings=(Obstacle(region=x),)) for x in (planet, plane)]
    near, far = (ClearanceMap(as_tip_map(arm), itself=False).of(gamma).value for arm in each)
    np.testing.assert_allclose(near, far, atol=1e-3)
    arm = TRUNK.replace(surroundings=(Obstacle(region=Sphere((0, 0, 1e200), 1)),))
    assert (ClearanceMap(as_tip_map(arm)).of(gamma[:1]).value > 1.0).all()


def test_nothing_around_is_no_obstacle():
    found = ClearanceMap(as_tip_map(TRUNK), itself=False).of(np.zeros((2, 3)))
    assert (found.which == NONE).all()
