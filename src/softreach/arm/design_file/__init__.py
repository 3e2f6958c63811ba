"""Designs as TOML files: lengths in meters, angles in degrees, the unit in every key."""

from softreach.arm.design_file.keys import in_file_terms as in_file_terms
from softreach.arm.design_file.read import LONGEST as LONGEST
from softreach.arm.design_file.read import document_of as document_of
from softreach.arm.design_file.read import read as read
from softreach.arm.design_file.read import text_of as text_of
from softreach.arm.design_file.write import display_text as display_text
from softreach.arm.design_file.write import render as render
from softreach.support.files.formats import FileFormat, Formats

DESIGN_FILE: Formats = {".toml": FileFormat()}  # Format that a design is saved in
