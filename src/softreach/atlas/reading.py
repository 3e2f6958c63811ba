"""Read an atlas, also while it is being written: a dataset over the parameters of its designs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.atlas.command import Command
from softreach.atlas.design_task import activations_of
from softreach.atlas.metrics import METRICS
from softreach.atlas.store import DONE, FAILED, GAP, TODO, AtlasStore, absolute
from softreach.curvature import QUANTITIES
from softreach.errors import InvalidInput
from softreach.rod.kinematics import tip_positions
from softreach.schema import cloud_dataset

if TYPE_CHECKING:
    import xarray as xr
    from zarr.storage import StoreLike

__all__ = ["AtlasStatus", "atlas_cloud", "atlas_design", "atlas_status", "open_atlas"]


@dataclass(frozen=True, kw_only=True)
class AtlasStatus:
    """How far an atlas is."""

    designs: int
    done: int
    failed: int
    gaps: int
    todo: int
    messages: dict[int, str]
    """Why designs failed or cannot exist: number -> message."""


def open_atlas(store: StoreLike) -> xr.Dataset:
    """An atlas with a dimension for each parameter, so that ``atlas.volume.sel(taper=...)`` works.

    Clouds are read when they are used. Designs that are not done are NaN.

    Args:
        store: Path, URL or Zarr store.

    Returns:
        Dataset over the parameters of a grid [SI units], or over `design`: the metrics (see their
        attributes), quantiles of curvature, `status`, `message`, `unit_activation`, and `tip` [m]
        if clouds were kept.

    Raises:
        InvalidInput: There is no atlas.
    """
    import xarray as xr

    command = AtlasStore.open(store, "r").command
    raw = xr.open_zarr(absolute(store), consolidated=False, zarr_format=3, chunks=None)
    # Status first: what it calls done is complete by then.
    done = (raw["status"].load() == DONE).values
    atlas = raw.drop_vars(["metrics", "metric", "curvature", "quantity"], errors="ignore")
    return atlas.assign(_metrics(command, raw, done) | _curvature(raw, done))


def atlas_status(store: StoreLike) -> AtlasStatus:
    """How many designs of an atlas are done, and what is wrong with the others.

    Raises:
        InvalidInput: There is no atlas.
    """
    atlas = AtlasStore.open(store, "r")
    counts = np.bincount(atlas.status(), minlength=4).tolist()
    return AtlasStatus(
        designs=atlas.command.space.size,
        done=counts[DONE],
        failed=counts[FAILED],
        gaps=counts[GAP],
        todo=counts[TODO],
        messages=atlas.messages(),
    )


def atlas_design(atlas: xr.Dataset, **at: float) -> Manipulator:
    """The design at, or nearest to, these parameters [SI units], or with `design` its number.

    Raises:
        InvalidInput: A parameter is missing or unknown.
        InvalidDesign: The place is a gap.
    """
    return _command(atlas).design(_number(atlas, at))


def atlas_cloud(atlas: xr.Dataset, **at: float) -> xr.Dataset:
    """The cloud of the design at, or nearest to, these parameters, like those of `compute_cloud`.

    Stored tips are rounded to 1e-5 L; without them the cloud is computed again, exactly as it was.

    Args:
        atlas: An atlas.
        **at: Every parameter [SI units], or `design` and its number.

    Raises:
        InvalidInput: A parameter is missing or unknown, or the design is not done.
    """
    command, number = _command(atlas), _number(atlas, at)
    row = _nearest(atlas[[name for name in ("status", "tip") if name in atlas]], at)
    if (status := int(row["status"])) != DONE:
        raise InvalidInput("design", at, "done", f"its status is {status}")
    arm = command.design(number)
    activation = activations_of(arm, atlas["unit_activation"].values)
    if "tip" in atlas:
        tip = np.ascontiguousarray(row["tip"].values.T, dtype=float)
    else:
        tip = tip_positions(arm, activation, command.tol)
    return cloud_dataset(
        arm, activation, tip, seed=command.seed, sampler=command.sampler, tol=command.tol
    )


def _metrics(command: Command, raw: xr.Dataset, done: np.ndarray) -> dict[str, Any]:
    table = raw["metrics"].values
    dims = command.space.dims
    found = {}
    for k, name in enumerate(map(str, raw["metric"].values)):
        group = next(group for group in command.metrics if name in METRICS[group])
        metric = METRICS[group][name]
        attrs: dict[str, Any] = {"units": metric.unit, "long_name": metric.meaning}
        if group == "concave":
            attrs["alpha_over_length"] = command.alpha
        found[name] = dims, np.where(done, table[..., k], np.nan), attrs
    return found


def _curvature(raw: xr.Dataset, done: np.ndarray) -> dict[str, Any]:
    if "curvature" not in raw:
        return {}
    values = np.where(done[..., None, None, None], raw["curvature"].values, np.nan)
    dims = [dim for dim in raw["curvature"].dims if dim != "quantity"]
    return {
        f"{name}_quantile": (dims, values[..., k, :, :], {"units": unit, "long_name": meaning})
        for k, (name, (unit, meaning)) in enumerate(QUANTITIES.items())
    }


def _command(atlas: xr.Dataset) -> Command:
    if "command" not in atlas.attrs:
        raise InvalidInput("atlas", type(atlas).__name__, "a dataset from open_atlas")
    return Command.from_json(atlas.attrs["command"])


def _nearest(atlas: xr.Dataset, at: Mapping[str, float]) -> xr.Dataset:
    """One design; also of a part of an atlas."""
    if "design" in at:
        return atlas.isel(design=int(at["design"]))
    return atlas.sel(at, method="nearest")


def _number(atlas: xr.Dataset, at: Mapping[str, float]) -> int:
    """The number of the nearest design in the whole atlas, axis by axis."""
    space = _command(atlas).space
    if set(at) != set(space.dims):
        raise InvalidInput("parameters", ", ".join(at) or "none", f"all of {', '.join(space.dims)}")
    if space.layout == "list":
        return int(at["design"])
    columns = dict(space.parameters)
    near = _nearest(atlas[[*space.dims]], at)
    place = [columns[name].index(near[name].item()) for name in space.dims]
    return int(np.ravel_multi_index(place, space.shape))
