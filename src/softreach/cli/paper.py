"""`softreach paper`: every figure and number of the paper, beside what it says."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from softreach.cli.console import console
from softreach.cli.options import OUT, Overwrite


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
