"""An image as a PNG file, without an image library."""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from softreach.errors import InvalidInput

__all__ = ["png_bytes"]

_COLOR_TYPES = {3: 2, 4: 6}  # channels -> RGB or RGBA


def png_bytes(image: NDArray[np.uint8]) -> bytes:
    """The content of a PNG file.

    Args:
        image: RGB or RGBA from 0 to 255, from top to bottom, shape (rows, columns, 3 or 4).

    Raises:
        InvalidInput: An image of another shape.
    """
    if image.ndim != 3 or image.shape[2] not in _COLOR_TYPES or not image.size:
        raise InvalidInput("image.shape", image.shape, "(rows, columns, 3 or 4)")
    rows, columns, channels = image.shape
    header = struct.pack(">2I5B", columns, rows, 8, _COLOR_TYPES[channels], 0, 0, 0)
    # each row begins with its filter: 0, none
    lines = np.pad(image.astype(np.uint8).reshape(rows, -1), ((0, 0), (1, 0)))
    content = zlib.compress(lines.tobytes(), 9)
    parts = ((b"IHDR", header), (b"IDAT", content), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in parts)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
