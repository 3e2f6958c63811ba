"""Names for arrays of which the shape says what they are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Faces", "Jacobians", "Points"]

Points = NDArray[np.float64]
"""Places [m], shape (n, 3)."""

Jacobians = NDArray[np.float64]
"""Derivatives of the tip by the activations, shape (n, 6, bundles), linear rows first."""

Faces = NDArray[np.integer]
"""Triangles as rows of three vertices, shape (n, 3)."""
