"""Clouds for other programs: tips and activations of all samples, in every format."""

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from io import BufferedWriter
from itertools import chain, count
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.export.formats import write_by_suffix, write_ply, write_vtu
from softreach.schema import a_cloud, activation_units
from softreach.support.arguments import as_flag, as_path
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput
from softreach.support.files.atomic import StrPath
from softreach.support.files.formats import FileFormat
from softreach.support.lazy import DataFrame, Dataset
from softreach.support.palette import activation_colors
from softreach.support.units import METER, LengthUnit, as_unit

_BLOCK = 1 << 18
_MAT_LIMIT = 2**31  # bytes of one variable in a version 5 file


class CloudTable(NamedTuple):
    """Tips and activations as plain arrays."""

    tip: Array  # In the unit of the table, shape (sample, 3)
    activation: Array  # γ, shape (sample, bundle)
    bundles: tuple[str, ...]  # Names of the bundles as the cloud has them
    units: tuple[str, ...]  # Unit of the activation of each bundle
    status: NDArray[np.uint8] | None  # `TipStatus` of an arm under loads, shape (sample,)
    metadata: dict[str, str | int | float]  # Design (TOML), seed, tolerance, versions and units
    unit: LengthUnit

    def columns(self, rows: slice = slice(None), suffix: str = "") -> dict[str, NDArray[Any]]:
        """Contiguous columns by name: x, y, z, the activations, and the status if there is one."""
        arrays = [*self.tip[rows].T, *self.activation[rows].T]
        names = [*(f"{axis}{suffix}" for axis in "xyz"), *column_names(self.bundles)]
        if self.status is not None:
            arrays.append(self.status[rows])
            names.append("status")
        return {name: np.ascontiguousarray(a) for name, a in zip(names, arrays, strict=True)}

    def blocks(self) -> Iterator[slice]:
        """Rows, a bounded number at a time."""
        for start in range(0, len(self.tip), _BLOCK) or [0]:
            yield slice(start, start + _BLOCK)


def cloud_table(cloud: Dataset) -> DataFrame:
    """A cloud as a tidy table of pandas: one row a sample, as in the files of `export_cloud`.

    The columns are x, y, z [m], one activation per bundle such as ``gamma_left``, and of arms under
    loads the `status`; `attrs` hold the design, seed, tolerance, versions and units.

    Args:
        cloud: tip(sample, axis) [m] and activation(sample, bundle), each in its unit.

    Raises:
        InvalidInput: The dataset is not a cloud.
    """
    import xarray as xr

    arrays = arrays_of(a_cloud("cloud", cloud))
    columns = {name: ("sample", values) for name, values in arrays.columns().items()}
    table = xr.Dataset(columns).to_dataframe()
    table.attrs.update(arrays.metadata)
    return table


def arrays_of(cloud: Dataset, unit: LengthUnit = METER) -> CloudTable:
    """The arrays and the description of a cloud, with its tips in a unit."""
    tip, activation = cloud["tip"], cloud["activation"]
    names = range(1, activation.sizes["bundle"] + 1)
    units, length = activation_units(activation), _length(cloud)
    each = ", ".join(units if len(set(units)) > 1 else units[:1])
    known = cloud.attrs | {"tip_units": unit.name, "activation_units": each}
    known |= {} if length is None else {"length_m": length}
    plain = {key: x.item() if isinstance(x, np.generic) else x for key, x in known.items()}
    return CloudTable(
        unit.of(tip.transpose("sample", "axis").values),
        activation.transpose("sample", "bundle").values.astype(float, copy=False),
        tuple(map(str, activation["bundle"].values if "bundle" in activation.coords else names)),
        units,
        cloud["status"].values.astype(np.uint8) if "status" in cloud else None,
        {str(key): x if isinstance(x, str | int | float) else str(x) for key, x in plain.items()},
        unit,
    )


def column_names(bundles: Sequence[str]) -> list[str]:
    """Column names that every format and language can hold, all different.

    >>> column_names(["left", "fiber 1 2", "left"])
    ['gamma_left', 'gamma_fiber_1_2', 'gamma_left_2']
    """
    names: list[str] = []
    for k, bundle in enumerate(bundles):
        safe = re.sub(r"[^0-9A-Za-z]+", "_", bundle).strip("_") or str(k + 1)
        plain = f"gamma_{safe}"
        numbered = (f"{plain}_{number}" for number in count(k))
        names.append(next(name for name in chain([plain], numbered) if name not in names))
    return names


