"""Small pictures of values for notebooks, above their text, as PNG without an image library."""

import base64
import html
import struct
import zlib
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.picture.projection import View, project
from softreach.picture.zbuffer import Extent, ZBuffer, draw_mesh, faces_to_eye, seen_through
from softreach.support.palette import STEEL, Color

_WIDTH = 220  # pixels
_MARGIN = 0.03
_MOST = 100_000  # points; more do not show at this size
_FINE = 20_000  # faces; more are about a pixel each, whose edges need no smoothing


def png_bytes(image: NDArray[np.uint8]) -> bytes:
    """A PNG file of RGBA from 0 to 255, from top to bottom, shape (rows, columns, 4)."""
    rows, columns, _ = image.shape
    header = struct.pack(">2I5B", columns, rows, 8, 6, 0, 0, 0)  # 8 bits a channel, RGBA
    lines = np.pad(image.reshape(rows, -1), ((0, 0), (1, 0)))  # each begins with its filter: none
    content = zlib.compress(lines.tobytes(), 9)
    file = b"\x89PNG\r\n\x1a\n"
    for kind, data in ((b"IHDR", header), (b"IDAT", content), (b"IEND", b"")):
        checksum = struct.pack(">I", zlib.crc32(kind + data))
        file += struct.pack(">I", len(data)) + kind + data + checksum
    return file


class Skin(NamedTuple):
    """A lit surface."""

    vertices: ArrayLike  # Shape (v, 3)
    faces: ArrayLike  # Shape (f, 3)
    color: Color = STEEL
    clear: bool = False  # True if the outward sides of all that is not so show through it


class Dots(NamedTuple):
    """Points."""

    points: ArrayLike  # Shape (n, 3)
    colors: ArrayLike = (64, 100, 150)  # RGB from 0 to 255, shape (n, 3) or (3,)


def html_card(text: str, *parts: Skin | Dots) -> str:
    """HTML that shows parts in common units above a text, which is escaped, for `_repr_html_`."""
    shown = thumbnail(*parts)
    said = f"<pre>{html.escape(text)}</pre>"
    if shown is None:
        return said
    data = base64.b64encode(shown).decode("ascii")
    return f'<div><img alt="" src="data:image/png;base64,{data}" width="{_WIDTH}"/>{said}</div>'


def thumbnail(*parts: Skin | Dots, view: View = "oblique", width: int = _WIDTH) -> bytes | None:
    """A small square PNG of parts in common units; None if there is nothing finite to show."""
    parts = tuple(_thinned(part) if isinstance(part, Dots) else part for part in parts)
    seen = [project(np.reshape(part[0], (-1, 3)), view) for part in parts]
    flat = np.concatenate([np.empty((0, 2)), *(points[:, :2] for points in seen)])
    flat = flat[np.isfinite(flat).all(axis=1)]
    if not len(flat):
        return None
    low, high = flat.min(axis=0), flat.max(axis=0)
    half = (0.5 + _MARGIN) * max(float((high - low).max()), 1e-9)
    (left, bottom), (right, top) = (low + high) / 2 - half, (low + high) / 2 + half
    extent = Extent(left, right, bottom, top)
    faces = sum(len(np.asarray(part.faces)) for part in parts if isinstance(part, Skin))
    clear = any(isinstance(part, Skin) and part.clear for part in parts)
    oversample = 1 if faces > _FINE else 2
    buffer, within = (ZBuffer(extent, width, oversample, color_step=4) for _ in range(2))
    for part, points in zip(parts, seen, strict=True):
        if isinstance(part, Dots):
            size = float(np.clip(0.8 * buffer.shape[1] / np.cbrt(max(len(points), 1)), 1.0, 6.0))
            buffer.draw_points(points, part.colors, size)
            continue
        if not np.size(part.faces):
            continue
        draw_mesh(buffer, part.vertices, part.faces, part.color, view)
        if clear and not part.clear:
            toward = faces_to_eye(part.vertices, part.faces, view)
            draw_mesh(within, part.vertices, toward, part.color, view)
    return png_bytes(seen_through(buffer.rgba(), within.rgba()) if clear else buffer.rgba())


def _thinned(dots: Dots) -> Dots:
    points, colors = np.reshape(dots.points, (-1, 3)), np.asarray(dots.colors)
    every = 1 + len(points) // _MOST
    return Dots(points[::every], colors[::every] if colors.ndim == 2 else colors)
