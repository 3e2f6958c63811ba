"""Points of other programs and of measurements: places, without a design."""

import io
import re
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from softreach.schema import AXES
from softreach.support.arguments import as_path
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, MissingExtra, check_installed
from softreach.support.files.text import MEGABYTE, read_text
from softreach.support.lazy import Dataset
from softreach.support.units import as_unit

__all__ = ["read_points"]

POINT_FILES = (".csv", ".txt", ".parquet", ".pq", ".ply", ".npy")
"""Suffixes of files that are read."""
_MOST_TEXT = 4096 * MEGABYTE
_COLUMN = re.compile(r"(?:tip|position|point)?[ _]*([xyz])(?:[ _]*[\[(]?(m|cm|mm|in)[\])]?)?", re.I)
"""Column of a table with its unit: x, x_mm, x [mm], tip_x (mm)."""


def read_points(path: str | PathLike[str], *, unit: str | None = None) -> Dataset:
    """Read points as a cloud that has no activations, for hulls, volumes and figures.

    CSV may have a header, whose columns x, y and z may name their unit (x_mm, "x [mm]"), or three
    columns of numbers alone; Parquet has columns of such names; PLY has vertices; NPY is an array
    (n, 3). With two columns, x and y, the points lie in the plane z = 0.

    Args:
        path: A file .csv, .txt, .parquet, .ply or .npy.
        unit: Of the numbers where the columns do not name it: "m" if left out, "cm", "mm" or "in".

    Returns:
        Dataset with `tip` (sample, axis) [m], whose attribute `unit_of_file` is the unit there, and
        an `activation` without bundles.

    Raises:
        InvalidInput: No such file or unit, no points in it, or numbers that are not finite.
        MissingExtra: The format needs a library that is not installed.
    """
    import xarray as xr

    file = Path(as_path("path", path))
    if file.suffix.lower() not in POINT_FILES:
        raise InvalidInput("path", str(file), f"a file name ending in {', '.join(POINT_FILES)}")
    if not file.is_file():
        raise InvalidInput("path", str(file), "a file that exists")
    try:
        values, named = _READERS.get(file.suffix.lower(), _of_csv)(file)
    except (InvalidInput, MissingExtra):
        raise
    except Exception as error:  # each library has its own
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InvalidInput("points", str(file), f"a table or points: {reason}") from None
    counted = as_unit(named or unit or "m")
    places = _checked(values, str(file)) * counted.size
    about = {"units": "m", "unit_of_file": counted.name}
    of_sample, none = ("sample", "bundle"), np.empty((len(places), 0))
    variables = {
        "tip": (("sample", "axis"), places, about),
        "activation": (of_sample, none),
    }
    return xr.Dataset(variables, {"axis": list(AXES), "bundle": np.empty(0, str)})


def _of_csv(file: Path) -> tuple[Array, str]:
    import pandas as pd

    text = read_text("points", file, _MOST_TEXT)
    first = next((line for line in text.splitlines() if line.strip() and line[0] != "#"), "")
    separator = "," if "," in first else r"\s+"
    options: dict[str, Any] = {"sep": separator, "comment": "#", "skipinitialspace": True}
    is_number = re.match(r"\s*[+-]?[\d.]", first) is not None
    table = pd.read_csv(io.StringIO(text), header=None if is_number else 0, **options)
    return (table.to_numpy(float)[:, :3], "") if is_number else _of_table(table)


def _of_parquet(file: Path) -> tuple[Array, str]:
    import pandas as pd

    check_installed("pyarrow")
    return _of_table(pd.read_parquet(file))


def _of_table(table: Any) -> tuple[Array, str]:
    """Numbers of the columns x, y and z, and the unit that their names say."""
    matches = {name: _COLUMN.fullmatch(str(name).strip()) for name in table.columns}
    columns = {m[1].lower(): (name, m[2] or "") for name, m in matches.items() if m}
    if not {"x", "y"} <= columns.keys():
        allowed = "x, y and z, such as x_mm, y_mm, z_mm"
        raise InvalidInput("columns", ", ".join(map(str, table.columns)), allowed)
    chosen = [columns[axis] for axis in AXES if axis in columns]
    units = {unit.lower() for _, unit in chosen}
    if len(units) > 1:
        raise InvalidInput("columns", ", ".join(str(name) for name, _ in chosen), "of one unit")
    return table[[name for name, _ in chosen]].to_numpy(float), units.pop()


def _of_ply(file: Path) -> tuple[Array, str]:
    check_installed("trimesh")
    import trimesh

    loaded: Any = trimesh.load(str(file), process=False)
    return np.asarray(loaded.vertices, float), ""


def _of_npy(file: Path) -> tuple[Array, str]:
    return np.asarray(np.load(file, allow_pickle=False), float), ""


_READERS = {".parquet": _of_parquet, ".pq": _of_parquet, ".ply": _of_ply, ".npy": _of_npy}


def _checked(values: Array, name: str) -> Array:
    if values.ndim != 2 or values.shape[1] not in (2, 3) or not len(values):
        raise InvalidInput("points", name, "rows of x, y and z, or of x and y")
    if len(wrong := np.flatnonzero(~np.isfinite(values).all(axis=1))):
        raise InvalidInput(f"{name}, point {wrong[0] + 1}", values[wrong[0]], "of finite numbers")
    plane = np.zeros((len(values), 3 - values.shape[1]))
    return np.concatenate([values, plane], axis=1)
