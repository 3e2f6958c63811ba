"""Points of other programs and of measurements: places, without a design."""

from os import PathLike

import numpy as np

from softreach.schema import AXES
from softreach.support.arguments import as_path
from softreach.support.errors import InvalidInput
from softreach.support.files.columns import MOST, numbers_of, read_table, split_unit, tip_columns
from softreach.support.files.text import read_bytes
from softreach.support.lazy import Dataset
from softreach.support.units import as_unit

POINT_FILES = (".csv", ".txt", ".parquet", ".pq", ".ply", ".npy")
"""Suffixes of files that the command line takes for points."""


def read_points(path: str | PathLike[str], *, unit: str | None = None) -> Dataset:
    """Read points as a cloud that has no activations, for hulls, volumes and figures.

    CSV may have a header, whose columns x, y and z may name their unit (x_mm, "x [mm]"), or three
    columns of numbers alone; Parquet has columns of such names; PLY has vertices; NPY is an array
    (n, 3). With two columns, x and y, the points lie in the plane z = 0.

    Args:
        path: A file .parquet, .ply or .npy; any other is read as CSV.
        unit: Of the numbers where the columns do not name it: "m" if left out, "cm", "mm" or "in".

    Returns:
        Dataset with `tip` (sample, axis) [m], whose attribute `unit_of_file` is the unit there, and
        an `activation` without bundles.

    Raises:
        InvalidInput: No such file or unit, no points in it, or numbers that are not finite.
        MissingExtra: The format needs a library that is not installed.
    """
    import xarray as xr

    name = as_path("path", path)
    table = read_table(read_bytes("path", name, MOST), name)
    columns = tip_columns(table.columns, "m", "")
    units = {split_unit(column)[3].lower() for column in columns}
    if len(units) > 1:
        raise InvalidInput("columns", ", ".join(columns), "of one unit")
    counted = as_unit(units.pop() or unit or "m")
    places = np.zeros((len(table), 3))
    for axis, column in enumerate(columns):
        places[:, axis] = counted.size * numbers_of(table, column)
    about = {"units": "m", "unit_of_file": counted.name}
    none = ("sample", "bundle"), np.empty((len(places), 0))
    variables = {"tip": (("sample", "axis"), places, about), "activation": none}
    return xr.Dataset(variables, {"axis": list(AXES), "bundle": np.empty(0, str)})
