"""`softreach solve`, `track`, `plan`, `equilibria`: activations that lead to places, and back."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import softreach as sr
from softreach.cli import options
from softreach.cli.console import console, fields_of, for_machines
from softreach.cli.options import UNCHANGED, Changes, Signed, Whole, design_from, read_as
from softreach.support.errors import InvalidInput, NotPossible, Range
from softreach.support.files.formats import TABLES
from softreach.support.files.text import write_text
from softreach.support.quantity import numbers_in
from softreach.support.units import TYPED, read_length


def solve(
    design: options.Design,
    /,
    *,
    target: Signed = None,
    targets: Path | None = None,
    within: str | None = None,
    direction: Signed = None,
    cone: options.Angle | None = None,
    markers: Annotated[list[str] | None, Parameter(name="--marker")] = None,
    family: Whole | None = None,
    changes: Changes = UNCHANGED,
    unit: options.Unit = None,
    json: options.AsJson = False,
) -> None:
    """Find every activation that puts the tip at a target.

    If there is none, prints the nearest point that the tip reaches, and the distance
    that every tip has at least. Targets are places in the world: --base down turns
    the arm there, and leaves the targets where they are.

    Example: softreach solve minimal_trunk --target 0.2,0.1,0.6

    Args:
        target: Tip position x,y,z, in m unless each has a unit: 80mm,50mm,-24cm.
        targets: CSV file with columns x, y, z; in m, or as x_mm, y_mm, z_mm.
        within: Distance at which a target counts as reached: 1mm, 0.005L, 0.001 (m).
        direction: Direction x,y,z in which the tip must point; its length does not matter.
        cone: Largest angle from --direction: 5deg, 0.1rad; 0deg if left out.
        markers: Position of a marker as well: elbow=80mm,0,120mm. May be repeated.
        family: Number of solutions for each target, with four or more free bundles: 1 if left out.
    """
    from softreach.inverse.request import position_in

    if (target is None) == (targets is None):
        raise NotPossible("give either --target or --targets")
    arm = design_from(design, changes, unit)
    if int((arm.input_bounds[:, 0] < arm.input_bounds[:, 1]).sum()) <= 3:
        options.refuse("with up to three free bundles, as all solutions are found", family=family)
    if direction is None:
        options.refuse("without --direction", cone=cone)
    if targets is None:
        points = [position_in("target", target or "", arm.length)]
    else:
        points = options.points_in("targets", targets, arm)
    distance = partial(read_length, length=arm.length), f"a length in m, or with {TYPED}, L"
    near = read_as("within", "0" if within is None else within, *distance, Range(0.0))
    count = 1 if family is None else family
    wanted = None if direction is None else numbers_in(direction, 3)
    if direction is not None and wanted is None:
        raise InvalidInput("direction", direction or "''", "three comma-separated numbers x,y,z")
    pairs = options.pairs_in("marker", markers, "NAME=x,y,z, such as elbow=80mm,0,120mm")
    places = {k: position_in(f"marker {k}", x, arm.length) for k, x in pairs.items()}
    goals: Any = {"direction": wanted, "markers": places, "marker_within": near, "within": near}
    solutions = sr.solve_inverse(arm, points, cone=cone or 0.0, family=count, **goals)
    if json:
        lengths = ("target", "residuals", "nearest", "gap", "gap_bound")
        lengths += ("marker_errors", "marker_gaps")
        known = [{k: x for k, x in vars(one).items() if k != "tip_maps"} for one in solutions]
        console.json([for_machines(fields_of(each, *lengths), arm.length) for each in known])
        return
    for solution in solutions:
        console.line(solution.text(arm.length_unit.name))
        if 0 < len(solution) < count:
            known = "this one" if len(solution) == 1 else f"one of these {len(solution)}"
            console.line(f"  no others found: further searches end at {known}")


def track(
    design: options.Design,
    path: Path,
    /,
    *,
    start: Signed = None,
    changes: Changes = UNCHANGED,
    out: options.Place = Path("activations.csv"),
    overwrite: options.Overwrite = False,
    unit: options.Unit = None,
) -> None:
    """Follow a path of tip positions, and say where it ends.

    The activations change continuously along the path and go into a CSV file.

    Example: softreach track minimal_trunk path.csv --out activations.csv

    Args:
        path: CSV file with columns x, y, z, a point a row; in m, or as x_mm, y_mm, z_mm.
        start: Activations to start from: -1,0,-0.5
        out: CSV file for the activations.
    """
    from softreach.export.clouds import path_csv
    from softreach.inverse.path import end_text

    arm = design_from(design, changes, unit)
    options.check_output(out, TABLES, overwrite)
    first = None if start is None else options.activation_of(start, arm, "start")
    tracked = sr.track_path(arm, options.points_in("path", path, arm), first)
    write_text(out, path_csv(tracked), overwrite=overwrite)
    console.line(f"{out}: {end_text(tracked, arm.length_unit)}")


def plan(
    design: options.Design,
    /,
    *,
    start: Signed = None,
    goal: Signed = None,
    to: Signed = None,
    rate: str | None = None,
    changes: Changes = UNCHANGED,
    out: options.Place = Path("plan.csv"),
    overwrite: options.Overwrite = False,
    unit: options.Unit = None,
) -> None:
    """Plan a motion that touches nothing, with times at given rates, into a CSV file.

    Example: softreach plan tank.toml --goal -1,0,-0.5 --rate 0.5 --out plan.csv

    Args:
        start: Activations to start from: -1,0,-0.5; those at rest if left out.
        goal: Activations to end with.
        to: Tip position x,y,z to end at, in m unless each has a unit: 80mm,50mm,-24cm.
        rate: Largest change of each activation per second, one number or one per bundle: 0.5
        out: CSV file for the plan.
    """
    from softreach.export.clouds import path_csv
    from softreach.inverse.request import position_in

    arm = design_from(design, changes, unit)
    options.check_output(out, TABLES, overwrite)
    if (goal is None) == (to is None):
        raise NotPossible("give either --goal or --to")
    planned = sr.inverse.plan(
        arm,
        None if start is None else options.activation_of(start, arm, "start"),
        None if goal is None else options.activation_of(goal, arm, "goal"),
        goal_position=None if to is None else position_in("to", to, arm.length),
        rate=None if rate is None else numbers_in(rate) or rate,
    )
    write_text(out, path_csv(planned), overwrite=overwrite)
    least = arm.length_unit.rounded(float(planned.clearance.min()))
    console.line(f"{out}: {planned.sizes['point']} points, least clearance {least}")


def equilibria(
    design: options.Design,
    /,
    *,
    activation: options.Activation = None,
    view: options.View = None,
    changes: Changes = UNCHANGED,
    out: options.Out = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Find every equilibrium of a loaded arm at given activations.

    Stable equilibria come first. The posture that the arm takes is marked: it is loaded
    first, and then activated.

    Example: softreach equilibria arm.toml --activation -1,0,-0.5 --out all.png

    Args:
        out: Draw them: .png .pdf .svg, or .html to turn
    """
    options.check_picture(out, output.overwrite, view=view, page=True)
    arm = design_from(design, changes, output.unit)
    result = sr.equilibria(arm, options.activation_of(activation, arm))
    if output.json:
        status = [sr.rod.TipStatus(each) for each in result.status]
        fields = vars(result) | {"status": status, "degree": result.degree}
        del fields["rod"], fields["solver"]
        console.json(for_machines(fields_of(fields, "tips"), arm.length))
    else:
        from softreach.schema import activation_text

        at = activation_text(arm, result.activation)
        console.line(f"equilibria{f' at {at}' if at else ''}: {result}")
    if out is not None:
        draw = sr.plot.plot_3d if options.is_page(out) else sr.plot.plot_equilibria
        figure = draw(result, view=view or "oblique", unit=arm.length_unit)
        options.save_picture(figure, out, output.overwrite)
