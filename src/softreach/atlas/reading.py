"""Read an atlas, also while it is being written: a dataset over the parameters of its designs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.atlas.command import Command
from softreach.atlas.metric import Metric, Need
from softreach.atlas.store import KNOWN, AtlasStore
from softreach.atlas.store_root import absolute
from softreach.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr
    from zarr.storage import StoreLike

    AtlasLike = StoreLike | xr.Dataset

__all__ = ["command_of", "open_atlas", "opened_atlas", "over_length"]

_POWERS = {"m": 1, "m2": 2, "m3": 3, "1/m": -1}


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


def over_length(atlas: xr.Dataset, metric: str) -> xr.DataArray:
    """A metric relative to each design's own length: V / L³, heights over L, curvatures times L.

    Args:
        atlas: From `open_atlas`.
        metric: Which one; without a length in its unit it stays as it is.
    """
    values = atlas[metric]
    power = _POWERS.get(values.attrs.get("units", "1"), 0)
    if not power:
        return values
    relative = (values / atlas["length"] ** power).transpose(*values.dims)
    return relative.assign_attrs({**values.attrs, "units": "1"})


def _opened(store: StoreLike, *, metrics: bool) -> xr.Dataset:
    import xarray as xr

    command = AtlasStore.open(store, "r").command
    raw = xr.open_zarr(absolute(store), consolidated=False, zarr_format=3, chunks=None)
    # Status first: what it calls done is complete by then.
    done = raw["status"].load().isin(KNOWN).values
    atlas = raw.drop_vars(["metrics", "metric", "curvature", "quantity"], errors="ignore")
    if metrics:
        atlas = atlas.assign(_metrics(command, raw, done))
    return atlas.assign_coords(_coordinates(command, raw))


def _metrics(command: Command, raw: xr.Dataset, done: np.ndarray) -> dict[str, Any]:
    dims, table = command.space.dims, raw["metrics"].values
    found = {
        metric.name: (dims, np.where(done, table[..., k], np.nan), _attributes(command, metric))
        for k, metric in enumerate(command.numbers)
    }
    profiles = raw["curvature"].values if command.profiles else np.empty(0)
    for k, metric in enumerate(command.profiles):
        values = np.where(done[..., None, None], profiles[..., k, :, :], np.nan)
        found[metric.name] = (*dims, *metric.over), values, _attributes(command, metric)
    return found


def _attributes(command: Command, metric: Metric) -> dict[str, Any]:
    attrs: dict[str, Any] = {"units": metric.unit, "long_name": metric.meaning}
    if Need.ALPHA in metric.needs:
        attrs["alpha_over_length"] = command.alpha_over_length
    return attrs


def _coordinates(command: Command, raw: xr.Dataset) -> dict[str, Any]:
    """Parameters, length and number of every design."""
    space = command.space
    numbers = np.arange(space.size, dtype=np.uint32).reshape(space.shape)
    found: dict[str, Any] = {
        "length": ((), space.base.length, {"units": "m"}),
        **{name: raw[name] for name in space.names},
        "number": (space.dims, numbers, {"long_name": "number of the design"}),
    }
    return found
