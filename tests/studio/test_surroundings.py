"""Solids around the arm: drawn as they are, and clearances that are the library's."""

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Marker, Obstacle, designs, edits
from softreach.arm.parameters import changed
from softreach.cloud.clouds import design_of
from softreach.geometry.regions import Box, Cylinder, HalfSpace, Region, Sphere, Tube
from softreach.rod import compute_clearance
from softreach.studio.captions import clearance_text
from softreach.studio.found import is_alike
from softreach.studio.markup import Bad
from softreach.studio.reach import Quality, sample_clearances, shown_samples, stages
from softreach.studio.scene import colors
from softreach.studio.scene.scene import Scene
from softreach.studio.scene.solids import region_surface
from softreach.studio.session import Session
from softreach.studio.state import Appearance, StudioState, vector
from softreach.studio.tabs import move
from softreach.studio.tabs.export import saved
from softreach.studio.tabs.solids import with_mesh
from softreach.support.errors import InvalidInput, SoftreachError
from tests.studio.test_scene import Meshes

SMALL = Quality(coarse_level=10, fine_level=11, coarse_accuracy=0.1, fine_accuracy=0.05)
AROUND = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
TABLE = Obstacle(region=HalfSpace((0, 0, 0), (0, 0, 1)), start_over_length=0.1, name="table")
POLE = Obstacle(region=Cylinder((0.4, 0, 0), (0.4, 0, 1.2), 0.05), clearance=0.01, name="pole")
ARM = designs.minimal_trunk().replace(surroundings=(TABLE, POLE))
FREE, TOUCHING = (0.0, 0.0, -0.5), (-1.2, 0.0, -0.5)


@pytest.mark.parametrize(
    "region",
    [
        Box((-0.1, 0.2, 0.3), (0.4, 0.5, 0.9)),
        Sphere((0.1, 0.2, 0.3), 0.2),
        Cylinder((0.1, 0.2, 0.3), (0.4, 0.1, 0.8), 0.2),
        Tube((0.1, 0.2, 0.3), (0.4, 0.1, 0.8), 0.2, 0.1),
    ],
)
def test_triangles_of_a_region_stand_on_its_boundary_and_enclose_its_volume(region: Region):
    surface = region_surface(region, AROUND)
    np.testing.assert_allclose(
        region.distance(surface.vertices[surface.faces.ravel()]), 0, atol=1e-12
    )
    assert surface.volume == pytest.approx(region.volume, rel=0.02)
    square = region_surface(TABLE.region, AROUND)
    np.testing.assert_allclose(TABLE.region.distance(square.vertices), 0, atol=1e-12)


@pytest.fixture
def session(opened) -> Session:
    opened.update(lambda state: StudioState(design=ARM, activation=FREE).showing(level=12))
    opened.settle()
    return opened


def test_the_readout_is_the_clearance_of_the_library_and_red_where_the_arm_touches(session):
    for activation in (FREE, TOUCHING):
        session.update(lambda state, a=activation: state.replace(activation=a))
        session.settle()
        exact = compute_clearance(ARM, activation)
        value, z = float(exact.clearance[0]), float(exact.station[0])
        name = exact.clearance.attrs["names"][int(exact.obstacle[0])]
        (text,) = clearance_text(session.state, session.found)
        assert text.startswith(f"clearance {value:.3g} m")
        assert text.endswith(f"{name} at Z = {z:.3g} m")
        assert isinstance(text, Bad) == (value < 0.0)
        touched = session.client.scene.get_handle_by_name("/surroundings/1").color
        assert (tuple(touched) == (210, 40, 40)) == (value < 0.0)
    session.update(lambda state: state.replace(design=ARM.replace(surroundings=())))
    session.settle()
    assert session.found.clearance is None
    assert session.client.scene.get_handle_by_name("/surroundings") is None


