"""The tip map of an arm, free or loaded, kept for the next call."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from softreach.arm.manipulator import Manipulator
from softreach.arm.summary import VERIFIED_LOAD_NUMBER, is_overloaded
from softreach.rod.arm_rod import ArmRod
from softreach.rod.free import FreeRod
from softreach.rod.tip_map import TipMap, check_tol
from softreach.rod.view import View
from softreach.support.arguments import as_flag, as_given
from softreach.support.errors import InvalidInput
from softreach.support.errors import warn as issue_warning

__all__ = ["refined", "tip_map"]


def tip_map(arm: Manipulator | TipMap, tol: float = 1e-6, *, warn: bool = True) -> TipMap:
    """The tip map of an arm, kept for the next call; a tip map is returned as it is.

    Args:
        arm: The design, or a tip map, whose own tolerance then counts.
        tol: Largest tip error, in L.
        warn: Whether to warn of loads beyond what was verified.

    Raises:
        InvalidInput: No arm, or `tol` out of range.
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """
    if isinstance(arm, TipMap):
        return arm
    if not isinstance(arm, Manipulator):
        raise InvalidInput("arm", as_given(arm), "a Manipulator or a TipMap")
    rod = _of_arm(arm, check_tol(tol))
    if as_flag("warn", warn) and arm.loads is not None:
        _warn_of_large_loads(arm)
    return rod


def refined(rod: TipMap, tol: float) -> TipMap:
    """The tip map of the same arm to a smaller tolerance; itself if its own is no larger.

    Args:
        rod: The tip map; one that is of no arm stays as it is.
        tol: Largest tip error, in L.
    """
    if rod.tol <= check_tol(tol):
        return rod
    if isinstance(rod, View):
        return replace(rod, base=refined(rod.base, tol))
    return _of_arm(rod.arm, tol) if isinstance(rod, ArmRod) else rod


@lru_cache(maxsize=64)
def _of_arm(arm: Manipulator, tol: float) -> TipMap:
    if arm.loads is None:
        return FreeRod(arm, tol)
    from softreach.rod.loaded.rod import LoadedRod

    return LoadedRod(arm, tol)


@lru_cache(maxsize=64)
def _warn_of_large_loads(arm: Manipulator) -> None:
    """Warn once of an arm that is loaded beyond what was verified; one text for all.

    Raises:
        InvalidDesign: Moduli or densities are missing.
    """
    if is_overloaded(arm):
        issue_warning(
            f"the load number is above {VERIFIED_LOAD_NUMBER:g}, up to which shapes under loads "
            "were verified: look at the status of the samples, and compare with a smaller tol"
        )
