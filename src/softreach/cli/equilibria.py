"""`softreach equilibria`: every equilibrium of a loaded arm at given activations."""

from __future__ import annotations

from typing import TYPE_CHECKING

from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.lengths import Lengths
from softreach.cli.options import (
    Activation,
    AsJson,
    Design,
    Out,
    Overwrite,
    Unit,
    View,
    activation_of,
    check_picture,
    is_page,
    write_page,
)
from softreach.cli.values import activation_text
from softreach.support.errors import counted

if TYPE_CHECKING:
    from softreach.rod import AllEquilibria


def equilibria(
    design: Design,
    /,
    *,
    activation: Activation = None,
    view: View = None,
    changes: Changes = UNCHANGED,
    out: Out = None,
    overwrite: Overwrite = False,
    unit: Unit = None,
    json: AsJson = False,
) -> None:
    """Find every equilibrium of a loaded arm at given activations.

    Stable ones come first. The posture of the arm that hangs first is marked.

    Example: softreach equilibria arm.toml --activation -1,0,-0.5 --out all.png

    Args:
        out: Draw them: .png .pdf .svg, or .html to turn
    """
    from softreach.rod import equilibria as all_of

    check_picture(out, overwrite, view=view, page=True)
    arm = design_from(design, changes)
    lengths = Lengths.of(arm, unit)
    result = all_of(arm, activation_of(activation, arm))
    if json:
        console.json(_record(result, lengths))
    else:
        _print(result, lengths)
    if out is not None and is_page(out):
        write_page([result], out, lengths, overwrite=overwrite, view=view or "oblique")
    elif out is not None:
        from softreach import plot

        figure = plot.plot_equilibria(result, view=view or "oblique", unit=lengths.unit)
        plot.save_figure(figure, out, overwrite=overwrite)


def _record(result: AllEquilibria, lengths: Lengths) -> dict[str, object]:
    loaded = result.solver is not None
    return {
        "activation": result.activation.tolist(),
        **lengths.record("tips", result.tips.tolist()),
        "status": _statuses(result),
        "margins": result.margin.tolist(),
        "directions": result.directions.tolist() if loaded else None,
        "signs": result.signs.tolist(),
        "is_ring": result.is_ring.tolist(),
        "followed": result.followed,
        "degree": result.degree,
        "complete": result.complete,
    }


def _statuses(result: AllEquilibria) -> list[str]:
    from softreach.rod import TipStatus

    return [TipStatus(status).name.lower() for status in result.status]


def _print(result: AllEquilibria, lengths: Lengths) -> None:
    at = activation_text(result.rod.arm, result.activation)
    count = counted(len(result), "solution")
    console.line(f"equilibria{f' at {at}' if at else ''}: {count}, degree {result.degree}")
    for k, status in enumerate(_statuses(result)):
        kind = f"{status}, any way around" if result.is_ring[k] else status
        which = ", the posture" if k == result.followed else ""
        tip = lengths.place(result.tips[k])
        console.line(f"  tip {tip}: {kind}, margin {result.margin[k]:.3g}{which}")
