"""Curvature and strain along an arm in one activation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.studio.plots.plot import Chart, Curve, Plot
from softreach.studio.state import solvable_rod
from softreach.studio.work import StaleCheck
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

Array = NDArray[np.float64]

_STATIONS = 121
_BENDING, _TORSION = Curve("bending κL", "#2f6db5"), Curve("torsion u₃L", "#e8590c")
_EXTENSION, _NO_STRAIN = Curve("ζ", "#2b8a3e"), Curve("no strain", "#868e96", dashed=True)


class AlongArm(NamedTuple):
    """Values at stations along the arm; NaN without equilibrium."""

    arm: Manipulator
    station: Array
    """Z [L]."""
    bending: Array
    """√(u₁² + u₂²) times L [-]."""
    torsion: Array
    """u₃ times L [-]."""
    extension: Array
    """ζ [-]."""


def along_arm(arm: Manipulator, activation: Sequence[float]) -> AlongArm:
    """Curvature and strain of an arm in an activation, station by station."""
    z = np.linspace(0.0, 1.0, _STATIONS)
    try:
        strains = solvable_rod(arm).strains_at(z * arm.length)
    except InvalidInput:  # loads that cannot be computed, which the status says
        unknown = np.full(_STATIONS, np.nan)
        return AlongArm(arm, z, unknown, unknown, unknown)
    curvature, extension = strains([list(activation)])
    u1, u2, u3 = curvature[0].T * arm.length
    return AlongArm(arm, z, np.hypot(u1, u2), u3, extension[0])


class AlongArmPlot(Plot):
    """Charts of curvature, torsion and extension that follow the arm while it moves."""

    name = "along_arm"
    label = "along the arm"
    hint = (
        "curvature κ and torsion u₃ (times L) and axial extension ζ at stations Z, in the "
        "present activation"
    )
    depends_on = ("design", "activation")

    def __init__(self, gui: GuiApi, folder: Any) -> None:
        self._curvature = Chart(gui, folder, "curvature × L")
        self._strain = Chart(gui, folder, "extension ζ")

    @staticmethod
    def compute(session: Session, check: StaleCheck) -> Iterator[AlongArm]:
        """All at once."""
        del check
        yield along_arm(session.state.design, session.state.activation)

    def show(self, result: AlongArm) -> str:
        """Draw the curves; they stay where there is no equilibrium."""
        _, z, bending, torsion, extension = result
        if not np.isfinite(extension).all():
            return "There is no equilibrium in this activation."
        self._curvature.show("Z / L", z, (_BENDING, _TORSION), (bending, torsion))
        self._strain.show("Z / L", z, (_EXTENSION, _NO_STRAIN), (extension, np.ones_like(z)))
        return f"largest κL {bending.max():.4g} · mean ζ {extension.mean():.4g}"
