"""How many activations reach a place."""

from __future__ import annotations

import numpy as np

from softreach.paper.verdict import Finding, Numbers, judged

__all__ = ["dimension", "unique"]


def unique(n: Numbers) -> Finding:
    """The share of the volume that several activations reach."""
    share = np.array(n["share"], float)
    activations = "; ".join(
        "(" + ", ".join(f"{g:.3f}" for g in row) + ")" for row in n["activations"]
    )
    tip = ", ".join(f"{x:.3f}" for x in n["tip"])
    words = (
        f"{n['paper_share']:.2%} of the volume is reached by more than one activation at Ω = 108°, "
        f"φ = 2°, up to {n['worst']:.1%} at Ω = {n['revolution_deg']:.4g}°, "
        f"φ = {n['taper_deg']:.3g}°; below 0.1 % in {int((share < 1e-3).sum())} of {share.size} "
        f"designs. There γ = {activations} all reach ({tip}) m"
    )
    return judged(words, n["worst"] < 1e-6, n["worst"] < 0.1)


def dimension(n: Numbers) -> Finding:
    """What two fibers and one reach."""
    words = f"dimension {n['dimension_of_two']} for two fibers, {n['dimension_of_one']} for one"
    return judged(words, n["dimension_of_two"] == 2 and n["dimension_of_one"] == 1)
