"""Curves in which a plane cuts a surface."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.geometry.surface import Surface, plane_cut, volume_beyond

SIDES = 96


def torus(large: float = 1.0, small: float = 0.3) -> Surface:
    """Around z, of even quadrilaterals cut in two."""
    turn = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    u, v = (grid.ravel() for grid in np.meshgrid(turn, turn, indexing="ij"))
    away = large + small * np.cos(v)
    vertices = np.stack([away * np.cos(u), away * np.sin(u), small * np.sin(v)], axis=1)
    i, j = (grid.ravel() for grid in np.meshgrid(*[np.arange(SIDES)] * 2, indexing="ij"))
    a, b = i * SIDES + j, (i + 1) % SIDES * SIDES + j
    c, d = (i + 1) % SIDES * SIDES + (j + 1) % SIDES, i * SIDES + (j + 1) % SIDES
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Surface(vertices=vertices, faces=faces)


@pytest.mark.parametrize("at", [0.0, 0.1, -0.25])
def test_a_plane_across_the_axis_of_a_torus_cuts_two_circles(at):
    curves = plane_cut(torus(), 2, at)
    half = np.sqrt(0.3**2 - at**2)
    radii = sorted(float(np.linalg.norm(curve[:, :2], axis=1).mean()) for curve in curves)
    assert radii == pytest.approx([1 - half, 1 + half], abs=2e-3)
    for curve in curves:
        np.testing.assert_array_equal(curve[0], curve[-1])
        np.testing.assert_array_equal(curve[:, 2], at)


def test_a_plane_through_the_axis_of_a_torus_cuts_its_tube_twice():
    curves = plane_cut(torus(), 0, 0.0)
    assert len(curves) == 2
    for curve in curves:
        away = np.hypot(np.abs(curve[:, 1]) - 1.0, curve[:, 2])
        np.testing.assert_allclose(away, 0.3, atol=2e-3)


@pytest.mark.parametrize("at", [-0.25, 0.0, 0.1, 0.31])
def test_the_volume_of_a_torus_beyond_a_plane_is_that_of_its_rings(at):
    """4π ∫ √(r² - z²) dz from there to r."""
    low = min(at, 0.3)
    right = 2 * np.pi * (0.3**2 * np.arccos(low / 0.3) - low * np.sqrt(0.3**2 - low**2))
    whole = 2 * np.pi**2 * 0.3**2
    assert volume_beyond(torus(), 2, at) == pytest.approx(right, abs=3e-3 * whole)
    both = volume_beyond(torus(), 2, at) + volume_beyond(torus(), 2, at, side=-1)
    assert both == pytest.approx(torus().volume, rel=1e-12)


def test_a_plane_beside_a_surface_cuts_nothing():
    assert plane_cut(torus(), 2, 0.31) == []


def test_the_cut_of_a_sheet_is_open_and_runs_from_edge_to_edge():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    sheet = Surface(vertices=vertices, faces=np.array([[0, 1, 2], [0, 2, 3]]))
    (curve,) = plane_cut(sheet, 0, 0.25)
    assert sorted(curve[[0, -1], 1]) == [0.0, 1.0]
    np.testing.assert_allclose(curve[:, 0], 0.25)
