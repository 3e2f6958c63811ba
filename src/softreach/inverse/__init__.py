"""The inverse problem: which activations put the tip where it should be."""

from softreach.inverse.continuation import PathStatus
from softreach.inverse.prepared_map import PreparedMap, prepared_map
from softreach.inverse.solutions import Solution, Solutions, Status
from softreach.inverse.solver import solve_inverse

__all__ = [
    "PathStatus",
    "PreparedMap",
    "Solution",
    "Solutions",
    "Status",
    "prepared_map",
    "solve_inverse",
]
