"""Laws of tubes and ribbons: closed, outward, and of the volume that they should have."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.geometry.surface import Surface
from softreach.geometry.tube import grid_faces, ribbon_surface, tube_surface
from softreach.support.errors import InvalidInput

trimesh = pytest.importorskip("trimesh")

TURN = np.linspace(0, 5, 160)
HELIX = np.column_stack([np.cos(TURN), np.sin(TURN), 0.3 * TURN])
INWARD = np.column_stack([-np.cos(TURN), -np.sin(TURN), 0 * TURN])
ALONG = np.column_stack([-np.sin(TURN), np.cos(TURN), 0.3 + 0 * TURN]) / np.hypot(1, 0.3)
FRENET = INWARD, np.cross(ALONG, INWARD)


def solid(surface):
    return trimesh.Trimesh(surface.vertices, surface.faces, process=False)


def straight(sides, radii=0.1, stations=11):
    center = np.zeros((stations, 3))
    center[:, 2] = np.linspace(0, 2, stations)
    frame = np.broadcast_to(np.eye(3), (stations, 3, 3))
    return solid(tube_surface(center, frame[:, 0], frame[:, 1], radii, sides))


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


def test_volume_of_a_prism_is_exact_for_any_number_of_sides():
    for sides in (3, 4, 7):
        area = sides / 2 * 0.1**2 * np.sin(2 * np.pi / sides)
        assert straight(sides).volume == pytest.approx(2 * area, rel=1e-12)


def test_a_linear_taper_gives_a_frustum():
    mesh = straight(2000, np.linspace(0.1, 0.03, 11))
    frustum = np.pi * 2 / 3 * (0.1**2 + 0.1 * 0.03 + 0.03**2)
    assert mesh.volume == pytest.approx(frustum, rel=1e-5)


@pytest.mark.parametrize("sides", [3, 8, 33])
def test_tubes_are_closed_and_outward(sides):
    assert_closed(straight(sides))
    assert_closed(solid(tube_surface(HELIX, *FRENET, 0.05, sides)))


def test_a_tube_along_a_curve_has_the_volume_of_pappus():
    length = TURN[-1] * np.hypot(1, 0.3)
    mesh = solid(tube_surface(HELIX, *FRENET, 0.05, 200))
    assert mesh.volume == pytest.approx(np.pi * 0.05**2 * length, rel=1e-3)


def test_a_ribbon_is_a_closed_slab():
    low = np.stack(np.meshgrid([0, 0.5, 1.0], [0, 0.4], [0.0], indexing="ij"), -1)[:, :, 0]
    mesh = solid(ribbon_surface(low, low + [0, 0, 0.1]))
    assert_closed(mesh)
    assert mesh.volume == pytest.approx(1.0 * 0.4 * 0.1)


def test_a_grid_covers_its_points_once():
    points = np.stack(np.meshgrid(np.arange(4.0), np.arange(3.0), [0.0], indexing="ij"), -1)
    mesh = solid(Surface(vertices=points.reshape(-1, 3), faces=grid_faces(4, 3)))
    assert mesh.area == pytest.approx(6)
    assert (mesh.face_normals[:, 2] == 1).all()


def test_curves_and_sides_that_enclose_nothing_are_refused():
    with pytest.raises(InvalidInput, match="stations >= 2"):
        tube_surface(np.zeros((1, 3)), *np.eye(3)[:2, None], 0.1)
    with pytest.raises(InvalidInput, match="at least 3"):
        straight(2)
    with pytest.raises(InvalidInput, match="two equal"):
        ribbon_surface(np.zeros((2, 2, 3)), np.zeros((2, 3, 3)))
