"""`softreach equilibria`: every equilibrium of a loaded arm at given activations."""

from __future__ import annotations

import json as json_format
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import (
    Activation,
    AsJson,
    Design,
    activation_of,
    design_from,
)
from softreach.cli.output_files import Overwrite, check_picture
from softreach.support.errors import counted

if TYPE_CHECKING:
    from softreach.rod import AllEquilibria

__all__ = ["equilibria"]


def equilibria(
    design: Design,
    *,
    activation: Activation = None,
    figure: Annotated[Path | None, Parameter(help="Draw them: .png .pdf .svg")] = None,
    view: Annotated[str, Parameter(help="front, side, top or oblique.")] = "oblique",
    overwrite: Overwrite = False,
    changes: Changes = UNCHANGED,
    json: AsJson = False,
) -> None:
    """Every equilibrium of a loaded arm, stable ones first, and which one the arm comes to."""
    from softreach.rod import equilibria as all_of

    check_picture("figure", figure, overwrite)
    arm = design_from(design, changes)
    found = all_of(arm, activation_of(activation, arm))
    if figure is not None:
        from softreach import plot

        plot.save_figure(plot.plot_equilibria(found, view=view), figure, overwrite=overwrite)
    if json:
        json_format.dump(_as_json(found), sys.stdout)
        sys.stdout.write("\n")
    else:
        sys.stdout.write("\n".join(_lines(found)) + "\n")


def _as_json(found: AllEquilibria) -> dict[str, object]:
    loaded = found.solver is not None
    return {
        "activation": found.activation.tolist(),
        "tips_m": found.tips.tolist(),
        "status": _statuses(found),
        "margins": found.margin.tolist(),
        "directions": found.directions.tolist() if loaded else None,
        "signs": found.signs.tolist(),
        "is_ring": found.is_ring.tolist(),
        "followed": found.followed,
        "degree": found.degree,
        "complete": found.complete,
    }


def _statuses(found: AllEquilibria) -> list[str]:
    from softreach.rod import TipStatus

    return [TipStatus(one).name.lower() for one in found.status]


def _lines(found: AllEquilibria) -> Iterator[str]:
    arm = found.rod.arm
    given = zip(arm.bundle_names, found.activation, arm.bundle_units, strict=True)
    at = ", ".join(f"{name} {x:.6g}" + (f" {u}" if u != "1" else "") for name, x, u in given)
    many = counted(len(found), "solution")
    yield f"equilibria{f' at {at}' if at else ''}: {many}, degree {found.degree}"
    for k, status in enumerate(_statuses(found)):
        tip = ", ".join(f"{x:.6g}" for x in found.tips[k])
        kind = f"{status}, any way around" if found.is_ring[k] else status
        which = ", from the unloaded arm" if k == found.followed else ""
        yield f"  tip ({tip}) m: {kind}, margin {found.margin[k]:.3g}{which}"
