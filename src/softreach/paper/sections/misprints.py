"""Misprints of the paper, found by computing with it as it is printed."""

from __future__ import annotations

import numpy as np

from softreach.arm.actuators.ring_integrals import ring_integrals
from softreach.arm.designs import minimal_trunk
from softreach.arm.manipulator import Manipulator
from softreach.paper import printed
from softreach.paper.claims import Finding, Numbers, Verdict, judged
from softreach.paper.notebook import Notebook, Settings
from softreach.rod.rods import as_tip_map
from softreach.rod.summary import describe
from softreach.support.errors import InvalidDesign
from softreach.workspace import reachable_set

_RATIOS = (0.6, 0.7, 0.75, 0.8, 0.9)
_TAPERS = tuple(np.radians([0.5, 1.0, 2.0, 3.0]))
_ANGLES = tuple(np.radians([-20.0, 5.0, 10.0, 40.0]))


def misprints(settings: Settings, notes: Notebook) -> None:
    """Appendix A against its integrals, the inner radius, and what α is measured from."""
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


def radius(n: Numbers) -> Finding:
    volumes = ", ".join(f"{r}: {v:.3f}" for r, v in n["volumes"].items())
    words = (
        f"such a design is {n['refusal']}. R2(0) is right, as it gives the 6.2-fold taper; we "
        f"read R1 = {n['ratio']:g} R2. Exact V/L³ by ratio: {volumes}"
    )
    return _misprint(words, n["refusal"] != "accepted")


def deltas(n: Numbers) -> Finding:
    worst = max(n["delta0"], n["delta1"])
    return judged(f"equal to the integrals to {worst:.0e}", worst < 1e-9)


def rotation(n: Numbers) -> Finding:
    words = (
        f"equals the integral to {n['rotation']:.0e}, and at φ = 1e-5 the printed limit to "
        f"{n['rotation_limit']:.0e}"
    )
    return judged(words, n["rotation"] < 1e-9 and n["rotation_limit"] < 1e-3)


def delta3(n: Numbers) -> Finding:
    words = (
        f"as printed it is {1 + n['delta3']:.3g} times the integral at this design's α = "
        f"{n['helical_angle_deg']:.2g}°; with the 3 before the T terms alone it equals the "
        f"integral to {n['delta3_corrected']:.0e} for every α and φ tried"
    )
    return _misprint(words, n["delta3"] > 1e-6 > n["delta3_corrected"])


def angle(n: Numbers) -> Finding:
    words = (
        f"a fiber of α = {n['helical_angle_deg']:.3g}° rises at {n['from_axis_deg']:.3g}° to the "
        f"axis and {n['from_circle_deg']:.3g}° to e_Θ; α = 0 is longitudinal, as section 2 has it"
    )
    return _misprint(words, abs(n["from_axis_deg"] - n["helical_angle_deg"]) < 1e-3)


def _of_minimal_trunk() -> tuple[float, float, float]:
    """Its taper φ [rad], R1/R2 [-] and the helical angle of its right-handed fiber [rad]."""
    facts, taper = describe(minimal_trunk()), np.radians(2)
    return taper, facts.radius_ratio, float(facts.helical_angles[1])


def _rotation(arm: Manipulator, taper: float, angle: float) -> dict[str, float]:
    """Errors of the printed fiber rotation: from the integral, and near φ = 0 from its limit."""
    from scipy.integrate import quad

    rod = as_tip_map(arm)
    z, radius = 0.7 * rod.length, describe(arm).base_radius
    slope = np.tan(angle) * np.hypot(1, np.tan(taper))
    integral = quad(lambda s: slope / float(rod.radius(s)), 0, z)[0]
    almost = printed.rotation(radius, 1e-5, angle, z)
    rotation = printed.rotation(radius, taper, angle, z)
    limit = np.tan(angle) * z / radius
    return {
        "rotation": float(abs(rotation / integral - 1)),
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
    """Errors of the printed δ0, δ1 and δ3, and of the corrected δ3, against the integrals [-]."""
    exact = ring_integrals(ratio, taper, angle, 0.5)
    pairs = (
        (printed.delta0(ratio, taper, angle, 0.5), 4 * exact.axial),
        (printed.delta1(ratio, taper, angle, 0.5), 6 * exact.bending),
        (printed.delta3(ratio, taper, angle), 6 * exact.torsion),
        (printed.delta3(ratio, taper, angle, corrected=True), 6 * exact.torsion),
    )
    return tuple(float(abs(value / true - 1)) for value, true in pairs)


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


def _misprint(words: str, is_wrong: bool) -> Finding:
    return Finding(words, Verdict.MISPRINT if is_wrong else Verdict.AGREES)