def test_a_base_in_a_solid_is_said_and_the_solid_is_drawn_all_the_same(session):
    buried = Obstacle(region=Box((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2)))
    session.update(lambda state: state.replace(design=ARM.replace(surroundings=(buried,))))
    session.settle()
    (text,) = clearance_text(session.state, session.found)
    assert "the base of the arm lies inside box 1" in text
    assert session.client.scene.get_handle_by_name("/surroundings/0") is not None


def test_a_cloud_is_colored_by_the_clearance_of_the_library_and_free_samples_stand_alone():
    *_, reach = stages(ARM, 11, SMALL, lambda: None)
    exact = sr.compute_cloud(ARM, 1 << 11, sampler="sobol", tol=SMALL.tol, clearance=True)
    np.testing.assert_array_equal(sample_clearances(reach, np.arange(1 << 11)), exact.clearance)
    assert "clearance" in colors.color_names(ARM)
    assert "clearance" not in colors.color_names(designs.minimal_trunk())
    rgb, key = colors.sample_colors(reach, 11, "clearance")
    touching = exact.clearance.values[shown_samples(reach, 11)] <= 0.0
    assert len(np.unique(rgb[touching], axis=0)) == 1
    assert key.label == "clearance [m]"
    assert colors.surface_colors(reach, "clearance").rgb.shape == reach.sheets.vertices.shape
    meshes = Meshes()
    Scene(meshes).draw_cloud(reach, Appearance(level=11 + 1, cloud=True, free=True, half=False))
    assert len(meshes.added["/cloud"].points) == (~touching).sum() > 100


# Solids are parts of the design: typed, moved, loaded from the file of a mesh


def test_a_solid_that_is_moved_leaves_the_set_as_it_is_and_its_cloud_names_it(session):
    reach = session.found.reach
    session.update(lambda s: s.replace(design=edits.with_solid(s.design, "box")))
    session.settle()
    assert session.found.reach.exact is reach.exact
    assert session.found.reach.arm == session.state.design
    assert design_of(session.found.reach.cloud) == session.state.design
    assert session.found.slopes.arm == session.state.design


def test_designs_are_alike_whatever_stands_around_them():
    long, short = ARM, changed(designs.minimal_trunk(), {"length": 0.3, "outer_radius": 0.02})
    far = short.replace(surroundings=(TABLE.replace(start_over_length=0.0, start=0.25),))
    assert is_alike(short, far)
    assert is_alike(long, designs.minimal_trunk())
    assert not is_alike(far, long.replace(surroundings=(TABLE.replace(start=0.9),)))


