"""`softreach demo`: the main job on the paper's design, start to end."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from softreach.cli.inputs import AsJson
from softreach.cli.output import print_rows
from softreach.cli.volume import volume_rows

__all__ = ["demo"]


def demo(
    *,
    out: Annotated[Path, Parameter(help="Folder for the results.")] = Path("out"),
    n: Annotated[int, Parameter(help="Number of samples.")] = 400_000,
    json: AsJson = False,
) -> None:
    """The paper's design (Ω = 108°, φ = 2°): cloud, volumes, hull and picture, into a folder.

    Example: softreach demo --out out
    """
    from time import perf_counter

    from softreach import export, parallel, plot
    from softreach.arm import designs
    from softreach.cloud import compute_cloud, save_cloud
    from softreach.rod.kinematics import configuration
    from softreach.volume import Hull, concave_hull, convex_hull

    start = perf_counter()
    arm = designs.minimal_trunk()
    arm.save(out / "design.toml")
    cloud = compute_cloud(arm, n)
    computed = perf_counter() - start

    def hulls() -> tuple[Hull, Hull]:
        return concave_hull(cloud.tip, bias=True), convex_hull(cloud.tip)

    with parallel.meanwhile(hulls) as found:
        save_cloud(cloud, out / "cloud.zarr")
        export.export_cloud(cloud, out / "cloud.ply")
        shape = configuration(arm, [-1.0, 0.0, -0.4])
        plot.save_figure(plot.plot_views(cloud, arm, shape), out / "cloud.png")
        concave, convex = found()
    export.export_mesh(concave, out / "hull.ply")

    rows = volume_rows(concave, convex, arm.length)
    rows["time to compute the cloud"] = (round(computed, 3), "s")
    rows["time in all"] = (round(perf_counter() - start, 3), "s")
    files = ("design.toml", "cloud.zarr", "cloud.ply", "hull.ply", "cloud.png")
    rows["written"] = ([str(out / name) for name in files], "")
    print_rows("minimal trunk, revolution 108°, taper 2°", rows, json)
