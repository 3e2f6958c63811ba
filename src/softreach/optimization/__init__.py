"""From requirements to designs: free parameters, objectives, search, tolerance."""

from softreach.optimization.deviations import Spread
from softreach.optimization.problem import OBJECTIVES, Candidate, Objective
from softreach.optimization.result import Search
from softreach.optimization.searching import search
from softreach.optimization.sensitivity import Multiplier, Sensitivity, VarianceShares, sensitivity
from softreach.optimization.tolerance import TargetTolerance, Tolerance, tolerance
from softreach.support.report import Report
from softreach.workspace.measure import Estimate

__all__ = ["OBJECTIVES", "Candidate", "Estimate", "Multiplier", "Objective", "Report", "Search"]
__all__ += ["Sensitivity", "Spread", "TargetTolerance", "Tolerance", "VarianceShares", "search"]
__all__ += ["sensitivity", "tolerance"]
