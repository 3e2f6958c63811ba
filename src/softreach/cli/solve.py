"""`softreach solve`: every activation that puts the tip at a target."""

from __future__ import annotations

import json as json_format
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import AsJson, Design, design_from, points_of
from softreach.cli.numbers import WHOLE
from softreach.support.errors import InvalidInput, counted

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator
    from softreach.inverse import Solution

__all__ = ["solve"]


def solve(
    design: Design,
    *,
    target: Annotated[
        str | None, Parameter(help="Tip position x,y,z [m].", allow_leading_hyphen=True)
    ] = None,
    targets: Annotated[Path | None, Parameter(help="CSV file with columns x, y, z [m].")] = None,
    family: Annotated[
        int, WHOLE, Parameter(help="With more than three free bundles: solutions for each target.")
    ] = 1,
    prove_least: Annotated[
        bool,
        Parameter(
            negative="",
            help="With more than three free bundles: say whether least activation is proved.",
        ),
    ] = False,
    changes: Changes = UNCHANGED,
    json: AsJson = False,
) -> None:
    """Every activation that reaches a target, or the nearest point that can be reached."""
    from softreach.inverse import solve_inverse

    if (target is None) == (targets is None):
        raise InvalidInput("target", target, "given, or --targets, and not both")
    arm = design_from(design, changes)
    points = points_of(target, targets)
    solutions = solve_inverse(arm, points, family=family, prove_least=prove_least)
    if json:
        json_format.dump([_as_json(solution) for solution in solutions], sys.stdout)
        sys.stdout.write("\n")
        return
    for solution in solutions:
        sys.stdout.write("\n".join(_lines(solution, arm)) + "\n")


def _as_json(solution: Solution) -> dict[str, object]:
    return {
        "target_m": solution.target.tolist(),
        "status": solution.status.name.lower(),
        "activations": solution.activations.tolist(),
        "residuals_m": solution.residuals.tolist(),
        "conditions": [value if value < 1e300 else None for value in solution.conditions.tolist()],
        "margins": solution.margins.tolist(),
        "nearest_m": solution.nearest.tolist(),
        "nearest_activation": solution.nearest_activation.tolist(),
        "gap_m": solution.gap,
        "gap_bound_m": solution.gap_bound,
        "change_bound": solution.change_bound,
        "least_proved": solution.least_proved,
        "unstable": solution.unstable,
    }


def _activation(arm: Manipulator, values: Iterable[float]) -> str:
    """Activations with their names and units."""
    return ", ".join(
        f"{name} {value:.6f}" if unit == "1" else f"{name} {value:.6g} {unit}"
        for name, value, unit in zip(arm.bundle_names, values, arm.bundle_units, strict=True)
    )


def _size_unit(arm: Manipulator) -> str:
    """What the size of an activation is in."""
    units = set(arm.bundle_units)
    if len(units) > 1:
        return " (each over its range)"
    return "" if units == {"1"} else f" {units.pop()}"


def _lines(solution: Solution, arm: Manipulator) -> list[str]:
    at = ", ".join(f"{x:.6g}" for x in solution.target)
    lines = [f"target ({at}) m: {solution.status.name.lower().replace('_', ' ')}"]
    for gamma, residual, condition, margin in zip(
        solution.activations,
        solution.residuals,
        solution.conditions,
        solution.margins,
        strict=True,
    ):
        quality = f"residual {residual:.1e} m, condition {condition:.3g}, margin {margin:.3g}"
        lines.append(f"  {_activation(arm, gamma)}  ({quality})")
    if solution.unstable:
        left = counted(solution.unstable, "activation")
        lines.append(f"  {left} left out whose equilibrium there is unstable")
    if solution.least_proved:
        lines.append("  proved to be the least")
    elif solution.change_bound:
        least = f"{solution.change_bound:.6g}{_size_unit(arm)}"
        lines.append(f"  no activation of a size below {least} reaches it")
    if not len(solution):
        near = ", ".join(f"{x:.6g}" for x in solution.nearest)
        bound = f", proved to be at least {solution.gap_bound:.4g} m" if solution.gap_bound else ""
        lines.append(f"  nearest ({near}) m, {solution.gap:.4g} m away{bound}")
        lines.append(f"  reached by {_activation(arm, solution.nearest_activation)}")
    return lines
