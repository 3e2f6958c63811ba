"""Binary PLY of points with any columns, and of meshes (Turk's polygon format, version 1.0)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

__all__ = ["write_mesh", "write_points"]

_TYPES = {"f8": "double", "f4": "float", "u1": "uchar"}


def write_points(
    file: BinaryIO,
    count: int,
    blocks: Iterable[Mapping[str, NDArray[np.generic]]],
    description: Mapping[str, object],
) -> None:
    """Write blocks of equally named columns as one `vertex` element.

    Args:
        file: Where to.
        count: Rows of all blocks together.
        blocks: Columns of float64, float32 or uint8, by name.
        description: Goes into the header, one comment per line of text.
    """
    for number, block in enumerate(blocks):
        rows = _records(block)
        if number == 0:
            file.write(_header(count, rows.dtype, description))
        file.write(rows.data)


def write_mesh(
    file: BinaryIO, vertices: Mapping[str, NDArray[np.generic]], faces: NDArray[np.integer]
) -> None:
    """Write triangles.

    Args:
        file: Where to.
        vertices: Columns of float64, float32 or uint8, by name.
        faces: Corners, shape (f, 3).
    """
    rows = _records(vertices)
    triangles = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    triangles["count"], triangles["corners"] = 3, faces
    element = f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
    file.write(_header(len(rows), rows.dtype, {}, element))
    file.write(rows.data)
    file.write(triangles.data)


def _records(columns: Mapping[str, NDArray[np.generic]]) -> NDArray[np.void]:
    fields = [(name, values.dtype.newbyteorder("<")) for name, values in columns.items()]
    rows = np.zeros(len(next(iter(columns.values()))), fields)
    for name, values in columns.items():
        rows[name] = values
    return rows


def _header(
    count: int, fields: np.dtype[np.void], description: Mapping[str, object], further: str = ""
) -> bytes:
    """What stands before the rows; further elements follow the vertices."""
    lines = ["ply", "format binary_little_endian 1.0"]
    for key, value in description.items():
        lines += [f"comment {key}: {_ascii(line)}" for line in str(value).splitlines()]
    lines.append(f"element vertex {count}")
    for name in fields.names or ():
        lines.append(f"property {_TYPES[fields[name].str[1:]]} {name}")
    return "\n".join([*lines, f"{further}end_header", ""]).encode("ascii")


def _ascii(text: str) -> str:
    r"""A PLY header is ASCII; a TOML string means the same with its letters as \\uXXXX."""
    return "".join(c if c.isascii() else f"\\u{ord(c):04x}" for c in text if c.isprintable())