def export_cloud(
    cloud: Dataset, path: StrPath, *, unit: str | LengthUnit = "m", overwrite: bool = False
) -> None:
    """Write a cloud as .ply, .csv, .parquet, .npz, .mat or .vtu, chosen by the suffix.

    Tables have the columns x, y, z and one activation per bundle, such as ``gamma_left``; in CSV,
    where nothing else would say the unit, x_mm, y_mm, z_mm if it is not the meter. NPZ and MAT hold
    the arrays tip, activation and bundle. Clouds of arms under loads have the column or array
    status too: 0 stable, 1 unstable; 2 no equilibrium, 3 undecided and 4 snaps, whose tips are NaN.
    Design, seed, tolerance, version and units go along, except in CSV and VTU, which have no place
    for them. PLY carries the picture's colors too.

    Args:
        cloud: tip(sample, axis) [m] and activation(sample, bundle), each in its unit.
        path: The file; it is replaced only when the new one is complete.
        unit: Of the places: "m", "cm", "mm", "in", or "L" if the cloud knows it.
        overwrite: Whether it may replace a file.

    Raises:
        InvalidInput: Unknown suffix or unit, not a cloud, more than the format can hold, or
            something else is there.
        MissingExtra: The format needs a library that is not installed.
        NotWritten: It cannot be written.

    Examples:
        >>> cloud = sr.compute_cloud(sr.designs.minimal_trunk(), n=1000)
        >>> sr.export.export_cloud(cloud, "cloud.csv", unit="mm")
    """
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    cloud = a_cloud("cloud", cloud)
    table = arrays_of(cloud, as_unit(unit, _length(cloud)))
    write_by_suffix(path, CLOUD_FILES, table, overwrite=overwrite)


def path_csv(found: Dataset) -> str:
    """What `track_path` or `plan` found at each point of a path, as lines of CSV."""
    names = column_names(found["bundle"].values.astype(str).tolist())
    parts = {"tip": ("x", "y", "z"), "tip_error": ("tip_error_m",), "clearance": ("clearance_m",)}
    parts = {each: own for each, own in (parts | {"time": ("time_s",)}).items() if each in found}
    names += [name for own in parts.values() for name in own]
    rows = np.column_stack([found[each].values for each in ("activation", *parts)]).tolist()
    return "\n".join([",".join(names), *(",".join(f"{x:.12g}" for x in row) for row in rows), ""])


def _length(cloud: Dataset) -> float | None:
    length = cloud["tip"].attrs.get("length") if "tip" in cloud else None
    return None if length is None else float(length)


def _write_ply(table: CloudTable, file: BufferedWriter) -> None:
    colors, names = activation_colors(table.activation), ("red", "green", "blue")
    columns = (
        table.columns(rows) | dict(zip(names, colors[rows].T, strict=True))
        for rows in table.blocks()
    )
    write_ply(file, len(table.tip), columns, table.metadata)


def _write_csv(table: CloudTable, file: BufferedWriter) -> None:
    suffix = {"m": "", "L": "_over_length"}.get(table.unit.name, f"_{table.unit.name}")
    if find_spec("pyarrow"):
        _write_batches(partial(import_module("pyarrow.csv").CSVWriter, file), table, suffix)
        return
    frame = import_module("pandas").DataFrame  # the same numbers, more slowly
    for rows in table.blocks():
        options = {"index": False, "header": not rows.start, "na_rep": "nan"}
        frame(table.columns(rows, suffix)).to_csv(file, **options)


def _write_parquet(table: CloudTable, file: BufferedWriter) -> None:
    writer = import_module("pyarrow.parquet").ParquetWriter
    _write_batches(partial(writer, file, compression="zstd"), table)


def _write_batches(writer_of: Callable[..., Any], table: CloudTable, suffix: str = "") -> None:
    pa, units = import_module("pyarrow"), [table.unit.name] * 3 + [*table.units, "1"]
    own = zip(table.columns(slice(0), suffix).items(), units, strict=False)
    fields = [pa.field(x, pa.from_numpy_dtype(v.dtype), metadata={"units": u}) for (x, v), u in own]
    schema = pa.schema(fields, metadata={key: str(v) for key, v in table.metadata.items()})
    with writer_of(schema=schema) as writer:
        for rows in table.blocks():
            writer.write_batch(pa.record_batch(table.columns(rows, suffix), schema=schema))


def _write_npz(table: CloudTable, file: BufferedWriter) -> None:
    content = table.metadata | _arrays(table) | {"bundle": table.bundles}
    arrays: dict[str, Any] = {name: np.array(values) for name, values in content.items()}
    np.savez(file, **arrays)


def _write_mat(table: CloudTable, file: BufferedWriter) -> None:
    from scipy.io import savemat

    size = max(table.tip.nbytes, table.activation.nbytes)
    if size >= _MAT_LIMIT:
        raise InvalidInput("cloud", f"{size} bytes", "below 2 GiB for MAT", "use .parquet or .npz")
    bundle = np.array(table.bundles, dtype=object)
    savemat(file, {**_arrays(table), "bundle": bundle, "metadata": table.metadata}, oned_as="row")


def _arrays(table: CloudTable) -> dict[str, NDArray[Any]]:
    status = {} if table.status is None else {"status": table.status}
    return {"tip": table.tip, "activation": table.activation, **status}


def _write_vtu(table: CloudTable, file: BufferedWriter) -> None:
    data = {name: values for name, values in table.columns().items() if name not in "xyz"}
    cells = [("vertex", np.arange(len(table.tip))[:, None])]
    # compressed it takes five times as long for a file two thirds as large
    write_vtu(file, table.tip, cells, compression=None, point_data=data)


CLOUD_FILES = {
    ".ply": FileFormat(write=_write_ply),
    ".csv": FileFormat(write=_write_csv),
    ".parquet": FileFormat(("pyarrow",), _write_parquet),
    ".npz": FileFormat(write=_write_npz),
    ".mat": FileFormat(write=_write_mat),
    ".vtu": FileFormat(("meshio",), _write_vtu),
}
