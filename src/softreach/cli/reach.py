"""`softreach reach`, `payload`, `gradient`; `cloud`, `volume`, `show`: exact sets, and samples."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

from cyclopts import Parameter

import softreach as sr
from softreach.cli import options
from softreach.cli.console import as_read, console, fields_of, rows_of
from softreach.cli.options import UNCHANGED, Changes, Number, design_from, read_mass
from softreach.support import progress
from softreach.support.arguments import as_number
from softreach.support.errors import NotPossible, Range, counted
from softreach.support.files.formats import PAGES, PICTURES
from softreach.support.memory import check_memory
from softreach.support.units import ERROR, Rows

_ACCURACY = 3e-3
HULL_BYTES = 700  # of memory that a sample and its share of the triangulation take at most


def reach(
    design: options.Design,
    /,
    *,
    accuracy: Number = _ACCURACY,
    free: bool = False,
    changes: Changes = UNCHANGED,
    out: Annotated[list[Path] | None, options.OUT] = None,
    at: Annotated[str | None, Parameter(group=options.OUTPUT, allow_leading_hyphen=True)] = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Compute the exact reachable set: volume, multiplicity, folds.

    Prints the volume with its error, the share of the convex hull that is not
    reached, and how many activations reach each place. It draws no samples.

    Example: softreach reach minimal_trunk --out reach.stl --out reach.png

    Args:
        accuracy: Relative error allowed in the volume.
        free: Print what the arm reaches without touching anything, and what only through a wall.
        out: Write the boundary (.ply .stl .obj .glb .3mf .vtu), draw slices (.png .pdf .svg), or
            the set as a web page that turns (.html). May be repeated.
        at: Point x,y,z that the slices meet at: the middle of the set if left out.
    """
    from softreach.export.surfaces import SURFACE_FILES
    from softreach.inverse.request import position_in
    from softreach.rod.summary import load_rows

    arm = design_from(design, changes, output.unit)
    if free:
        options.refuse("with --free", out=out, at=at, accuracy=accuracy != _ACCURACY)
        found = sr.workspace.free_set(arm).drop_vars(["state", *"xyz"])
        console.rows(f"free set of {design}", rows_of(found), output.json, arm)
        return
    outs = sorted(out or [], key=_is_drawn)  # pictures come last
    meshed = ["skimage"] * any(path.suffix.lower() in SURFACE_FILES for path in outs)
    options.check_output(outs, {**SURFACE_FILES, **PICTURES, **PAGES}, output.overwrite, *meshed)
    dimension = int((arm.input_bounds[:, 0] < arm.input_bounds[:, 1]).sum())
    for path in outs:
        _check_dimension(path, dimension)
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
    _check_dimension(path, reached.dimension)
    unit = arm.length_unit
    if options.is_page(path):
        options.save_picture(sr.plot.plot_3d([reached, arm], unit=unit), path, overwrite)
    elif _is_drawn(path):
        options.save_picture(sr.plot.plot_slices(reached.grid, at=at, unit=unit), path, overwrite)
    else:
        options.save_mesh(reached.surface(), options.written_unit(arm), path, overwrite)


