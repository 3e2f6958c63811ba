"""α-shapes and the reachable set."""

from __future__ import annotations

from softreach.paper.verdict import Finding, Numbers, Verdict

__all__ = ["dependence"]


def dependence(n: Numbers) -> Finding:
    """Volume over the radius of the α-shape."""
    many = list(n["volumes"])[-1]
    pairs = zip(n["radii"], n["volumes"][many], strict=True)
    values = ", ".join(f"{v:.3f} at {r:g} L" for r, v in pairs)
    words = (
        f"{int(many):,} points give {values}; the exact volume is {n['exact']:.4f} ± "
        f"{n['exact_error']:.0e} L³"
    )
    return Finding(words, Verdict.OPEN)
