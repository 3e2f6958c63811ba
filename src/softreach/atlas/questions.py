"""Questions asked of an atlas: how much is done, which design is where, and its cloud."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.atlas.intermediates import activations_of
from softreach.atlas.reading import command_of, opened_atlas
from softreach.atlas.store import DONE, FAILED, GAP, KNOWN, TODO, UNSTABLE
from softreach.errors import InvalidInput
from softreach.rod.tip_map import tip_map
from softreach.schema import cloud_dataset, with_status

if TYPE_CHECKING:
    import xarray as xr

    from softreach.atlas.reading import AtlasLike

__all__ = ["AtlasStatus", "atlas_cloud", "atlas_design", "atlas_status"]


@dataclass(frozen=True, kw_only=True)
class AtlasStatus:
    """How much of an atlas is done."""

    designs: int
    done: int
    failed: int
    gaps: int
    unstable: int
    """Designs of which no activation has a stable equilibrium."""
    todo: int
    messages: dict[int, str]
    """Why designs failed, cannot exist or are nowhere stable: number -> message."""


def atlas_status(atlas: AtlasLike) -> AtlasStatus:
    """How many designs of an atlas are done, and what is wrong with the others.

    Args:
        atlas: A store; or a dataset from `open_atlas`, which has the status of when it was opened.

    Raises:
        InvalidInput: There is no atlas.
    """
    opened = opened_atlas(atlas, metrics=False)
    status = opened["status"].values.ravel()
    counts = np.bincount(status, minlength=5).tolist()
    return AtlasStatus(
        designs=status.size,
        done=counts[DONE],
        failed=counts[FAILED],
        gaps=counts[GAP],
        unstable=counts[UNSTABLE],
        todo=counts[TODO],
        messages=_messages(opened, np.isin(status, (FAILED, GAP, UNSTABLE))),
    )


def atlas_design(atlas: AtlasLike, **at: float) -> Manipulator:
    """The design at, or nearest to, these parameters.

    Args:
        atlas: A store, or a dataset from `open_atlas`.
        **at: Every parameter [SI units], or `design` and its number.

    Raises:
        InvalidInput: A parameter is missing or unknown.
        InvalidDesign: The place is a gap.
    """
    opened = opened_atlas(atlas, metrics=False)
    return command_of(opened).design(int(_nearest(opened[["number"]], at)["number"]))


def atlas_cloud(atlas: AtlasLike, **at: float) -> xr.Dataset:
    """The cloud of the design at, or nearest to, these parameters, like those of `compute_cloud`.

    Stored tips are rounded to 1e-5 of the shortest length; without them the cloud is computed
    again, exactly as it was, and so are those of loaded designs, whose samples have a status.

    Args:
        atlas: A store, or a dataset from `open_atlas`.
        **at: Every parameter [SI units], or `design` and its number.

    Raises:
        InvalidInput: A parameter is missing or unknown, or the design is not done.
    """
    opened = opened_atlas(atlas, metrics=False)
    command = command_of(opened)
    kept = [name for name in ("status", "number", "tip") if name in opened]
    row = _nearest(opened[kept], at)
    if (status := int(row["status"])) not in KNOWN:
        raise InvalidInput("design", at, "done", f"its status is {status}")
    arm = command.design(int(row["number"]))
    rod = tip_map(arm, command.tol)
    activation = activations_of(rod, opened["unit_activation"].values)
    drawn: Any = {"seed": command.seed, "sampler": command.sampler, "tol": command.tol}
    if rod.supports_unstable:
        tip, stability = rod.tips_and_status(activation)
        return with_status(cloud_dataset(arm, activation, tip, **drawn), stability)
    if "tip" in opened:
        tip = np.ascontiguousarray(row["tip"].values.T, dtype=float)
    else:
        tip = rod.tips(activation)
    return cloud_dataset(arm, activation, tip, **drawn)


def _messages(atlas: xr.Dataset, told: np.ndarray) -> dict[int, str]:
    numbers = atlas["number"].values.ravel()[told].tolist()
    texts = atlas["message"].values.ravel()[told].tolist() if told.any() else []
    return dict(zip(numbers, map(str, texts), strict=True))


def _nearest(atlas: xr.Dataset, at: Mapping[str, float]) -> xr.Dataset:
    """One design of an atlas or of a part of it."""
    dims = [str(dim) for dim in atlas["number"].dims]
    if set(at) != set(dims):
        raise InvalidInput("parameters", ", ".join(at) or "none", f"all of {', '.join(dims)}")
    if "design" in at:
        return atlas.isel(design=int(at["design"]))
    return atlas.sel(at, method="nearest")
