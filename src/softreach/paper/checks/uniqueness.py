"""How many activations reach a place."""

from __future__ import annotations

import numpy as np

from softreach.paper.verdict import Finding, Numbers, judged

__all__ = ["dimension", "unique"]


def unique(n: Numbers) -> Finding:
    """The share of the volume that several activations reach, and an example."""
    share = np.array(n["share"], float)
    words = (
        f"{n['paper_share']:.2%} of the volume is reached by more than one activation at Ω = 108°, "
        f"φ = 2°, up to {n['worst']:.1%} at Ω = {n['revolution_deg']:.4g}°, "
        f"φ = {n['taper_deg']:.3g}°; less than 0.1 % in {int((share < 1e-3).sum())} of "
        f"{share.size} designs. {_example(n)}"
    )
    alone = len(n["activations"]) < 2
    return judged(words, alone, n["worst"] < 0.1)


def _example(n: Numbers) -> str:
    if len(n["activations"]) < 2:
        return "No place with two activations was found"
    rows = [", ".join(f"{g:.3f}" for g in row) for row in n["activations"]]
    tip = ", ".join(f"{x:.3f}" for x in n["tip"])
    return f"In the latter design γ = ({'); ('.join(rows)}) all reach ({tip}) m"


def dimension(n: Numbers) -> Finding:
    """What two fibers and one reach."""
    words = (
        f"two fibers sweep a surface of {n['area']:.3f} L², one fiber a curve of "
        f"{n['curve']:.3f} L (of the minimal design, in the order of its fibers)"
    )
    return judged(words, min(n["area"], n["curve"]) > 1e-6)
