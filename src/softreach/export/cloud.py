"""Clouds for other programs: every format holds the tips and the activations of all samples."""

from __future__ import annotations

from io import BufferedWriter
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arguments import checked, dataset, flag, path
from softreach.errors import InvalidInput
from softreach.export import ply
from softreach.export.formats import Writers, load_library, write_by_suffix, write_vtk, write_vtu
from softreach.export.table import CloudTable, cloud_table
from softreach.file_kinds import FileKind, Formats, Recognizes, beginning_with, text_with
from softreach.palette import activation_colors

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["CLOUD_FILES", "export_cloud"]

_BYTES = 12  # of a number in a file: 8, or about 18 in text, which few formats are
_MAT_LIMIT = 2**31  # bytes of one variable in a version 5 file


@checked(cloud=dataset("tip", "activation", what="a cloud"), path=path, overwrite=flag)
def export_cloud(cloud: xr.Dataset, path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Write a cloud as .ply, .csv, .parquet, .npz, .mat, .vtu or .vtk, chosen by the suffix.

    Tables have the columns x, y, z [m] and one activation per bundle, such as ``gamma_left``;
    NPZ and MAT hold the arrays tip, activation and bundle. Clouds of arms under loads have the
    column or array status too: 0 stable, 1 unstable, 2 no equilibrium, whose tip is NaN. Design,
    seed, tolerance, version and units go along, except in CSV, VTU and VTK, which have no place for
    them. PLY carries the picture's colors too.

    Args:
        cloud: tip(sample, axis) [m] and activation(sample, bundle), each in its unit.
        path: The file; it is replaced only when the new one is complete.
        overwrite: Whether it may replace any file, and not only a table of that format.

    Raises:
        InvalidInput: Unknown suffix, not a cloud, more than the format can hold, or something else
            is there.
        MissingExtra: The format needs a library that is not installed.
        NotWritten: It cannot be written.
    """
    table = cloud_table(cloud)
    takes = _BYTES * (table.tip.size + table.activation.size)
    write_by_suffix(path, CLOUD_FILES, _WRITERS, table, overwrite, takes=takes)


def _write_ply(table: CloudTable, file: BufferedWriter) -> None:
    colors = activation_colors(table.activation)

    def blocks():
        start = 0
        for block in table.blocks():
            stop = start + len(block["x"])
            rgb = dict(zip(("red", "green", "blue"), colors[start:stop].T, strict=True))
            yield {**block, **rgb}
            start = stop

    ply.write_points(file, len(table.tip), blocks(), table.metadata)


def _write_csv(table: CloudTable, file: BufferedWriter) -> None:
    pa, csv = load_library("pyarrow"), load_library("pyarrow.csv")
    fields = [(name, pa.float64()) for name in ("x", "y", "z", *table.gammas)]
    if table.status is not None:
        fields.append(("status", pa.uint8()))
    schema = pa.schema(fields)
    with csv.CSVWriter(file, schema) as writer:
        for block in table.blocks():
            writer.write_batch(pa.record_batch(block, schema=schema))


def _write_parquet(table: CloudTable, file: BufferedWriter) -> None:
    pa, parquet = load_library("pyarrow"), load_library("pyarrow.parquet")
    fields = [pa.field(name, pa.float64(), metadata={"units": "m"}) for name in "xyz"]
    fields += [
        pa.field(name, pa.float64(), metadata={"units": unit})
        for name, unit in zip(table.gammas, table.units, strict=True)
    ]
    if table.status is not None:
        fields.append(pa.field("status", pa.uint8(), metadata={"units": "1"}))
    schema = pa.schema(fields, metadata={key: str(v) for key, v in table.metadata.items()})
    with parquet.ParquetWriter(file, schema, compression="zstd") as writer:
        for block in table.blocks():
            writer.write_batch(pa.record_batch(block, schema=schema))


def _write_npz(table: CloudTable, file: BufferedWriter) -> None:
    described = {key: np.array(value) for key, value in table.metadata.items()}
    arrays = {"tip": table.tip, "activation": table.activation, "bundle": np.array(table.bundles)}
    if table.status is not None:
        arrays["status"] = table.status
    np.savez(file, **{**described, **arrays})


def _write_mat(table: CloudTable, file: BufferedWriter) -> None:
    from scipy.io import savemat

    size = max(table.tip.nbytes, table.activation.nbytes)
    if size >= _MAT_LIMIT:
        raise InvalidInput("cloud", f"{size} bytes", "below 2 GiB for MAT", "use .parquet or .npz")
    status = {} if table.status is None else {"status": table.status}
    savemat(
        file,
        {
            **status,
            "tip": table.tip,
            "activation": table.activation,
            "bundle": np.array(table.bundles, dtype=object),
            "metadata": table.metadata,
        },
        oned_as="row",
    )


def _write_vtu(table: CloudTable, file: BufferedWriter) -> None:
    # compressed it takes five times as long for a file two thirds as large
    options = {"compression": None, "header_type": "UInt64"}
    write_vtu(_point_mesh(table), file, **options)


def _write_vtk(table: CloudTable, file: BufferedWriter) -> None:
    write_vtk(_point_mesh(table), file)


def _point_mesh(table: CloudTable) -> Any:
    meshio = load_library("meshio")
    columns = table.columns()
    data = {name: values for name, values in columns.items() if name not in ("x", "y", "z")}
    cells = [("vertex", np.arange(len(table.tip))[:, None])]
    return meshio.Mesh(table.tip, cells, point_data=data)


def _file(name: str, recognizes: Recognizes, *libraries: str) -> FileKind:
    return FileKind(f"{name} file", recognizes, libraries, "export")


CLOUD_FILES: Formats = {
    ".ply": _file("a PLY", beginning_with(b"ply\n", b"ply\r")),
    ".csv": _file("a cloud's CSV", beginning_with(b'"x","y","z",', b"x,y,z,gamma_"), "pyarrow"),
    ".parquet": _file("a Parquet", beginning_with(b"PAR1"), "pyarrow"),
    ".npz": _file("an NPZ", beginning_with(b"PK")),
    ".mat": _file("a MAT", beginning_with(b"MATLAB ")),
    ".vtu": _file("a VTU", text_with("<VTKFile", "UnstructuredGrid"), "meshio"),
    ".vtk": _file("a VTK", beginning_with(b"# vtk DataFile"), "meshio"),
}
"""What clouds can be exported as."""

_WRITERS: Writers = {
    ".ply": _write_ply,
    ".csv": _write_csv,
    ".parquet": _write_parquet,
    ".npz": _write_npz,
    ".mat": _write_mat,
    ".vtu": _write_vtu,
    ".vtk": _write_vtk,
}
