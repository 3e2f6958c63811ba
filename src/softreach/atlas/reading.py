"""Reading an atlas, also while it is being written: a dataset over its parameters."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softreach.atlas.command import Command
from softreach.atlas.layout import PER_DESIGN, array_plans
from softreach.atlas.metric import Metric, Need
from softreach.atlas.store import DAMAGED, FAILED, GAP, KNOWN, OF, UNSTABLE, AtlasStore
from softreach.support.arguments import as_dataset, as_given, as_path, as_text
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, counted, warn
from softreach.support.files.stores import ARRAYS, DIGEST, READING, Chunk, storage_errors

if TYPE_CHECKING:
    import xarray as xr
    from zarr.storage import StoreLike

    AtlasLike = StoreLike | xr.Dataset


EXPLAINED = (FAILED, GAP, UNSTABLE)
"""The status of designs that have a message."""

_POWERS = {"m": 1, "m2": 2, "m3": 3, "1/m": -1}
_READ_HERE = ("metrics", "metric", "curvature", "quantity", "status", "message")


@dataclass(frozen=True, kw_only=True, eq=False)
class Contents:
    """Contents of an atlas but its tips, each chunk checked."""

    status: NDArray[np.uint8]
    """DAMAGED for designs of which a chunk is, shape (designs,)."""
    messages: dict[int, str]
    """Messages of designs that failed, cannot exist, are nowhere stable or damaged, by number."""
    tables: dict[str, Any]
    """Arrays `metrics` and `curvature`; fill values where they are damaged."""

    @property
    def damage(self) -> str:
        """Number of damaged designs, and the first of them; empty if none is."""
        damaged = np.flatnonzero(self.status == DAMAGED).tolist()
        if not damaged:
            return ""
        verb = "is" if len(damaged) == 1 else "are"
        first = damaged[0]
        return (
            f"{counted(len(damaged), 'design')} {verb} damaged, "
            f"first number {first}: {self.messages[first]}"
        )


def contents(store: AtlasStore, *, metrics: bool = True, tips_of: Iterable[int] = ()) -> Contents:
    """Read and check what an atlas holds of its designs.

    Args:
        store: The atlas; from now on it misses the chunks that its designs must have.
        metrics: Whether to read the metrics; without, only the status and messages are checked.
        tips_of: Numbers of designs whose tips are checked too; these are read but not kept.

    Raises:
        DamagedStore: What describes an array is damaged, so that no design can be read.
    """
    reader = _Reader(store)
    status = reader.read("status").ravel()
    store.watch.required = _required(store, status)
    names = ("metrics", "curvature") if store.command.profiles else ("metrics",)
    tables = {name: reader.table(name, status) for name in names if metrics}
    for index in tips_of if store.command.keep_clouds else ():
        if status[index] in KNOWN:
            reader.read("tip", store.command.space.place(index))
    texts = {
        index: str(reader.read("message", store.command.space.place(index)).item())
        for index in np.flatnonzero(np.isin(status, EXPLAINED)).tolist()
    }
    status[[*reader.damaged]] = DAMAGED
    messages = dict(sorted((texts | reader.damaged).items()))
    return Contents(status=status, messages=messages, tables=tables)


def a_store(name: str, value: object) -> Any:
    """A place where an atlas may be.

    Raises:
        InvalidInput: Neither text nor a path nor a Zarr store.
    """
    if isinstance(value, str | os.PathLike):
        return as_path(name, value)
    for module, kind in (("zarr.abc.store", "Store"), ("zarr.storage", "StorePath")):
        # who has a store has imported it
        if module in sys.modules and isinstance(value, getattr(sys.modules[module], kind)):
            return value
    if isinstance(value, dict) and all(hasattr(content, "to_bytes") for content in value.values()):
        return value  # a store in memory
    raise InvalidInput(name, as_given(value), "a path, a URL or a Zarr store")


def an_atlas(name: str, value: Any) -> Any:
    """A store, or a dataset from `open_atlas` or a part of one.

    Raises:
        InvalidInput: Anything else.
    """
    allowed = "a store, or a dataset from open_atlas"
    xarray = sys.modules.get("xarray")
    if xarray is not None and isinstance(value, xarray.Dataset):
        if "command" in value.attrs and "status" in value:
            return value
        raise InvalidInput(name, "another Dataset", allowed)
    try:
        return a_store(name, value)
    except InvalidInput:
        raise InvalidInput(name, as_given(value), allowed) from None


def open_atlas(store: StoreLike) -> xr.Dataset:
    """An atlas with a dimension for each parameter, so that ``atlas.volume.sel(taper=...)`` works.

    Clouds are read when they are used. Designs that are not done are NaN, and
    so are those of which no activation is stable, but for their `lost_share`.

    Args:
        store: Path, URL or Zarr store.

    Returns:
        Dataset over the parameters of a grid [SI units], or over `design`: the metrics (see their
        attributes), quantiles of curvature, `status`, `message`, `unit_activation`, and `tip` [m]
        if clouds were kept; as coordinates the parameters, the `length` [m] and the `number` of
        each design.

    Raises:
        InvalidInput: There is no atlas.
        DamagedStore: What all designs share is damaged; tips raise it when they are read.

    Warns:
        SoftreachWarning: Designs are damaged; they are NaN, and their status says so.
    """
    return _opened(a_store("store", store), metrics=True)


def opened_atlas(atlas: AtlasLike, *, metrics: bool = True) -> xr.Dataset:
    """The dataset that a question about an atlas is asked of.

    Args:
        atlas: A store, which is opened, or a dataset from `open_atlas` or a part of one.
        metrics: Whether the metrics are asked for; reading all of a large store takes time.

    Raises:
        InvalidInput: Another dataset, or no atlas.
    """
    import xarray as xr

    atlas = an_atlas("atlas", atlas)
    return atlas if isinstance(atlas, xr.Dataset) else _opened(atlas, metrics=metrics)


def command_of(atlas: xr.Dataset) -> Command:
    """Command that built the atlas."""
    return Command.from_json(atlas.attrs["command"])


def over_length(atlas: xr.Dataset, metric: str) -> xr.DataArray:
    """A metric relative to each design's own length: V / L³, heights over L, curvatures times L.

    Args:
        atlas: From `open_atlas`.
        metric: Which one; without a length in its unit it stays as it is.

    Raises:
        InvalidInput: No atlas, or a metric that it does not have.
    """
    atlas = as_dataset("atlas", atlas, "length", what="an atlas")
    if as_text("metric", metric) not in atlas:
        raise InvalidInput("metric", metric, f"one of {', '.join(map(str, atlas.data_vars))}")
    values = atlas[metric]
    power = _POWERS.get(values.attrs.get("units", "1"), 0)
    if not power:
        return values
    relative = (values / atlas["length"] ** power).transpose(*values.dims)
    return relative.assign_attrs({**values.attrs, "units": "1"})


class _Reader:
    def __init__(self, store: AtlasStore) -> None:
        self._store = store
        self.damaged: dict[int, str] = {}
        """Damage of each: number -> message."""

    def read(self, name: str, place: Any = ...) -> NDArray[Any]:
        array = self._store.array(name)
        with self._store.watch.noting() as noted:
            values = np.array(array[place])
        for chunk, error in noted.items():
            self.damaged.setdefault(self._store.number(chunk), str(error))
        return values

    def table(self, name: str, status: NDArray[np.uint8]) -> Array:
        if np.isin(status, KNOWN).any():
            return self.read(name)
        return np.full(self._store.array(name).shape, np.nan)


def _required(store: AtlasStore, status: NDArray[np.uint8]) -> Callable[[Chunk], bool]:
    known, explained = np.isin(status, KNOWN), np.isin(status, EXPLAINED)

    def required(chunk: Chunk) -> bool:
        if chunk.array not in PER_DESIGN:
            return True
        of_designs = explained if chunk.array == "message" else known
        return chunk.array != "status" and bool(of_designs[store.number(chunk)])

    return required


def _opened(store: StoreLike, *, metrics: bool) -> xr.Dataset:
    import xarray as xr

    atlas = AtlasStore.open(store, "r")
    content = contents(atlas, metrics=metrics)
    if content.damage:
        then = "left out; the command that built the atlas computes again what is damaged"
        warn(f"{content.damage} ({then})")
    with storage_errors(f"{atlas.location} cannot be read"):
        raw = xr.open_zarr(atlas.opened.place, drop_variables=_READ_HERE, **READING)
        coordinates = _coordinates(atlas, raw)
    for variable in (raw, *raw.variables.values()):
        for name in (ARRAYS, DIGEST, OF):
            variable.attrs.pop(name, None)
    variables = _variables(atlas, content) | (_metrics(atlas.command, content) if metrics else {})
    opened = raw.assign(variables).assign_coords(coordinates)
    opened.encoding["source"] = str(atlas.location)
    return opened


def _variables(store: AtlasStore, content: Contents) -> dict[str, Any]:
    space = store.command.space
    texts = np.full(space.size, "", dtype=np.dtypes.StringDType())
    for index, message in content.messages.items():
        texts[index] = message
    values = {"status": content.status, "message": texts}
    plans = {plan.name: plan for plan in array_plans(store.command)}
    return {
        name: (space.dims, column.reshape(space.shape), plans[name].attrs)
        for name, column in values.items()
    }


def _metrics(command: Command, contents: Contents) -> dict[str, Any]:
    dims, table = command.space.dims, contents.tables["metrics"]
    done = np.isin(contents.status, KNOWN).reshape(command.space.shape)
    variables = {
        metric.name: (dims, np.where(done, table[..., k], np.nan), _attributes(command, metric))
        for k, metric in enumerate(command.numbers)
    }
    for k, metric in enumerate(command.profiles):
        profiles = contents.tables["curvature"][..., k, :, :]
        values = np.where(done[..., None, None], profiles, np.nan)
        variables[metric.name] = (*dims, *metric.over), values, _attributes(command, metric)
    return variables


def _attributes(command: Command, metric: Metric) -> dict[str, Any]:
    attrs: dict[str, Any] = {"units": metric.unit, "long_name": metric.meaning}
    if Need.ALPHA in metric.needs:
        attrs["alpha_over_length"] = command.alpha_over_length
    return attrs


def _coordinates(store: AtlasStore, raw: xr.Dataset) -> dict[str, Any]:
    space = store.command.space
    numbers = np.arange(space.size, dtype=np.uint32).reshape(space.shape)
    return {
        "length": ((), space.base.length, {"units": "m"}),
        **{name: raw[name] for name in space.names},
        "number": (space.dims, numbers, {"long_name": "number of the design"}),
    }
