"""The inverse problem: which activations put the tip where it should be."""

from softreach.inverse.solutions import Solution, Solutions, Status
from softreach.inverse.solver import InverseSolver, solve_inverse

__all__ = ["InverseSolver", "Solution", "Solutions", "Status", "solve_inverse"]
