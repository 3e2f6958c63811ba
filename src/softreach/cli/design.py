"""`softreach design`: what follows from a design."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from softreach.cli.inputs import AsJson, Design, RevolutionDeg, TaperDeg, design_from
from softreach.cli.output import print_rows

__all__ = ["design"]


def design(
    design: Design,
    *,
    revolution_deg: RevolutionDeg = None,
    taper_deg: TaperDeg = None,
    save: Annotated[Path | None, Parameter(help="Write the design to this TOML file.")] = None,
    json: AsJson = False,
) -> None:
    """Print what follows from a design: angles, radii, ranges of extension and curvature, warnings.

    Example: softreach design minimal_trunk --taper-deg 3
    """
    import sys

    from softreach.arm.summary import describe

    arm = design_from(design, revolution_deg, taper_deg)
    facts = describe(arm)
    if save is not None:
        arm.save(save)
    rows: dict[str, tuple[Any, str]] = {
        "bundles": (arm.bundles, ""),
        "bundle names": (list(arm.bundle_names), ""),
        "helical angle": (_degrees(facts.helical_angles), "deg"),
        "revolution": (_degrees(facts.revolutions), "deg"),
        "length": (arm.length, "m"),
        "outer radius at base": (facts.base_radius, "m"),
        "outer radius at tip": (facts.tip_radius, "m"),
        "base to tip ratio": (facts.taper_ratio, ""),
        "inner to outer radius": (facts.radius_ratio, ""),
        "extension": (list(facts.extension), ""),
        "curvature times L": (list(facts.curvature), ""),
    }
    if json:
        rows["warnings"] = (list(facts.warnings), "")
    print_rows(f"design {design}", rows, json)
    for warning in facts.warnings if not json else ():
        sys.stderr.write(f"warning: {warning}\n")


def _degrees(angles: Any) -> list[float]:
    import numpy as np

    return [round(float(angle), 9) for angle in np.degrees(angles)]
