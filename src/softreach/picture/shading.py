"""Lit meshes drawn into a z-buffer, and what lies inside of them, seen through."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.picture.projection import View, project
from softreach.picture.zbuffer import ZBuffer
from softreach.support.arrays import Array, Index

_LAMP = np.array([-0.45, 0.60, 0.66])  # over the left shoulder: right, up, toward the camera
_AMBIENT, _DIFFUSE, _GLOSS = 0.40, 0.62, 0.08
_SHARE = 0.55  # of what is inside, in the color of a pixel


def draw_mesh(
    buffer: ZBuffer,
    vertices: ArrayLike,
    faces: ArrayLike,
    color: ArrayLike,
    view: View,
    fade: float = 0.0,
) -> None:
    """Draw a shaded mesh of vertices in the units of the buffer, (v, 3), and faces, (f, 3).

    The color is RGB from 0 to 1; `fade` is how far the lit colors go toward white.
    """
    points, faces = project(vertices, view), np.asarray(faces)
    colors = shade(vertex_normals(points, faces), color)
    colors += fade * (255 - colors)
    buffer.draw_triangles(points[faces], colors[faces])


def shade(normals: Array, color: ArrayLike) -> Array:
    """RGB from 0 to 255 of surface elements, lit alike from both sides, shape (n, 3).

    Unit normals are right, up and toward the camera, shape (n, 3); the color is RGB from 0 to 1.
    """
    facing = np.where(normals[:, 2:] < 0, -normals, normals)
    # from 0 to 1 all around, so that the dark side has a shape too
    light = (0.5 + 0.5 * (facing @ _LAMP) / np.linalg.norm(_LAMP))[:, None] ** 1.5
    lit = (_AMBIENT + _DIFFUSE * light) * np.asarray(color, float) + _GLOSS * light**12
    return 255 * np.clip(lit, 0.0, 1.0)


def vertex_normals(points: Array, faces: NDArray[np.integer]) -> Array:
    """Unit mean of the normals of the faces around each vertex, by area, shape (v, 3)."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    total = np.zeros_like(points)
    for k in range(3):
        np.add.at(total, faces[:, k], normals)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0)


def seen_through(image: NDArray[np.uint8], within: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An image through which one of what is within shows: RGBA, 0 to 255, (rows, columns, 4)."""
    front, back = image.astype(float), within.astype(float)
    cover = front[..., 3:] / 255
    weight = back[..., 3:] / 255 * (1.0 - (1.0 - _SHARE) * cover)
    mixed = np.where(cover > 0, (1.0 - weight) * front + weight * back, back)
    mixed[..., 3:] = np.maximum(front[..., 3:], back[..., 3:])
    return np.rint(mixed).astype(np.uint8)


def faces_to_eye(vertices: ArrayLike, faces: ArrayLike, view: View) -> Index:
    """Those of faces turning outwards, (f, 3), that are seen from outside, shape (n, 3)."""
    points, faces = project(vertices, view)[:, :2], np.asarray(faces)
    a, b, c = (points[faces[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return faces[ux * vy > uy * vx]
