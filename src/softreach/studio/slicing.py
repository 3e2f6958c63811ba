"""What a slab across the scene leaves of points and surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from softreach.studio.state import Slice

__all__ = ["in_slice", "sliced_faces"]

Array = NDArray[np.float64]


def in_slice(points: Array, cut: Slice) -> NDArray[np.bool_]:
    """Which points [L], shape (n, 3), a slice shows."""
    if cut.axis == "none":
        return np.ones(len(points), bool)
    return np.abs(points[:, "xyz".index(cut.axis)] - cut.center) <= cut.thickness / 2


def sliced_faces(vertices: Array, faces: NDArray[Any], cut: Slice) -> NDArray[Any]:
    """The faces whose centers [L] a slice shows."""
    return faces[in_slice(vertices[faces].mean(axis=1), cut)]
