"""More independent bundles from one: the way from a minimal to a redundant design (section 5)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from softreach.errors import InvalidInput
from softreach.fiber import FiberArchitecture

__all__ = ["split_fiber"]

Fibers = tuple[FiberArchitecture, ...]


def split_fiber(
    fibers: Fibers, fiber: str | int, count: int, keep_extent: bool
) -> tuple[Fibers, list[int]]:
    """Replace an architecture of one bundle by several, as `Manipulator.split` describes.

    Args:
        fibers: The architectures of an arm.
        fiber: Name or index of one of them.
        count: How many shall take its place.
        keep_extent: Whether each has the extent of the original, or its share.

    Returns:
        The new architectures, and how often each bundle of the old ones stands among the new.

    Raises:
        InvalidInput: No such architecture, one of several bundles, or a count below 1.
    """
    index = _index(fibers, fiber)
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise InvalidInput("count", count, "a whole number >= 1")
    whole = fibers[index]
    if whole.bundles != 1:
        hint = "its bundles are independent already"
        raise InvalidInput(f"fibers[{index}].bundles", whole.bundles, "1 to be split", hint)
    parts = tuple(_parts(whole, int(count), keep_extent, whole.name or f"fiber {index + 1}"))
    before, after = fibers[:index], fibers[index + 1 :]
    repeats = [*_ones(before), int(count), *_ones(after)]
    return (*before, *(parts if count > 1 else (whole,)), *after), repeats


def _index(fibers: Fibers, fiber: str | int) -> int:
    names = [architecture.name for architecture in fibers]
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


def _ones(fibers: Sequence[FiberArchitecture]) -> list[int]:
    """One for each bundle."""
    return [1] * sum(fiber.bundles for fiber in fibers)
