"""The rod of a design, as the studio uses it."""

from __future__ import annotations

import threading
from functools import lru_cache

from softreach.arm.design_file import in_file_terms
from softreach.arm.manipulator import Manipulator
from softreach.rod.rods import tip_map
from softreach.rod.tip_map import TipMap
from softreach.support.errors import InvalidDesign, InvalidInput

__all__ = ["TOL", "design_of_text", "rod_of", "solvable_rod"]

TOL = 1e-5
"""Largest tip error, in L: far below a pixel."""


def rod_of(arm: Manipulator) -> TipMap:
    """The tip map of a design, kept for the next call.

    Raises:
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """
    return tip_map(arm, TOL, warn=False)  # the page says whether samples are stable


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


def solvable_rod(arm: Manipulator) -> TipMap:
    """The tip map of a design whose loads can be computed; slow the first time for a loaded arm.

    Raises:
        InvalidInput: The arm is loaded so heavily that no number of steps suffices.
    """
    if arm.loads is not None:
        with _one_at_a_time:  # jobs that draw and measure the same arm would both try for long
            solvable = _is_solvable(arm)
        if not solvable:
            allowed = f"such that tips can be computed to {TOL:g} L"
            raise InvalidInput("loads", "too large", allowed, "lighten them or stiffen the arm")
    return rod_of(arm)


_one_at_a_time = threading.Lock()


@lru_cache(maxsize=64)
def _is_solvable(arm: Manipulator) -> bool:
    try:
        return rod_of(arm).steps > 0
    except InvalidInput:  # which a tip map does not keep
        return False
