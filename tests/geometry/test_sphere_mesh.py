"""Laws of meshes of the sphere."""

from __future__ import annotations

import numpy as np

from softreach.geometry.sphere_maps import icosphere, quartered


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
