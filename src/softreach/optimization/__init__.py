"""From requirements to designs: free parameters, objectives, search, tolerance."""

from softreach.optimization.objectives import OBJECTIVES, Objective, Value
from softreach.optimization.problem import Candidate
from softreach.optimization.result import Search
from softreach.optimization.searching import search

__all__ = ["OBJECTIVES", "Candidate", "Objective", "Search", "Value", "search"]
