"""Names for arrays by what they hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Faces", "Points"]

Points = NDArray[np.float64]
"""Places [m], shape (n, 3)."""

Faces = NDArray[np.integer]
"""Triangles as rows of three vertices, shape (n, 3)."""
