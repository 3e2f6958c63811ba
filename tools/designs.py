"""Writes the named designs as files: `python -m tools.designs`."""

from __future__ import annotations

import inspect
import textwrap
from pathlib import Path

from softreach.arm import designs

FOLDER = Path(__file__).parent.parent / "designs"


def design_file(name: str) -> str:
    """The file of a named design: where it comes from, and its numbers."""
    function = getattr(designs, name)
    return f"{_comment(inspect.getdoc(function) or '')}\n{function().to_toml()}"


def _comment(text: str) -> str:
    """The paragraphs of a docstring before its arguments, as a comment."""
    told = text.partition("\nArgs:")[0].partition("\nRaises:")[0].strip()
    paragraphs = [textwrap.fill(part, 97) for part in told.split("\n\n")]
    return (
        textwrap.indent("\n\n".join(paragraphs), "# ", lambda line: True).replace("# \n", "#\n")
        + "\n"
    )


if __name__ == "__main__":
    for design in designs.__all__:
        (FOLDER / f"{design}.toml").write_text(design_file(design), encoding="utf-8")
