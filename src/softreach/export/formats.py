"""Writers that clouds and surfaces share."""

import os
from collections.abc import Iterable, Mapping
from importlib import import_module
from io import BufferedWriter
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from softreach.support.files.atomic import StrPath, writing
from softreach.support.files.formats import Formats, format_of

_TYPES = {"f8": "double", "f4": "float", "u1": "uchar"}


def write_by_suffix(path: StrPath, formats: Formats, content: Any, *, overwrite: bool) -> None:
    """Write the content whole, or leave what was there."""
    write = format_of(path, formats).write
    assert write is not None
    with writing(path, overwrite=overwrite) as file:
        write(content, file)


def write_vtu(
    file: BufferedWriter, points: Any, cells: Any, *, compression: str | None = "zlib", **data: Any
) -> None:
    """Write a mesh as meshio has it, which for this format opens what it is given itself."""
    meshio = import_module("meshio")
    options = {"compression": compression, "header_type": "UInt64"}
    meshio.vtu.write(os.fspath(file.name), meshio.Mesh(points, cells, **data), **options)


def write_ply(
    file: BinaryIO,
    count: int,
    blocks: Iterable[Mapping[str, NDArray[np.generic]]],
    description: Mapping[str, object],
    faces: NDArray[np.integer] | None = None,
) -> None:
    """Write points or triangles as a binary PLY (Turk's polygon format, version 1.0).

    Blocks hold `count` points as equally named columns of float64, float32 or uint8; faces are the
    corners of triangles, shape (f, 3). The header has a comment for each line of the description.
    """
    for number, columns in enumerate(blocks):
        fields = [(name, values.dtype.newbyteorder("<")) for name, values in columns.items()]
        rows = np.zeros(len(next(iter(columns.values()))), fields)
        for name, values in columns.items():
            rows[name] = values
        if number == 0:
            header = ["ply", "format binary_little_endian 1.0"]
            for key, value in description.items():
                for x in str(value).splitlines():  # in ASCII; TOML means the same by \\uXXXX
                    own = [c if c.isascii() else f"\\u{ord(c):04x}" for c in x if c.isprintable()]
                    header.append(f"comment {key}: {''.join(own)}")
            header.append(f"element vertex {count}")
            header += [f"property {_TYPES[kind.str[1:]]} {name}" for name, kind in fields]
            if faces is not None:
                header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
            file.write("\n".join([*header, "end_header", ""]).encode("ascii"))
        file.write(rows.data)
    if faces is not None:
        triangles = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
        triangles["count"], triangles["corners"] = 3, faces
        file.write(triangles.data)
