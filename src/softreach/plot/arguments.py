"""Arguments that figures have in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softreach.arguments import POSITIVE, as_given, dataset, flag, instance, optional, within
from softreach.arm.manipulator import Manipulator
from softreach.arrays import as_floats, as_indices
from softreach.errors import InvalidInput, Range
from softreach.geometry.surface import SurfaceMesh
from softreach.picture.projection import view_angles

__all__ = [
    "AX",
    "BOX",
    "DRAWN",
    "LENGTH",
    "MANIPULATOR",
    "PLACE",
    "POINTS",
    "SHAPE",
    "SIZE",
    "WIDTH",
    "a_surface",
    "a_view",
    "some_bundles",
]

MANIPULATOR = instance(Manipulator, "a Manipulator")
SHAPE = dataset("position", "directors", "extension", "Z", what="a configuration")
POINTS = dataset("tip", "activation", what="a cloud")
LENGTH = within(POSITIVE._replace(unit="m"))
PLACE = within(Range(unit="m"))
SIZE = optional(within(Range(0.0, 1e3, "pixels", open_low=True)))
WIDTH = within(Range(1.0, 100.0, "inches"))


def _axes(name: str, value: Any) -> Any:
    """Axes of matplotlib, which need not be loaded to know them."""
    if hasattr(value, "imshow") and hasattr(value, "get_figure") and not isinstance(value, type):
        return value
    raise InvalidInput(name, as_given(value), "axes of matplotlib, or None")


def a_view(name: str, value: Any) -> Any:
    """A view, as `view_angles` knows it."""
    del name
    view_angles(value)
    return value


def _box(name: str, value: Any) -> NDArray[np.float64]:
    """A lower and an upper corner, shape (2, 3)."""
    allowed = "a lower and an upper corner, finite numbers of shape (2, 3)"
    corners = as_floats(name, value, allowed)
    rising = corners.shape == (2, 3) and bool((corners[0] < corners[1]).all())
    if rising and np.isfinite(corners).all():
        return corners
    raise InvalidInput(name, corners.tolist(), allowed)


def a_surface(name: str, value: Any) -> SurfaceMesh:
    """Anything with vertices and faces that index them."""
    allowed = "an object with vertices [m], shape (v, 3), and faces, shape (f, 3)"
    if isinstance(value, type) or not (hasattr(value, "vertices") and hasattr(value, "faces")):
        raise InvalidInput(name, as_given(value), allowed)
    return value


def some_bundles(name: str, value: Any, arm: Manipulator) -> list[int]:
    """Indices of bundles of an arm."""
    if isinstance(value, set | frozenset | range):
        value = sorted(value)
    return as_indices(name, value, arm.bundles, "bundles of the arm").tolist()


AX: Callable[[str, Any], Any] = optional(_axes)
BOX = optional(_box)
DRAWN = {"ax": AX, "view": a_view, "box": BOX}
"""What figures of one panel have in common."""
KEY = {"key": flag}
