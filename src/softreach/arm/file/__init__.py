"""Designs as TOML files: lengths in meters, angles in degrees, the unit in every key."""

from softreach.arm.file.document import DESIGN_FILE, Parts, text_of
from softreach.arm.file.reading import parse
from softreach.arm.file.terms import in_file_terms
from softreach.arm.file.writing import render

__all__ = ["DESIGN_FILE", "Parts", "in_file_terms", "parse", "render", "text_of"]
