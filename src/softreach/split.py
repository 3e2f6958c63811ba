"""More independent bundles from one: the way from a minimal to a redundant design (section 5)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from softreach.errors import InvalidInput
from softreach.fiber import FiberArchitecture
from softreach.manipulator import Bounds, Manipulator

__all__ = ["split_fiber"]


def split_fiber(
    arm: Manipulator, fiber: str | int, count: int, *, keep_extent: bool = True
) -> Manipulator:
    """Replace an architecture of one bundle by `count` independent ones beside each other.

    They are spread evenly about the center of the original, one extent apart, and wind as it does.
    Splitting the longitudinal fiber of `designs.minimal_trunk` in two gives
    `designs.redundant_trunk`. Overlap is not checked: fibers of different architectures
    may cross anyway.

    Args:
        arm: The design.
        fiber: Name or index of the architecture.
        count: How many shall take its place; 1 leaves the design as it is.
        keep_extent: True gives each the extent σ of the original, False its share σ / count, so
            that together they fill the sector of the original.

    Returns:
        The new design; the parts are named "NAME 1", "NAME 2", ..., and each has the activation
        bounds of the original.

    Raises:
        InvalidInput: No such architecture, one of several bundles, or a count below 1.
        InvalidDesign: The parts do not fit on the arm, such as a reachable extension of zero.
    """
    index = _index(arm, fiber)
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise InvalidInput("count", count, "a whole number >= 1")
    whole = arm.fibers[index]
    if whole.bundles != 1:
        hint = "its bundles are independent already"
        raise InvalidInput(f"fibers[{index}].bundles", whole.bundles, "1 to be split", hint)
    if count == 1:
        return arm
    parts = tuple(_parts(whole, int(count), keep_extent, whole.name or f"fiber {index + 1}"))
    return arm.replace(
        fibers=(*arm.fibers[:index], *parts, *arm.fibers[index + 1 :]),
        activation_bounds=_bounds(arm, index, int(count)),
    )


def _index(arm: Manipulator, fiber: str | int) -> int:
    names = [architecture.name for architecture in arm.fibers]
    if isinstance(fiber, str) and names.count(fiber) == 1:
        return names.index(fiber)
    if not isinstance(fiber, str | bool) and fiber in range(len(names)):
        return int(fiber)
    known = ", ".join(f"{k} ({name})" if name else str(k) for k, name in enumerate(names))
    raise InvalidInput("fiber", repr(fiber), f"the name or index of one architecture: {known}")


def _parts(
    whole: FiberArchitecture, count: int, keep_extent: bool, name: str
) -> Iterator[FiberArchitecture]:
    extent = whole.extent if keep_extent else whole.extent / count
    for k in range(count):
        offset = whole.offset + (k - (count - 1) / 2) * extent
        yield whole.replace(name=f"{name} {k + 1}", offset=offset, extent=extent)


def _bounds(arm: Manipulator, index: int, count: int) -> Bounds:
    """One pair for all stays one; of pairs for each bundle, the parts inherit theirs."""
    if np.ndim(arm.activation_bounds) == 1:
        return arm.activation_bounds
    bundle = int(np.flatnonzero(arm.bundle_fiber == index)[0])
    repeats = np.ones(arm.bundles, int)
    repeats[bundle] = count
    low_high = np.repeat(arm.bounds, repeats, axis=0)
    return tuple((low, high) for low, high in low_high.tolist())
