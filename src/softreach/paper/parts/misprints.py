"""What is misprinted in the paper, found by computing with it as it is printed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from softreach.arm.actuators.ring_integrals import ring_integrals
from softreach.arm.designs import minimal_trunk
from softreach.arm.manipulator import Manipulator
from softreach.arm.summary import describe
from softreach.errors import InvalidDesign
from softreach.paper import printed
from softreach.paper.notebook import Notebook
from softreach.paper.settings import Settings
from softreach.rod.tip_map import tip_map
from softreach.workspace import reachable_set

__all__ = ["misprints"]

_RATIOS = (0.6, 0.7, 0.75, 0.8, 0.9)
_TAPERS = tuple(np.radians([0.5, 1.0, 2.0, 3.0]))
_ANGLES = tuple(np.radians([-20.0, 5.0, 10.0, 40.0]))


def misprints(settings: Settings, folder: Path, notes: Notebook) -> None:
    """Appendix A against its integrals, the inner radius, and what α is measured from."""
    del folder
    arm, (taper, ratio, angle) = minimal_trunk(), _of_minimal_trunk()
    pairs = [(taper, angle) for taper in _TAPERS for angle in _ANGLES]
    errors = np.array([_errors(ratio, *pair) for pair in pairs])
    own = _errors(ratio, taper, angle)
    from_axis, from_circle = np.degrees(_inclination(arm, taper))
    notes.note(
        delta0=float(errors[:, 0].max()),
        delta1=float(errors[:, 1].max()),
        delta3=own[2],
        delta3_corrected=float(errors[:, 3].max()),
        **_rotation(arm, taper, angle),
        refusal=_refusal(),
        ratio=ratio,
        volumes={str(r): _volume(r, settings.accuracy) for r in _RATIOS},
        helical_angle_deg=float(np.degrees(angle)),
        from_axis_deg=float(from_axis),
        from_circle_deg=float(from_circle),
    )


def _of_minimal_trunk() -> tuple[float, float, float]:
    """Its taper φ [rad], R1/R2 [-] and the helical angle of its right-handed fiber [rad]."""
    facts, taper = describe(minimal_trunk()), np.radians(2)
    return taper, facts.radius_ratio, float(facts.helical_angles[1])


def _rotation(arm: Manipulator, taper: float, angle: float) -> dict[str, float]:
    """How far the printed fiber rotation is from the integral, and near φ = 0 from its limit."""
    from scipy.integrate import quad

    rod = tip_map(arm)
    z, radius = 0.7 * rod.length, describe(arm).base_radius
    slope = np.tan(angle) * np.hypot(1, np.tan(taper))
    integral = quad(lambda s: slope / float(rod.radius(s)), 0, z)[0]
    almost = printed.rotation(radius, 1e-5, angle, z)
    found = printed.rotation(radius, taper, angle, z)
    limit = np.tan(angle) * z / radius
    return {
        "rotation": float(abs(found / integral - 1)),
        "rotation_limit": float(abs(almost / limit - 1)),
    }


def _inclination(arm: Manipulator, taper: float) -> tuple[float, float]:
    """Angle of the right-handed fiber at the base to the axis and to e_Θ, on the surface [rad].

    In the plane normal to e_R, as Appendix C has it.
    """
    step = 1e-6 * arm.length
    start, end = arm.outline([0.0, step]).center[:, 1]
    around, along = describe(arm).base_radius * (end - start), step / np.cos(taper)
    return float(np.arctan2(around, along)), float(np.arctan2(along, around))


def _errors(ratio: float, taper: float, angle: float) -> tuple[float, ...]:
    """How far the printed δ0, δ1 and δ3, and the corrected δ3, are from the integrals [-]."""
    exact = ring_integrals(ratio, taper, angle, 0.5)
    pairs = (
        (printed.delta0(ratio, taper, angle, 0.5), 4 * exact.axial),
        (printed.delta1(ratio, taper, angle, 0.5), 6 * exact.bending),
        (printed.delta3(ratio, taper, angle), 6 * exact.torsion),
        (printed.delta3(ratio, taper, angle, corrected=True), 6 * exact.torsion),
    )
    return tuple(float(abs(found / true - 1)) for found, true in pairs)


def _refusal() -> str:
    """The error that a design with R1(0) = L/12 and R2(0) = L/16 raises."""
    arm = minimal_trunk()
    try:
        Manipulator.tapered(
            length=1.0, outer_radius=1 / 16, inner_radius=1 / 12, actuators=arm.actuators
        )
    except InvalidDesign as error:
        return f"refused: {error}"
    return "accepted"


def _volume(ratio: float, accuracy: float) -> float:
    return reachable_set(minimal_trunk(radius_ratio=ratio), accuracy=accuracy).volume
