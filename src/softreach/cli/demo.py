"""`softreach demo`, `example` and `paper`: the main job, files to begin with, all of the paper."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated

from cyclopts import Parameter

import softreach as sr
from softreach.cli.changes import design_from
from softreach.cli.cloud import check_hull_memory, volume_rows
from softreach.cli.console import console
from softreach.cli.options import DEFAULT, OUT, Output, Overwrite, check_output, written_unit
from softreach.cli.values import Whole
from softreach.support import parallel
from softreach.support.errors import InvalidInput
from softreach.support.files.atomic import check_place
from softreach.support.files.formats import PICTURES
from softreach.support.files.text import write_text

_FILES = {
    "tentacle": ("tentacle.toml", "tentacle.csv"),
    "three_fibers": ("three_fibers.toml", "five_places.toml"),
    "tendon_arm": ("tendon_arm.toml", "tendon_arm.sh", "requirement_check.py"),
    "spine": ("spine.toml", "magnets.py", "own_actuator.sh"),
}


def demo(
    *,
    n: Annotated[Whole, Parameter(name=("--n", "-n"))] = 400_000,
    out: Annotated[Path, OUT] = Path("out"),
    output: Output = DEFAULT,
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
    formats = {"design.toml": DESIGN_FILE, "cloud.zarr": CLOUD_STORE, "cloud.png": PICTURES}
    formats |= {"cloud.ply": CLOUD_FILES, "hull.ply": CLOUD_FILES}
    for name, kinds in formats.items():
        check_output(out / name, kinds, output.overwrite)
    check_hull_memory(n)
    cloud = sr.compute_cloud(arm, n)
    computed = perf_counter() - start
    written = written_unit(arm)
    hulls = partial(sr.concave_hull, cloud.tip, bias=True), partial(sr.convex_hull, cloud.tip)
    with parallel.meanwhile(lambda: [make() for make in hulls]) as made:
        arm.save(out / "design.toml", overwrite=output.overwrite)
        sr.save_cloud(cloud, out / "cloud.zarr", overwrite=output.overwrite)
        sr.export.export_cloud(cloud, out / "cloud.ply", unit=written, overwrite=output.overwrite)
        shape = sr.configuration(arm, [-1.0, 0.0, -0.4])
        figure = sr.plot.plot_views(cloud, arm, shape, unit=arm.length_unit)
        sr.plot.save_figure(figure, out / "cloud.png", overwrite=output.overwrite)
        concave, convex = made()
    sr.export.export_mesh(concave, out / "hull.ply", unit=written, overwrite=output.overwrite)
    for name in ("cloud.ply", "hull.ply"):
        console.written(out / name, written)
    rows = volume_rows(concave, convex)
    rows["time to compute the cloud"] = (round(computed, 3), "s")
    rows["time in all"] = (round(perf_counter() - start, 3), "s")
    rows["written"] = ([str(out / name) for name in formats], "")
    console.rows("minimal trunk, revolution 108°, taper 2°", rows, output.json, arm)


def example(
    name: str, /, *, out: Annotated[Path, OUT] = Path(), overwrite: Overwrite = False
) -> None:
    """Write an example here: a design and the data and scripts that go with it.

    softreach list examples prints their names. Designs of the gallery are examples
    of one file.

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
    known = {
        name: tuple(_folder("examples") / file for file in files) for name, files in _FILES.items()
    }
    return known | {file.stem: (file,) for file in sorted(_folder("designs").glob("*.toml"))}


def _folder(name: str) -> Path:
    """Folder in the installed package, or at the root of a clone."""
    package = Path(sr.__file__).parent
    return package / name if (package / name).is_dir() else package.parents[1] / name


def paper(
    *,
    quick: bool = False,
    out: Annotated[Path, OUT] = Path("paper"),
    overwrite: Overwrite = False,
) -> None:
    """Recompute the paper's figures and statements into a report.

    The same command continues after an interruption.

    Example: softreach paper --out paper --quick

    Args:
        quick: Small clouds: coarse numbers in under a minute.
        out: Folder for the report and its figures.
    """
    from softreach.paper import reproduce_paper

    console.line(reproduce_paper(out, quick=quick, overwrite=overwrite, say=console.note))
