"""Solids around the arm: drawn as they are, and clearances that are the library's."""

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Obstacle, designs
from softreach.geometry.regions import Box, Cylinder, HalfSpace, Region, Sphere, Tube
from softreach.rod import compute_clearance
from softreach.studio.captions import clearance_text
from softreach.studio.markup import Bad
from softreach.studio.reach import Quality, sample_clearances, shown_samples, stages
from softreach.studio.scene import colors
from softreach.studio.scene.scene import Scene
from softreach.studio.scene.solids import region_surface
from softreach.studio.session import Session
from softreach.studio.state import Appearance
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
    opened.update(lambda state: state.replace(design=ARM, activation=FREE))
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
