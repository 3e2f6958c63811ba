"""Laws of the arm's surface: where body, fibers and bands lie."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.rod.arm_shape import (
    arm_surface,
    bundle_curves,
    bundle_skins,
    bundle_surfaces,
    rest_configuration,
)
from softreach.support.errors import InvalidInput

trimesh = pytest.importorskip("trimesh")

ACTIVATION = [-1.2, -0.3, -0.8]


@pytest.fixture(scope="module")
def bent(trunk):
    return sr.configuration(trunk, ACTIVATION, stations=61)


def solid(surface):
    return trimesh.Trimesh(surface.vertices, surface.faces, process=False)


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


def test_fibers_lie_on_the_surface_in_its_cross_sections(trunk, bent):
    local = from_centerline(bent, bundle_curves(trunk, bent))
    np.testing.assert_allclose(local[..., 2], 0, atol=1e-12)
    distance = np.linalg.norm(local, axis=-1)
    np.testing.assert_allclose(distance, np.tile(bent.radius, (3, 1)), rtol=1e-12)


def test_fibers_start_where_the_design_says_and_turn_by_their_revolution(trunk):
    x, y, _ = np.moveaxis(bundle_curves(trunk, rest_configuration(trunk)), -1, 0)
    angles = np.unwrap(np.arctan2(y, x), axis=1)
    np.testing.assert_allclose(angles[:, 0] % (2 * np.pi), np.radians([66, 114, 270]))
    np.testing.assert_allclose(np.ptp(angles, axis=1), np.radians([108, 108, 0]), atol=1e-9)


def test_bands_span_the_extent_about_their_fiber(trunk, bent):
    curves = bundle_curves(trunk, bent)
    for curve, skin, extent in zip(
        curves, bundle_skins(trunk, bent), trunk.outline([0.0]).extent, strict=True
    ):
        band = skin.vertices.reshape(len(curve), -1, 3)
        chord = np.linalg.norm(band[:, -1] - band[:, 0], axis=1)
        np.testing.assert_allclose(chord, 2 * bent.radius * np.sin(extent / 2), rtol=1e-9)
        to_edges = np.linalg.norm(band[:, [0, -1]] - curve[:, None], axis=2)
        np.testing.assert_allclose(to_edges[:, 0], to_edges[:, 1], rtol=1e-9)


def test_the_body_is_closed_and_keeps_its_volume_at_rest(trunk):
    mesh = solid(arm_surface(trunk, rest_configuration(trunk), sides=400))
    r, tip = trunk.profile.radius(np.array([0.0, trunk.length]))
    frustum = np.pi * trunk.length / 3 * (r * r + r * tip + tip * tip)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(frustum, rel=1e-4)


def test_bands_are_closed_skins_of_their_thickness(trunk, bent):
    for skin in bundle_surfaces(trunk, rest_configuration(trunk), thickness=0.1):
        mesh = solid(skin)
        assert mesh.is_watertight
        section = np.radians(48) * 0.1  # of R2², about a mean radius of R2
        squares = np.mean(trunk.profile.radius(np.linspace(0, trunk.length, 2001)) ** 2)
        assert mesh.volume == pytest.approx(section * squares, rel=0.01)
    for skin in bundle_surfaces(trunk, bent):
        assert solid(skin).volume > 0


def test_several_configurations_are_refused_with_the_way_to_choose(trunk):
    several = sr.configuration(trunk, [ACTIVATION, [0, 0, 0]], stations=5)
    with pytest.raises(InvalidInput, match="isel"):
        arm_surface(trunk, several)
