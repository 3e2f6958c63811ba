"""Slices of a surface, and the file that a page draws a surface from."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.studio.state import Slice
from softreach.workspace.sheets import clipped

Array = NDArray[np.float64]


class Skin(NamedTuple):
    """A surface and the color of its vertices."""

    vertices: Array
    """[L], shape (v, 3)."""
    faces: NDArray[Any]
    colors: Array
    """RGB from 0 to 255, shape (v, 3)."""


def in_slice(points: Array, cut: Slice) -> NDArray[np.bool_]:
    """Mask of the points [L], shape (n, 3), that a slice shows."""
    if cut.axis == "none":
        return np.ones(len(points), bool)
    return np.abs(points[:, "xyz".index(cut.axis)] - cut.center) <= cut.thickness / 2


def sliced(skin: Skin, cut: Slice) -> Skin:
    """The part of a surface that a slice shows, cut at its planes."""
    if cut.axis == "none":
        return skin
    axis = "xyz".index(cut.axis)
    for side in (-1.0, 1.0):
        skin = _half(skin, cut.thickness / 2 - side * (skin.vertices[:, axis] - cut.center))
    return skin


def _half(skin: Skin, depth: Array) -> Skin:
    """The part where a depth at the vertices is not below zero."""
    faces, pairs, shares = clipped(
        skin.faces,
        depth >= 0.0,
        lambda pairs: depth[pairs[:, 0]] / (depth[pairs[:, 0]] - depth[pairs[:, 1]]),
    )
    at = shares[:, None]
    vertices, colors = (
        np.concatenate([values, values[pairs[:, 0]] * (1 - at) + values[pairs[:, 1]] * at])
        for values in (skin.vertices, skin.colors)
    )
    return Skin(vertices, faces, colors)


_UNLIT = "KHR_materials_unlit"
_LINES, _TRIANGLES = 1, 4  # ways to draw in glTF


def glb(
    skin: Skin, opacity: float, lines: Array, ink: tuple[int, int, int], *, both_sides: bool
) -> bytes:
    """A surface and lines on it as binary glTF, in their colors as they are.

    viser's own meshes have one color each, its lines are slow, and so is light without a graphics
    card. Lines have ends [L] of shape (n, 2, 3) and a color, RGB from 0 to 255. A surface that is
    seen from inside too takes a page twice as long.
    """
    from trimesh import Scene, Trimesh
    from trimesh.exchange.gltf import export_glb

    colors = _linear(np.column_stack([skin.colors, np.full(len(skin.colors), 255.0 * opacity)]))
    parts = [Trimesh(skin.vertices, skin.faces, vertex_colors=colors, process=False)]
    if count := len(lines):  # pairs of corners, which trimesh takes for triples
        pairs = np.resize(np.arange(2 * count), (2 * -(-count // 3), 3))
        colors = _linear(np.tile([*ink, 255.0], (2 * count, 1)))
        parts.append(Trimesh(lines.reshape(-1, 3), pairs, vertex_colors=colors, process=False))

    def unlit(tree: dict[str, Any]) -> None:
        look = {"alphaMode": "BLEND", "doubleSided": both_sides, "extensions": {_UNLIT: {}}}
        tree |= {"extensionsUsed": [_UNLIT], "materials": [look]}
        for mesh, mode in zip(tree["meshes"], (_TRIANGLES, _LINES), strict=False):
            mesh["primitives"][0] |= {"material": 0, "mode": mode}

    return export_glb(Scene(parts), include_normals=False, tree_postprocessor=unlit)


def _linear(colors: Array) -> NDArray[np.uint8]:
    """Colors as glTF has them, shape (n, 4), from 0 to 255."""
    colors = (colors / 255).clip(0, 1)
    colors[:, :3] **= 2.2
    return np.rint(255 * colors).astype(np.uint8)
