"""`softreach check`: a design against what it is for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.lengths import Lengths
from softreach.cli.options import AsJson, Design, Out, Overwrite, Unit, View, check_picture
from softreach.cli.values import Number

if TYPE_CHECKING:
    from softreach.requirements import Check, Finding

EXIT = {"met": 0, "missed": 1, "undecided": 3}
"""Verdict -> exit code; 2 is that of wrong input."""


def check(
    design: Design,
    needs: Path,
    /,
    *,
    accuracy: Number = 1e-2,
    changes: Changes = UNCHANGED,
    out: Out = None,
    view: View = None,
    overwrite: Overwrite = False,
    unit: Unit = None,
    json: AsJson = False,
) -> int:
    """Check a design against requirements: met or missed, and by how much.

    Places to reach, regions to stay in or to avoid, payloads, limits, measures;
    for what is missed, how far, which bounds hold the arm back, and what it would
    take. A margin that is smaller than its own error is undecided. The exit code
    is 0 if all is met, 1 if something is missed, and 3 if something is undecided.

    Example: softreach check arm.toml needs.toml --out check.png

    Args:
        needs: Requirements (.toml).
        accuracy: Accuracy of coverages and volumes.
        out: Draw the arm at the places (.png .pdf .svg).
    """
    from softreach.requirements import Requirements
    from softreach.requirements import check as checked
    from softreach.support import progress

    arm = design_from(design, changes)
    lengths = Lengths.of(arm, unit)
    check_picture(out, overwrite, view=view)
    requirements = Requirements.load(needs, length=arm.length)
    shown = arm.replace(display_unit=lengths.unit.name)
    with progress.bar("checking", None) as step:
        result = checked(shown, requirements, accuracy=accuracy, progress=step)
    if json:
        console.json(_record(result, lengths))
    else:
        console.line(result)
    if out is not None:
        from softreach.plot import plot_check, save_figure

        axes: Any = plot_check(result, view=view or "oblique", unit=lengths.unit)
        save_figure(axes.figure, out, overwrite=overwrite)
    return EXIT[result.verdict]


def finding_record(finding: Finding) -> dict[str, object]:
    """A finding for machines."""
    return {**vars(finding), "met": finding.met}


def _record(result: Check, lengths: Lengths) -> dict[str, object]:
    return {
        "met": result.met,
        "verdict": result.verdict,
        "excess": result.excess,
        "findings": [finding_record(finding) for finding in result.findings],
        "payloads_kg": list(result.payloads),
        **lengths.record("places", result.places.tolist()),
        **lengths.record("gaps", result.gaps.tolist()),
        "poses": result.poses.tolist(),
        "effort": result.effort.tolist(),
        "coverages": [coverage._asdict() for coverage in result.coverages],
    }
