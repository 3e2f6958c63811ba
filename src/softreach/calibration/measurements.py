"""Measured poses of an arm: a table of inputs and of the places of markers, with units in names."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.support.arguments import as_given, as_mapping, as_one_of, as_text
from softreach.support.arrays import Array, Mask
from softreach.support.errors import InvalidInput, NotPossible, counted, did_you_mean, warn
from softreach.support.files.columns import MOST, numbers_of, place_columns, read_table, split_unit
from softreach.support.files.text import read_bytes
from softreach.support.lazy import DataFrame

_RUNS = ("run", "pattern", "group", "trial", "cluster", "sequence")
_ORDERS = ("time_s", "time", "t_s", "sample", "order", "index", "frame")
_MOST_ROWS = 2_000_000
_WIDEST = 4.0  # Distance of a place from the middle of all, in lengths of the arm, that is no pose
_HARD = 100.0  # inputs beyond the bounds of the design, in them, that are a wrong unit or a slip
_SLACK = 0.01  # of the largest tension: a negative one that is the zero of a load cell


@dataclass(frozen=True, eq=False)
class Measurements:
    """Poses of an arm, one row for each sample."""

    inputs: Array
    """Inputs of the arm [unit of each], shape (n, input)."""
    places: Array
    """Markers in the axes of the data [m], NaN where one was not seen, shape (n, marker, 3)."""
    input_names: tuple[str, ...]
    """Columns that the inputs were read from; "" for one that stays at 0."""
    marker_names: tuple[str, ...]
    """Names of the markers."""
    runs: NDArray[np.intp]
    """Number of the run of each sample: those of one run may share errors; shape (n,)."""
    run_names: tuple[str, ...]
    """Names of the runs."""
    order: NDArray[np.intp]
    """Samples in the order in which they were taken, shape (n,)."""
    rows: NDArray[np.intp]
    """Row of each sample in the source, the first below the header being 0; shape (n,)."""
    source: str = "data"
    """Name of the file."""
    digest: str = ""
    """SHA-256 of all numbers."""

    def __len__(self) -> int:
        return len(self.inputs)

    @property
    def markers(self) -> int:
        """Number of markers."""
        return self.places.shape[1]

    def of(self, rows: NDArray[np.intp] | Mask) -> "Measurements":
        """Some of them, in the order in which they were taken."""
        rows = np.arange(len(self))[rows]
        rank = np.argsort(self.order)
        kept = {name: getattr(self, name)[rows] for name in ("inputs", "places", "runs", "rows")}
        return replace(self, order=np.argsort(rank[rows], kind="stable"), **kept)


def marker_names(arm: Manipulator) -> tuple[str, ...]:
    """Names of the markers of an arm, which is "tip" without any."""
    return tuple(marker.name for marker in arm.markers) or ("tip",)


def read_measurements(
    arm: Manipulator,
    data: Any,
    *,
    inputs: Mapping[str, str] | None = None,
    markers: Mapping[str, str] | None = None,
    run: str | None = None,
    order: str | None = None,
) -> Measurements:
    """Measured poses of an arm from a table.

    Units stand at the end of the names of columns: `tension1_N`, `q3_mm`, `chamber_kPa`,
    `marker2_x_mm`, `x1_m`. Inputs are found by the names of those of the arm, or by their unit and
    order; markers by theirs. A table with one place for each sample and an arm without markers
    speaks of the tip.

    Args:
        arm: The design, whose inputs and markers the columns are.
        data: Path of a CSV or Parquet file, a DataFrame, a dataset of xarray, or a dictionary of
            columns; what was read before stays as it is.
        inputs: Column of each input by the name of the input, where names do not tell.
        markers: Start of the columns of each marker by its name, such as {"tip": "disk3"}.
        run: Column that says which samples belong together; by default `run`, `pattern`, `group`,
            `trial`, `cluster` or `sequence`, if there is one.
        order: Column to sort by, in which samples were taken; by default `time_s` or `sample`, or
            the order of the rows.

    Raises:
        InvalidInput: No such file, columns that are missing, in no unit that is known or in one
            that an input does not have, text or NaN among inputs, no rows, or values that no such
            arm has: tensions below 0, inputs 100 times its bounds, markers 4 lengths away.

    Warns:
        SoftreachWarning: Markers that were never seen.
    """
    arm = a_manipulator("arm", arm)
    if isinstance(data, Measurements):
        return data
    columns_of = {} if inputs is None else as_mapping("inputs", inputs, as_text)
    starts_of = {} if markers is None else as_mapping("markers", markers, as_text)
    table, source = _table(data)
    columns = list(table.columns)
    run, order = _named(columns, run, _RUNS, "run"), _named(columns, order, _ORDERS, "order")
    triples = _triples([name for name in columns if name not in (run, order)])
    chosen = _chosen_markers(arm, triples, starts_of)
    used = {run, order, *(name for triple in triples.values() for name in triple)}
    sources = _input_columns(arm, [name for name in columns if name not in used], columns_of)
    values = _inputs(table, sources, arm.input_units)
    places = _places(table, {name: triples[start] for name, start in chosen.items()})
    seen = np.asarray(np.isfinite(places).any(axis=(0, 2)))
    if lost := [name for name, own in zip(chosen, seen, strict=True) if not own]:
        warn(f"markers that were never seen are left out: {', '.join(lost)}")
        places, chosen = places[:, seen], {k: x for k, x in chosen.items() if k not in lost}
    _refuse_far(arm, places, [triples[start] for start in chosen.values()])
    _refuse_inputs(arm, values, sources)
    numbers = np.concatenate([values, places.reshape(len(values), -1)], axis=1)
    known: dict[str, Any] = _runs_and_order(table, run, order) | {"rows": np.arange(len(values))}
    known |= {"input_names": tuple(sources), "marker_names": tuple(chosen), "source": source}
    digest = hashlib.sha256(numbers.tobytes()).hexdigest()
    return Measurements(inputs=values, places=places, digest=digest, **known)


def _runs_and_order(table: DataFrame, run: str | None, order: str | None) -> dict[str, Any]:
    """Names of runs, the run of each sample, and samples run by run in the order of each."""
    every = np.full(len(table), "all") if run is None else table[run].to_numpy(object)
    names, begins, runs = np.unique(every.astype(str), return_index=True, return_inverse=True)
    taken = np.arange(len(table))
    if order is not None and table[order].dtype.kind in "iuf":  # names of samples say nothing
        taken = np.lexsort((numbers_of(table, order, gaps=True), begins[runs])).astype(np.intp)
    return {"run_names": tuple(names.tolist()), "runs": runs, "order": taken}


def _places(table: DataFrame, columns: Mapping[str, Sequence[str]]) -> Array:
    """Places of markers from their columns [m], NaN where one was not seen."""
    each = [
        [numbers_of(table, x, gaps=True) * split_unit(x)[2] for x in y] for y in columns.values()
    ]
    places = np.moveaxis(np.array(each), 2, 0)
    seen = np.isfinite(places).all(axis=2)
    if not seen.any():
        raise NotPossible("no marker was seen in any sample: its columns hold no number")
    places[~seen] = np.nan
    return places


def _inputs(table: DataFrame, sources: Sequence[str], units: Sequence[str]) -> Array:
    """Inputs in their units from their columns, 0 without one, shape (n, input)."""
    values = np.zeros((len(table), len(sources)))
    for k, (name, unit) in enumerate(zip(sources, units, strict=True)):
        if not name:
            continue
        _, own, size, _ = split_unit(name)
        if own and own != unit:
            raise NotPossible(f"column {name} is in {own}, and must be in {_unit_text(unit)}")
        if not own and unit in ("m", "N", "Pa"):
            usual = f"{name}_{'mm' if unit == 'm' else unit}"
            raise NotPossible(f"the name of column {name} must end in its unit, such as {usual}")
        values[:, k] = numbers_of(table, name) * size
    return values


def _table(data: Any) -> tuple[DataFrame, str]:
    """A table, no two columns of which have one name, and its own name."""
    table, source = _opened(data)
    if len(table) > _MOST_ROWS:
        raise InvalidInput("data", f"{len(table):,} rows", f"at most {_MOST_ROWS:,}")
    columns = [str(name) for name in table.columns]
    for name in columns:  # the second of which pandas calls NAME.1
        first = re.sub(r"\.\d+$", "", name)
        if columns.count(name) > 1 or (first != name and first in columns):
            raise NotPossible(f"the data has two columns of this name: {first}")
    return table.set_axis(columns, axis=1), source


def _opened(data: Any) -> tuple[DataFrame, str]:
    import pandas as pd

    if isinstance(data, pd.DataFrame):
        return data.reset_index(drop=True), "a DataFrame"
    if hasattr(data, "to_dataframe"):
        return data.to_dataframe().reset_index(), "a dataset"
    if isinstance(data, Mapping):
        try:
            return pd.DataFrame(dict(data)), "a dictionary"
        except ValueError as error:
            raise InvalidInput("data", str(error), "columns of one length") from None
    if not isinstance(data, str | PathLike):
        raise InvalidInput("data", as_given(data), "a path, a DataFrame, or columns")
    return read_table(read_bytes("data", data, MOST), str(data)), Path(data).name


def _named(columns: list[str], given: str | None, usual: Sequence[str], what: str) -> str | None:
    if given is not None and as_text(what, given) not in columns:
        raise _missing(what, given, columns)
    by_name = {name.lower(): name for name in columns}
    return given or next((by_name[name] for name in usual if name in by_name), None)


def _refuse_far(arm: Manipulator, places: Array, columns: Sequence[Sequence[str]]) -> None:
    offsets = [float(np.linalg.norm(marker.offset)) for marker in arm.markers]
    reach = _WIDEST * (arm.length + max(offsets, default=0.0))
    away = np.nan_to_num(np.abs(places - np.nanmedian(places, axis=0)))
    if far := int((away > reach).sum()):
        row, marker, axis = (int(k) for k in np.unravel_index(away.argmax(), away.shape))
        given = f"{1e3 * places[row, marker, axis]:.4g} mm"
        given += f", and {far - 1} more cells" if far > 1 else ""
        near = f"within {1e3 * reach:.4g} mm of the median, for an arm of {1e3 * arm.length:.4g} mm"
        hint = "look at the unit of the column, and leave a cell empty where no marker was seen"
        raise InvalidInput(f"{columns[marker][axis]} in row {row}", given, f"{near}: {hint}")


def _refuse_inputs(arm: Manipulator, values: Array, columns: Sequence[str]) -> None:
    actuators = [*[None] * len(arm.drives), *(arm.bundle_actuators[k] for k in arm.undriven)]
    for unit in dict.fromkeys(arm.input_units):
        own = [k for k, each in enumerate(arm.input_units) if each == unit and columns[k]]
        bound = np.abs(arm.input_bounds[own]).max(initial=0.0)
        size = np.abs(values[:, own])
        if not size.any() or not 0 < bound < np.inf:
            continue
        rows = values[:, own].argmin(axis=0).tolist()
        least = [getattr(actuators[k], "least", -np.inf) - _SLACK * size.max() for k in own]
        wrong = [x for *x, low in zip(rows, own, least, strict=True) if values[*x] < low]
        allowed = f"at least 0 {unit}: a tendon pulls and cannot push"
        if size.max() > _HARD * bound:
            row, k = divmod(int(size.argmax()), len(own))
            wrong = [[row, own[k]]]
            near = f"near the bounds of the design, {bound:.4g} {unit}"
            allowed = f"{near}: look at the column's unit"
        for row, k in wrong:
            given = f"{values[row, k]:.4g} {unit}"
            raise InvalidInput(f"{columns[k]} in row {row}", given, allowed)


def _missing(what: str, name: str, columns: Sequence[str]) -> InvalidInput:
    listed = ", ".join(columns[:12]) + ", ..." * (len(columns) > 12)
    return InvalidInput(what, name, f"a column: {listed}", did_you_mean(name, columns))


def _triples(columns: list[str]) -> dict[str, list[str]]:
    """Columns x, y, z of places by the start, or the number, that they share."""
    places = place_columns(columns, "m")
    for axes in places.values():
        if lacking := [axis for axis in "xyz" if axis not in axes]:
            given = ", ".join(axes.values())
            raise NotPossible(f"a place needs x, y and z: {lacking[0]} is missing beside {given}")
    if not places:
        usual = "x_mm, y_mm, z_mm or marker1_x_mm"
        raise NotPossible(f"the data has no columns of places, such as {usual}")
    return {start: [axes[axis] for axis in "xyz"] for start, axes in places.items()}


def _chosen_markers(
    arm: Manipulator, triples: Mapping[str, list[str]], given: Mapping[str, str]
) -> dict[str, str]:
    names = marker_names(arm)
    if chosen := _matched("marker", names, given, {start: start for start in triples}):
        return chosen
    if len(names) == len(triples):
        return dict(zip(names, triples, strict=True))
    listed = ", ".join(start or "x, y, z" for start in triples)
    own = f"the arm has {counted(len(names), 'marker')} ({', '.join(names)})"
    seen = f"the data has {len(triples)} ({listed})"
    raise NotPossible(f"{own}, {seen}: name them by `markers` (--marker)")


def _matched(
    what: str, names: Sequence[str], given: Mapping[str, str], columns: Mapping[str, str]
) -> dict[str, str]:
    """Columns of markers or inputs, of those with such names: as given, else by their names."""

    def simple(name: str) -> str:
        return re.sub(r"[\s_\-.]+", "", name).lower()

    for name, column in given.items():
        as_one_of(f"{what}s", name, names)
        if column not in columns and (column or what == "marker"):
            raise _missing(f"columns of {what} {name}", column, list(columns))
    known = {simple(name): column for column, name in columns.items()}
    pairs = ((name, given.get(name, known.get(simple(name)))) for name in names)
    return {name: column for name, column in pairs if column is not None}


def _input_columns(arm: Manipulator, columns: list[str], given: Mapping[str, str]) -> list[str]:
    """Column of each input; "" for one that stays at zero."""
    chosen = _matched("input", arm.input_names, given, {c: split_unit(c)[0] for c in columns})
    units = dict(zip(arm.input_names, arm.input_units, strict=True))
    left = [name for name in arm.input_names if name not in chosen]
    for unit in dict.fromkeys(units[name] for name in left):
        wanting = [name for name in left if units[name] == unit]
        fitting = {unit} if unit in ("m", "N", "Pa") else {unit, ""}  # a plain number has none
        free = [c for c in columns if c not in chosen.values() and split_unit(c)[1] in fitting]
        if len(free) != len(wanting):
            want = f"{counted(len(wanting), 'column')} in {_unit_text(unit)}"
            want += f" for {', '.join(wanting)}, and has {', '.join(free) or 'none'}"
            raise NotPossible(f"the data must have {want}: name the columns by `inputs` (--input)")
        chosen |= dict(zip(wanting, free, strict=True))
    return [chosen[name] for name in arm.input_names]


def _unit_text(unit: str) -> str:
    return {"1": "no unit", "m": "m, cm or mm", "N": "N", "Pa": "Pa, kPa or bar"}.get(unit, unit)
