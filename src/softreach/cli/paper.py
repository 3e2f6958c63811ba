"""`softreach paper`: every figure and number of the paper, beside what it says."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from softreach.cli.console import console
from softreach.cli.options import Overwrite, out_option


def paper(
    *,
    quick: Annotated[
        bool, Parameter(help="Small clouds: coarse numbers in under a minute.")
    ] = False,
    out: Annotated[Path, out_option("Folder for the report and its figures.")] = Path("paper"),
    overwrite: Overwrite = False,
) -> None:
    """Recompute the paper's figures and statements into a report.

    The same command continues after an interruption.

    Example: softreach paper --out paper --quick
    """
    from softreach.paper import reproduce_paper

    console.line(reproduce_paper(out, quick=quick, overwrite=overwrite, say=console.note))
