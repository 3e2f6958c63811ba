"""What is printed, against what it must mean."""

from __future__ import annotations

from softreach.paper.verdict import Finding, Numbers, Verdict, judged

__all__ = ["angle", "delta3", "deltas", "radius"]


def radius(n: Numbers) -> Finding:
    """The inner radius: refused as printed, and what the ratio does to the volume."""
    volumes = ", ".join(f"{r}: {v:.3f}" for r, v in n["volumes"].items())
    words = (
        f"refused: {n['refusal']}. Read as R1 = {n['ratio']:g} R2. Exact V/L³ by ratio: {volumes}"
    )
    return Finding(words, Verdict.MISPRINT)


def deltas(n: Numbers) -> Finding:
    """δ0 and δ1 as printed."""
    worst = max(n["delta0"], n["delta1"])
    return judged(f"equal to the integrals to {worst:.0e}", worst < 1e-9)


def delta3(n: Numbers) -> Finding:
    """δ3 as printed, and with its 3 in another place."""
    words = (
        f"as printed it is off by a factor of {1 + n['delta3_least']:.3g} at least; with the 3 "
        f"before the T terms alone it equals the integral to {n['delta3_mended']:.0e}"
    )
    return Finding(words, Verdict.MISPRINT)


def angle(n: Numbers) -> Finding:
    """From which direction α is measured."""
    words = (
        f"with Appendix B and Ω = 108° the helical fibers have α = {n['helical_angle_deg']:.3g}° "
        f"and the longitudinal one {n['longitudinal_deg']:.2g}°, as section 2 has it: α is "
        "measured from the axis, not from e_Θ"
    )
    return Finding(words, Verdict.MISPRINT)
