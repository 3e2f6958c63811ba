"""Section 2 and appendices A to C: the minimal design (figures 1b to 1d), and misprints."""

from typing import Any

import numpy as np
from scipy.integrate import quad

from softreach.arm.actuators.fiber import ring_integrals
from softreach.arm.designs import minimal_trunk
from softreach.arm.manipulator import Manipulator
from softreach.paper.notebook import Finding, Notebook, Numbers, Settings, Verdict, judged
from softreach.plot import DesignPanel, plot_designs
from softreach.rod.kinematics import tip_positions
from softreach.rod.summary import describe
from softreach.support.arrays import Array
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
    both = plot_designs([DesignPanel("front", arm), DesignPanel("back", arm, "back")])
    notes.draw("1d", "figure_1d_design", words, both)
    # between the right-handed bundle and the longitudinal one at the tip
    angles = arm.outline(arm.length).center[0]
    apart = (angles[1] - angles[2] + np.pi) % (2 * np.pi) - np.pi
    gap = abs(apart) - arm.outline(0.0).extent[1:].mean()
    corners = (minimal_trunk(*np.radians([o, p])) for o in (0, 108) for p in (0, 3))
    most = max(_asymmetry(corner, settings.seed) for corner in corners)
    return {"narrowing": describe(arm).taper_ratio, "gap_deg": np.degrees(gap), "asymmetry": most}


def meeting(n: Numbers) -> Finding:
    gap = abs(n.gap_deg)
    return judged(f"at Z = L the edges of the sectors are {gap:.2g}° apart", gap < 1.0)


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
    return np.abs(tips * [-1, 1, 1] - others).max() / arm.length


def misprints(settings: Settings, notes: Notebook) -> dict[str, Any]:
    """Appendix A against its integrals, the inner radius, and what α is measured from."""
    accuracy, facts = settings.accuracy, describe(arm := minimal_trunk())
    ratio, angle = arm.section.inner_ratio, facts.helical_angles[1]
    errors = np.array([_errors(ratio, taper, a) for taper in _TAPERS for a in _ANGLES])
    sets = {r: reachable_set(minimal_trunk(radius_ratio=r), accuracy=accuracy) for r in _RATIOS}
    # the right-handed fiber at the base, on the surface in the plane normal to e_R (Appendix C)
    start, end = arm.outline([0.0, 1e-6]).center[:, 1]
    around, along = arm.profile.radius(0.0) * (end - start), 1e-6 / np.cos(_TAPER)
    *both, _, corrected = errors.max(axis=0)
    third = _errors(ratio, _TAPER, angle)[2]
    found: dict[str, Any] = {
        "deltas": both,
        "delta3": third,
        "delta3_corrected": corrected,
        **_rotation_errors(arm, angle),
        "refusal": _refusal(arm),
        "ratio": ratio,
        "volumes": {r: reached.volume for r, reached in sets.items()},
        "helical_angle_deg": np.degrees(angle),
        "from_axis_deg": np.degrees(np.arctan2(around, along)),
    }
    return found | {"from_circle_deg": np.degrees(np.arctan2(along, around))}


def radius(n: Numbers) -> Finding:
    volumes = ", ".join(f"{r}: {v:.3f}" for r, v in n.volumes.items())
    words = f"such a design is {n.refusal}. R2(0) is right, as it gives the 6.2-fold taper; we "
    words += f"read R1 = {n.ratio:g} R2. Exact V/L³ by ratio: {volumes}"
    return judged(words, n.refusal == "accepted", no=Verdict.MISPRINT)


def deltas(n: Numbers) -> Finding:
    worst = max(n.deltas)
    return judged(f"equal to the integrals to {worst:.0e}", worst < 1e-9)


def rotation(n: Numbers) -> Finding:
    off, limit = n.rotation, n.rotation_limit
    words = f"equals the integral to {off:.0e}, and at φ = 1e-5 the printed limit to {limit:.0e}"
    return judged(words, off < 1e-9 and limit < 1e-3)


