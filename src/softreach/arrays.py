"""Names for array shapes; checked at run time in the tests only."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

__all__ = [
    "Activations",
    "Faces",
    "Jacobians",
    "PerStation",
    "Points",
    "StationMap",
    "StationVectors",
]

Points = Float[np.ndarray, "point 3"]
Activations = Float[np.ndarray, "sample fiber"]
Jacobians = Float[np.ndarray, "sample 6 fiber"]
PerStation = Float[np.ndarray, " station"]
StationMap = Float[np.ndarray, "station fiber"]
StationVectors = Float[np.ndarray, "station 3 fiber"]
Faces = Int[np.ndarray, "face 3"]
