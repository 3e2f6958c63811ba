"""What is misprinted in the paper, found by computing with it as it is printed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from softreach.cross_section import section_integrals
from softreach.designs import minimal_trunk
from softreach.errors import InvalidDesign
from softreach.manipulator import Manipulator
from softreach.paper import printed
from softreach.paper.notebook import Notebook
from softreach.paper.settings import Settings
from softreach.workspace import reachable_set

__all__ = ["misprints"]

_RATIOS = (0.6, 0.7, 0.75, 0.8, 0.9)
_TAPERS = tuple(np.radians([0.5, 1.0, 2.0, 3.0]))
_ANGLES = tuple(np.radians([-20.0, 5.0, 10.0, 40.0]))


def misprints(settings: Settings, folder: Path, notes: Notebook) -> None:
    """Appendix A against its integrals, the inner radius, and what α is measured from."""
    del folder
    arm = minimal_trunk()
    pairs = [(taper, angle) for taper in _TAPERS for angle in _ANGLES]
    errors = np.array([_errors(arm.radius_ratio, *pair) for pair in pairs])
    own = _errors(arm.radius_ratio, arm.taper, float(arm.helical_angles[1]))
    from_axis, from_circle = np.degrees(_inclination(arm))
    notes.note(
        delta0=float(errors[:, 0].max()),
        delta1=float(errors[:, 1].max()),
        delta3=own[2],
        delta3_mended=float(errors[:, 3].max()),
        **_rotation(arm),
        refusal=_refusal(),
        ratio=arm.radius_ratio,
        volumes={str(r): _volume(r, settings.accuracy) for r in _RATIOS},
        helical_angle_deg=float(np.degrees(arm.helical_angles[1])),
        from_axis_deg=float(from_axis),
        from_circle_deg=float(from_circle),
    )


def _rotation(arm: Manipulator) -> dict[str, float]:
    """How far the printed fiber rotation is from the integral, and near φ = 0 from its limit."""
    from scipy.integrate import quad

    z, angle = 0.7 * arm.length, float(arm.helical_angles[1])
    slope = np.tan(angle) * np.hypot(1, np.tan(arm.taper))
    integral = quad(lambda s: slope / float(arm.radius(s)), 0, z)[0]
    almost = printed.rotation(arm.outer_radius, 1e-5, angle, z)
    found = printed.rotation(arm.outer_radius, arm.taper, angle, z)
    limit = np.tan(angle) * z / arm.outer_radius
    return {
        "rotation": float(abs(found / integral - 1)),
        "rotation_limit": float(abs(almost / limit - 1)),
    }


def _inclination(arm: Manipulator) -> tuple[float, float]:
    """Angle of the right-handed fiber at the base to the axis and to e_Θ, on the surface [rad].

    In the plane normal to e_R, as Appendix C has it.
    """
    step = 1e-6 * arm.length
    start, end = arm.fiber_angles(np.array([0.0, step]))[:, 1]
    around, along = arm.outer_radius * (end - start), step / np.cos(arm.taper)
    return float(np.arctan2(around, along)), float(np.arctan2(along, around))


def _errors(ratio: float, taper: float, angle: float) -> tuple[float, ...]:
    """How far the printed δ0, δ1 and δ3, and the mended δ3, are from the integrals [-]."""
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
        return f"refused: {error}"
    return "accepted"


def _volume(ratio: float, accuracy: float) -> float:
    return reachable_set(minimal_trunk(radius_ratio=ratio), accuracy=accuracy).volume
