"""Moves the project to another address: `python -m tools.address https://example.org/me/softreach`.

The address stands once, as `Repository` in pyproject.toml; this writes it to all that must spell it
out, since package indexes do not know relative links.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent
SPELLED_OUT = ("pyproject.toml", "README.md", "CITATION.cff")


def address() -> str:
    """The address of the repository that pyproject.toml names."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    return project["urls"]["Repository"]


def move(new: str) -> None:
    """Put another address wherever the present one stands."""
    old = address()
    for name in SPELLED_OUT:
        file = ROOT / name
        file.write_text(file.read_text("utf-8").replace(old, new.rstrip("/")), "utf-8")


if __name__ == "__main__":
    move(sys.argv[1])
