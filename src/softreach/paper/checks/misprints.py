"""What is printed, against what it must mean."""

from __future__ import annotations

from softreach.paper.verdict import Finding, Numbers, Verdict, judged

__all__ = ["angle", "delta3", "deltas", "radius", "rotation"]


def _misprint(words: str, is_wrong: bool) -> Finding:
    return Finding(words, Verdict.MISPRINT if is_wrong else Verdict.AGREES)


def radius(n: Numbers) -> Finding:
    """The inner radius: refused as printed, and what the ratio does to the volume."""
    volumes = ", ".join(f"{r}: {v:.3f}" for r, v in n["volumes"].items())
    words = (
        f"such a design is {n['refusal']}. R2(0) is right, as it gives the 6.2-fold taper; we "
        f"read R1 = {n['ratio']:g} R2. Exact V/L³ by ratio: {volumes}"
    )
    return _misprint(words, n["refusal"] != "accepted")


def deltas(n: Numbers) -> Finding:
    """δ0 and δ1 as printed."""
    worst = max(n["delta0"], n["delta1"])
    return judged(f"equal to the integrals to {worst:.0e}", worst < 1e-9)


def rotation(n: Numbers) -> Finding:
    """The fiber rotation as printed."""
    words = (
        f"equals the integral to {n['rotation']:.0e}, and at φ = 1e-5 the printed limit to "
        f"{n['rotation_limit']:.0e}"
    )
    return judged(words, n["rotation"] < 1e-9 and n["rotation_limit"] < 1e-3)


def delta3(n: Numbers) -> Finding:
    """δ3 as printed, and with its 3 in another place."""
    words = (
        f"as printed it is {1 + n['delta3']:.3g} times the integral at this design's α = "
        f"{n['helical_angle_deg']:.2g}°; with the 3 before the T terms alone it equals the "
        f"integral to {n['delta3_corrected']:.0e} for every α and φ tried"
    )
    return _misprint(words, n["delta3"] > 1e-6 > n["delta3_corrected"])


def angle(n: Numbers) -> Finding:
    """From which direction α is measured."""
    words = (
        f"a fiber of α = {n['helical_angle_deg']:.3g}° rises at {n['from_axis_deg']:.3g}° to the "
        f"axis and {n['from_circle_deg']:.3g}° to e_Θ; α = 0 is longitudinal, as section 2 has it"
    )
    return _misprint(words, abs(n["from_axis_deg"] - n["helical_angle_deg"]) < 1e-3)