def _check_dimension(path: Path, dimension: int) -> None:
    if not options.is_page(path) and dimension < (3 if _is_drawn(path) else 2):
        needed = "slices need three free bundles, surfaces two"
        raise NotPossible(f"{path} cannot be written: {needed}")


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
    rows |= {"share to keep": (share, ""), "largest payload": (largest.payload, "kg")}
    rows[f"largest payload{ERROR}"] = largest.payload_error, "kg"
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

    Prints the derivatives of the volume, of the volume of the convex hull and of the
    unreachability, all in SI units.

    Example: softreach gradient lce_arm taper upper --set lower=-3 --set upper=-1

    Args:
        parameters: Parameters, as softreach list parameters DESIGN names them, or without units.
        accuracy: Relative error allowed in volumes found on a raster.
    """
    from softreach.arm.parameters import parameters_by_every_name, written_name

    arm = design_from(design, changes)
    plain = {written_name(name, p.unit): name for name, p in parameters_by_every_name(arm).items()}
    parameters = [plain.get(name, name) for name in parameters]
    with progress.bar("differentiating the volume", len(parameters)) as step:
        derivatives = sr.volume_gradient(arm, parameters, accuracy=accuracy, progress=step)
    numbers = rows_of(derivatives.to_dataset())
    rows: Rows = {"route": numbers.pop("route")}
    pairs = zip(derivatives.parameters, derivatives.units, strict=True)
    for k, (parameter, unit) in enumerate(pairs):
        for name, (values, symbol) in numbers.items():
            label = f"{name.removesuffix(ERROR)} by {parameter}{ERROR * name.endswith(ERROR)}"
            kind = as_read((), symbol.removesuffix(" per unit"))[1]
            rows[label] = (values[k], kind if unit == "1" else f"{kind or '1'}/{unit}")
    console.rows(f"derivatives of the reachable set of {design}", rows, json)


def cloud(
    design: options.Design,
    /,
    *,
    sampling: options.Sampling = options.SAMPLING,
    tol: Number = 1e-6,
    device: options.Device = "cpu",
    free: bool = False,
    changes: Changes = UNCHANGED,
    out: options.Out = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Sample the reachability cloud of a design and store it as Zarr.

    Example: softreach cloud minimal_trunk --n 400000 --out trunk.zarr

    Args:
        tol: Largest tip error, in L.
        device: What computes the tips: cpu, or cuda (a GPU), which takes arms without loads.
        free: Keep only samples at which the whole arm is clear of its surroundings and of itself.
        out: Where the cloud goes (.zarr): DESIGN.zarr, in this folder, if left out.
    """
    from softreach.cloud.clouds import CLOUD_STORE
    from softreach.rod.summary import load_rows

    arm = design_from(design, changes, output.unit)
    out = out or Path(f"{Path(design).stem}.zarr")
    options.check_output(out, CLOUD_STORE, output.overwrite)
    arguments = sampling.arguments
    start = perf_counter()
    dataset = sr.compute_cloud(arm, **arguments, tol=tol, device=device, clearance=free)
    touching: Rows = {}
    if free:
        dataset, touching = _free(dataset)
    seconds = perf_counter() - start
    sr.save_cloud(dataset, out, overwrite=output.overwrite)
    named = {
        "samples": arguments["n"],
        "sampler": arguments["sampler"],
        "seed": arguments["seed"],
        "steps per arm": sr.rod.as_tip_map(arm, tol).steps,
    }
    rows = fields_of(named | {"device": dataset.attrs["device"]})
    rows |= {"time to compute": (round(seconds, 3), "s"), **touching, **load_rows(arm)}
    for status in sr.rod.TipStatus if "status" in dataset else ():
        count = int((dataset.status == status).sum())
        rows[status.name.lower().replace("_", " ")] = count, ""
    heights = dataset.tip[:, 2]
    rows |= {"highest tip": (float(heights.max()), "m"), "lowest tip": (float(heights.min()), "m")}
    rows["cloud"] = str(out), ""
    console.rows(f"cloud of {design}", rows, output.json, arm)


def _free(cloud: Any) -> tuple[Any, Rows]:
    """The samples that touch nothing, and a row for what the others touch."""
    touches = cloud.clearance <= 0.0
    left = cloud.isel(sample=(cloud.clearance > 0.0).values)
    if not left.sizes["sample"]:
        raise NotPossible("the arm touches something in every sample: look at its surroundings")
    counts = {
        f"touching {name}": (int((touches & (cloud.obstacle == k)).sum()), "")
        for k, name in enumerate(cloud.clearance.names)
    }
    return left, {"free samples": (left.sizes["sample"], ""), **counts}


