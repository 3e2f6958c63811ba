"""Designs as TOML files: lengths in meters, angles in degrees, the unit in every key."""

from softreach.arm.design_file.keys import in_file_terms
from softreach.arm.design_file.read import LONGEST, document_of, read, text_of
from softreach.arm.design_file.write import display_text, render
from softreach.support.files.formats import FileFormat, Formats

__all__ = [
    "DESIGN_FILE",
    "LONGEST",
    "display_text",
    "document_of",
    "in_file_terms",
    "read",
    "render",
    "text_of",
]

DESIGN_FILE: Formats = {".toml": FileFormat()}
"""Format that a design is saved in."""
