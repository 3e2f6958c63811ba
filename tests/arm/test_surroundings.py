"""Surroundings in design files, and meshes that are refused."""

import json
import zipfile

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Manipulator, Obstacle, designs, edits
from softreach.requirements import Box, HalfSpace, Tube
from softreach.rod import compute_clearance
from softreach.support.errors import InvalidDesign, InvalidInput, NotPossible
from tests.requirements.test_regions import box_mesh

TRUNK = designs.minimal_trunk().to_toml()
TABLES = """
[[surroundings]]
name = "table"
half_space = { point = ["0cm", "0cm", "-10cm"], normal = [0, 0, 2] }
clearance_m = 0.002
start_over_length = 0.1

[[surroundings]]
tube = { start_m = [0, 0, 0], end_m = [0, 0, 2], radius = "60cm", inner_radius_m = 0.5 }
"""


def test_tables_are_obstacles_and_come_back_from_text():
    arm = Manipulator.from_toml(TRUNK + TABLES)
    table, tube = arm.surroundings
    plane = HalfSpace((0, 0, -0.1), (0, 0, 1))
    assert table == Obstacle(region=plane, name="table", clearance=0.002, start_over_length=0.1)
    assert tube.region == Tube((0, 0, 0), (0, 0, 2), 0.6, 0.5)
    again = Manipulator.from_toml(arm.to_toml())
    assert again == arm
    assert hash(again) == hash(arm)
    assert arm != designs.minimal_trunk()


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("clearance_m = 1", r"surroundings\[0\]: needs one of box, .* and has 0"),
        ("box = {low_m=[0,0,0], high_m=[1,1,1]}\nmesh='a.stl'", "needs one of .* and has 2"),
        ("box = {low_m=[0,0,0], high_m=[0,1,1]}", "box.low_m = .*: must be below high = 0 m"),
        ("sphere = {center_m=[0,0,0], radius_m=nan}", "sphere.radius_m = nan: must be a finite"),
        ("sphere = {center_m=[0,0,0], radius=1}", "radius = 1: must have its unit"),
        ("sphere = {center_m=[0,0,0], radius_m=1}\ninside = 3", "inside = 3: must be True or"),
        ("sphere = {center_m=[0,0,0], radius_m=1}\nclearanc_m = 1", 'did you mean "clearance_m"'),
        ("sphere = {center_m=[0,0,0], radius_m=1}\nstart = 'no'", "start = 'no': must be Z in m"),
        ("tube = {start_m=[0,0,0], end_m=[0,0,1], radius_m=1, inner_radius_m=2}", "inner_radius"),
    ],
)
def test_faults_of_a_table_are_named(table, said):
    with pytest.raises(InvalidDesign, match=said):
        Manipulator.from_toml(f"{TRUNK}\n[[surroundings]]\n{table}\n")


def stl(path, mesh, scale=1.0):
    trimesh = pytest.importorskip("trimesh")
    trimesh.Trimesh(mesh[0] * scale, mesh[1], process=False).export(path)
    return path


@pytest.fixture
def cube():
    mesh = box_mesh(sr.requirements.Box((0.3, -0.1, 0.3), (0.5, 0.1, 0.5)))
    return np.array(mesh.vertices), np.array(mesh.faces)


def arm_beside(path, **words):
    lines = [f"{name} = {json.dumps(value)}" for name, value in words.items()]
    text = "\n".join(["[[surroundings]]", f'mesh = "{path}"', *lines])
    return Manipulator.from_toml(f"{TRUNK}\n{text}\n")


def test_a_mesh_in_mm_is_the_box_that_it_is(tmp_path, cube):
    stl(tmp_path / "cube.stl", cube, 1000.0)
    (tmp_path / "arm.toml").write_text(
        f'{TRUNK}\n[[surroundings]]\nmesh = "cube.stl"\nmesh_unit = "mm"'
    )
    arm = Manipulator.load(tmp_path / "arm.toml")  # the mesh lies beside the design
    box = Obstacle(region=sr.requirements.Box((0.3, -0.1, 0.3), (0.5, 0.1, 0.5)))
    gamma = np.random.default_rng(0).uniform(-1, 0, (60, 3))
    each = [
        compute_clearance(a, gamma, itself=False) for a in (arm, arm.replace(surroundings=(box,)))
    ]
    mesh, solid = (found.clearance.values for found in each)
    bound = each[0].clearance.attrs["error"]
    assert (np.sign(mesh) == np.sign(solid))[np.abs(solid) > 1e-3].all()
    assert np.abs(mesh - solid).max() < bound
    assert mesh == pytest.approx(solid, abs=1e-2)


