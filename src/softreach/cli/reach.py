"""`softreach reach`, `payload` and `gradient`: the exact reachable set, and what changes it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import softreach as sr
from softreach.cli import options
from softreach.cli.changes import UNCHANGED, Changes, design_from, read_mass
from softreach.cli.console import console
from softreach.cli.design import load_rows
from softreach.cli.values import ERROR, Number, Rows, as_read, rows_of
from softreach.support import progress
from softreach.support.arguments import as_number
from softreach.support.errors import NotPossible, Range, counted
from softreach.support.files.formats import PAGES, PICTURES


def reach(
    design: options.Design,
    /,
    *,
    accuracy: Number = 3e-3,
    changes: Changes = UNCHANGED,
    out: Annotated[list[Path] | None, options.OUT] = None,
    at: Annotated[str | None, Parameter(group=options.OUTPUT, allow_leading_hyphen=True)] = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Compute the exact reachable set: volume, multiplicity, folds.

    Without samples: the volume with its error, the share of the convex hull that
    is not reached, and the number of activations that reach each place.

    Example: softreach reach minimal_trunk --out reach.stl --out reach.png

    Args:
        accuracy: Relative error allowed in the volume.
        out: Write the boundary (.ply .stl .obj .glb .3mf .vtu), draw slices (.png .pdf .svg), or
            the set as a web page that turns (.html). May be repeated.
        at: Point x,y,z that the slices meet at: the middle of the set if left out.
    """
    from softreach.export.surfaces import SURFACE_FILES
    from softreach.inverse.request import position_in

    arm = design_from(design, changes, output.unit)
    outs = sorted(out or [], key=_is_drawn)  # pictures come last
    meshed = ["skimage"] * any(path.suffix.lower() in SURFACE_FILES for path in outs)
    options.check_output(outs, {**SURFACE_FILES, **PICTURES, **PAGES}, output.overwrite, *meshed)
    free = int((arm.input_bounds[:, 0] < arm.input_bounds[:, 1]).sum())
    for path in outs:
        if not options.is_page(path) and free < (3 if _is_drawn(path) else 2):
            raise _too_few(path)
    if not any(map(_is_drawn, outs)):
        options.refuse("without a picture: add --out slices.png", at=at)
    point = None if at is None else position_in("at", at, arm.length)
    with progress.bar("mapping the activation box", None) as step:
        reached = sr.reachable_set(arm, accuracy=accuracy, progress=step)
    rows = load_rows(arm) | rows_of(reached.to_dataset())
    rows = rows if output.json else _by_activations(rows)
    console.rows(f"reachable set of {design}", rows, output.json, arm)
    for path in outs:
        _write(reached, arm, path, point, output.overwrite)


def _by_activations(rows: Rows) -> Rows:
    """A row each for the places that one activation reaches, two, and so on, in place of lists."""
    lists = "activations", "multiplicity", f"multiplicity{ERROR}"
    if not rows.keys() >= {*lists}:
        return rows
    result = {name: row for name, row in rows.items() if name not in lists}
    (error, unit), (volume_error, _) = rows[lists[2]], rows[f"volume{ERROR}"]
    for count, volume in zip(rows["activations"][0], rows["multiplicity"][0], strict=True):
        name = f"reached by {counted(int(count), 'activation')}"
        result[name] = volume, unit
        result[f"{name}{ERROR}"] = error + (volume_error if count == 1 else 0.0), unit
    return result


def _is_drawn(path: Path) -> bool:
    return path.suffix.lower() in PICTURES


def _write(
    reached: sr.workspace.ReachableSet,
    arm: sr.Manipulator,
    path: Path,
    at: list[float] | None,
    overwrite: bool,
) -> None:
    unit = arm.length_unit
    if options.is_page(path):
        options.save_picture(sr.plot.plot_3d([reached, arm], unit=unit), path, overwrite)
    elif _is_drawn(path) and reached.dimension == 3:
        options.save_picture(sr.plot.plot_slices(reached.grid, at=at, unit=unit), path, overwrite)
    elif not _is_drawn(path) and reached.dimension >= 2:
        written = options.written_unit(arm)
        sr.export.export_mesh(reached.surface(), path, unit=written, overwrite=overwrite)
        console.written(path, written)
    else:
        raise _too_few(path)


