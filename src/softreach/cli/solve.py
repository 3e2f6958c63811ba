"""`softreach solve`: every activation that puts the tip at a target."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from softreach.cli.changes import UNCHANGED, Changes, Signed, design_from
from softreach.cli.console import console
from softreach.cli.lengths import Lengths
from softreach.cli.options import AsJson, Design, Unit, points_in, refuse
from softreach.cli.values import Whole, activation_text
from softreach.support.errors import NotPossible

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator
    from softreach.inverse import Solution

_EXACT = 1e-6  # of L, the error of tips


def solve(
    design: Design,
    /,
    *,
    target: Signed = None,
    targets: Path | None = None,
    within: str | None = None,
    family: Whole | None = None,
    changes: Changes = UNCHANGED,
    unit: Unit = None,
    json: AsJson = False,
) -> None:
    """Find every activation that puts the tip at a target.

    Where none does, the nearest point that can be reached and a bound on its
    distance. Places are in the world: --base hanging turns the arm in it.

    Example: softreach solve minimal_trunk --target 0.2,0.1,0.6

    Args:
        target: Tip position x,y,z, in m unless each has a unit: 80mm,50mm,-24cm.
        targets: CSV file with columns x, y, z; in m, or as x_mm, y_mm, z_mm.
        within: Distance at which a target counts as reached: 1mm, 0.005L, 0.001 (m).
        family: With more than three free bundles: solutions for each target (1).
    """
    from softreach.inverse import solve_inverse
    from softreach.inverse.request import length_in, position_in

    if (target is None) == (targets is None):
        raise NotPossible("give either --target or --targets")
    arm = design_from(design, changes)
    lengths = Lengths.of(arm, unit)
    if int((arm.input_bounds[:, 0] < arm.input_bounds[:, 1]).sum()) <= 3:
        refuse("on up to three free bundles, where all solutions are found", family=family)
    if targets is None:
        points = [position_in("target", target or "", arm.length)]
    else:
        points = points_in("targets", targets, arm)
    count = 1 if family is None else family
    reach = 0.0 if within is None else length_in("within", within, arm.length)
    solutions = solve_inverse(arm, points, within=reach, family=count)
    if json:
        console.json([_record(one, lengths) for one in solutions])
        return
    for solution in solutions:
        _print(solution, arm, lengths)
        if 0 < len(solution) < count:
            known = "this one" if len(solution) == 1 else f"one of these {len(solution)}"
            console.line(f"  no others found: further searches end at {known}")


def _record(solution: Solution, lengths: Lengths) -> dict[str, object]:
    return {
        **lengths.record("target", solution.target.tolist()),
        "status": solution.status.name.lower(),
        "activations": solution.activations.tolist(),
        **lengths.record("residuals", solution.residuals.tolist()),
        "conditions": [value if value < 1e300 else None for value in solution.conditions.tolist()],
        "margins": solution.margins.tolist(),
        "from_rest": (solution.sheets == 0).tolist(),
        **lengths.record("nearest", solution.nearest.tolist()),
        "nearest_activation": solution.nearest_activation.tolist(),
        **lengths.record("gap", solution.gap),
        **lengths.record("gap_bound", solution.gap_bound),
    }


def _print(solution: Solution, arm: Manipulator, lengths: Lengths) -> None:
    status = solution.status.name.lower().replace("_", " ")
    if len(solution) and solution.gap > _EXACT * arm.length:
        status += f" within {lengths.text(solution.gap, '.4g')}"
    console.line(f"target {lengths.place(solution.target)}: {status}")
    rows = zip(
        solution.activations,
        solution.residuals,
        solution.conditions,
        solution.margins,
        solution.sheets,
        strict=True,
    )
    for gamma, residual, condition, margin, sheet in rows:
        apart = lengths.text(residual, ".1e")
        quality = f"residual {apart}, condition {condition:.3g}, margin {margin:.3g}"
        quality = quality if gamma.size else f"residual {apart}"
        quality += ", in a posture that it does not take straight from rest" if sheet else ""
        console.line(f"  {activation_text(arm, gamma)}  ({quality})")
    if not len(solution):
        least = lengths.text(solution.gap_bound, ".4g")
        bound = f", proved to be at least {least}" if solution.gap_bound else ""
        gap = lengths.text(solution.gap, ".4g")
        console.line(f"  nearest {lengths.place(solution.nearest)}, {gap} away{bound}")
        console.line(f"  reached by {activation_text(arm, solution.nearest_activation)}")
