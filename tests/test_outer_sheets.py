"""The boundary by the faces of the activation box: whole and sharp where a raster frays."""

import numpy as np
import pytest

import softreach as sr
from softreach.arm.parameters import changed
from softreach.workspace.flux import face_image
from softreach.workspace.image import boundary_surface
from tests.sets import is_closed
from tests.test_flux import Mapped, mirrored, twisted


@pytest.fixture(scope="module")
def folded():
    """A set with rims thinner than a cell."""
    found = sr.reachable_set(sr.designs.minimal_trunk(), accuracy=0.02)
    assert found.route == "raster"
    return found


@pytest.mark.parametrize("of", [twisted, mirrored])
def test_the_image_of_the_faces_is_closed_and_bounds_what_a_one_to_one_map_fills(of):
    found = sr.reachable_set(Mapped(of), accuracy=0.02)
    assert found.route == "flux"
    surface = found.surface()
    assert is_closed(surface.faces)
    assert surface.volume == pytest.approx(found.volume, rel=2e-4)


def test_sheets_reach_the_outermost_tips_where_the_raster_ends_before_them(folded):
    from scipy.spatial import ConvexHull

    faces = face_image(folded.tip_map, 120)
    outermost = faces.vertices[ConvexHull(faces.vertices).vertices]
    cell = folded.image.lattice.cell
    raster = boundary_surface(folded.image, folded.volume)
    assert raster.distance(outermost).max() > cell
    assert folded.surface().distance(outermost).max() < 0.2 * cell
    assert folded.sheets().distance(outermost).max() < 0.05 * cell


def test_sheets_end_where_they_cross_and_no_reach_is_before_them():
    arm = changed(sr.designs.minimal_trunk(), {"taper": np.deg2rad(3), "revolution": 0.2 * np.pi})
    reached = sr.reachable_set(arm, accuracy=0.02)
    sheets = reached.sheets()
    corners = sheets.vertices[sheets.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normals, axis=1)
    some = area > 1e-9
    before = corners[some].mean(axis=1) + 0.01 * normals[some] / area[some, None]
    outside = ~reached.contains(before)
    assert area[some][outside].sum() > 0.97 * area.sum()


def test_sheets_know_their_activations_and_lines(folded):
    sheets = folded.sheets()
    tips = sr.tip_positions(folded.arm, sheets.activation)
    np.testing.assert_allclose(tips, sheets.vertices, atol=1e-5)
    low, high = folded.arm.bounds.T
    at_bound = (np.isclose(sheets.activation, low) | np.isclose(sheets.activation, high)).sum(
        axis=1
    )
    on_lines = np.zeros(len(sheets.vertices), bool)
    on_lines[sheets.lines] = True
    assert on_lines[at_bound >= 2].all()  # edges of the box
    assert (on_lines & (at_bound < 2)).any()  # folds and crossings


def test_sheets_look_outwards_and_bound_the_volume(folded):
    assert folded.sheets().volume == pytest.approx(folded.volume, rel=0.02)
