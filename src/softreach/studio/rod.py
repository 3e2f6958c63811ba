"""The rod of a design, as the studio uses it."""

from __future__ import annotations

from softreach.arm.file import in_file_terms
from softreach.arm.manipulator import Manipulator
from softreach.errors import InvalidDesign
from softreach.rod.tip_map import TipMap, tip_map

__all__ = ["TOL", "design_of_text", "rod_of"]

TOL = 1e-5
"""Largest tip error, in L: far below a pixel."""


def rod_of(arm: Manipulator) -> TipMap:
    """The tip map of a design, kept for the next call.

    Raises:
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """
    return tip_map(arm, TOL)


def design_of_text(text: str, source: str) -> Manipulator:
    """A design that has a rod, from the text of a file; `source` is what errors call it.

    Raises:
        InvalidDesign: The arm cannot exist, or would be shortened to nothing.
    """
    arm = Manipulator.from_toml(text, source)
    try:
        return rod_of(arm).arm
    except InvalidDesign as error:
        raise in_file_terms(error, source) from None