def _too_few(path: Path) -> NotPossible:
    return NotPossible(f"{path} cannot be written: slices need three free bundles, surfaces two")


def payload(
    design: options.Design,
    /,
    *,
    share: Number = 0.8,
    payloads: str | None = None,
    accuracy: Number = 0.01,
    changes: Changes = UNCHANGED,
    out: options.Out = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Compute how much of its reach a payload costs an arm.

    Prints the volume under each of several payloads, which replace the design's
    own, and the largest payload that keeps a share of the volume.

    Example: softreach payload lce_arm --gravity up --share 0.8

    Args:
        share: Share to keep of the volume without a payload.
        payloads: Masses at the tip, instead of the design's own payload: 2g,5g,10g
        accuracy: Relative error allowed in each volume.
        out: Draw the curve: .png .pdf .svg
    """
    arm = design_from(design, changes, output.unit)
    as_number("share", share, Range(0.0, 1.0, open_low=True, open_high=True))
    options.check_picture(out, output.overwrite)
    if arm.loads is None:
        raise NotPossible("this design has no loads; add --gravity down")
    masses = None if payloads is None else [read_mass("payloads", m) for m in payloads.split(",")]
    with progress.bar("computing volumes", None) as step:
        curve = sr.payload_curve(arm, masses, accuracy=accuracy, progress=step)
        largest = curve.largest_payload(share)
    rows = rows_of(curve.to_dataset())
    rows |= {
        "share to keep": (share, ""),
        "largest payload": (largest.payload, "kg"),
        f"largest payload{ERROR}": (largest.payload_error, "kg"),
    }
    console.rows(f"payload of {design}", rows, output.json, arm)
    if arm.loads.payload and not output.json:
        console.line(f"  they take the place of the design's own payload, {arm.loads.payload:g} kg")
    if out is not None:
        figure = sr.plot.plot_payload_curve(curve, largest=[largest])
        options.save_picture(figure, out, output.overwrite)


def gradient(
    design: options.Design,
    parameters: list[str],
    /,
    *,
    accuracy: Number = 3e-3,
    changes: Changes = UNCHANGED,
    json: options.AsJson = False,
) -> None:
    """Differentiate the reachable volume by design parameters.

    Also prints those of the convex hull and the unreachability, all in SI units.

    Example: softreach gradient lce_arm taper upper --set lower=-3 --set upper=-1

    Args:
        parameters: Parameters, as softreach list parameters DESIGN names them, or without units.
        accuracy: Relative error allowed in volumes found on a raster.
    """
    from softreach.arm.parameters import parameters_by_every_name
    from softreach.arm.written import written_name

    arm = design_from(design, changes)
    plain = {written_name(name, p.unit): name for name, p in parameters_by_every_name(arm).items()}
    parameters = [plain.get(name, name) for name in parameters]
    with progress.bar("differentiating the volume", len(parameters)) as step:
        derivatives = sr.volume_gradient(arm, parameters, accuracy=accuracy, progress=step)
    numbers = rows_of(derivatives.to_dataset())
    rows: Rows = {"route": numbers.pop("route")}
    for k, (parameter, unit) in enumerate(
        zip(derivatives.parameters, derivatives.units, strict=True)
    ):
        for name, (values, symbol) in numbers.items():
            label = f"{name.removesuffix(ERROR)} by {parameter}{ERROR * name.endswith(ERROR)}"
            kind = as_read((), symbol.removesuffix(" per unit"))[1]
            per = kind if unit == "1" else f"{kind or '1'}/{unit}"
            rows[label] = (values[k], per)
    console.rows(f"derivatives of what {design} reaches", rows, json)
