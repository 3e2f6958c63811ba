"""Read an atlas, also while it is being written: a dataset over the parameters of its designs."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arguments import checked, dataset, text
from softreach.atlas.arguments import a_store
from softreach.atlas.command import Command
from softreach.atlas.contents import Contents, contents
from softreach.atlas.metric import Metric, Need
from softreach.atlas.store import KNOWN, AtlasStore
from softreach.errors import InvalidInput, SoftreachWarning
from softreach.stores.damage import Chunk, storage_errors
from softreach.stores.place import READING, check_arrays

if TYPE_CHECKING:
    import xarray as xr
    from zarr.storage import StoreLike

    AtlasLike = StoreLike | xr.Dataset

__all__ = ["command_of", "open_atlas", "opened_atlas", "over_length"]

_POWERS = {"m": 1, "m2": 2, "m3": 3, "1/m": -1}


@checked(store=a_store)
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
    return _opened(store, metrics=True)


def opened_atlas(atlas: AtlasLike, *, metrics: bool = True) -> xr.Dataset:
    """The dataset that a question about an atlas is asked of.

    Args:
        atlas: A store, which is opened, or a dataset from `open_atlas` or a part of one.
        metrics: Whether the metrics are asked for; reading all of a large store takes time.

    Raises:
        InvalidInput: Another dataset, or no atlas.
    """
    import xarray as xr

    if not isinstance(atlas, xr.Dataset):
        return _opened(atlas, metrics=metrics)
    if "command" not in atlas.attrs:
        raise InvalidInput("atlas", type(atlas).__name__, "a store, or a dataset from open_atlas")
    return atlas


def command_of(atlas: xr.Dataset) -> Command:
    """What the atlas was asked to hold."""
    return Command.from_json(atlas.attrs["command"])


@checked(atlas=dataset("length", what="an atlas"), metric=text)
def over_length(atlas: xr.Dataset, metric: str) -> xr.DataArray:
    """A metric relative to each design's own length: V / L³, heights over L, curvatures times L.

    Args:
        atlas: From `open_atlas`.
        metric: Which one; without a length in its unit it stays as it is.
    """
    if metric not in atlas:
        raise InvalidInput("metric", metric, f"one of {', '.join(map(str, atlas.data_vars))}")
    values = atlas[metric]
    power = _POWERS.get(values.attrs.get("units", "1"), 0)
    if not power:
        return values
    relative = (values / atlas["length"] ** power).transpose(*values.dims)
    return relative.assign_attrs({**values.attrs, "units": "1"})


def _opened(store: StoreLike, *, metrics: bool) -> xr.Dataset:
    import xarray as xr

    held = AtlasStore.open(store, "r")
    found = contents(held, metrics=metrics)
    if found.damage:
        then = "left out; the command that built the atlas computes again what is damaged"
        warnings.warn(f"{found.damage} ({then})", SoftreachWarning, stacklevel=4)
    with storage_errors(f"{held.location} cannot be read"):
        check_arrays(held.opened)
        raw = xr.open_zarr(held.opened.place, drop_variables=_READ_HERE, **READING)
        coordinates = _coordinates(held, raw)
    variables = _variables(held, found) | (_metrics(held.command, found) if metrics else {})
    whole = raw.assign(variables).assign_coords(coordinates)
    whole.encoding["source"] = str(held.location)
    return whole


_READ_HERE = ("metrics", "metric", "curvature", "quantity", "status", "message")


def _variables(store: AtlasStore, found: Contents) -> dict[str, Any]:
    """Status and message of every design."""
    space = store.command.space
    texts = np.full(space.size, "", dtype=np.dtypes.StringDType())
    for index, message in found.messages.items():
        texts[index] = message
    values = {"status": found.status, "message": texts}
    return {
        name: (space.dims, column.reshape(space.shape), store.array(name).attrs.asdict())
        for name, column in values.items()
    }


def _metrics(command: Command, contents: Contents) -> dict[str, Any]:
    dims, table = command.space.dims, contents.tables["metrics"]
    done = np.isin(contents.status, KNOWN).reshape(command.space.shape)
    found = {
        metric.name: (dims, np.where(done, table[..., k], np.nan), _attributes(command, metric))
        for k, metric in enumerate(command.numbers)
    }
    for k, metric in enumerate(command.profiles):
        profiles = contents.tables["curvature"][..., k, :, :]
        values = np.where(done[..., None, None], profiles, np.nan)
        found[metric.name] = (*dims, *metric.over), values, _attributes(command, metric)
    return found


def _attributes(command: Command, metric: Metric) -> dict[str, Any]:
    attrs: dict[str, Any] = {"units": metric.unit, "long_name": metric.meaning}
    if Need.ALPHA in metric.needs:
        attrs["alpha_over_length"] = command.alpha_over_length
    return attrs


def _coordinates(store: AtlasStore, raw: xr.Dataset) -> dict[str, Any]:
    """Parameters, length and number of every design."""
    space = store.command.space
    for name, values in space.parameters:
        if not np.array_equal(raw[name].values, values):
            store.watch.report(Chunk(name, None), "with other values", "those of the command")
    numbers = np.arange(space.size, dtype=np.uint32).reshape(space.shape)
    found: dict[str, Any] = {
        "length": ((), space.base.length, {"units": "m"}),
        **{name: raw[name] for name in space.names},
        "number": (space.dims, numbers, {"long_name": "number of the design"}),
    }
    return found
