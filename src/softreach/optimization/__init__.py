"""From requirements to designs: free parameters, objectives, search, tolerance."""

from softreach.optimization.deviations import Spread
from softreach.optimization.problem import OBJECTIVES, Candidate, Objective, Value
from softreach.optimization.result import Search
from softreach.optimization.searching import search
from softreach.optimization.sensitivity import Multiplier, Sensitivity, VarianceShares, sensitivity
from softreach.optimization.tolerance import TargetTolerance, Tolerance, tolerance
from softreach.support.report import Report

__all__ = [
    "OBJECTIVES",
    "Candidate",
    "Multiplier",
    "Objective",
    "Report",
    "Search",
    "Sensitivity",
    "Spread",
    "TargetTolerance",
    "Tolerance",
    "Value",
    "VarianceShares",
    "search",
    "sensitivity",
    "tolerance",
]
