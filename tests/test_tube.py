"""Laws of tubes and ribbons: closed, outward, and of the volume that they should have."""

import numpy as np
import pytest

import softreach as sr
from softreach.arm.skin import arm_surface, bundle_skins, bundle_surfaces
from softreach.geometry.surface import Surface, grid_faces, ribbon_surface, tube_surface
from softreach.rod.kinematics import rest_configuration
from softreach.support.errors import InvalidInput
from tests.sets import mesh_of

pytest.importorskip("trimesh")

TURN = np.linspace(0, 5, 160)
HELIX = np.column_stack([np.cos(TURN), np.sin(TURN), 0.3 * TURN])
INWARD = np.column_stack([-np.cos(TURN), -np.sin(TURN), 0 * TURN])
ALONG = np.column_stack([-np.sin(TURN), np.cos(TURN), 0.3 + 0 * TURN]) / np.hypot(1, 0.3)
FRENET = INWARD, np.cross(ALONG, INWARD)


def straight(sides, radii=0.1, stations=11):
    center = np.zeros((stations, 3))
    center[:, 2] = np.linspace(0, 2, stations)
    frame = np.broadcast_to(np.eye(3), (stations, 3, 3))
    return mesh_of(tube_surface(center, frame[:, 0], frame[:, 1], radii, sides))


def assert_closed(mesh):
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 2
    assert mesh.volume > 0


def test_volume_tends_to_the_cylinder_with_second_order():
    sides = np.array([16, 32, 64, 128])
    errors = [np.pi * 0.1**2 * 2 - straight(n).volume for n in sides]
    order = -np.diff(np.log(errors)) / np.diff(np.log(sides))
    np.testing.assert_allclose(order, 2, atol=0.05)


def test_prisms_of_any_number_of_sides_and_frustums_have_their_volume():
    for sides in (3, 4, 7):
        area = sides / 2 * 0.1**2 * np.sin(2 * np.pi / sides)
        assert straight(sides).volume == pytest.approx(2 * area, rel=1e-12)
    mesh = straight(2000, np.linspace(0.1, 0.03, 11))
    frustum = np.pi * 2 / 3 * (0.1**2 + 0.1 * 0.03 + 0.03**2)
    assert mesh.volume == pytest.approx(frustum, rel=1e-5)


@pytest.mark.parametrize("sides", [3, 8, 33])
def test_tubes_are_closed_and_outward(sides):
    assert_closed(straight(sides))
    assert_closed(mesh_of(tube_surface(HELIX, *FRENET, 0.05, sides)))


def test_a_tube_along_a_curve_has_the_volume_of_pappus():
    length, mesh = TURN[-1] * np.hypot(1, 0.3), mesh_of(tube_surface(HELIX, *FRENET, 0.05, 200))
    assert mesh.volume == pytest.approx(np.pi * 0.05**2 * length, rel=1e-3)


def test_a_ribbon_is_a_closed_slab():
    low = np.stack(np.meshgrid([0, 0.5, 1.0], [0, 0.4], [0.0], indexing="ij"), -1)[:, :, 0]
    mesh = mesh_of(ribbon_surface(low, low + [0, 0, 0.1]))
    assert_closed(mesh)
    assert mesh.volume == pytest.approx(1.0 * 0.4 * 0.1)


def test_a_grid_covers_its_points_once():
    points = np.stack(np.meshgrid(np.arange(4.0), np.arange(3.0), [0.0], indexing="ij"), -1)
    mesh = mesh_of(Surface(vertices=points.reshape(-1, 3), faces=grid_faces(4, 3)))
    assert mesh.area == pytest.approx(6)
    assert (mesh.face_normals[:, 2] == 1).all()


def test_curves_and_sides_that_enclose_nothing_are_refused():
    with pytest.raises(InvalidInput, match="stations >= 2"):
        tube_surface(np.zeros((1, 3)), *np.eye(3)[:2, None], 0.1)
    with pytest.raises(InvalidInput, match="at least 3"):
        straight(2)


# Laws of the arm's surface: where body, fibers and bands lie


ACTIVATION = [-1.2, -0.3, -0.8]


@pytest.fixture(scope="module")
def bent(trunk):
    return sr.configuration(trunk, ACTIVATION, stations=61)


def from_centerline(shape, points):
    """Components in the directors of points given at the stations, (..., stations, 3)."""
    offset = points - shape.position.values
    return np.einsum("...si,sdi->...sd", offset, shape.directors.values)


