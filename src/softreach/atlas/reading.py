"""Reading an atlas, also while it is being written: a dataset over its parameters."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softreach.atlas.command import Command
from softreach.atlas.layout import PER_DESIGN, array_plans
from softreach.atlas.metric import Metric, Need
from softreach.atlas.store import DAMAGED, FAILED, GAP, KNOWN, OF, UNSTABLE, AtlasStore
from softreach.schema import stored_names
from softreach.support.arguments import as_dataset, as_given, as_instance, as_path, as_text
from softreach.support.errors import InvalidInput, counted, warn
from softreach.support.files.stores import ARRAYS, DIGEST, READING, Chunk, storage_errors

if TYPE_CHECKING:
    import xarray as xr
    from zarr.storage import StoreLike

    AtlasLike = StoreLike | xr.Dataset


EXPLAINED = (FAILED, GAP, UNSTABLE)
"""The status of designs that have a message."""

_A_STORE = "a path, a URL or a Zarr store"
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
    damaged: dict[int, str] = {}

    def read(name: str, place: Any = ...) -> NDArray[Any]:
        array = store.array(name)
        with store.watch.noting() as noted:
            values = np.array(array[place])
        for chunk, error in noted.items():
            damaged.setdefault(store.number(chunk), str(error))
        return values

    place_of, command = store.command.space.place, store.command
    status = read("status").ravel()
    known, explained = np.isin(status, KNOWN), np.isin(status, EXPLAINED)
    store.watch.required = lambda chunk: _is_required(store, chunk, known, explained)
    names = ("metrics", "curvature") if command.profiles else ("metrics",)
    tables = {
        name: read(name) if known.any() else np.full(store.array(name).shape, np.nan)
        for name in names
        if metrics
    }
    for index in tips_of if command.keep_clouds else ():
        if known[index]:
            read("tip", place_of(index))
    explained_ones = np.flatnonzero(explained).tolist()
    texts = {index: str(read("message", place_of(index)).item()) for index in explained_ones}
    status[[*damaged]] = DAMAGED
    return Contents(status=status, messages=dict(sorted((texts | damaged).items())), tables=tables)


def _is_required(
    store: AtlasStore, chunk: Chunk, known: NDArray[np.bool_], explained: NDArray[np.bool_]
) -> bool:
    if chunk.array not in PER_DESIGN:
        return True
    of_designs = explained if chunk.array == "message" else known
    return chunk.array != "status" and bool(of_designs[store.number(chunk)])


def a_store(name: str, value: Any) -> Any:
    """A place where an atlas may be.

    Raises:
        InvalidInput: Neither text nor a path nor a Zarr store.
    """
    from zarr.abc.store import Store
    from zarr.storage import StorePath

    if isinstance(value, str | os.PathLike):
        return as_path(name, value)
    if isinstance(value, dict) and all(hasattr(content, "to_bytes") for content in value.values()):
        return value  # a store in memory
    return as_instance(name, value, (Store, StorePath), _A_STORE)


def open_atlas(store: StoreLike) -> xr.Dataset:
    """An atlas with a dimension for each parameter, so that ``atlas.volume.sel(taper=...)`` works.

    Clouds are read when they are used. Designs that are not done are NaN, and
    so are those of which no activation is stable, but for their `lost_share`.

    Args:
        store: Path, URL or Zarr store.

    Returns:
        Dataset over the parameters of a grid [SI units], or over `design`: the metrics (see their
        attributes), quantiles of curvature, `status`, `unit_activation`, and `tip` [m] if clouds
        were kept; as coordinates the parameters, the `length` [m], and the `number` of each design
        with the `message` that says why it has no metrics.

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
        InvalidInput: Another dataset, anything else, or no atlas.
    """
    import xarray as xr

    if isinstance(atlas, xr.Dataset) and "command" in atlas.attrs and "status" in atlas:
        return atlas
    try:
        return _opened(a_store("atlas", atlas), metrics=metrics)
    except InvalidInput as error:
        if error.allowed != _A_STORE:
            raise
        given = "another Dataset" if isinstance(atlas, xr.Dataset) else as_given(atlas)
        raise InvalidInput("atlas", given, "a store, or a dataset from open_atlas") from None


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


def _opened(location: StoreLike, *, metrics: bool) -> xr.Dataset:
    import xarray as xr

    store = AtlasStore.open(location, "r")
    content, space = contents(store, metrics=metrics), store.command.space
    if content.damage:
        then = "left out; the command that built the atlas computes again what is damaged"
        warn(f"{content.damage} ({then})")
    with storage_errors(f"{store.location} cannot be read"):
        raw = xr.open_zarr(store.opened.place, drop_variables=_READ_HERE, **READING)
        coordinates: dict[str, Any] = {
            "length": ((), space.base.length, {"units": "m"}),
            **{name: raw[name] for name in space.names},
        }
    for variable in (raw, *raw.variables.values()):
        for name in (ARRAYS, DIGEST, OF):
            variable.attrs.pop(name, None)
    numbers = np.arange(space.size, dtype=np.uint32).reshape(space.shape)
    coordinates["number"] = space.dims, numbers, {"long_name": "number of the design"}
    opened = raw.assign(_variables(store, content)).assign_coords(coordinates)
    opened = stored_names(opened).set_coords("message")
    opened.encoding["source"] = str(store.location)
    return opened


def _variables(store: AtlasStore, content: Contents) -> dict[str, Any]:
    """Status, messages, and the metrics that were read."""
    command, shape, dims = store.command, store.command.space.shape, store.command.space.dims
    texts = np.full(command.space.size, "", dtype=object)
    for index, message in content.messages.items():
        texts[index] = message
    plans = {plan.name: plan.attrs for plan in array_plans(command)}
    variables: dict[str, Any] = {
        "status": (dims, content.status.reshape(shape), plans["status"]),
        "message": (dims, texts.reshape(shape), plans["message"]),
    }
    done = np.isin(content.status, KNOWN).reshape(shape)
    if (table := content.tables.get("metrics")) is not None:
        for k, metric in enumerate(command.numbers):
            values = np.where(done, table[..., k], np.nan)
            variables[metric.name] = dims, values, _attributes(command, metric)
    if (table := content.tables.get("curvature")) is not None:
        for k, metric in enumerate(command.profiles):
            values = np.where(done[..., None, None], table[..., k, :, :], np.nan)
            variables[metric.name] = (*dims, *metric.over), values, _attributes(command, metric)
    return variables


def _attributes(command: Command, metric: Metric) -> dict[str, Any]:
    attrs: dict[str, Any] = {"units": metric.unit, "long_name": metric.meaning}
    if Need.ALPHA in metric.needs:
        attrs["alpha_over_length"] = command.alpha_over_length
    return attrs
