"""How the volume of a cloud depends on the radius of its α-shape."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.cloud.volume import volume_curve
from softreach.rod.tip_map import TipStatus
from softreach.studio.reach import Reach, shown_rows
from softreach.studio.work import all_cores
from softreach.workspace import ReachableSolid

__all__ = ["VolumeCurve", "volume_curve_of"]

Array = NDArray[np.float64]

_RADII = np.geomspace(0.01, 0.5, 60)  # [L]
_MOST = 17
"""Level of the largest cloud that is triangulated, as for the α-shape in the scene."""


class VolumeCurve(NamedTuple):
    """V(α), in L."""

    arm: Manipulator
    samples: int
    radius: Array
    volume: Array
    exact: float
    """Volume of the reachable set; NaN while it is not known."""
    convex: float
    """Of its convex hull."""


def volume_curve_of(reach: Reach, level: int) -> VolumeCurve:
    """V(α) of those of 2^level samples that are stable, at most 2^17."""
    rows = shown_rows(reach, min(level, _MOST))
    rows = rows[reach.status[rows] == TipStatus.STABLE]
    length, found = reach.arm.length, reach.exact
    with all_cores:
        volumes = volume_curve(reach.cloud.tip.values[rows], _RADII * length) / length**3
    solid = isinstance(found, ReachableSolid)
    convex = found.convex_volume / length**3 if solid else math.nan
    return VolumeCurve(reach.arm, len(rows), _RADII, volumes, reach.volume, convex)
