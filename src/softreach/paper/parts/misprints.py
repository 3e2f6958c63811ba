"""What is misprinted in the paper, found by computing with it as it is printed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from softreach.cross_section import section_integrals
from softreach.designs import minimal_trunk
from softreach.errors import InvalidDesign
from softreach.paper import printed
from softreach.paper.notebook import Notebook
from softreach.paper.settings import Settings
from softreach.workspace import reachable_set

__all__ = ["misprints"]

_RATIOS = (0.6, 0.7, 0.75, 0.8, 0.9)
_TAPERS_DEG = (0.5, 1.0, 2.0, 3.0)
_ANGLES_DEG = (-20.0, 5.0, 10.0, 40.0)


def misprints(settings: Settings, folder: Path, notes: Notebook) -> None:
    """Appendix A against its integrals, the inner radius, and what α is measured from."""
    del folder
    arm = minimal_trunk()
    errors = np.array([_errors(arm.radius_ratio, t, a) for t in _TAPERS_DEG for a in _ANGLES_DEG])
    names = ("delta0", "delta1", "delta3_least", "delta3_mended")
    worst = (*errors[:, :2].max(axis=0), errors[:, 2].min(), errors[:, 3].max())
    notes.note(
        **dict(zip(names, map(float, worst), strict=True)),
        refusal=_refusal(),
        ratio=arm.radius_ratio,
        volumes={str(r): _volume(r, settings.accuracy) for r in _RATIOS},
        helical_angle_deg=float(np.degrees(arm.helical_angles[1])),
        longitudinal_deg=float(np.degrees(arm.helical_angles[2])),
    )


def _errors(ratio: float, taper_deg: float, angle_deg: float) -> tuple[float, ...]:
    """How far the printed δ0, δ1 and δ3, and the mended δ3, are from the integrals [-]."""
    taper, angle = np.radians([taper_deg, angle_deg])
    exact = section_integrals(ratio, taper, angle, 0.5)
    pairs = (
        (printed.delta0(ratio, taper, angle, 0.5), 4 * exact.axial),
        (printed.delta1(ratio, taper, angle, 0.5), 6 * exact.bending),
        (printed.delta3(ratio, taper, angle), 6 * exact.torsion),
        (printed.delta3(ratio, taper, angle, mended=True), 6 * exact.torsion),
    )
    return tuple(float(abs(found / true - 1)) for found, true in pairs)


def _refusal() -> str:
    """What a design with R1(0) = L/12 and R2(0) = L/16 is told."""
    arm = minimal_trunk()
    try:
        arm.replace(inner_radius=arm.length / 12)
    except InvalidDesign as error:
        return str(error)
    return "accepted"


def _volume(ratio: float, accuracy: float) -> float:
    return reachable_set(minimal_trunk(radius_ratio=ratio), accuracy=accuracy).volume
