"""Section 2 and appendices A to C: the minimal design (figures 1b to 1d), and misprints."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import quad

from softreach.arm.actuators.fiber import ring_integrals
from softreach.arm.designs import minimal_trunk
from softreach.arm.manipulator import Manipulator
from softreach.paper.notebook import Finding, Notebook, Numbers, Settings, Verdict, judged
from softreach.plot import DesignPanel, plot_designs
from softreach.rod.kinematics import tip_positions
from softreach.rod.rods import as_tip_map
from softreach.rod.summary import describe
from softreach.support.errors import InvalidDesign
from softreach.workspace import reachable_set

_RATIOS = (0.6, 0.7, 0.75, 0.8, 0.9)
_TAPERS = np.radians([0.5, 1.0, 2.0, 3.0])
_ANGLES = np.radians([-20.0, 5.0, 10.0, 40.0])
_TAPER = np.radians(2)  # φ of the minimal trunk


def model(settings: Settings, notes: Notebook) -> dict[str, Any]:
    """The design, its angles, its symmetry."""
    arm = minimal_trunk(taper=np.radians(3))
    words = "A helical fiber of the tapered arm, and its cross-section at the base and halfway."
    helix = [DesignPanel("Ω = 108°, left", arm, "left", [1])]
    figure = plot_designs(helix, stations_over_length=(0.0, 0.5), width=1.8)
    notes.draw("1b", "figure_1b_fiber", words, figure)
    words = "The three architectures alone, each above its bundle's place in the cross-section."
    sides = enumerate(("back", "back", "front"))
    singles = [DesignPanel(f"{arm.bundle_names[k]}, {side}", arm, side, [k]) for k, side in sides]
    notes.draw("1c", "figure_1c_architectures", words, plot_designs(singles))
    words = "The minimal design from the front and the back, above its cross-section at the base."
    both = [DesignPanel("front", arm), DesignPanel("back", arm, "back")]
    notes.draw("1d", "figure_1d_design", words, plot_designs(both))
    facts = describe(arm)
    # between the right-handed bundle and the longitudinal one at the tip
    angles = arm.outline(arm.length).center[0]
    apart = (angles[1] - angles[2] + np.pi) % (2 * np.pi) - np.pi
    gap = abs(apart) - arm.outline(0.0).extent[1:].mean()
    corners = [minimal_trunk(np.radians(o), np.radians(p)) for o in (0, 108) for p in (0, 3)]
    return {
        "narrowing": facts.taper_ratio,
        "helical_angle_deg": float(np.degrees(facts.helical_angles[1])),
        "gap_deg": float(np.degrees(gap)),
        "asymmetry": max(_asymmetry(corner, settings.seed) for corner in corners),
    }


def meeting(n: Numbers) -> Finding:
    words = f"at Z = L the edges of the sectors are {abs(n.gap_deg):.2g}° apart"
    return judged(words, abs(n.gap_deg) < 1.0)


def narrowing(n: Numbers) -> Finding:
    return judged(f"{n.narrowing:.2f}-fold", round(n.narrowing, 1) == 6.2)


def symmetry(n: Numbers) -> Finding:
    words = f"exchanging the helical activations mirrors the tip to within {n.asymmetry:.1e} L"
    return judged(words, n.asymmetry < 1e-9)


def _asymmetry(arm: Manipulator, seed: int) -> float:
    """Distance of tips of exchanged helical activations from mirror images [L]."""
    low, high = arm.bounds.T
    gamma = np.random.default_rng(seed).uniform(low, high, (2_000, 3))
    tips, others = tip_positions(arm, gamma), tip_positions(arm, gamma[:, [1, 0, 2]])
    return float(np.abs(tips * [-1, 1, 1] - others).max() / arm.length)


def misprints(settings: Settings, notes: Notebook) -> dict[str, Any]:
    """Appendix A against its integrals, the inner radius, and what α is measured from."""
    arm, accuracy = minimal_trunk(), settings.accuracy
    facts = describe(arm)
    ratio, angle = facts.radius_ratio, float(facts.helical_angles[1])
    errors = np.array([_errors(ratio, taper, a) for taper in _TAPERS for a in _ANGLES])
    sets = {r: reachable_set(minimal_trunk(radius_ratio=r), accuracy=accuracy) for r in _RATIOS}
    # the right-handed fiber at the base, on the surface in the plane normal to e_R (Appendix C)
    step = 1e-6 * arm.length
    start, end = arm.outline([0.0, step]).center[:, 1]
    around, along = facts.base_radius * (end - start), step / np.cos(_TAPER)
    return {
        "delta0": errors[:, 0].max(),
        "delta1": errors[:, 1].max(),
        "delta3": _errors(ratio, _TAPER, angle)[2],
        "delta3_corrected": errors[:, 3].max(),
        **_rotation_errors(arm, angle),
        "refusal": _refusal(arm),
        "ratio": ratio,
        "volumes": {r: reached.volume for r, reached in sets.items()},
        "helical_angle_deg": np.degrees(angle),
        "from_axis_deg": np.degrees(np.arctan2(around, along)),
        "from_circle_deg": np.degrees(np.arctan2(along, around)),
    }


def radius(n: Numbers) -> Finding:
    volumes = ", ".join(f"{r}: {v:.3f}" for r, v in n.volumes.items())
    words = (
        f"such a design is {n.refusal}. R2(0) is right, as it gives the 6.2-fold taper; we "
        f"read R1 = {n.ratio:g} R2. Exact V/L³ by ratio: {volumes}"
    )
    return _misprint(words, n.refusal != "accepted")


def deltas(n: Numbers) -> Finding:
    worst = max(n.delta0, n.delta1)
    return judged(f"equal to the integrals to {worst:.0e}", worst < 1e-9)


def rotation(n: Numbers) -> Finding:
    words = (
        f"equals the integral to {n.rotation:.0e}, and at φ = 1e-5 the printed limit to "
        f"{n.rotation_limit:.0e}"
    )
    return judged(words, n.rotation < 1e-9 and n.rotation_limit < 1e-3)


def delta3(n: Numbers) -> Finding:
    words = (
        f"as printed it is {1 + n.delta3:.3g} times the integral at this design's α = "
        f"{n.helical_angle_deg:.2g}°; with the 3 before the T terms alone it equals the "
        f"integral to {n.delta3_corrected:.0e} for every α and φ tried"
    )
    return _misprint(words, n.delta3 > 1e-6 > n.delta3_corrected)


def angle(n: Numbers) -> Finding:
    words = (
        f"a fiber of α = {n.helical_angle_deg:.3g}° rises at {n.from_axis_deg:.3g}° to the "
        f"axis and {n.from_circle_deg:.3g}° to e_Θ; α = 0 is longitudinal, as section 2 has it"
    )
    return _misprint(words, abs(n.from_axis_deg - n.helical_angle_deg) < 1e-3)


def _misprint(words: str, is_wrong: bool) -> Finding:
    return Finding(words, Verdict.MISPRINT if is_wrong else Verdict.AGREES)


def printed_deltas(ratio: float, taper: float, angle: float, nu: float) -> tuple[float, ...]:
    """δ0, δ1 = δ2 and δ3 of Appendix A for R2 = 1, as printed, and δ3 corrected [-].

    Corrected, the 3 stands before the arctangents T alone, and not before the bracket. The ratio is
    R1/R2, the taper φ ≠ 0, the angle α neither 0 nor ±φ [rad].
    """
    p, a, inner = np.tan(taper), np.tan(angle), ratio**2
    rise = (1 + inner * p**2) * (1 + a**2) / ((1 + p**2) * (1 + inner * a**2))
    delta0 = 2 * (inner - 1) * nu - 2 * (1 + nu) / (p**2 - a**2) * np.log(rise)

    cubes = (ratio**3 - 1) * nu

    def half(b: float, c: float) -> float:
        return 3 * (1 + nu) * (np.arctan(ratio * b) - np.arctan(b)) * c + cubes * b**3 * c

    delta1 = 2 / (p * a * (p**2 - a**2)) * (half(p, a) - p * half(a, 1.0))
    root = np.sqrt(complex(p**2 - a**2))

    def s(radius: float) -> complex:
        return root * np.sqrt(1 + p**2 * radius**2)

    def t(radius: float) -> complex:
        return np.arctan((a + 1j * p**2 * radius) / s(radius))

    arctangents = (t(-ratio) + t(ratio) - t(-1) - t(1)) * p**2
    roots = 6 * a * (s(1) - s(ratio))
    below = p**2 * a**2 * root
    delta3, corrected = 3 * (arctangents + roots) / below, (3 * arctangents + roots) / below
    return float(delta0), float(delta1), float(delta3.real), float(corrected.real)


def _errors(ratio: float, taper: float, angle: float) -> list[float]:
    """Errors of `printed_deltas` against the integrals that they stand for [-]."""
    exact = ring_integrals(ratio, taper, angle, 0.5)
    true = (4 * exact.axial, 6 * exact.bending, 6 * exact.torsion, 6 * exact.torsion)
    deltas = printed_deltas(ratio, taper, angle, 0.5)
    return [float(abs(value / known - 1)) for value, known in zip(deltas, true, strict=True)]


def _rotation_errors(arm: Manipulator, angle: float) -> dict[str, float]:
    """Errors of the printed fiber rotation: from the integral, and near φ = 0 from its limit."""
    rod = as_tip_map(arm)
    z, radius = 0.7 * rod.length, describe(arm).base_radius
    slope, limit = np.tan(angle) * np.hypot(1, np.tan(_TAPER)), np.tan(angle) * z / radius

    def printed(taper: float) -> float:  # Θ̃2 of Appendix B [rad]
        return -np.tan(angle) / np.sin(taper) * np.log(1 - z * np.tan(taper) / radius)

    integral = quad(lambda s: slope / float(rod.radius(s)), 0, z)[0]
    return {
        "rotation": abs(printed(_TAPER) / integral - 1),
        "rotation_limit": abs(printed(1e-5) / limit - 1),
    }


def _refusal(arm: Manipulator) -> str:
    """The error that a design with R1(0) = L/12 and R2(0) = L/16 raises."""
    radii = {"outer_radius": 1 / 16, "inner_radius": 1 / 12}
    try:
        Manipulator.tapered(length=1.0, **radii, actuators=arm.actuators)
    except InvalidDesign as error:
        return f"refused: {error}"
    return "accepted"
