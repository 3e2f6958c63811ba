"""Arrays that users pass, converted and checked in one place, and names for what they hold."""

from collections.abc import Sequence
from operator import itemgetter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from softreach.support.arguments import as_given
from softreach.support.errors import InvalidInput

Array = NDArray[np.float64]  # Numbers
Index = NDArray[np.int64]  # Places in other arrays
Mask = NDArray[np.bool_]  # Truth values that mark some of several things
Points = NDArray[np.float64]  # Places [m], shape (n, 3)
Faces = NDArray[np.integer]  # Triangles as rows of three vertices, shape (n, 3)
Table = TypeVar("Table", bound=tuple[NDArray[Any], ...])  # Named, of columns of one length

_FARTHEST = 1e9  # of positions [m]: their powers must be numbers
_NUMBERS = "an array of numbers"


def rows(table: Table, chosen: Mask | Index | slice) -> Table:
    """Some rows of a table; the table itself where a mask leaves none out."""
    if isinstance(chosen, np.ndarray) and chosen.dtype == bool and chosen.all():
        return table
    return type(table)(*map(itemgetter(chosen), table))


def joined(tables: Sequence[Table]) -> Table:
    """The rows of tables, of one at least, one table after the other."""
    if len(tables) == 1:
        return tables[0]
    return type(tables[0])(*map(np.concatenate, zip(*tables, strict=True)))


def joined_by(column: str, tables: Sequence[Table]) -> Table:
    """The rows of tables, of one at least, sorted by a column."""
    table = joined(tables)
    return rows(table, np.argsort(getattr(table, column), kind="stable"))


def over(dims: str | tuple[str, ...], unit: str = "", /, **columns: Any) -> dict[str, Any]:
    """Columns over the same dimensions, and in one unit if any, as `xarray.Dataset` takes them."""
    return {name: (dims, x, {"units": unit} if unit else {}) for name, x in columns.items()}


def read_only(values: Array) -> Array:
    """The array itself, not to be written: kernels are compiled once more for those that are."""
    values.setflags(write=False)
    return values


def as_floats(name: str, values: object, allowed: str = _NUMBERS) -> Array:
    """Numbers as a float array in memory order, of any shape; NaN and infinity are numbers."""
    if type(values) is np.ndarray and values.dtype == np.float64:
        return np.ascontiguousarray(values).reshape(values.shape)
    array = _array(name, values, allowed)
    if array.dtype.kind in "iuf":
        return np.asarray(array, np.float64, order="C")
    raise InvalidInput(name, _described(values, array), allowed)


def labeled(name: str, values: Any, labels: Sequence[str]) -> Any:
    """An xarray array with columns of these labels, all of them, in this order; else as given."""
    dims = [dim for dim in getattr(values, "dims", ()) if dim in ("axis", "bundle")]
    if len(dims) != 1:
        return values
    if (dim := dims[0]) in values.coords:
        known = [str(label) for label in values.coords[dim].values]
        if sorted(known) != sorted(labels):
            raise InvalidInput(f"{name}.{dim}", ", ".join(known), f"labeled {', '.join(labels)}")
        values = values.isel({dim: [known.index(label) for label in labels]})
    return values.transpose(..., dim)


def as_rows(name: str, values: object, columns: int, allowed: str) -> Array:
    """Finite numbers of shape (n, columns); one row may stand alone."""
    rows = as_floats(name, values, allowed)
    rows = rows[None] if rows.shape == (columns,) else rows
    if rows.ndim != 2 or rows.shape[1] != columns:
        raise InvalidInput(f"{name}.shape", rows.shape, allowed)
    return check_finite(name, rows)


def as_points(name: str, values: object, *, any_scale: bool = False) -> Points:
    """Finite positions [m], shape (n, 3); one may stand alone, and an empty array is none.

    They are at most 1e9 m far, unless any scale is allowed.
    """
    allowed = "of shape (n, 3), positions in m"
    points = as_floats(name, labeled(name, values, ("x", "y", "z")), allowed)
    if points.size == 0 and points.ndim <= 2:
        return points.reshape(0, 3)
    points = as_rows(name, points, 3, allowed)
    if not any_scale and (farthest := max(-points.min(), points.max())) > _FARTHEST:
        raise InvalidInput(name, f"up to {farthest:g} m", f"at most {_FARTHEST:g} m far")
    return points


