"""All places where a map of the sphere takes a value: maps whose places are known."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.geometry.sphere_maps import (
    icosphere,
    is_axisymmetric,
    pole_rings,
    quartered,
    sphere_roots,
)

POLE = np.array([0.0, 0.0, 1.0])
NOWHERE = np.empty((0, 3))
VALUE = np.array([0.48, 0.6, 0.64])


def plane(points):
    """Stereographic coordinates as complex numbers; the south pole is 0."""
    x, y, z = points.T
    return (x + 1j * y) / np.maximum(1 - z, 1e-300)


def sphere(w):
    size = np.abs(w) ** 2
    return np.stack([2 * w.real, 2 * w.imag, size - 1], axis=1) / (1 + size)[:, None]


def roots(image, value=VALUE, levels=4):
    return sphere_roots(image, value, levels=levels, caution=1.0, starts=NOWHERE)


@pytest.mark.parametrize("power", [1, 2, 5])
def test_a_power_takes_every_value_as_often_as_its_exponent(power):
    found, settled = roots(lambda points: sphere(plane(points) ** power))
    assert settled
    assert len(found.points) == power
    assert (found.determinants > 0).all()
    np.testing.assert_allclose(sphere(plane(found.points) ** power), [VALUE] * power, atol=1e-10)


def test_a_mirror_turns_the_sense_over():
    found, _ = roots(lambda points: points * [1, 1, -1])
    np.testing.assert_allclose(found.points, [VALUE * [1, 1, -1]], atol=1e-12)
    assert found.determinants[0] == pytest.approx(-1)


def folded(amount):
    """Of degree 1, the more folded the larger the amount: longitudes swing with the latitude."""

    def image(points):
        x, y, z = points.T
        return turned(np.arctan2(np.hypot(x, y), z), np.arctan2(y, x), amount)

    return image


def turned(polar, around, amount):
    leaning = polar + amount * np.sin(polar) * np.cos(around) * np.sin(3 * polar)
    ring = np.sin(leaning)
    return np.stack([ring * np.cos(around), ring * np.sin(around), np.cos(leaning)], axis=1)


@pytest.mark.parametrize("amount", [0.3, 1.0, 2.5])
def test_however_folded_the_signs_add_up_to_the_degree(amount):
    for value in np.random.default_rng(3).normal(size=(6, 3)):
        found, _ = roots(folded(amount), value / np.linalg.norm(value))
        assert np.sign(found.determinants).sum() == 1


@pytest.mark.parametrize("shift", [0.1, 1e-3, 1e-5])
def test_what_is_left_of_a_ring_is_found(shift):
    """The ring of a map about the pole shrinks to two points when the value moves off it."""
    value = np.array([np.sin(shift), 0.0, np.cos(shift)])
    found, _ = roots(overturned, value)
    assert len(found.points) == 3
    assert np.sign(found.determinants).sum() == 1
    np.testing.assert_allclose(overturned(found.points), [value] * 3, atol=1e-10)


def overturned(points):
    """The latitude runs past the pole and back: one ring goes there."""
    x, y, z = points.T
    polar, ring = np.arctan2(np.hypot(x, y), z), np.maximum(np.hypot(x, y), 1e-300)
    leaning = polar - 1.5 * np.sin(polar)
    along = np.sin(leaning) / ring
    return np.stack([along * x, along * y, np.cos(leaning)], axis=1)


def test_rings_are_where_the_meridian_passes_the_pole():
    assert is_axisymmetric(overturned, POLE, 1e-12)
    assert not is_axisymmetric(folded(0.5), POLE, 1e-3)
    rings = pole_rings(overturned, POLE, np.array([0.0, 1.0, 0.0]))
    assert rings.complete
    assert (rings.pole_sign, rings.signs.tolist()) == (-1, [1])
    polar = np.arccos(rings.points[0] @ POLE)
    assert polar == pytest.approx(1.5 * np.sin(polar), abs=1e-12)
    assert rings.points[0, 0] == pytest.approx(0.0, abs=1e-12)


def test_a_turn_about_the_axis_is_no_symmetry_of_meridians():
    turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    assert not is_axisymmetric(lambda points: points @ turn, POLE, 1e-3)


# Laws of meshes of the sphere


def solid_angle(corners):
    """Signed, of triangles (n, 3, 3) of unit vectors."""
    a, b, c = np.moveaxis(corners, 1, 0)
    volume = np.einsum("nc,nc->n", a, np.cross(b, c))
    sides = 1 + (a * b).sum(1) + (b * c).sum(1) + (c * a).sum(1)
    return 2 * np.arctan2(volume, sides)


def test_triangles_cover_the_sphere_once_and_face_outward():
    for levels in range(4):
        points, triangles = icosphere(levels)
        assert triangles.shape == (20 * 4**levels, 3)
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0)
        angles = solid_angle(points[triangles])
        assert angles.min() > 0
        np.testing.assert_allclose(angles.sum(), 4 * np.pi)


def test_four_parts_cover_what_was_cut():
    points, triangles = icosphere(1)
    finer, parts = quartered(points, triangles[:7])
    np.testing.assert_array_equal(finer[: len(points)], points)
    whole = solid_angle(points[triangles[:7]]).sum()
    np.testing.assert_allclose(solid_angle(finer[parts]).sum(), whole)
