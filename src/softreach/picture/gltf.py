"""Surfaces in the colors of their vertices, and lines, as binary glTF."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.support.arrays import Array

_UNLIT = "KHR_materials_unlit"
_LINES, _TRIANGLES = 1, 4  # ways to draw in glTF
_LIGHT = np.array([0.35, -0.55, 0.76])  # from the front, the right and above
_SHADE = 0.38  # of what looks away from it


class ColoredSkin(NamedTuple):
    """A surface and the color of its vertices."""

    vertices: Array  # [L], shape (v, 3)
    faces: NDArray[Any]
    colors: Array  # RGB from 0 to 255, shape (v, 3)


def glb(
    skin: ColoredSkin, opacity: float, lines: Array, ink: tuple[int, int, int], *, both_sides: bool
) -> bytes:
    """A surface and lines, ends [L] of shape (n, 2, 3), as binary glTF in their colors as they are.

    viser's own meshes have one color each, its lines are slow, and so is light without a graphics
    card. A surface that is seen from inside too takes a page twice as long.
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


def shaded(colors: NDArray[Any], outward: Array) -> NDArray[np.uint8]:
    """Colors of a surface, shape (n, 3), as a lamp lights what looks outward, shape (n, 3)."""
    facing = np.clip(outward @ _LIGHT, -1.0, 1.0)
    return np.rint(colors * (1.0 - _SHADE * 0.5 * (1.0 - facing))[:, None]).astype(np.uint8)
