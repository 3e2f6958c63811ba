"""The design: its angles, radii and symmetry."""

from __future__ import annotations

from softreach.paper.verdict import Finding, Numbers, judged

__all__ = ["meeting", "narrowing", "symmetry"]


def meeting(n: Numbers) -> Finding:
    """Where the fibers are at the tip."""
    words = f"at Z = L the edges of the sectors are {abs(n['gap_deg']):.2g}° apart"
    return judged(words, abs(n["gap_deg"]) < 1.0)


def narrowing(n: Numbers) -> Finding:
    """How much the radius shrinks."""
    return judged(f"{n['narrowing']:.2f}-fold", round(n["narrowing"], 1) == 6.2)


def symmetry(n: Numbers) -> Finding:
    """Mirror images."""
    words = f"exchanging the helical activations mirrors the tip to within {n['asymmetry']:.1e} L"
    return judged(words, n["asymmetry"] < 1e-9)
