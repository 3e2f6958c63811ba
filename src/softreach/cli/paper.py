"""`softreach paper`: every figure and number of the paper, beside what it says."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from softreach.cli.output_files import Overwrite

__all__ = ["paper"]


def paper(
    *,
    out: Annotated[Path, Parameter(help="Folder for the report and its figures.")] = Path("paper"),
    quick: Annotated[
        bool, Parameter(negative="", help="Small clouds: coarse numbers in under a minute.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Recompute the paper's figures and statements into a report; run again to continue.

    Example: softreach paper --out paper --quick
    """
    from softreach.paper import reproduce_paper

    report = reproduce_paper(
        out,
        quick=quick,
        overwrite=overwrite,
        say=lambda line: sys.stderr.write(f"{line}\n"),
    )
    sys.stdout.write(f"{report}\n")
