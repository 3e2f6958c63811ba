"""`softreach list`: the names that other commands take."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from cyclopts import Parameter

import softreach as sr
from softreach.cli import demo
from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.options import AsJson, refuse
from softreach.cli.values import as_read
from softreach.support.errors import NotPossible

Kind = Literal[
    "designs", "examples", "materials", "actuators", "metrics", "objectives", "parameters"
]
Table = Iterator[tuple[Any, ...]]
"""Names of the columns, then rows."""


def listing(
    kind: Kind,
    design: Annotated[str | None, Parameter(help="Design, for its parameters alone.")] = None,
    /,
    *,
    changes: Changes = UNCHANGED,
    json: AsJson = False,
) -> None:
    """List designs, examples, materials, actuators, metrics, objectives, or parameters.

    Parameters are those of a design, with their values, as --set and --vary name
    them. A dash means that the design gives no single number, or that parts which
    share the parameter differ; it can still be set. Actuators and metrics of your
    own are listed with --import, or if a package declares them. Metrics of an
    atlas that are single numbers can be objectives of a search too.

    Example: softreach list parameters minimal_trunk

    Args:
        kind: What to list.
    """
    if kind != "parameters":
        refuse(f"with list {kind}", **changes.given)
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
    for name, files in demo.examples().items():
        heading = files[0].read_text("utf-8").partition("\n")[0].lstrip("# ").rstrip(".")
        yield name, " ".join(file.name for file in files), heading


def _materials() -> Table:
    from softreach.arm.material import material_record

    yield "material", "young_modulus_pa", "poisson_ratio", "density_kg_m3", "modulus"
    for name in sr.arm.material_names():
        of, modulus = (record := material_record(name)).material, record.modulus
        yield name, of.young_modulus, of.poisson_ratio, of.density, modulus


def _actuators() -> Table:
    from softreach.arm.design_file.keys import every_kind

    yield "kind", "activation", "unit", "module", "description"
    for name, kind in every_kind(sr.arm.Actuator).items():
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
    from softreach.arm.parameters import parameters
    from softreach.arm.written import written_name

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