def volume(
    source: options.Points,
    /,
    *,
    alpha: str | None = None,
    sampling: options.Sampling = options.SAMPLING,
    changes: Changes = UNCHANGED,
    out: options.Out = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Estimate volumes and unreachability from a cloud, or from points of your own.

    The volume is that of an α-shape; the number of samples limits its accuracy.
    Points are in m unless their columns (x_mm) or --unit say otherwise.
    softreach reach computes the exact volume, without samples and with its error.

    Example: softreach volume trunk.zarr --alpha 0.03L --out hull.ply

    Args:
        alpha: α-shape radius: 0.05L, 5cm, 0.05 (m), or critical. 0.05L if left out; critical, the
            smallest that keeps the points together, for points without a design.
        out: Write the α-shape here: .ply .stl .obj .glb .3mf .vtu
    """
    from softreach.export.surfaces import SURFACE_FILES
    from softreach.schema import is_stable

    options.check_output(out, SURFACE_FILES, output.overwrite)
    if options.is_points(source):
        cloud, unit = options.points_of(source, sampling, changes, output.unit)
        arm, radius = None, options.radius_of(alpha or "critical", None)
        bias = False
    else:
        alpha = alpha or "0.05L"
        options.radius_of(alpha, 1.0)  # what is wrong with it is said before the cloud is computed
        if not options.is_stored(source):
            check_memory("n", n := sampling.arguments["n"], HULL_BYTES * n)
        cloud, arm = options.cloud_of(source, sampling, changes, output.unit)
        unit, radius = options.written_unit(arm), options.radius_of(alpha, arm.length)
        bias = cloud.attrs["sampler"] == "uniform"
    concave = sr.concave_hull(cloud.tip, radius, bias=bias)
    rows = volume_rows(concave, sr.convex_hull(cloud.tip))
    areas = sr.volume.flat_areas(cloud.tip.values[is_stable(cloud.tip)], concave.alpha)
    if areas is not None:
        share = 1 - areas[0] / areas[1] if areas[1] else None
        rows = {name: rows[name] for name in ("points", "alpha")}
        rows |= {"area (in one plane)": (areas[0], "m²"), "convex area": (areas[1], "m²")}
        rows["unreachability"] = (share, "")
    console.rows(f"volume of {source}", rows, output.json, arm, unit)
    if out is not None:
        options.save_mesh(concave, unit, out, output.overwrite)


def volume_rows(concave: sr.volume.Hull, convex: sr.volume.Hull) -> Rows:
    """The size of a cloud and the trust that it deserves."""
    share = 1 - concave.volume / convex.volume if convex.volume else None
    rows: Rows = {
        "points": (concave.n, ""),
        "alpha": (concave.alpha, "m"),
        "mean spacing": (concave.spacing, "m"),
        "regions": (concave.regions, ""),
    }
    rows["volume"] = concave.volume, "m³"
    rows["volume without sampling bias (estimate)"] = concave.volume_corrected, "m³"
    return rows | {"convex volume": (convex.volume, "m³"), "unreachability": (share, "")}


def show(
    source: options.Points,
    /,
    *,
    color: str | None = None,
    activation: options.Activation = None,
    sampling: options.Sampling = options.SAMPLING,
    changes: Changes = UNCHANGED,
    out: options.Place = Path("cloud.png"),
    overwrite: options.Overwrite = False,
    unit: options.Unit = None,
) -> None:
    """Draw a cloud and its arm from four sides, or as a web page that turns.

    Three views are orthogonal, one is oblique; --activation bends the arm. A page
    (.html) is one file, which needs no network.

    Example: softreach show trunk.zarr --activation -1,0,-0.5 --out trunk.pdf

    Args:
        color: rgb (up to three bundles), strongest (the bundle that acts most; more than three),
            effort, the name of a bundle, or compliance (how far the tip yields).
        out: Picture file: .png .pdf .svg, or .html to turn
    """
    from softreach.plot.coloring import bundle_names

    options.check_picture(out, overwrite, page=True)
    if options.is_points(source):
        options.refuse("on points, which have no design", activation=activation, color=color)
        cloud, written = options.points_of(source, sampling, changes, unit)
        arm = shape = None
    else:
        cloud, arm = options.cloud_of(source, sampling, changes, unit)
        shape = None if activation is None else options.shape_of(activation, arm)
        written = arm.length_unit
    look: dict[str, Any] = {"color": color, "unit": written}
    if color == "compliance" and color not in bundle_names(cloud):  # which figures do not compute
        look["color"] = sr.stiffness.cloud_compliance(cloud)["largest_compliance"]
    if options.is_page(out):
        bent = arm if shape is None else shape
        figure = sr.plot.plot_3d([cloud] if bent is None else [cloud, bent], **look)
    else:
        figure = sr.plot.plot_views(cloud, arm, shape, **look)
    options.save_picture(figure, out, overwrite)
    console.line(out)
