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


def glb(skin: Skin, opacity: float, *, both_sides: bool) -> bytes:
    """A surface as binary glTF, in its colors as they are.

    viser's own meshes have one color each, and a page without a graphics card is slow with light.

    Args:
        skin: The surface.
        opacity: Of it.
        both_sides: Whether it is seen from inside too, which takes a page twice as long.
    """
    from trimesh import Trimesh
    from trimesh.exchange.gltf import export_glb

    colors = np.column_stack(
        [255 * (skin.colors / 255) ** 2.2, np.full(len(skin.colors), 255 * opacity)]
    )
    mesh = Trimesh(
        skin.vertices, skin.faces, vertex_colors=np.rint(colors).astype(np.uint8), process=False
    )

    def unlit(tree: dict[str, Any]) -> None:
        look = {"alphaMode": "BLEND", "doubleSided": both_sides, "extensions": {_UNLIT: {}}}
        tree |= {"extensionsUsed": [_UNLIT], "materials": [look]}
        tree["meshes"][0]["primitives"][0]["material"] = 0

    return export_glb(mesh, include_normals=False, tree_postprocessor=unlit)
