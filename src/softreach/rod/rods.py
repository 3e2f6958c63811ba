"""The tip map of an arm, free or loaded, kept for the next call."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, partial

from softreach.arm.driving import inner_arm
from softreach.arm.load_number import VERIFIED_LOAD_NUMBER, is_overloaded
from softreach.arm.manipulator import Manipulator
from softreach.rod.arm_rod import ArmRod
from softreach.rod.driven import DrivenRod
from softreach.rod.free import FreeRod
from softreach.rod.tip_map import Frame, TipMap, check_tol
from softreach.rod.view import PlacedRod, View
from softreach.support.arguments import as_flag, as_given, as_one_of
from softreach.support.errors import InvalidInput
from softreach.support.errors import warn as issue_warning

__all__ = ["coarsened", "effective", "in_steps", "refined", "tip_map"]


def tip_map(
    arm: Manipulator | TipMap, tol: float = 1e-6, *, frame: Frame = "world", warn: bool = True
) -> TipMap:
    """The tip map of an arm, kept for the next call; a tip map is returned as it is.

    Args:
        arm: The design, or a tip map, whose own tolerance then counts.
        tol: Largest tip error, in L.
        frame: Frame of places: the "world", or that of the "base", whose z is
            along the straight arm. That of a tip map, if it is not of the world, counts.
        warn: Whether to warn of loads beyond what was verified.

    Raises:
        InvalidInput: No arm, no such frame, or `tol` out of range.
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """
    as_one_of("frame", frame, ("world", "base"))
    if isinstance(arm, TipMap):
        return arm if frame == "world" else _from_base(arm)
    if not isinstance(arm, Manipulator):
        raise InvalidInput("arm", as_given(arm), "a Manipulator or a TipMap")
    rod = _of_arm(arm, check_tol(tol), frame)
    if as_flag("warn", warn) and arm.loads is not None:
        _warn_of_large_loads(arm)
    return rod


def _from_base(rod: TipMap) -> TipMap:
    if isinstance(rod, View | DrivenRod):
        return replace(rod, base=_from_base(rod.base))
    return rod.base if isinstance(rod, PlacedRod) else rod


def refined(rod: TipMap, tol: float) -> TipMap:
    """The tip map of the same arm to a smaller tolerance; itself if its own is no larger.

    Args:
        rod: The tip map; one that is of no arm stays as it is.
        tol: Largest tip error, in L.
    """
    return rod if rod.tol <= check_tol(tol) else _to_tolerance(rod, tol)


def coarsened(rod: TipMap, tol: float) -> TipMap:
    """The tip map of the same arm to a larger tolerance; itself if its own is no smaller.

    Args:
        rod: The tip map; one that is of no arm stays as it is.
        tol: Largest tip error, in L.
    """
    return rod if rod.tol >= check_tol(tol) else _to_tolerance(rod, tol)


def _to_tolerance(rod: TipMap, tol: float) -> TipMap:
    if isinstance(rod, View | DrivenRod):
        return replace(rod, base=_to_tolerance(rod.base, tol))
    frame: Frame = "base" if isinstance(rod, ArmRod) else "world"
    return _of_arm(rod.arm, tol, frame) if isinstance(rod, ArmRod | PlacedRod) else rod


def effective(rod: TipMap) -> TipMap:
    """The tip map of the same arm in inputs beyond the dead zones of its drives.

    It has the same image and no kinks at dead zones; itself where there are none.
    """
    if isinstance(rod, View):
        return replace(rod, base=effective(rod.base))
    if isinstance(rod, DrivenRod) and any(drive.dead_zone for drive in rod.outer.drives):
        return replace(rod, is_effective=True)
    return rod


def in_steps(arm: Manipulator, steps: int, like: TipMap) -> TipMap:
    """The tip map of an arm in so many steps, which are not checked against its tolerance.

    Maps of neighboring designs in as many steps err by what is a smooth function of the design, so
    that differences between them do not see it; and none of them needs a search for its steps.

    Args:
        arm: The design.
        steps: Along the arm, if nothing breaks it.
        like: A tip map whose tolerance and frame it has.
    """
    rod = _new(arm, like.tol, like.frame, steps)
    return effective(rod) if isinstance(like, DrivenRod) and like.is_effective else rod


@lru_cache(maxsize=64)
def _of_arm(arm: Manipulator, tol: float, frame: Frame) -> TipMap:
    return _new(arm, tol, frame)


def _new(arm: Manipulator, tol: float, frame: Frame, steps: int | None = None) -> TipMap:
    inside = _of_arm if steps is None else partial(_new, steps=steps)
    if not arm.is_direct:
        inner = inside(inner_arm(arm), tol, frame)
        assert isinstance(inner, ArmRod | PlacedRod)
        return DrivenRod(inner, arm)
    if frame == "world" and not arm.base.is_identity:
        rod = inside(arm, tol, "base")
        assert isinstance(rod, ArmRod)
        return PlacedRod(rod)
    if arm.loads is None:
        return FreeRod(arm, tol, steps)
    from softreach.rod.loaded.rod import LoadedRod

    return LoadedRod(arm, tol, steps)


@lru_cache(maxsize=64)
def _warn_of_large_loads(arm: Manipulator) -> None:
    """Warn once of an arm that is loaded beyond what was verified; one text for all."""
    if is_overloaded(arm):
        issue_warning(
            f"the load number is above {VERIFIED_LOAD_NUMBER:g}, up to which shapes under loads "
            "were verified: look at the status of the samples, and compare with a smaller tol"
        )
