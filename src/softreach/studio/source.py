"""What the studio is opened on: a design, a stored cloud, or an atlas."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from softreach.arm.manipulator import Manipulator
from softreach.studio.atlas_map import metric_names
from softreach.studio.files import LARGEST
from softreach.studio.reach import Quality, Reach
from softreach.studio.stages import reached
from softreach.studio.state import StudioState
from softreach.support.errors import InvalidInput
from softreach.support.files.stores import kind_of

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Start", "start_on_design", "start_on_state", "start_on_store"]


@dataclass(frozen=True, kw_only=True)
class Start:
    """What every new tab begins with."""

    state: StudioState
    quality: Quality
    reach: Reach | None = None
    atlas: xr.Dataset | None = None


def start_on_design(arm: Manipulator, quality: Quality | None = None) -> Start:
    """Begin with a design."""
    return Start(state=StudioState(design=arm), quality=quality or Quality())


def start_on_state(path: str | PathLike[str], quality: Quality | None = None) -> Start:
    """Begin with a state that a tab was saved as.

    Raises:
        InvalidInput: There is no such file, or it is no state.
        InvalidDesign: A design in it cannot exist.
    """
    try:
        if (size := Path(path).stat().st_size) > LARGEST:
            most = f"at most {LARGEST / 1e6:g} MB"
            raise InvalidInput("state file", f"{size / 1e6:.3g} MB", most)
        text = Path(path).read_bytes()
    except OSError as error:
        raise InvalidInput("state file", str(path), "a file that can be read", str(error)) from None
    return Start(state=StudioState.from_json(text), quality=quality or Quality())


def start_on_store(path: str | PathLike[str], quality: Quality | None = None) -> Start:
    """Begin with a cloud that `save_cloud` wrote, or with the largest design of an atlas.

    Raises:
        InvalidInput: The store is neither, or the atlas holds no design yet.
    """
    quality = quality or Quality()
    if kind_of(path) == "cloud":
        from softreach.cloud.clouds import open_cloud

        reach = reached(open_cloud(path), quality)
        return Start(state=StudioState(design=reach.arm), quality=quality, reach=reach)
    from softreach.atlas import open_atlas

    atlas = open_atlas(path)
    return Start(state=StudioState(design=_best(atlas)), quality=quality, atlas=atlas)


def _best(atlas: xr.Dataset) -> Manipulator:
    from softreach.atlas import atlas_design, best_designs

    best = best_designs(atlas, metric_names(atlas)[0])
    dims = [str(dim) for dim in atlas["status"].dims]
    if not best.sizes.get("rank"):
        raise InvalidInput("atlas", "no design is done", "built, at least in part")
    return atlas_design(atlas, **{dim: float(best[dim].values[0]) for dim in dims})
