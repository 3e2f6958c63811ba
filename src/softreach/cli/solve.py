"""`softreach solve`: every activation that puts the tip at a target."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.lengths import Lengths
from softreach.cli.options import AsJson, Design, Unit, points_in, refuse
from softreach.cli.values import WHOLE, activation_text
from softreach.support.errors import InvalidInput, counted

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator
    from softreach.inverse import Solution, Solutions

_EXACT = 1e-6  # of L: a nearer tip is at its target, as far as tips are known
_HINTS = 100  # targets out of reach that get one


def solve(
    design: Design,
    /,
    *,
    target: Annotated[
        str | None,
        Parameter(
            help="Tip position x,y,z, in m unless each has a unit: 80mm,50mm,-24cm.",
            allow_leading_hyphen=True,
        ),
    ] = None,
    targets: Annotated[
        Path | None, Parameter(help="CSV file with columns x, y, z; in m, or as x_mm, y_mm, z_mm.")
    ] = None,
    within: Annotated[
        str | None,
        Parameter(help="Distance at which a target counts as reached: 1mm, 0.005L, 0.001 (m)."),
    ] = None,
    family: Annotated[
        int | None,
        WHOLE,
        Parameter(help="With more than three free bundles: solutions for each target (1)."),
    ] = None,
    prove_least: Annotated[
        bool,
        Parameter(help="With more than three free bundles: prove that the activation is least."),
    ] = False,
    changes: Changes = UNCHANGED,
    unit: Unit = None,
    json: AsJson = False,
) -> None:
    """Find every activation that puts the tip at a target.

    Where none does, the nearest point that can be reached and a bound on its
    distance. Places are in the world: --base hanging turns the arm in it.

    Example: softreach solve minimal_trunk --target 0.2,0.1,0.6
    """
    from softreach.inverse import solve_inverse
    from softreach.inverse.request import length_in, position_in

    if (target is None) == (targets is None):
        raise InvalidInput("target", target, "given, or --targets, and not both")
    arm = design_from(design, changes)
    lengths = Lengths.of(arm, unit)
    if int((arm.input_bounds[:, 0] < arm.input_bounds[:, 1]).sum()) <= 3:
        why = "left out for a design with three free bundles or fewer: all solutions are found"
        refuse(why, family=family, prove_least=prove_least)
    if targets is None:
        points = [position_in("target", target or "", arm.length)]
    else:
        points = points_in("targets", targets, arm)
    count = 1 if family is None else family
    reach = 0.0 if within is None else length_in("within", within, arm.length)
    solutions = solve_inverse(arm, points, within=reach, family=count, prove_least=prove_least)
    hints = _hints(arm, solutions)
    if json:
        records = zip(solutions, hints, strict=True)
        console.json([{**_record(one, lengths), "hint": hint or None} for one, hint in records])
        return
    for solution, hint in zip(solutions, hints, strict=True):
        _print(solution, arm, lengths)
        if len(solution):
            _print_more(solution, arm, count, prove_least)
        if hint:
            console.line(f"  {hint}")


def _hints(arm: Manipulator, solutions: Solutions) -> list[str]:
    """Hints at what targets out of reach may mean; for the first of many."""
    from softreach.inverse import twin_hints

    hints = [""] * len(solutions)
    missed = [k for k, one in enumerate(solutions) if not len(one)][:_HINTS]
    if missed:
        found = twin_hints(arm, solutions.targets[missed])
        for k, hint in zip(missed, found, strict=True):
            hints[k] = hint
    return hints


def _record(solution: Solution, lengths: Lengths) -> dict[str, object]:
    return {
        **lengths.record("target", solution.target.tolist()),
        "status": solution.status.name.lower(),
        "activations": solution.activations.tolist(),
        **lengths.record("residuals", solution.residuals.tolist()),
        "conditions": [value if value < 1e300 else None for value in solution.conditions.tolist()],
        "margins": solution.margins.tolist(),
        **lengths.record("nearest", solution.nearest.tolist()),
        "nearest_activation": solution.nearest_activation.tolist(),
        **lengths.record("gap", solution.gap),
        **lengths.record("gap_bound", solution.gap_bound),
        "change_bound": solution.change_bound,
        "least_proved": solution.least_proved,
        "unstable": solution.unstable,
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
        strict=True,
    )
    for gamma, residual, condition, margin in rows:
        apart = lengths.text(residual, ".1e")
        quality = f"residual {apart}, condition {condition:.3g}, margin {margin:.3g}"
        console.line(f"  {activation_text(arm, gamma)}  ({quality})")
    if solution.unstable:
        left_out = counted(solution.unstable, "activation")
        console.line(f"  {left_out} left out because the arm is unstable there")
    if not len(solution):
        least = lengths.text(solution.gap_bound, ".4g")
        bound = f", proved to be at least {least}" if solution.gap_bound else ""
        gap = lengths.text(solution.gap, ".4g")
        console.line(f"  nearest {lengths.place(solution.nearest)}, {gap} away{bound}")
        console.line(f"  reached by {activation_text(arm, solution.nearest_activation)}")


def _print_more(solution: Solution, arm: Manipulator, wanted: int, prove_least: bool) -> None:
    """Remarks on the family and the proof that were asked for."""
    if len(solution) < wanted:
        known = "this one" if len(solution) == 1 else f"one of these {len(solution)}"
        console.line(f"  no others found: further searches end at {known}")
    if prove_least:
        console.line(f"  {_proof(solution, arm)}")


def _proof(solution: Solution, arm: Manipulator) -> str:
    """A line on what is proved about the size √Σγ² of the activations that reach a target."""
    from softreach.inverse.proofs import MOST_BUNDLES

    bound = f"no activation of a size √Σγ² below {solution.change_bound:.6g}{_size_unit(arm)}"
    if solution.least_proved:
        return f"proved to be the least: {bound} reaches it"
    if solution.change_bound:
        return f"proved: {bound} reaches it; whether the first is the least is open"
    if arm.loads is not None:
        return "nothing is proved: of arms under loads nothing can be"
    return f"nothing is proved: that takes {MOST_BUNDLES} free bundles or fewer, and less effort"


def _size_unit(arm: Manipulator) -> str:
    """Unit of the size of an activation."""
    units = set(arm.input_units)
    if len(units) > 1:
        return " (each over its range)"
    return "" if units == {"1"} else f" {units.pop()}"
