"""Clouds for other programs: every format holds the tips and the activations of all samples."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arguments import checked, dataset, path
from softreach.errors import InvalidInput
from softreach.export import ply
from softreach.export.formats import load_library, write_by_suffix
from softreach.export.table import CloudTable, cloud_table
from softreach.palette import activation_colors

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["export_cloud"]

_MAT_LIMIT = 2**31  # bytes of one variable in a version 5 file


@checked(cloud=dataset("tip", "activation", what="a cloud"), path=path)
def export_cloud(cloud: xr.Dataset, path: str | PathLike[str]) -> None:
    """Write a cloud as .ply, .csv, .parquet, .npz, .mat, .vtu or .vtk, chosen by the suffix.

    Tables have the columns x, y, z [m] and one activation per bundle, such as ``gamma_left``;
    NPZ and MAT hold the arrays tip, activation and bundle. Clouds of arms under loads have the
    column or array status too: 0 stable, 1 unstable, 2 no equilibrium, whose tip is NaN. Design,
    seed, tolerance, version and units go along, except in CSV, VTU and VTK, which have no place for
    them. PLY carries the picture's colors too.

    Args:
        cloud: tip(sample, axis) [m] and activation(sample, bundle), each in its unit.
        path: The file; it is replaced only when the new one is complete.

    Raises:
        InvalidInput: Unknown suffix, not a cloud, or more than the format can hold.
        MissingExtra: The format needs a library that is not installed.
    """
    write_by_suffix(path, _WRITERS, cloud_table(cloud))


def _write_ply(table: CloudTable, path: Path) -> None:
    colors = activation_colors(table.activation)

    def blocks():
        start = 0
        for block in table.blocks():
            stop = start + len(block["x"])
            rgb = dict(zip(("red", "green", "blue"), colors[start:stop].T, strict=True))
            yield {**block, **rgb}
            start = stop

    ply.write_points(path, len(table.tip), blocks(), table.metadata)


def _write_csv(table: CloudTable, path: Path) -> None:
    pa, csv = load_library("pyarrow"), load_library("pyarrow.csv")
    fields = [(name, pa.float64()) for name in ("x", "y", "z", *table.gammas)]
    if table.status is not None:
        fields.append(("status", pa.uint8()))
    schema = pa.schema(fields)
    with csv.CSVWriter(path, schema) as writer:
        for block in table.blocks():
            writer.write_batch(pa.record_batch(block, schema=schema))


def _write_parquet(table: CloudTable, path: Path) -> None:
    pa, parquet = load_library("pyarrow"), load_library("pyarrow.parquet")
    fields = [pa.field(name, pa.float64(), metadata={"units": "m"}) for name in "xyz"]
    fields += [
        pa.field(name, pa.float64(), metadata={"units": unit})
        for name, unit in zip(table.gammas, table.units, strict=True)
    ]
    if table.status is not None:
        fields.append(pa.field("status", pa.uint8(), metadata={"units": "1"}))
    schema = pa.schema(fields, metadata={key: str(v) for key, v in table.metadata.items()})
    with parquet.ParquetWriter(path, schema, compression="zstd") as writer:
        for block in table.blocks():
            writer.write_batch(pa.record_batch(block, schema=schema))


def _write_npz(table: CloudTable, path: Path) -> None:
    described = {key: np.array(value) for key, value in table.metadata.items()}
    arrays = {"tip": table.tip, "activation": table.activation, "bundle": np.array(table.bundles)}
    if table.status is not None:
        arrays["status"] = table.status
    np.savez(path, **{**described, **arrays})


def _write_mat(table: CloudTable, path: Path) -> None:
    from scipy.io import savemat

    size = max(table.tip.nbytes, table.activation.nbytes)
    if size >= _MAT_LIMIT:
        raise InvalidInput("cloud", f"{size} bytes", "below 2 GiB for MAT", "use .parquet or .npz")
    status = {} if table.status is None else {"status": table.status}
    savemat(
        path,
        {
            **status,
            "tip": table.tip,
            "activation": table.activation,
            "bundle": np.array(table.bundles, dtype=object),
            "metadata": table.metadata,
        },
        oned_as="row",
    )


def _write_vtu(table: CloudTable, path: Path) -> None:
    # compressed it takes five times as long for a file two thirds as large
    options = {"compression": None, "header_type": "UInt64"}
    load_library("meshio").vtu.write(path, _point_mesh(table), **options)


def _write_vtk(table: CloudTable, path: Path) -> None:
    load_library("meshio").write(path, _point_mesh(table))


def _point_mesh(table: CloudTable) -> Any:
    meshio = load_library("meshio")
    columns = table.columns()
    data = {name: values for name, values in columns.items() if name not in ("x", "y", "z")}
    cells = [("vertex", np.arange(len(table.tip))[:, None])]
    return meshio.Mesh(table.tip, cells, point_data=data)


_WRITERS = {
    ".ply": _write_ply,
    ".csv": _write_csv,
    ".parquet": _write_parquet,
    ".npz": _write_npz,
    ".mat": _write_mat,
    ".vtu": _write_vtu,
    ".vtk": _write_vtk,
}