def test_a_mesh_that_is_missing_is_asked_for_when_it_is_used(tmp_path):
    arm = arm_beside(tmp_path / "gone.stl", mesh_unit="mm")
    with pytest.raises(InvalidInput, match="a file that exists"):
        compute_clearance(arm, [0, 0, 0])


def test_open_and_turned_meshes_and_archives_are_refused_by_name(tmp_path, cube):
    vertices, faces = cube
    hole = arm_beside(stl(tmp_path / "open.stl", (vertices, faces[:-1])), mesh_unit="m")
    with pytest.raises(NotPossible, match=r"open\.stl has holes: close its 3 open edges"):
        compute_clearance(hole, [0, 0, 0])
    turned = arm_beside(stl(tmp_path / "in.stl", (vertices, faces[:, ::-1])), mesh_unit="m")
    with pytest.raises(NotPossible, match=r"in\.stl face in: turn them to face out"):
        compute_clearance(turned, [0, 0, 0])
    with zipfile.ZipFile(tmp_path / "packed.stl", "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("tank.stl", b"\0" * 10_000_000)
    with pytest.raises(InvalidInput, match="not an archive: unpack it first"):
        compute_clearance(arm_beside(tmp_path / "packed.stl", mesh_unit="m"), [0, 0, 0])


def test_a_cloud_keeps_its_clearance_and_what_is_left_touches_nothing(tmp_path):
    arm = Manipulator.from_toml(TRUNK + TABLES)
    cloud = sr.compute_cloud(arm, 2000, clearance=True)
    sr.save_cloud(cloud, tmp_path / "c.zarr")
    stored = sr.open_cloud(tmp_path / "c.zarr")
    np.testing.assert_array_equal(stored.clearance, cloud.clearance)
    assert stored.clearance.attrs["names"] == ["table", "tube 2", "the arm itself"]
    free = cloud.isel(sample=(cloud.clearance > 0).values)
    assert 0 < free.sizes["sample"] < 2000
    again = compute_clearance(arm, free.activation.values)
    assert (again.clearance > 0).all()
    plain = sr.compute_cloud(arm, 2000)
    np.testing.assert_array_equal(plain.tip, cloud.tip)


@pytest.mark.parametrize("kind", edits.SOLID_KINDS)
@pytest.mark.parametrize("points", ["up", "down"])
def test_a_solid_that_is_added_is_apart_from_the_arm_named_and_moved_as_a_whole(kind, points, rng):
    trunk = designs.minimal_trunk().replace(base=sr.Base(points=points, position=(0.1, 0, 0)))
    arm = edits.with_solid(edits.with_solid(trunk, kind), kind)
    assert [each.name for each in arm.surroundings] == [f"{kind} 1", f"{kind} 2"]
    assert compute_clearance(arm, [0, 0, 0]).clearance[0] > 0.0
    region, by = arm.surroundings[0].region, np.array([0.1, -0.2, 0.3])
    points = rng.uniform(-1, 1, (50, 3))
    apart = edits.moved(region, by).distance(points + by)
    np.testing.assert_allclose(apart, region.distance(points), atol=1e-9)
    assert edits.without_solid(edits.without_solid(arm, 1), 0) == trunk
    wide = edits.with_changed_solid(arm, 1, clearance=0.02)
    assert [each.clearance for each in wide.surroundings] == [0.0, 0.02]


def test_the_mesh_of_a_file_that_is_moved_is_part_of_the_design(tmp_path):
    cube = box_mesh(Box((0, 0, 0), (1, 1, 2)))
    arm = arm_beside(stl(tmp_path / "cube.stl", (cube.vertices, cube.faces)), mesh_unit="m")
    before, by = arm.surroundings[0].region, np.array([0.25, 0.0, 0.5])
    moved = edits.with_changed_solid(arm, 0, region=edits.moved(before, by))
    again = Manipulator.from_toml(moved.to_toml()).surroundings[0].region
    np.testing.assert_allclose(again.bounds, before.bounds + by, atol=1e-9)
