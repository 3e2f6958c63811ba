"""The reachable set as the image of the activation box: volume, multiplicity, folds, surface."""

from softreach.workspace.directions import direction_spread
from softreach.workspace.reach import reachable_set
from softreach.workspace.reachable import ReachableSet

__all__ = ["ReachableSet", "direction_spread", "reachable_set"]