def test_the_arm_at_rest_is_the_configuration_without_activation(trunk):
    computed = sr.configuration(trunk, np.zeros(3), stations=61)
    resting = rest_configuration(trunk, stations=61)
    assert set(resting.variables) == set(computed.variables)
    for name in ("position", "directors", "extension", "radius", "Z"):
        np.testing.assert_allclose(resting[name], computed[name], atol=1e-9)


def bands(arm, shape):
    stations = shape.sizes["station"]
    return [skin.vertices.reshape(stations, -1, 3) for skin in bundle_skins(arm, shape)]


def test_bands_lie_on_the_surface_in_its_cross_sections(trunk, bent):
    for band in bands(trunk, bent):
        local = from_centerline(bent, np.swapaxes(band, 0, 1))
        np.testing.assert_allclose(local[..., 2], 0, atol=1e-12)
        distance = np.linalg.norm(local, axis=-1)
        np.testing.assert_allclose(distance, np.tile(bent.radius, (len(local), 1)), rtol=1e-12)


def test_bands_start_where_the_design_says_and_turn_by_their_revolution(trunk):
    edges = np.stack([band[:, [0, -1]] for band in bands(trunk, rest_configuration(trunk))])
    angles = np.unwrap(np.arctan2(edges[..., 1], edges[..., 0]), axis=1)
    middle = angles[:, :, 0] + trunk.outline([0.0]).extent[:, None] / 2
    np.testing.assert_allclose(middle[:, 0] % (2 * np.pi), np.radians([66, 114, 270]))
    np.testing.assert_allclose(np.ptp(middle, axis=1), np.radians([108, 108, 0]), atol=1e-9)


def test_bands_span_the_extent_of_their_bundle(trunk, bent):
    for band, extent in zip(bands(trunk, bent), trunk.outline([0.0]).extent, strict=True):
        chord = np.linalg.norm(band[:, -1] - band[:, 0], axis=1)
        np.testing.assert_allclose(chord, 2 * bent.radius * np.sin(extent / 2), rtol=1e-9)


def test_the_body_is_closed_and_keeps_its_volume_at_rest(trunk):
    mesh = mesh_of(arm_surface(trunk, rest_configuration(trunk), sides=400))
    r, tip = trunk.profile.radius(np.array([0.0, trunk.length]))
    frustum = np.pi * trunk.length / 3 * (r * r + r * tip + tip * tip)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(frustum, rel=1e-4)


@pytest.mark.parametrize(("distance", "disk_radius"), [(0.01, None), (0.01, 0.02), (0.0005, None)])
def test_disks_stand_at_guides_where_they_are_wider_than_the_body(distance, disk_radius):
    robot = sr.designs.three_tendon_robot()
    own = {"distance": distance, "disk_radius": disk_radius}
    held = robot.replace(actuators=(robot.actuators[0].replace(guides=4, **own),))
    bent = sr.configuration(held, 0.5 * held.bounds[:, 1])
    mesh, body = (mesh_of(arm_surface(arm, bent, sides=400)) for arm in (held, robot))
    assert mesh.is_watertight
    radius = disk_radius or distance
    outside = radius > held.profile.radius(0.0)
    disks = outside * 4 * np.pi * radius**2 * held.length / 150
    assert mesh.volume - body.volume == pytest.approx(disks, rel=1e-3)
    farthest = np.linalg.norm(mesh.vertices[:, None] - bent.position.values, axis=2).min(axis=1)
    assert farthest.max() == pytest.approx(max(radius, held.profile.radius(0.0)), rel=0.05)


def test_bands_are_closed_skins_of_their_thickness(trunk, bent):
    for skin in bundle_surfaces(trunk, rest_configuration(trunk)):
        mesh = mesh_of(skin)
        assert mesh.is_watertight
        section = np.radians(48) * 0.04  # of R2², about a mean radius of R2
        squares = np.mean(trunk.profile.radius(np.linspace(0, trunk.length, 2001)) ** 2)
        assert mesh.volume == pytest.approx(section * squares, rel=0.01)
    for skin in bundle_surfaces(trunk, bent):
        assert mesh_of(skin).volume > 0


def test_several_configurations_are_refused_with_the_way_to_choose(trunk):
    several = sr.configuration(trunk, [ACTIVATION, [0, 0, 0]], stations=5)
    with pytest.raises(InvalidInput, match="isel"):
        arm_surface(trunk, several)