def stl(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.torus(120, 30).export(tmp_path / "ring.stl")
    return (tmp_path / "ring.stl").read_bytes()


def test_a_mesh_is_loaded_in_its_unit_and_stays_in_the_text_of_the_design(tmp_path):
    content = stl(tmp_path)
    arm = with_mesh(designs.minimal_trunk(), "../ring.stl", content, "mm")
    (ring,) = arm.surroundings
    assert ring.name == "ring"
    assert ring.region.volume == pytest.approx(2 * np.pi**2 * 0.12 * 0.03**2, rel=0.05)
    again = StudioState.from_json(StudioState(design=arm).to_json()).design.surroundings[0]
    np.testing.assert_array_equal(again.region.vertices, ring.region.vertices)
    for unit, bad, words in (
        ("as it says", content, "does not name its unit"),
        ("mm", content[:-50], "ring.stl"),
    ):
        with pytest.raises(SoftreachError, match=words) as refused:
            with_mesh(arm, "ring.stl", bad, unit)
        assert "/" not in str(refused.value)


def test_a_page_may_name_no_mesh_of_this_machine_but_those_it_was_opened_on():
    text = designs.minimal_trunk().to_toml() + '\n[[surroundings]]\nmesh = "/etc/part.stl"\n'
    with pytest.raises(InvalidInput, match="other files are not sent along"):
        saved("tank.toml", text.encode())
    arm = sr.Manipulator.from_toml(text)
    assert (
        saved("tank.toml", text.encode(), arm.surroundings)(StudioState(design=ARM)).design == arm
    )


# Where the tip points, and what counts as the tip


def test_the_inverse_meets_a_direction_within_its_cone_and_says_how_far_off_it_is(session):
    arm, pulls = designs.redundant_trunk(), (-0.7, -0.4, -0.9, -0.2)
    shape = sr.configuration(arm, pulls, 2)
    target, way = shape.position.values[-1], shape.directors.values[-1, 2]
    session.update(lambda s: s.replace(design=arm, target=vector(target), direction=tuple(2 * way)))
    session.settle()
    answer = session.found.answer
    assert len(answer) >= 1
    assert np.degrees(answer.direction_errors.max()) <= 1.0 + 1e-4
    angle = np.degrees(answer.direction_errors.max())
    assert f", direction error {angle:.3g}°" in move._answer_text(session.state, session.found)[0]
    end = session.client.scene.get_handle_by_name("/target/way/end")
    np.testing.assert_allclose(end.position, 0.15 * way, atol=1e-6)
    session.update(lambda s: s.replace(direction=tuple(-way)))
    session.settle()
    answer = session.found.answer
    exact = sr.solve_inverse(arm, [target], direction=-way, cone=np.radians(1.0), from_rest=True)[0]
    assert answer.direction_gap == pytest.approx(exact.direction_gap, rel=1e-6)
    (text,) = move._answer_text(session.state, session.found)
    assert f"position error {answer.gap:.3g} m, direction error" in text
    with pytest.raises(InvalidInput, match="direction"):
        session.state.replace(direction=(0.0, 0.0, 0.0))


def test_the_tip_that_is_shown_is_the_point_of_the_tool():
    trunk, pulls = designs.minimal_trunk(), (-0.7, -0.4, -0.9)
    held = Marker(name="tool", offset=(0.02, 0.0, 0.2))
    middle = Marker(name="middle", station_over_length=0.53, offset=(0.1, 0.0, 0.0))
    for marker in (held, middle):
        arm, meshes = trunk.replace(markers=(marker,), point=marker.name), Meshes()
        scene = Scene(meshes)
        tip = scene.draw_arm(arm, pulls)
        np.testing.assert_allclose(tip, sr.tip_positions(arm, [pulls])[0], atol=1e-6)
        z = marker.station_over_length * arm.length
        section = sr.configuration(arm, pulls, [0.0, z])
        np.testing.assert_allclose(scene.pointing, section.directors.values[-1, 2], atol=1e-6)
        line = meshes.added["/arm/tool"].points[0]
        np.testing.assert_allclose(line, [section.position.values[-1], tip], atol=1e-6)


def test_the_arm_moves_to_a_target_on_a_way_that_touches_nothing(session):
    start, goal = (-0.717, -0.723, -0.049), (-0.194, -0.173, -0.739)
    session.update(lambda s: s.replace(activation=start))
    session.settle()
    session.aim(sr.tip_positions(ARM, [goal])[0])
    session.settle()
    np.testing.assert_allclose(session.state.activation, goal, atol=1e-6)
    rows = np.array(session.state.path.activations)
    np.testing.assert_allclose(rows[[0, -1]], [start, goal], atol=1e-6)
    assert compute_clearance(ARM, rows).clearance.min() > 0.0
    np.testing.assert_allclose(sr.tip_positions(ARM, rows), session.state.path.points, atol=1e-5)
    assert StudioState.from_json(session.state.to_json()).path == session.state.path
    move.take(session, np.array(TOUCHING))
    session.settle()
    np.testing.assert_allclose(session.state.activation, goal, atol=1e-6)  # it stays
    assert "goal" in session.note
    session.aim(sr.tip_positions(ARM, [TOUCHING])[0])
    session.settle()
    assert (
        "reached only where the arm touches" in move._answer_text(session.state, session.found)[0]
    )
