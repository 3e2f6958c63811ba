"""`softreach demo`, `example`, `list`, `paper`, `doctor`, `warmup`: what to begin with."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from importlib.metadata import PackageNotFoundError, requires, version
from itertools import chain
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal

from cyclopts import Parameter

import softreach as sr
from softreach.cli import options
from softreach.cli.console import as_read, console, fields_of
from softreach.cli.options import UNCHANGED, Changes, Overwrite, Place, Whole, design_from
from softreach.cli.reach import HULL_BYTES, volume_rows
from softreach.support import parallel
from softreach.support.arguments import as_one_of
from softreach.support.errors import InvalidInput, NotPossible, no_warnings
from softreach.support.files.atomic import check_place
from softreach.support.files.formats import PICTURES
from softreach.support.files.text import write_text
from softreach.support.memory import check_memory, free_memory
from softreach.support.progress import bar

Kind = Literal[
    "designs", "examples", "materials", "actuators", "metrics", "objectives", "parameters"
]
Table = Iterator[tuple[Any, ...]]  # names of the columns, then rows
_FILES = {
    "tentacle": ("tentacle.toml", "tentacle.csv"),
    "three_fibers": ("three_fibers.toml", "five_places.toml"),
    "tendon_arm": ("tendon_arm.toml", "tendon_arm.sh", "requirement_check.py"),
    "spine": ("spine.toml", "magnets.py", "own_actuator.sh"),
}


def demo(
    *,
    n: Annotated[Whole, Parameter(name=("--n", "-n"))] = 400_000,
    out: Place = Path("out"),
    output: options.Output = options.DEFAULT,
) -> None:
    """Start here: cloud, volumes and picture of the paper's design.

    The design is minimal_trunk (Ω = 108°, φ = 2°); all is written into one folder.

    Example: softreach demo --out out

    Args:
        n: Number of samples.
        out: Folder for the results.
    """
    from softreach.arm.design_file import DESIGN_FILE
    from softreach.cloud.clouds import CLOUD_STORE
    from softreach.export.clouds import CLOUD_FILES

    start = perf_counter()
    arm = design_from("minimal_trunk", unit=output.unit)
    formats = {
        "design.toml": DESIGN_FILE,
        "cloud.zarr": CLOUD_STORE,
        "cloud.png": PICTURES,
        "cloud.ply": CLOUD_FILES,
        "hull.ply": CLOUD_FILES,
    }
    for name, kinds in formats.items():
        options.check_output(out / name, kinds, output.overwrite)
    check_memory("n", n, HULL_BYTES * n)
    cloud = sr.compute_cloud(arm, n)
    computed = perf_counter() - start
    written = options.written_unit(arm)
    hulls = partial(sr.concave_hull, cloud.tip, bias=True), partial(sr.convex_hull, cloud.tip)
    with parallel.meanwhile(lambda: [make() for make in hulls]) as made:
        arm.save(out / "design.toml", overwrite=output.overwrite)
        sr.save_cloud(cloud, out / "cloud.zarr", overwrite=output.overwrite)
        sr.export.export_cloud(cloud, out / "cloud.ply", unit=written, overwrite=output.overwrite)
        shape = sr.configuration(arm, [-1.0, 0.0, -0.4])
        figure = sr.plot.plot_views(cloud, arm, shape, unit=arm.length_unit)
        sr.plot.save_figure(figure, out / "cloud.png", overwrite=output.overwrite)
        concave, convex = made()
    console.written(out / "cloud.ply", written)
    options.save_mesh(concave, options.written_unit(arm), out / "hull.ply", output.overwrite)
    rows = volume_rows(concave, convex)
    rows["time to compute the cloud"] = (round(computed, 3), "s")
    rows["time in all"] = (round(perf_counter() - start, 3), "s")
    rows["written"] = ([str(out / name) for name in formats], "")
    console.rows("minimal trunk, revolution 108°, taper 2°", rows, output.json, arm)


def example(name: str, /, *, out: Place = Path(), overwrite: Overwrite = False) -> None:
    """Write an example here: a design and the data and scripts that go with it.

    softreach list examples prints their names, designs of the gallery among them.

    Example: softreach example tentacle

    Args:
        name: Name of the example.
        out: Folder for the files: this one if left out.
    """
    if name not in (known := examples()):
        raise InvalidInput("example", name, f"one of {', '.join(known)}")
    for file in known[name]:
        check_place(out / file.name, overwrite=overwrite)
    for file in known[name]:
        write_text(out / file.name, file.read_text("utf-8"), overwrite=overwrite)
        console.line(out / file.name)


def examples() -> dict[str, tuple[Path, ...]]:
    """The files of each example by its name."""
    known = {name: tuple(_folder("examples") / x for x in files) for name, files in _FILES.items()}
    return known | {file.stem: (file,) for file in sorted(_folder("designs").glob("*.toml"))}


def _folder(name: str) -> Path:
    """Folder in the installed package, or at the root of a clone."""
    package = Path(sr.__file__).parent
    return package / name if (package / name).is_dir() else package.parents[1] / name


def listing(
    kind: Kind,
    design: Annotated[str | None, Parameter(help="Design whose parameters are listed.")] = None,
    /,
    *,
    changes: Changes = UNCHANGED,
    json: options.AsJson = False,
) -> None:
    """List designs, examples, materials, actuators, metrics, objectives, or parameters.

    The parameters of a design have the names that --set and --vary take. A dash means
    that a parameter has no single value: it is left out, or varies along the arm or
    between parts. It can be set all the same. Actuators and metrics of your own
    are listed with --import. Metrics of an atlas that are single numbers can be
    objectives of a search too.

    Example: softreach list parameters minimal_trunk

    Args:
        kind: What to list.
    """
    if kind != "parameters":
        options.refuse(f"with list {kind}", **changes.given)
        if design is not None:
            raise NotPossible(f"list {kind} takes no design; list parameters {design} does")
        columns, *rows = _TABLES[kind]()
    elif design is None:
        raise NotPossible("name the design, as in softreach list parameters minimal_trunk")
    else:
        columns, *rows = _parameters(design_from(design, changes))
    console.table([dict(zip(columns, row, strict=True)) for row in rows], json)


def _designs() -> Table:
    yield "design", "bundles", "length_m", "description"
    for name in sr.designs.__all__:
        make = getattr(sr.designs, name)
        arm = make()
        yield name, arm.bundles, arm.length, _summary(make).rstrip(".").replace("`", "")


def _summary(documented: object) -> str:
    return (documented.__doc__ or "").strip().partition("\n")[0]


def _examples() -> Table:
    yield "example", "files", "description"
    for name, files in examples().items():
        heading = files[0].read_text("utf-8").partition("\n")[0].lstrip("# ").rstrip(".")
        yield name, " ".join(file.name for file in files), heading


def _materials() -> Table:
    from softreach.arm.section import material_record

    yield "material", "young_modulus_pa", "poisson_ratio", "density_kg_m3", "modulus"
    for name in sr.arm.material_names():
        of, modulus = (record := material_record(name)).material, record.modulus
        yield name, of.young_modulus, of.poisson_ratio, of.density, modulus


def _actuators() -> Table:
    from softreach.arm.design_file import KINDS, own_kinds

    yield "kind", "activation", "unit", "module", "description"
    kinds = {**KINDS[sr.arm.Actuator], **own_kinds(sr.arm.Actuator)}
    for name, kind in kinds.items():
        yield name, kind.activation, kind.unit, kind.__module__, _summary(kind)


def _metrics() -> Table:
    from softreach.atlas.metrics import own_metrics

    yield "metric", "group", "unit", "meaning"
    groups = sr.atlas.METRIC_GROUPS | {name: (one,) for name, one in own_metrics().items()}
    for group, members in groups.items():
        yield from ((one.name, group, one.unit, one.meaning) for one in members)


def _objectives() -> Table:
    yield "objective", "unit", "asks", "derivatives", "meaning"
    for one in sr.optimization.OBJECTIVES.values():
        yield one.name, one.unit, one.asks, "yes" if one.smooth else "no", one.meaning


def _parameters(arm: sr.Manipulator) -> Table:
    from softreach.arm.parameters import parameters, written_name

    yield "parameter", "value", "unit", "symbol", "meaning"
    for name, one in parameters(arm).items():
        value, unit = as_read(one.value(arm), one.unit)
        yield written_name(name, one.unit), value, unit, one.symbol, one.meaning


_TABLES = {
    "designs": _designs,
    "examples": _examples,
    "materials": _materials,
    "actuators": _actuators,
    "metrics": _metrics,
    "objectives": _objectives,
}


def paper(*, quick: bool = False, out: Place = Path("paper"), overwrite: Overwrite = False) -> None:
    """Recompute the paper's figures and statements into a report.

    The same command continues after an interruption.

    Example: softreach paper --out paper --quick

    Args:
        quick: Small clouds: coarse numbers in under a minute.
        out: Folder for the report and its figures.
    """
    from softreach.paper import reproduce_paper

    console.line(reproduce_paper(out, quick=quick, overwrite=overwrite, say=console.note))


def warmup(*, only: str | None = None) -> int:
    """Compile all kernels now, so that no later command has to.

    A cache on disk keeps them; if it has them already, this takes seconds.
    Exits with 1 if the cache cannot be written.

    Example: softreach warmup --only free

    Args:
        only: Kernels of arms without loads (free), with loads (loaded) or with loads and two
            bending stiffnesses (flat): all if left out.
    """
    from softreach.kernels.compiler import not_kept

    asked = [*_JOBS] if only is None else [as_one_of("only", only, _JOBS)]
    with bar("compiling", None) as done, no_warnings():  # of clouds and grids too coarse
        for _ in chain(*(_JOBS[name]() for name in asked)):
            if not_kept:
                break
            done(1)
    if not_kept:
        reason = f"nothing could be kept: {not_kept[0]}"
        console.error(f"{reason}; set NUMBA_CACHE_DIR to a folder that can be written")
        return 1
    console.line(f"all kernels{'' if only is None else f' of {only} arms'} are compiled")
    return 0


def _free() -> Iterator[object]:
    """Results that need the kernels of arms without loads, each computed when it is asked for."""
    import numpy as np

    from softreach.picture.zbuffer import Extent, ZBuffer

    arm, redundant = sr.designs.minimal_trunk(), sr.designs.redundant_trunk()
    hanging = arm.replace(base=sr.Base(points="down"))
    target, beyond = (0.2, 0.1, 0.6), (2.0, 0.0, 0.0)
    path = (target, (0.2, 0.1, 0.61))
    yield _hulls()
    yield ZBuffer(Extent(0, 1, 0, 1), 4).draw_triangles(np.zeros((1, 3, 3)), np.zeros((1, 3, 3)))
    yield _calibration()
    yield _clearance(arm)
    yield sr.tip_jacobian(arm, [[-1.0, 0.0, -0.4]])
    yield sr.tip_jacobian(hanging, [[-1.0, 0.0, -0.4]])
    yield sr.configuration(arm, [-1.0, 0.0, -0.4])
    reached = sr.reachable_set(arm, accuracy=0.1)
    yield reached.contains(target)
    yield reached.distance(beyond)
    yield sr.solve_inverse(arm, [target, beyond])
    yield sr.inverse.prepared_map(arm).tree
    yield sr.track_path(arm, path)
    yield sr.reachable_set(redundant, accuracy=0.1)
    yield sr.solve_inverse(redundant, [target], near=[-0.5] * 4)
    yield sr.solve_inverse(redundant, [target])
    yield sr.solve_inverse(redundant, [target], direction=(0.0, 0.0, 1.0))
    yield sr.reached_cells(arm, 100, cell=0.1)
    yield sr.track_path(redundant, path)


def _calibration() -> None:
    import numpy as np

    tendon = sr.arm.LengthTendon(distance=0.01, bundles=3, activation_bounds=(0.0, 0.01))
    arm = sr.Manipulator.tapered(
        length=0.2, outer_radius=0.01, inner_radius=0.005, young_modulus=1e6, actuators=[tendon]
    )
    inputs = 0.01 * np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.5, 1.0]])
    data = {f"{name}_m": values for name, values in zip(arm.input_names, inputs.T, strict=True)}
    places = np.array([[0.0, 0.0, 0.2], [0.01, 0.0, 0.2], [0.0, 0.01, 0.2]])
    data |= {f"{axis}_m": values for axis, values in zip("xyz", places.T, strict=True)}
    sr.calibrate(arm, data, free=["pose.x"], rivals=False)


def _clearance(arm: sr.Manipulator) -> None:
    import numpy as np

    faces = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 3]])
    stone = sr.requirements.Mesh(np.eye(4, 3) + [2.0, 0.0, 0.0], faces)
    floor = sr.requirements.HalfSpace((0, 0, -0.1), (0, 0, 1))
    around = tuple(sr.arm.Obstacle(region=each) for each in (stone, floor))
    sr.rod.compute_clearance(arm.replace(surroundings=around), [[-1.0, 0.0, -0.4]])


def _hulls() -> None:
    import numpy as np

    from softreach.geometry.alpha_shape import alpha_hull
    from softreach.geometry.surface import Surface

    designs = sr.designs.minimal_trunk(), sr.designs.redundant_trunk()
    cloud, other = (sr.compute_cloud(design, 2000) for design in designs)
    tips = cloud.tip.values
    sr.concave_hull(tips, alpha=0.2)
    hull = sr.concave_hull(tips, alpha="critical")
    Surface(vertices=hull.vertices, faces=hull.faces).distance(hull.vertices[:2])
    alpha_hull(tips, 0.1, boxes=2)
    sr.concave_hull(np.concatenate([tips, tips + 9.0]), alpha="critical")  # in two parts
    _ = sr.activation_distance(cloud, 0.1), sr.activation_distance(other, 0.1)


def _loaded(free: sr.Manipulator | None = None) -> Iterator[object]:
    free = free or sr.designs.lce_arm()
    rest, pulled = [0.0] * free.bundles, free.input_bounds[:, 0].tolist()
    weight = free.replace(loads=sr.Loads(gravity=(0, 0, 9.81), payload=0.001))
    follower = free.replace(loads=sr.Loads(follower_force=(0, 0.001, 0)))
    for arm in (weight, follower):
        yield sr.tip_positions(arm, [rest])
        yield sr.tip_jacobian(arm, [rest])
        yield sr.configuration(arm, rest)
    yield sr.equilibria(weight, pulled)


def _flat() -> Iterator[object]:
    arm = sr.designs.lce_arm()
    measured = sr.arm.Measured(bending_stiffness=(1e-3, 2e-3))  # stiff: it does not snap
    return _loaded(arm.replace(section=arm.section.replace(measured=measured)))


_JOBS = {"free": _free, "loaded": _loaded, "flat": _flat}


def doctor(*, json: options.AsJson = False) -> None:
    """Print versions, cores, memory and caches, for a bug report.

    Example: softreach doctor --json
    """
    from softreach.kernels.compiler import not_kept
    from softreach.kernels.rod import tips

    cache = getattr(tips._tips, "_cache", None)
    kept = str(getattr(cache, "cache_path", "nowhere: not compiled"))
    kept = f"nowhere: {not_kept[0]}" if not_kept else kept
    names = re.findall(r"^[\w.-]+", "\n".join(requires("softreach") or []), re.MULTILINE)
    named = {
        "softreach": sr.__version__,
        "installed in": str(Path(sr.__file__).parent),
        "Python": platform.python_version(),
        "system": platform.platform(),
        "cores": os.cpu_count(),
        "threads used": parallel.thread_count(),
    }
    rows = fields_of(named) | {"free memory": (round(free_memory() / 1e9, 1), "GB")}
    rows |= fields_of({"kernels are kept in": kept})
    for name in names:
        if name != "softreach":
            rows[name] = "not installed", ""
            with suppress(PackageNotFoundError):
                rows[name] = version(name), ""
    console.rows("this machine and this installation", rows, json)
