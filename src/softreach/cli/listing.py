"""`softreach list`: the names that other commands take."""

from __future__ import annotations

from typing import Any

from cyclopts import App

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


@listing.command
def designs(*, json: AsJson = False) -> None:
    """List the built-in designs with what drives them.

    Example: softreach list designs
    """
    from softreach.arm import designs

    makers = {name: getattr(designs, name) for name in designs.__all__}
    records = [
        {
            "design": name,
            "bundles": (arm := make()).bundles,
            "length_m": arm.length,
            "description": (make.__doc__ or "").partition("\n")[0].rstrip(".").replace("`", ""),
        }
        for name, make in makers.items()
    ]
    console.table(records, json)


@listing.command
def examples(*, json: AsJson = False) -> None:
    """List the examples that softreach example writes, with their files.

    Example: softreach list examples
    """
    from softreach.cli.example import examples as known

    records = [
        {
            "example": name,
            "files": " ".join(file.name for file in files),
            "description": files[0].read_text("utf-8").partition("\n")[0].lstrip("# ").rstrip("."),
        }
        for name, files in known().items()
    ]
    console.table(records, json)


@listing.command
def materials(*, json: AsJson = False) -> None:
    """List the named materials from soft to stiff, with Young's modulus and density.

    Example: softreach list materials
    """
    from softreach.arm.material import material_names, material_record

    records = [
        {
            "material": name,
            "young_modulus_pa": (record := material_record(name)).material.young_modulus,
            "poisson_ratio": record.material.poisson_ratio,
            "density_kg_m3": record.material.density,
            "modulus": record.modulus,
        }
        for name in material_names()
    ]
    console.table(records, json)


@listing.command
def actuators(*, json: AsJson = False) -> None:
    """List the kinds of actuators of design files, and the modules that they are in.

    Those of your own are there with --import, or as entry points of a package.

    Example: softreach list actuators
    """
    from softreach.arm.actuators import Actuator
    from softreach.arm.design_file.keys import every_kind

    records = [
        {
            "kind": name,
            "activation": kind.activation,
            "unit": kind.unit,
            "module": kind.__module__,
            "description": (kind.__doc__ or "").strip().partition("\n")[0],
        }
        for name, kind in every_kind(Actuator).items()
    ]
    console.table(records, json)


@listing.command
def metrics(*, json: AsJson = False) -> None:
    """List the metrics of an atlas with their groups and units.

    Metrics of your own are their own group; see --import.

    Example: softreach list metrics
    """
    from softreach.atlas.metrics import METRIC_GROUPS, own_metrics

    own = [(name, (metric,)) for name, metric in own_metrics().items()]
    records = [
        {"metric": metric.name, "group": group, "unit": metric.unit, "meaning": metric.meaning}
        for group, members in [*METRIC_GROUPS.items(), *own]
        for metric in members
    ]
    console.table(records, json)


@listing.command
def objectives(*, json: AsJson = False) -> None:
    """List the objectives of a search with their units.

    All metrics of an atlas that are single numbers can be objectives too.

    Example: softreach list objectives
    """
    from softreach.optimization import OBJECTIVES

    records = [
        {
            "objective": objective.name,
            "unit": objective.unit,
            "asks": objective.asks,
            "derivatives": "yes" if objective.smooth else "no",
            "meaning": objective.meaning,
        }
        for objective in OBJECTIVES.values()
    ]
    console.table(records, json)


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
    records: list[dict[str, Any]] = []
    for name, parameter in parameters_of(arm).items():
        value, unit = as_read(parameter.value(arm), parameter.unit)
        written = written_name(name, parameter.unit)
        row = (written, value, unit, parameter.symbol, parameter.meaning)
        columns = ("parameter", "value", "unit", "symbol", "meaning")
        records.append(dict(zip(columns, row, strict=True)))
    console.table(records, json)
