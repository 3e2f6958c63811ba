"""What is stored and passed on: names, dimensions, units and version of every dataset."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["AXES", "SCHEMA_VERSION", "check_cloud", "cloud_dataset", "configuration_dataset"]

SCHEMA_VERSION = 1
AXES = ("x", "y", "z")

# variable -> (dimensions, unit, meaning)
_CLOUD = {
    "tip": (("sample", "axis"), "m", "tip position"),
    "activation": (("sample", "fiber"), "1", "activation γ of each bundle; negative contracts"),
}
_CONFIGURATION = {
    "position": (("station", "axis"), "m", "centerline r"),
    "directors": (("station", "director", "axis"), "1", "directors d1, d2, d3"),
    "curvature": (("station", "component"), "1/m", "Darboux vector u1, u2, u3 in the directors"),
    "extension": (("station",), "1", "axial extension ζ"),
    "radius": (("station",), "m", "outer radius R2 before activation"),
}
