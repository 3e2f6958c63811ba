"""Tables in files, whose columns name their units, and the places that they hold."""

import bz2
import csv
import gzip
import io
import lzma
import re
import zipfile
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, MissingExtra, check_installed, counted
from softreach.support.files.text import MEGABYTE, text_of
from softreach.support.lazy import DataFrame
from softreach.support.quantity import sizes_in

MOST = 1000 * MEGABYTE  # bytes of a table

_SIZES = {x.lower(): (u, s) for u in ("m", "N", "Pa") for x, s in sizes_in(u).items()}
_SIZES |= {"gf": ("N", 9.80665e-3), "mbar": ("Pa", 1e2), "psi": ("Pa", 6894.757293168361)}
_SIZES |= {"percent": ("1", 1e-2), "over_length": ("L", 1.0)}  # in small letters: SI unit, size
_UNIT = re.compile(r"(.*?)\s*[\[(](.*)[\])]|(.+?)_(over_length|[^_]*)")
_PLACE = re.compile(r"(?P<head>.*?)_?(?P<axis>[xyz])(?P<number>\d*)", re.IGNORECASE)
_TIPS = ("", "tip", "position", "point")  # starts of the columns of a tip

_UNPACKED: dict[str, Any] = {".gz": gzip.open, ".bz2": bz2.open, ".xz": lzma.open}
_UNPACKED[".zip"] = lambda file: (packed := zipfile.ZipFile(file)).open(packed.namelist()[0])


def split_unit(column: str) -> tuple[str, str, float, str]:
    """Name of a column without its unit, the SI unit, the size in it, and the unit as written.

    No unit where none is known: those of "marker1_x_mm" and "x [mm]" are.
    """
    match = _UNIT.fullmatch(column)
    name, written = (x for x in match.groups() if x is not None) if match else ("", "")
    written = "over_length" if match and match[2] == "L" else written
    unit = _SIZES.get(written.lower())
    return (column, "", 1.0, "") if unit is None else (name, *unit, written)


def read_table(content: bytes, name: str) -> DataFrame:
    """The table of a file by its name: Parquet, NPY, PLY, else CSV, packed if it says .gz or .zip.

    What has no header has columns x, y and z.
    """
    import pandas as pd

    try:
        suffix, stream = Path(name).suffix.lower(), io.BytesIO(content)
        if suffix in (".parquet", ".pq"):
            check_installed("pyarrow")
            table = pd.read_parquet(stream)
        elif suffix in (".npy", ".ply"):
            points = _vertices(stream) if suffix == ".ply" else np.load(stream, allow_pickle=False)
            table = pd.DataFrame(points, columns=list("xyz")[: points.shape[1]])
        else:
            with _UNPACKED.get(suffix, nullcontext)(stream) as opened:
                lines = _lines(text_of("data", name, opened.read(MOST + 1), MOST))
            _refuse_ragged(lines, name)
            table = pd.read_csv(io.StringIO("\n".join(lines)), skipinitialspace=True)
    except (InvalidInput, MissingExtra):
        raise
    except Exception as error:  # each kind of file has its own
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InvalidInput("data", name, f"a table in CSV or Parquet: {reason}") from None
    if not len(table):
        raise InvalidInput("data", name, "a table with at least one row")
    return table


def _vertices(stream: io.BytesIO) -> Array:
    check_installed("trimesh")
    import trimesh

    loaded: Any = trimesh.load(stream, file_type="ply", process=False)
    return np.asarray(loaded.vertices)


def _lines(text: str) -> list[str]:
    """Lines of CSV without comments, from a header on; spaces may stand for commas."""
    rows = (line for line in text.splitlines() if not line.lstrip().startswith("#"))
    plain = (row if '"' in row else row.partition("#")[0] for row in rows)
    lines = [line for line in plain if line.strip()]
    if lines and "," not in lines[0]:
        lines = [",".join(line.split()) for line in lines]
    if lines and all(re.match(r"\s*[+-]?\.?\d", cell) for cell in lines[0].split(",")):
        count = lines[0].count(",") + 1
        lines.insert(0, ",".join(["x", "y", "z", *map(str, range(3, count))][:count]))
    return lines


def _refuse_ragged(lines: list[str], name: str) -> None:
    """Refuse rows of another length than the header, which pandas fills up or cuts."""
    rows = csv.reader(lines, skipinitialspace=True)
    head = next(rows, [])
    count = len([cell for cell in head if cell.strip()])
    for k, row in enumerate(rows):
        if not count <= len(row) <= len(head):
            given = counted(len(row), "cell")
            place = f"row {k} of {Path(name).name}"
            raise InvalidInput(place, given, f"{count}, as in its first row")


def place_columns(columns: Iterable[str], *units: str) -> dict[str, dict[str, str]]:
    """Columns of x, y and z by the start, or the number, that they share, of these units."""
    places: dict[str, dict[str, str]] = {}
    for column in columns:
        name, unit, *_ = split_unit(column)
        if unit in units and (match := _PLACE.fullmatch(name)):
            start = match["head"].rstrip("_ ") + match["number"]
            places.setdefault(start, {})[match["axis"].lower()] = column
    return places


def tip_columns(columns: Iterable[Any], *units: str) -> list[str]:
    """Columns x, y and, if there is one, z of the tip, or of the first place, of these units."""
    names = [str(name) for name in columns]
    places = place_columns(names, *units)
    own = [places[start] for start in places if start.lower() in _TIPS] or [*places.values()]
    if not own or not {"x", "y"} <= own[0].keys():
        allowed = "x, y and z, such as x_mm, y_mm, z_mm"
        raise InvalidInput("columns", ", ".join(names), allowed)
    return [own[0][axis] for axis in "xyz" if axis in own[0]]


def numbers_of(table: DataFrame, column: str, *, gaps: bool = False) -> Array:
    """Finite numbers of a column; NaN where there is none, if it may have gaps."""
    try:
        values = table[column].to_numpy(float)
    except (ValueError, TypeError) as error:
        raise InvalidInput(f"column {column}", str(error), "numbers") from None
    wrong = np.isinf(values) if gaps else ~np.isfinite(values)
    if wrong.any():
        row = int(wrong.argmax())
        raise InvalidInput(f"{column} in row {row}", values[row], "a finite number")
    return values
