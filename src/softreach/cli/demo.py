"""`softreach demo`: the main job on the paper's design, start to end."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from softreach.cli.console import console
from softreach.cli.lengths import Lengths
from softreach.cli.options import OUT, AsJson, Overwrite, Unit, check_output
from softreach.cli.values import Whole
from softreach.cli.volume import check_hull_memory, volume_rows

_FILES = ("design.toml", "cloud.zarr", "cloud.ply", "hull.ply", "cloud.png")


def demo(
    *,
    n: Annotated[Whole, Parameter(name=("--n", "-n"))] = 400_000,
    out: Annotated[Path, OUT] = Path("out"),
    overwrite: Overwrite = False,
    unit: Unit = None,
    json: AsJson = False,
) -> None:
    """Start here: cloud, volumes and picture of the paper's design.

    The design is minimal_trunk (Ω = 108°, φ = 2°); all is written into one folder.

    Example: softreach demo --out out

    Args:
        n: Number of samples.
        out: Folder for the results.
    """
    from time import perf_counter

    from softreach import export, plot
    from softreach.arm import designs
    from softreach.cloud.clouds import compute_cloud, save_cloud
    from softreach.cloud.volume import Hull, concave_hull, convex_hull
    from softreach.rod.kinematics import configuration
    from softreach.support import parallel

    start = perf_counter()
    arm = designs.minimal_trunk()
    lengths = Lengths.of(arm, unit)
    _check(out, overwrite)
    check_hull_memory(n)
    cloud = compute_cloud(arm, n)
    computed = perf_counter() - start

    def hulls() -> tuple[Hull, Hull]:
        return concave_hull(cloud.tip, bias=True), convex_hull(cloud.tip)

    with parallel.meanwhile(hulls) as result:
        arm.save(out / "design.toml", overwrite=overwrite)
        save_cloud(cloud, out / "cloud.zarr", overwrite=overwrite)
        export.export_cloud(cloud, out / "cloud.ply", unit=lengths.written, overwrite=overwrite)
        shape = configuration(arm, [-1.0, 0.0, -0.4])
        figure = plot.plot_views(cloud, arm, shape, unit=lengths.unit)
        plot.save_figure(figure, out / "cloud.png", overwrite=overwrite)
        concave, convex = result()
    export.export_mesh(concave, out / "hull.ply", unit=lengths.written, overwrite=overwrite)
    for name in ("cloud.ply", "hull.ply"):
        console.written(out / name, lengths)

    rows = volume_rows(concave, convex)
    rows["time to compute the cloud"] = (round(computed, 3), "s")
    rows["time in all"] = (round(perf_counter() - start, 3), "s")
    rows["written"] = ([str(out / name) for name in _FILES], "")
    console.rows("minimal trunk, revolution 108°, taper 2°", rows, json, lengths)


def _check(folder: Path, overwrite: bool) -> None:
    from softreach.arm.design_file import DESIGN_FILE
    from softreach.cloud.clouds import CLOUD_STORE
    from softreach.export.clouds import CLOUD_FILES
    from softreach.support.files.formats import PICTURES

    formats = (DESIGN_FILE, CLOUD_STORE, CLOUD_FILES, CLOUD_FILES, PICTURES)
    for name, kinds in zip(_FILES, formats, strict=True):
        check_output(folder / name, kinds, overwrite)
