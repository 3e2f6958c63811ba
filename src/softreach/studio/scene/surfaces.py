"""Surfaces of a scene: their colors, their slices, and the file that a page draws them from."""

from __future__ import annotations

import json
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.plot.coloring import Coloring, color_samples
from softreach.studio.reach import Reach, nearest_samples
from softreach.studio.scene.clouds import counts_key, sample_values, shown_color
from softreach.studio.state import LEVELS, Slice
from softreach.workspace.sheets import clipped

Array = NDArray[np.float64]

_LEVEL = 15  # 2^15 samples, of which the nearest tell what is not known of a surface
_BY_NEIGHBORS = ("activation distance",)
"""Colors that tell something of the samples around a place."""


def surface_colors(reach: Reach, color: str) -> Coloring:
    """Colors of the vertices of the boundary, and the key to them."""
    import xarray as xr

    boundary, color = reach.boundary, shown_color(reach.arm, color)
    known = reach.sheets is not None and reach.sheets.activation is not None
    if color == "multiplicity" or (known and color not in _BY_NEIGHBORS):
        values = sample_values(boundary, LEVELS[-1], color)
        if color == "multiplicity" and not isinstance(values, str | int):
            values = values.clip(1, keep_attrs=True)  # where the set is thinner than looked inside
            coloring = color_samples(boundary.cloud, values)
            return coloring._replace(key=counts_key(coloring.rgb, values.values, shares=False))
        return color_samples(boundary.cloud, values)
    values = sample_values(reach, _LEVEL, color)
    if not isinstance(values, str | int):
        near = nearest_samples(reach, boundary.cloud.tip.values, _LEVEL)
        values = xr.DataArray(values.values[near].mean(axis=1), dims="sample", attrs=values.attrs)
    return color_samples(boundary.cloud, values)


class Skin(NamedTuple):
    """A surface and the color of its vertices."""

    vertices: Array
    """[L], shape (v, 3)."""
    faces: NDArray[Any]
    colors: Array
    """RGB from 0 to 255, shape (v, 3)."""


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


_FLOAT, _BYTE, _NUMBER = 5126, 5121, 5125  # component types of glTF
_AS_LINES, _AS_TRIANGLES = 1, 4  # ways to draw
_UNLIT = "KHR_materials_unlit"


def glb(
    skin: Skin, opacity: float, lines: Array, ink: tuple[int, int, int], *, both_sides: bool
) -> bytes:
    """A surface and lines on it as binary glTF, in their colors as they are.

    viser's own meshes have one color each, and a page without a graphics card is slow with light.

    Args:
        skin: The surface.
        opacity: Of it.
        lines: Their ends [L], shape (n, 2, 3).
        ink: Color of the lines, RGB from 0 to 255.
        both_sides: Whether it is seen from inside too, which takes a page twice as long.
    """
    file = _Gltf(both_sides)
    colors = np.column_stack([skin.colors, np.full(len(skin.colors), 255.0 * opacity)])
    file.add(_AS_TRIANGLES, skin.vertices, colors, skin.faces.ravel())
    if len(lines):
        colors = np.tile([*ink, 255.0], (2 * len(lines), 1))
        file.add(_AS_LINES, lines.reshape(-1, 3), colors, np.arange(2 * len(lines)))
    return file.binary()


class _Gltf:
    def __init__(self, both_sides: bool) -> None:
        self._both_sides = both_sides
        self._data = b""
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._primitives: list[dict[str, Any]] = []

    def add(self, mode: int, places: Array, colors: Array, indices: NDArray[Any]) -> None:
        linear = colors / 255
        linear[:, :3] **= 2.2
        limits = {"min": places.min(axis=0).tolist(), "max": places.max(axis=0).tolist()}
        position = self._accessor(places.astype("<f4"), "VEC3", _FLOAT, **limits)
        color = np.rint(255 * linear.clip(0, 1)).astype(np.uint8)
        at = {
            "POSITION": position,
            "COLOR_0": self._accessor(color, "VEC4", _BYTE, normalized=True),
        }
        number = self._accessor(indices.astype("<u4"), "SCALAR", _NUMBER)
        self._primitives.append({"attributes": at, "indices": number, "material": 0, "mode": mode})

    def _accessor(self, values: NDArray[Any], kind: str, component: int, **more: Any) -> int:
        raw = values.tobytes()
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(raw)}
        self._data += raw
        self._views.append(view)
        number = len(self._accessors)
        what = {"bufferView": number, "componentType": component, "type": kind}
        self._accessors.append({**what, "count": len(values), **more})
        return number

    def binary(self) -> bytes:
        material = {
            "alphaMode": "BLEND",
            "doubleSided": self._both_sides,
            "extensions": {_UNLIT: {}},
        }
        content = {
            "asset": {"version": "2.0"},
            "extensionsUsed": [_UNLIT],
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": self._primitives}],
            "materials": [material],
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(self._data)}],
        }
        text = json.dumps(content).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self._data), b"BIN\0") + self._data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