def check_finite(name: str, values: Array) -> Array:
    """The array itself, if no number in it is NaN or infinite; the first such row is named."""
    # The extremes take a third of the time of isfinite, and no memory.
    if not values.size or np.isfinite([values.min(), values.max()]).all():
        return values
    if values.ndim < 2:
        raise InvalidInput(name, values, "finite numbers")
    wrong = np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))
    hint = f"so are {len(wrong):,} rows in all" if len(wrong) > 1 else ""
    raise InvalidInput(f"{name}[{wrong[0]}]", values[wrong[0]], "finite numbers", hint)


def as_stations(name: str, values: object) -> Array:
    """Finite numbers of shape (station,), of which one may stand alone."""
    stations = np.atleast_1d(as_floats(name, values))
    if stations.ndim > 1:
        raise InvalidInput(f"{name}.shape", stations.shape, "of shape (station,)")
    return check_finite(name, stations)


def repeated(name: str, values: object, shape: tuple[int, ...], count: int) -> Array:
    """Finite numbers of a shape, or of (count, *shape), as those of the second."""
    array = as_floats(name, values)
    if array.shape not in (shape, (count, *shape)):
        raise InvalidInput(f"{name}.shape", array.shape, f"{shape} or {(count, *shape)}")
    return np.broadcast_to(check_finite(name, array), (count, *shape))


def as_directions(name: str, values: object, count: int | None = None) -> Array:
    """Unit vectors along vectors of shape (3,) or (n, 3) and any length but 0.

    With a count, shape (count, 3): one vector may stand for all. Else that of the values.
    """
    vectors = as_floats(name, values) if count is None else repeated(name, values, (3,), count)
    if vectors.ndim not in (1, 2) or vectors.shape[-1] != 3:
        raise InvalidInput(f"{name}.shape", vectors.shape, "(3,) or (n, 3)")
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not (np.isfinite(size).all() and (size > 0).all()):
        raise InvalidInput(name, vectors, "finite vectors longer than 0")
    return vectors / size


def as_indices(name: str, values: object, count: int, what: str) -> Index:
    """Indices from 0 to count - 1 of things such as "samples of the cloud", shape (k,)."""
    allowed = f"one-dimensional, of whole numbers from 0 to {count - 1:,}, {what}"
    indices = _array(name, values, allowed)
    return _within(name, indices, indices.ndim == 1, count, allowed).astype(np.intp)


def as_faces(name: str, values: object, count: int) -> Faces:
    """Triangles whose corners are indices from 0 to count - 1, shape (f, 3)."""
    allowed = f"of shape (f, 3), whole numbers from 0 to {count - 1:,}"
    faces = _array(name, values, allowed)
    faces = faces if faces.size else np.empty((0, 3), np.int64)
    return _within(name, faces, faces.shape[1:] == (3,), count, allowed).astype(np.int64)


def _within(name: str, indices: NDArray[Any], fits: bool, count: int, allowed: str) -> NDArray[Any]:
    if not fits or (indices.size and indices.dtype.kind not in "iu"):
        raise InvalidInput(name, _described(indices, indices), allowed)
    if indices.size and not (indices.min() >= 0 and indices.max() < count):
        span = f"indices from {indices.min():,} to {indices.max():,}"
        raise InvalidInput(name, span, allowed)
    return indices


def _array(name: str, values: object, allowed: str) -> NDArray[Any]:
    if np.ma.is_masked(values):  # NumPy would take what is behind the mask
        raise InvalidInput(name, "a masked array", allowed, "drop or fill the masked entries")
    try:
        return np.asarray(values)
    except (TypeError, ValueError):  # ragged rows; objects that are no arrays
        raise InvalidInput(name, as_given(values), allowed) from None


def _described(values: object, array: NDArray[Any]) -> object:
    return f"{array.dtype} of shape {array.shape}" if array.ndim else as_given(values)
