"""The inverse problem: which activations put the tip where it should be."""

from softreach.inverse.path import PathStatus
from softreach.inverse.prepared import PreparedMap, prepared_map
from softreach.inverse.solutions import Solution, Solutions, Status
from softreach.inverse.solve import solve_inverse
from softreach.inverse.twins import twin_hints

__all__ = [
    "PathStatus",
    "PreparedMap",
    "Solution",
    "Solutions",
    "Status",
    "prepared_map",
    "solve_inverse",
    "twin_hints",
]
