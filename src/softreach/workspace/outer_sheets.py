"""The boundary of a rasterized image as the sheets it consists of: faces of the box, and folds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.surface import Surface, compact_surface
from softreach.rod.stable_tips import stable_tips
from softreach.rod.tip_map import TipMap
from softreach.workspace.image import Image

__all__ = ["outer_sheets"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_ASIDE = 0.02  # cells beside a triangle where is looked for the inside
_PARTS = 4  # into which each edge of a triangle of the grid is divided
# Barycentric, of the places on a triangle that are looked at: where sheets cross, one is outside.
_PLACES = np.array([[1, 1, 1], [8, 1, 1], [1, 8, 1], [1, 1, 8]], float)
_PLACES /= _PLACES.sum(axis=1, keepdims=True)


def _small_triangles() -> tuple[Ints, Ints]:
    """Barycentric places of the corners, times `_PARTS`, and the triangles between them."""
    steps = [(i, j) for i in range(_PARTS + 1) for j in range(_PARTS + 1 - i)]
    number = {step: k for k, step in enumerate(steps)}
    inner = [(i, j) for i, j in steps if i + j < _PARTS]
    up = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in inner]
    down = [
        (number[i + 1, j], number[i + 1, j + 1], number[i, j + 1])
        for i, j in inner
        if i + j < _PARTS - 1
    ]
    return np.array([(_PARTS - i - j, i, j) for i, j in steps]), np.array(up + down)


_STEPS, _SMALL = _small_triangles()


def outer_sheets(rod: TipMap, image: Image) -> Surface:
    """The critical triangles of which some place has the image on one side only, made finer.

    Their corners lie where the map puts them, so on faces of the box they are on the boundary to
    the tolerance of the tips: rims are sharp, and parts of any thinness whole. Where sheets cross,
    some triangles reach a little into the inside: the surface is not a closed one.

    Args:
        rod: The tip map, of three free bundles.
        image: Of the grid of cubes over its activation box.

    Returns:
        Triangles whose normals point outwards.
    """
    cells = round(len(image.vertices) ** (1 / 3)) - 1
    triangles = _outer_triangles(image)
    nodes = np.stack(np.unravel_index(triangles, (cells + 1,) * 3), axis=-1)
    keys, faces = _divided(nodes * _PARTS, cells * _PARTS + 1)
    tips = stable_tips(rod).tips(rod.box.from_free_cube(keys / (cells * _PARTS)))
    known = np.asarray(np.isfinite(tips).all(axis=1))
    vertices, faces = compact_surface(tips, faces[known[faces].all(axis=1)])
    return Surface(vertices=vertices, faces=faces)


def _outer_triangles(image: Image) -> Ints:
    """Vertices of the triangles at the boundary, with the inside behind them, shape (n, 3)."""
    lattice, triangles = image.lattice, image.triangles[:, :3]
    corners = lattice.origin + image.vertices[triangles] * (lattice.cell / image.unit)
    size = np.linalg.norm(_cross(corners), axis=1)
    some = np.flatnonzero(size)
    triangles, corners = triangles[some], corners[some]
    senses = np.stack([_senses(image, corners, place) for place in _PLACES], axis=1)
    turned = np.where(senses.sum(axis=1)[:, None] < 0, triangles[:, ::-1], triangles)
    return turned[(senses != 0).any(axis=1)]


def _senses(image: Image, corners: Array, place: Array) -> Ints:
    """1 where only what is behind a triangle is reached, -1 before it; 0 inside and outside."""
    normals = _cross(corners)
    away = _ASIDE * image.lattice.cell * normals / np.linalg.norm(normals, axis=1, keepdims=True)
    at = np.einsum("k,tki->ti", place, corners)
    before, behind = (image.counts_at(at + side * away) > 0 for side in (1, -1))
    return behind.astype(np.int64) - before


def _cross(corners: Array) -> Array:
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _divided(corners: Ints, width: int) -> tuple[Ints, NDArray[np.int32]]:
    """Triangles cut into as many along each edge as `_PARTS`.

    Args:
        corners: On a grid of integers, multiples of `_PARTS`, shape (n, 3, 3).
        width: Of that grid along each axis.

    Returns:
        Places on the grid, each once, and the triangles between them.
    """
    places = np.einsum("sk,tki->tsi", _STEPS, corners) // _PARTS
    keys, flat = np.unique(
        np.ravel_multi_index(tuple(places.reshape(-1, 3).T), (width,) * 3), return_inverse=True
    )
    faces = flat.reshape(len(corners), -1)[:, _SMALL].reshape(-1, 3)
    return np.stack(np.unravel_index(keys, (width,) * 3), axis=1), faces.astype(np.int32)
