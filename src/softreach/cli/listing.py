"""`softreach list`: the names that other commands take."""

from __future__ import annotations

from collections.abc import Sequence

from cyclopts import App

import softreach as sr
from softreach.cli import demo
from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.options import AsJson, Design
from softreach.cli.values import as_read

listing = App(
    name="list",
    help="""List designs, examples, materials, actuators, metrics, objectives, or parameters.

Example: softreach list parameters minimal_trunk
""",
)


def _print(columns: str, rows: Sequence[Sequence[object]], json: bool) -> None:
    console.table([dict(zip(columns.split(), row, strict=True)) for row in rows], json)


@listing.command
def designs(*, json: AsJson = False) -> None:
    """List the built-in designs with what drives them.

    Example: softreach list designs
    """
    makers = {name: getattr(sr.designs, name) for name in sr.designs.__all__}
    rows = [
        (name, (arm := make()).bundles, arm.length, _summary(make).rstrip(".").replace("`", ""))
        for name, make in makers.items()
    ]
    _print("design bundles length_m description", rows, json)


def _summary(documented: object) -> str:
    return (documented.__doc__ or "").strip().partition("\n")[0]


@listing.command
def examples(*, json: AsJson = False) -> None:
    """List the examples that softreach example writes, with their files.

    Example: softreach list examples
    """
    records = [
        {
            "example": name,
            "files": " ".join(file.name for file in files),
            "description": files[0].read_text("utf-8").partition("\n")[0].lstrip("# ").rstrip("."),
        }
        for name, files in demo.examples().items()
    ]
    console.table(records, json)


@listing.command
def materials(*, json: AsJson = False) -> None:
    """List the named materials from soft to stiff, with Young's modulus and density.

    Example: softreach list materials
    """
    from softreach.arm.material import material_record

    records = [(name, material_record(name)) for name in sr.arm.material_names()]
    rows = [
        (
            name,
            of.material.young_modulus,
            of.material.poisson_ratio,
            of.material.density,
            of.modulus,
        )
        for name, of in records
    ]
    _print("material young_modulus_pa poisson_ratio density_kg_m3 modulus", rows, json)


@listing.command
def actuators(*, json: AsJson = False) -> None:
    """List the kinds of actuators of design files, and the modules that they are in.

    Those of your own are there with --import, or as entry points of a package.

    Example: softreach list actuators
    """
    from softreach.arm.design_file.keys import every_kind

    rows = [
        (name, kind.activation, kind.unit, kind.__module__, _summary(kind))
        for name, kind in every_kind(sr.arm.Actuator).items()
    ]
    _print("kind activation unit module description", rows, json)


@listing.command
def metrics(*, json: AsJson = False) -> None:
    """List the metrics of an atlas with their groups and units.

    Metrics of your own are their own group; see --import.

    Example: softreach list metrics
    """
    from softreach.atlas.metrics import own_metrics

    groups = sr.atlas.METRIC_GROUPS | {name: (metric,) for name, metric in own_metrics().items()}
    rows = [
        (metric.name, group, metric.unit, metric.meaning)
        for group, members in groups.items()
        for metric in members
    ]
    _print("metric group unit meaning", rows, json)


@listing.command
def objectives(*, json: AsJson = False) -> None:
    """List the objectives of a search with their units.

    All metrics of an atlas that are single numbers can be objectives too.

    Example: softreach list objectives
    """
    rows = [
        (each.name, each.unit, each.asks, "yes" if each.smooth else "no", each.meaning)
        for each in sr.optimization.OBJECTIVES.values()
    ]
    _print("objective unit asks derivatives meaning", rows, json)


@listing.command
def parameters(design: Design, /, *, changes: Changes = UNCHANGED, json: AsJson = False) -> None:
    """List every parameter of a design with its value, as --set and --vary name it.

    A dash means that the design gives no single number, or that parts which share
    the parameter differ; it can still be set.

    Example: softreach list parameters minimal_trunk
    """
    from softreach.arm.parameters import parameters as parameters_of
    from softreach.arm.written import written_name

    arm = design_from(design, changes)
    rows = [
        (written_name(name, one.unit), *as_read(one.value(arm), one.unit), one.symbol, one.meaning)
        for name, one in parameters_of(arm).items()
    ]
    _print("parameter value unit symbol meaning", rows, json)
