"""Volume of the α-shape of a cloud against its radius."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.cloud.volume import volume_curve
from softreach.rod.tip_map import TipStatus
from softreach.studio.plots.plot import Chart, Curve, Plot, complete_reach
from softreach.studio.reach import Reach, shown_rows
from softreach.studio.work import StaleCheck, all_cores
from softreach.workspace import ReachableSolid

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

Array = NDArray[np.float64]

_RADII = np.geomspace(0.01, 0.5, 60)  # [L]
_MOST = 17
"""Level of the largest cloud that is triangulated, as for the α-shape in the scene."""
_OF_ALPHA, _EXACT = Curve("V(α)", "#2f6db5"), Curve("exact", "#495057")
_HULL = Curve("convex hull", "#868e96", dashed=True)


class VolumeCurve(NamedTuple):
    """V(α)."""

    arm: Manipulator
    samples: int
    radius: Array
    """[L]."""
    volume: Array
    """[m³]."""
    exact: float
    """Volume of the reachable set [m³]; NaN while it is not known."""
    convex: float
    """Of its convex hull [m³]."""


def volume_curve_of(reach: Reach, level: int) -> VolumeCurve:
    """V(α) of those of 2^level samples that are stable, at most 2^17."""
    rows = shown_rows(reach, min(level, _MOST))
    rows = rows[reach.status[rows] == TipStatus.STABLE]
    length, exact = reach.arm.length, reach.exact
    with all_cores:
        volumes = volume_curve(reach.cloud.tip.values[rows], _RADII * length)
    solid = isinstance(exact, ReachableSolid)
    convex = exact.convex_volume if solid else math.nan
    return VolumeCurve(reach.arm, len(rows), _RADII, volumes, reach.volume, convex)


class VolumeCurvePlot(Plot):
    """Chart of V(α), beside the exact volume and that of the convex hull."""

    name = "volume_curve"
    label = "V against α"
    hint = "V(α): volume of the α-shape of the cloud against the radius α, beside the exact volume"
    depends_on = ("appearance.level",)
    sources = frozenset({"reach"})

    def __init__(self, gui: GuiApi, folder: Any) -> None:
        self._chart = Chart(gui, folder, logarithmic=True)

    @staticmethod
    def compute(session: Session, check: StaleCheck) -> Iterator[VolumeCurve]:
        """Triangulate the cloud, once it is complete."""
        del check
        reach = complete_reach(session)
        if reach is not None:
            with session.working("V(α): triangulating the cloud"):
                yield volume_curve_of(reach, session.state.appearance.level)

    def show(self, result: VolumeCurve) -> str:
        """Draw the curve."""
        curves, values = [_OF_ALPHA], [result.volume]
        if np.isfinite(result.exact) and np.isfinite(result.convex):
            curves += [_EXACT, _HULL]
            values += [np.full_like(result.radius, each) for each in (result.exact, result.convex)]
        unit = result.arm.length_unit
        shown = [unit.of(each, 3) for each in values]
        at = float(np.interp(0.05, result.radius, result.volume))
        self._chart.show("α / L", result.radius, curves, shown, y=unit.label("V", 3))
        return f"V(0.05 L) = {unit.rounded(at, 3)} of {result.samples:,} samples"
