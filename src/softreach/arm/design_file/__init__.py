"""Designs as TOML files: lengths in meters, angles in degrees, the unit in every key."""

from softreach.arm.design_file.keys import in_file_terms
from softreach.arm.design_file.read import (
    LONGEST,
    Parts,
    document_of,
    is_design,
    parse,
    text_of,
)
from softreach.arm.design_file.write import display_text, render
from softreach.support.files.kinds import FileKind, Formats

__all__ = [
    "DESIGN_FILE",
    "LONGEST",
    "Parts",
    "display_text",
    "document_of",
    "in_file_terms",
    "parse",
    "render",
    "text_of",
]

DESIGN_FILE: Formats = {".toml": FileKind("a design file", is_design)}
"""Kind of file that a design is saved as, and replaces."""
