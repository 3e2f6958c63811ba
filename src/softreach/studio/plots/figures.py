"""What has been found for the plots of a tab."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from softreach.studio.plots.along_arm import AlongArm
from softreach.studio.plots.image import Picture
from softreach.studio.plots.sweep import Sweep
from softreach.studio.plots.volumes import VolumeCurve

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Figures"]


@dataclass(eq=False)
class Figures:
    """Each is None until it is known; jobs replace them, panels show them."""

    along_arm: AlongArm | None = None
    volume_curve: VolumeCurve | None = None
    sweep: Sweep | None = None
    histogram: Picture | None = None
    section: Picture | None = None
    track: xr.Dataset | None = None
    """What `track_path` found for the path."""