def delta3(n: Numbers) -> Finding:
    words = f"as printed it is {1 + n.delta3:.3g} times the integral at this design's α = "
    words += f"{n.helical_angle_deg:.2g}°; with the 3 before the T terms alone it equals the "
    words += f"integral to {n.delta3_corrected:.0e} for every α and φ tried"
    wrong = n.delta3 > 1e-6 > n.delta3_corrected
    return judged(words, not wrong, no=Verdict.MISPRINT)


def angle(n: Numbers) -> Finding:
    words = f"a fiber of α = {n.helical_angle_deg:.3g}° rises at {n.from_axis_deg:.3g}° to the axis"
    words += f" and {n.from_circle_deg:.3g}° to e_Θ; α = 0 is longitudinal, as section 2 has it"
    off = abs(n.from_axis_deg - n.helical_angle_deg)
    return judged(words, off >= 1e-3, no=Verdict.MISPRINT)


def printed_deltas(ratio: float, taper: float, angle: float, nu: float) -> tuple[float, ...]:
    """δ0, δ1 = δ2 and δ3 of Appendix A for R2 = 1, as printed, and δ3 corrected [-].

    Corrected, the 3 stands before the arctangents T alone, and not before the bracket. The ratio is
    R1/R2, the taper φ ≠ 0, the angle α neither 0 nor ±φ [rad].
    """
    p, a, inner = np.tan(taper), np.tan(angle), ratio**2
    rise = (1 + inner * p**2) * (1 + a**2) / ((1 + p**2) * (1 + inner * a**2))
    delta0 = 2 * (inner - 1) * nu - 2 * (1 + nu) / (p**2 - a**2) * np.log(rise)
    cubes, root = (ratio**3 - 1) * nu, np.sqrt(complex(p**2 - a**2))

    def half(b: float, c: float) -> float:
        return 3 * (1 + nu) * (np.arctan(ratio * b) - np.arctan(b)) * c + cubes * b**3 * c

    delta1 = 2 / (p * a * (p**2 - a**2)) * (half(p, a) - p * half(a, 1.0))
    radii = np.array([-ratio, ratio, -1.0, 1.0])
    s = root * np.sqrt(1 + p**2 * radii**2)
    t = np.arctan((a + 1j * p**2 * radii) / s)
    arctangents = (t[0] + t[1] - t[2] - t[3]) * p**2
    roots, below = 6 * a * (s[3] - s[1]), p**2 * a**2 * root
    delta3, corrected = 3 * (arctangents + roots) / below, (3 * arctangents + roots) / below
    return float(delta0), float(delta1), float(delta3.real), float(corrected.real)


def _errors(ratio: float, taper: float, angle: float) -> Array:
    """Errors of `printed_deltas` against the integrals that they stand for [-]."""
    exact = ring_integrals(ratio, taper, angle, 0.5)
    true = (4 * exact.axial, 6 * exact.bending, 6 * exact.torsion, 6 * exact.torsion)
    return np.abs(np.divide(printed_deltas(ratio, taper, angle, 0.5), true) - 1)


def _rotation_errors(arm: Manipulator, angle: float) -> dict[str, float]:
    """Errors of the printed fiber rotation: from the integral, and near φ = 0 from its limit."""
    z, radius = 0.7 * arm.length, float(arm.profile.radius(0.0))
    slope, limit = np.tan(angle) * np.hypot(1, np.tan(_TAPER)), np.tan(angle) * z / radius

    def printed(taper: float) -> float:  # Θ̃2 of Appendix B [rad]
        return -np.tan(angle) / np.sin(taper) * np.log(1 - z * np.tan(taper) / radius)

    integral = quad(lambda s: slope / float(arm.profile.radius(s)), 0, z)[0]
    off = abs(printed(_TAPER) / integral - 1)
    return {"rotation": off, "rotation_limit": abs(printed(1e-5) / limit - 1)}


def _refusal(arm: Manipulator) -> str:
    """The error that a design with R1(0) = L/12 and R2(0) = L/16 raises."""
    sizes = {"length": 1.0, "outer_radius": 1 / 16, "inner_radius": 1 / 12}
    try:
        Manipulator.tapered(**sizes, actuators=arm.actuators)
    except InvalidDesign as error:
        return f"refused: {error}"
    return "accepted"
